//! `flotor worker`: the process of one isolated force model, started by the host of a run.

use clap::Args;
use flotor_command::CommandError;
use flotor_servo::engine::process;
use flotor_session::registry::load_file;
use std::path::PathBuf;

/// Arguments of a worker. The standard input of a worker is the memory that it shares with its host.
#[derive(Args, Clone, Debug)]
pub(super) struct WorkerArguments {
    /// The plugin's shared library
    plugin: PathBuf,
    /// Process id of the host
    #[arg(long)]
    host: i32,
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
    // Signals end a worker like any process; the signals of a terminal do not reach its separate process group.
    let WorkerArguments { plugin, host, period_ns, seed, sets } = arguments;
    process::serve(&process::WorkerArguments { plugin, host, period_ns, seed, sets }, load_file)
        .map_err(|error| CommandError::Usage(format!("`flotor worker` is started by a host: {error}")))
}
