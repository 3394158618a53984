//! `flotor bridge`: starts the bridge, a separate program because it needs Zenoh.

use clap::Args;
use flotor_command::separate::{Built, SeparateProgram};
use std::ffi::{OsStr, OsString};
use std::path::PathBuf;

pub(super) const BRIDGE: SeparateProgram<'static> = SeparateProgram {
    program: "flotor-bridge",
    built: Built::OwnWorkspace("bridge"),
    build: "cargo build --release --manifest-path interop/bridge/Cargo.toml --target-dir target/bridge",
};

/// Prefix that marks the name of a remote session.
const REMOTE: &str = "zenoh/";

/// Options for reaching a remote session.
#[derive(Args)]
pub(super) struct Way {
    /// With zenoh/NAME: Zenoh configuration with keys, see `flotor bridge keys`
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// With zenoh/NAME: endpoint to connect to, such as tls/lab.example.org:7447 (repeatable; default: those in --config,
    /// else the bridges of this user)
    #[arg(long, value_name = "ENDPOINT")]
    connect: Vec<String>,
}

impl Way {
    /// Returns the arguments of the bridge for `command` on the remote session `name`.
    pub(super) fn arguments(&self, command: &str, name: &OsStr) -> Vec<OsString> {
        let mut arguments = vec![command.into(), name.to_owned()];
        arguments.extend(self.config.iter().flat_map(|file| ["--config".into(), file.into()]));
        arguments.extend(self.connect.iter().flat_map(|endpoint| ["--connect".into(), endpoint.into()]));
        arguments
    }
}

/// Returns true if a text is the name of a remote session.
pub(super) fn is_remote(text: &OsStr) -> bool {
    text.to_str().is_some_and(|text| text.starts_with(REMOTE))
}
