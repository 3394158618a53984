//! Program `flotor-lend`: the command `flotor lend`, which `flotor` starts, and the guard process of the lent program. Runs on Linux
//! only. Not real-time throughout.

mod api;
mod arguments;
mod folder;
mod guard;
mod lend;
mod outcome;
mod program;
mod service;
mod stop_request;

use clap::Subcommand;
use flotor_command::{exit_code_of, options};
use std::process::ExitCode;

/// Lend a device to programs of other makers; `flotor lend` starts this program.
#[derive(Subcommand)]
enum Command {
    Lend(arguments::LendArguments),
    /// Process that starts the program of `lend`, and kills its remaining processes
    #[command(hide = true)]
    ProgramGuard(guard::GuardArguments),
}

/// Function that returns the command-line parser of all commands. Not real-time.
pub const PARSER: fn() -> clap::Command = options::parser_of::<Command>;

/// Runs the command given on the command line and returns its exit code. Not real-time.
#[must_use]
pub fn main() -> ExitCode {
    flotor_session::on_notice(|notice| flotor_command::note(notice));
    exit_code_of(match options::command_of::<Command>() {
        Command::Lend(arguments) => lend::run(arguments),
        Command::ProgramGuard(arguments) => guard::run(&arguments),
    })
}
