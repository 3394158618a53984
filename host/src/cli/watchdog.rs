//! `flotor watchdog`: the process that stops devices when the host is gone, started by the host of a run.

use clap::Args;
use flotor_command::{CommandError, stopping};
use flotor_servo::watchdog_process;

/// Arguments of the watchdog process. Its standard input is a socket to its host.
#[derive(Args, Clone, Copy, Debug)]
pub(super) struct WatchdogArguments {
    /// Process id of the host
    #[arg(long)]
    host: i32,
}

pub(super) fn run(arguments: WatchdogArguments) -> Result<(), CommandError> {
    // A signal to all processes of a run ends the host; this process must survive to stop the devices.
    stopping::outlive_signals();
    let refused = |error| CommandError::Usage(format!("`flotor watchdog` is started by a host: {error}"));
    watchdog_process::serve(arguments.host).map_err(refused)
}
