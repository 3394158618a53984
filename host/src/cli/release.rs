//! `flotor release`: releases the emergency stop of this machine.

use clap::Args;
use flotor_command::CommandError;
use flotor_command::say;
use flotor_live::Directory;

/// Release the emergency stop of this machine: runs may start again.
#[derive(Args)]
#[command(
    after_help = "An emergency stop of any run of yours (key, signal, viewer, network, button) stops all of them \
    and stays pressed:\n\
    nothing is energised, also after a restart of any program, until `flotor release`. First find out why it was pressed.\n\n\
    Example:\n  flotor release"
)]
pub(crate) struct ReleaseArguments {}

pub(crate) fn run(_: &ReleaseArguments) -> Result<(), CommandError> {
    let latch = Directory::of_this_user().latch();
    let who = format!("process {}", std::process::id());
    match latch.release(&who).map_err(|error| CommandError::Failed(error.to_string()))? {
        Some(pressed) => say!("released: {pressed}"),
        None => say!("the emergency stop of this machine is not pressed"),
    }
    Ok(())
}
