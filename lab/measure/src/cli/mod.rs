//! Commands that measure plugins, loops and recordings: command line of the program `flotor-lab`, which `flotor` starts.

mod bench;
mod eval;
mod jitter;
mod replay;
mod replay_picture;
mod stability;
mod stress;
mod validate;

use crate::Progress;
use crate::replay::ReplayError;
use clap::Subcommand;
use flotor_command::{CommandError, exit_code_of, options, progress_bar, supervised};
use std::process::ExitCode;

/// Measure plugins, loops and recordings; `flotor COMMAND` starts this program.
#[derive(Subcommand)]
enum Command {
    Replay(replay::ReplayArguments),
    Eval(eval::EvalArguments),
    Validate(validate::ValidateArguments),
    Jitter(jitter::JitterArguments),
    Stability(stability::StabilityArguments),
    Bench(bench::BenchArguments),
    Stress(stress::StressArguments),
}

/// Function that returns the command-line parser of all commands. Not real-time.
pub const PARSER: fn() -> clap::Command = options::parser_of::<Command>;

/// Runs the command of this process.
#[must_use]
pub fn main() -> ExitCode {
    flotor_session::on_notice(|notice| flotor_command::note(notice));
    match options::command_of::<Command>() {
        Command::Replay(arguments) => supervised(|| replay::run(&arguments)),
        Command::Eval(arguments) => supervised(|| eval::run(&arguments)),
        Command::Jitter(arguments) => supervised(|| jitter::run(&arguments)),
        Command::Stability(arguments) => supervised(|| stability::run(&arguments)),
        Command::Bench(arguments) => supervised(|| bench::run(&arguments)),
        // These start their own processes for the code of plugins.
        Command::Validate(arguments) => exit_code_of(validate::run(&arguments)),
        Command::Stress(arguments) => exit_code_of(stress::run(&arguments)),
    }
}

impl From<ReplayError> for CommandError {
    fn from(error: ReplayError) -> Self {
        match error {
            ReplayError::Read(error) => Self::Read(error),
            ReplayError::Run(error) => Self::Run(error),
            other => Self::Usage(other.to_string()),
        }
    }
}

/// Progress bar of a measurement on a terminal; nothing in a pipe.
struct ProgressLine(indicatif::ProgressBar);

impl ProgressLine {
    fn new() -> Self {
        Self(progress_bar(0, "{msg:<44} {wide_bar} {percent:>3} %  {elapsed}"))
    }
}

impl Progress for ProgressLine {
    fn begin(&self, name: &str, steps: u64) {
        self.0.set_length(steps);
        self.0.set_position(0);
        self.0.set_message(name.to_owned());
    }

    fn advance(&self, steps: u64) {
        self.0.inc(steps);
    }
}
