//! Command line of Flotor as one program, including the commands that separate programs carry out.

use clap::Command;

/// Returns the parser of `flotor` with all its commands and their arguments.
#[must_use]
pub fn whole_program() -> Command {
    let separate = [
        flotor_lab::cli::PARSER(),
        flotor_study_program::PARSER(),
        flotor_calibration::cli::PARSER(),
        flotor_identify::cli::PARSER(),
        flotor_test::cli::PARSER(),
        flotor_lend::PARSER(),
    ];
    flotor_command::whole_program(flotor::cli::command(), &separate)
}
