//! `flotor worker`: the process that holds one force model, started by `flotor run`.

use clap::Args;
use flotor_command::{CommandError, stopping};
use flotor_servo::engine::process;
use flotor_session::registry::load_file;
use std::path::PathBuf;

/// Arguments of a worker. Its standard input is the memory it shares with its host.
#[derive(Args, Clone, Debug)]
pub(super) struct WorkerArguments {
    /// The plugin's shared library
    plugin: PathBuf,
    /// Nominal time between ticks, ns
    #[arg(long)]
    period_ns: u64,
    /// Seed of the run
    #[arg(long)]
    seed: u64,
    /// A parameter of the model, KEY=VALUE
    #[arg(long = "set")]
    sets: Vec<String>,
}

pub(super) fn run(arguments: WorkerArguments) -> Result<(), CommandError> {
    // A terminal signals both worker and host, and the host still steps the model while the force fades out. A
    // worker ends with its host, so nobody listens to the switch.
    let _ = stopping::stop_on_signals();
    let WorkerArguments { plugin, period_ns, seed, sets } = arguments;
    process::serve(&process::WorkerArguments { plugin, period_ns, seed, sets }, load_file)
        .map_err(|error| CommandError::Usage(format!("`flotor worker` is started by `flotor run`: {error}")))
}
