//! `flotor bridge`: starts the bridge, which is a program of its own, because it brings Zenoh.

use super::CommandError;
use super::companion::Companion;
use clap::Args;
use std::ffi::OsString;

pub(super) const BRIDGE: Companion<'static> = Companion {
    program: "flotor-bridge",
    build: "cargo build --release --manifest-path host/bridge/Cargo.toml --target-dir target",
};

/// Put a running host on a network, or bring one from there to this machine.
#[derive(Args)]
#[command(disable_help_flag = true)]
pub(crate) struct BridgeArguments {
    /// What to do, and options; `flotor bridge --help` lists them
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "COMMAND")]
    arguments: Vec<OsString>,
}

pub(crate) fn run(arguments: &BridgeArguments) -> Result<(), CommandError> {
    BRIDGE.become_with(&arguments.arguments)
}
