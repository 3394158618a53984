//! `flotor sweep`: starts the sweeper, a separate program because it needs Parquet.

use clap::Args;
use flotor_command::CommandError;
use flotor_command::separate::{Built, SeparateProgram};
use std::ffi::OsString;

const SWEEPER: SeparateProgram<'static> = SeparateProgram {
    program: "flotor-sweep",
    built: Built::OwnWorkspace("sweep"),
    build: "cargo build --release --manifest-path host/sweep/Cargo.toml --target-dir target/sweep",
};

/// Sweep a model or a scene over parameters, poses and seeds into a Parquet table.
#[derive(Args)]
#[command(disable_help_flag = true)]
pub(crate) struct SweepArguments {
    /// Plan (TOML) and options; `flotor sweep --help` lists them
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "PLAN.toml")]
    arguments: Vec<OsString>,
}

pub(crate) fn run(arguments: &SweepArguments) -> Result<(), CommandError> {
    SWEEPER.become_with(&arguments.arguments)
}
