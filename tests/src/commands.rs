//! The command line of Flotor as one program, with the commands that separate programs carry out.

use clap::Command;

/// Returns `flotor` with the arguments of all its commands.
#[must_use]
pub fn whole_program() -> Command {
    let separate = [
        flotor_lab::cli::PARSER(),
        flotor_study_program::PARSER(),
        flotor_calibration::cli::PARSER(),
        flotor_test::cli::PARSER(),
    ];
    flotor_command::whole_program(flotor::cli::command(), &separate)
}
