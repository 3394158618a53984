//! The command line of Flotor as one program, with the commands that separate programs carry out.

use clap::Command;

/// Returns `flotor` with the arguments of all its commands.
#[must_use]
pub fn whole_program() -> Command {
    let separate = [
        flotor_lab::cli::command(),
        flotor_study_program::command(),
        flotor_calibration::cli::command(),
        flotor_test::cli::command(),
    ];
    flotor_command::whole_program(flotor::cli::command(), &separate)
}
