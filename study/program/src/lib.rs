//! Program `flotor-study`: the study commands, started by `flotor`.

mod analyse;
mod page;
mod platform;
mod study;

use clap::Subcommand;
use flotor_command::{CommandError, exit_code_of, options, supervised};
use flotor_study::dataset::DatasetError;
use std::process::ExitCode;

/// Run and analyse perception experiments; `flotor COMMAND` starts this program.
#[derive(Subcommand)]
enum Command {
    Study(Box<study::StudyArguments>),
    Analyse(analyse::AnalyseArguments),
}

/// Function that returns the command-line parser of `study` and `analyse`. Not real-time.
pub const PARSER: fn() -> clap::Command = options::parser_of::<Command>;

/// Runs the command given on the command line and returns its exit code. Not real-time.
#[must_use]
pub fn main() -> ExitCode {
    flotor_session::on_notice(|notice| flotor_command::note(notice));
    match options::command_of::<Command>() {
        Command::Study(arguments) => supervised(|| study::run(&arguments)),
        Command::Analyse(arguments) => exit_code_of(analyse::run(&arguments)),
    }
}

/// Converts a data set error to a command error with its exit code.
fn of_dataset(error: DatasetError) -> CommandError {
    match error {
        DatasetError::File { .. } => CommandError::Failed(error.to_string()),
        other => CommandError::Usage(other.to_string()),
    }
}
