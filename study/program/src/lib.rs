//! Program `flotor-study`: the study commands, started by `flotor`.

mod analyse;
mod page;
mod platform;
mod study;

use clap::{CommandFactory, Parser, Subcommand};
use flotor_command::{CommandError, exit_code_of, options, supervised};
use flotor_study::dataset::DatasetError;
use std::process::ExitCode;

/// Run and analyse perception experiments; `flotor COMMAND` starts this program.
#[derive(Parser)]
#[command(name = "flotor", bin_name = "flotor", version, max_term_width = 110)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Study(Box<study::StudyArguments>),
    Analyse(analyse::AnalyseArguments),
}

/// Returns the clap command with all arguments. Not real-time.
#[must_use]
pub fn command() -> clap::Command {
    Arguments::command()
}

/// Runs the command given on the command line.
#[must_use]
pub fn main() -> ExitCode {
    flotor_session::on_notice(|notice| flotor_command::note(notice));
    match options::arguments::<Arguments>().command {
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
