//! The way onto the network.

use clap::Args;
use std::path::PathBuf;
use zenoh::{Config, Session, Wait};

/// Where a bridge listens unless told otherwise: this machine only.
pub const LOOPBACK: &str = "tcp/127.0.0.1:7447";

/// How to reach others.
#[derive(Args, Clone, Debug, Default)]
pub struct LinkOptions {
    /// Zenoh configuration (JSON5): endpoints, keys, access control; `flotor bridge keys` writes some
    #[arg(long, value_name = "FILE", global = true)]
    pub config: Option<PathBuf>,
    /// Where to be reached, such as tls/0.0.0.0:7447 (repeatable)
    #[arg(long, value_name = "ENDPOINT", global = true)]
    pub listen: Vec<String>,
    /// Whom to reach, such as tls/lab.example.org:7447 (repeatable)
    #[arg(long, value_name = "ENDPOINT", global = true)]
    pub connect: Vec<String>,
}

/// Why there is no network.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LinkError {
    /// The configuration is none.
    #[error("the configuration{} cannot be used: {reason}", file.as_ref().map_or(String::new(), |f| format!(" {}", f.display())))]
    Config {
        /// The file.
        file: Option<PathBuf>,
        /// What is wrong.
        reason: String,
    },
    /// No session.
    #[error("cannot open the session: {0}; is the endpoint free, and the peer there?")]
    Open(String),
    /// The network refuses something.
    #[error("the network refuses: {0}")]
    Network(String),
}

impl From<zenoh::Error> for LinkError {
    fn from(error: zenoh::Error) -> Self {
        Self::Network(error.to_string())
    }
}

/// Which end of a link this program is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// Is reached by others.
    Serving,
    /// Reaches others.
    Visiting,
}

/// A session. Nothing is searched for by multicast: who is to be reached is said, by somebody.
///
/// # Errors
/// [`LinkError`].
pub fn open(options: &LinkOptions, end: End) -> Result<Session, LinkError> {
    let file = options.config.clone();
    let wrong = |error: zenoh::Error| LinkError::Config { file: file.clone(), reason: error.to_string() };
    let mut config = match &options.config {
        Some(path) => Config::from_file(path).map_err(wrong)?,
        None => Config::default(),
    };
    let (listen, connect) = endpoints(options, end);
    if options.config.is_none() {
        config.insert_json5("mode", "\"peer\"").map_err(wrong)?;
        config.insert_json5("scouting/multicast/enabled", "false").map_err(wrong)?;
        config.insert_json5("scouting/gossip/enabled", "false").map_err(wrong)?;
        // Without this, a visitor would listen on all interfaces.
        config.insert_json5("listen/endpoints", &list(&listen)).map_err(wrong)?;
        config.insert_json5("connect/endpoints", &list(&connect)).map_err(wrong)?;
    } else {
        for (key, given) in [("listen/endpoints", &options.listen), ("connect/endpoints", &options.connect)] {
            if !given.is_empty() {
                config.insert_json5(key, &list(given)).map_err(wrong)?;
            }
        }
    }
    zenoh::open(config).wait().map_err(|error| LinkError::Open(error.to_string()))
}

/// What to listen on and connect to, where nothing was said.
fn endpoints(options: &LinkOptions, end: End) -> (Vec<String>, Vec<String>) {
    let (mut listen, mut connect) = (options.listen.clone(), options.connect.clone());
    if listen.is_empty() && connect.is_empty() {
        match end {
            End::Serving => listen.push(LOOPBACK.to_owned()),
            End::Visiting => connect.push(LOOPBACK.to_owned()),
        }
    }
    (listen, connect)
}

fn list(endpoints: &[String]) -> String {
    serde_json::to_string(endpoints).unwrap_or_else(|_| "[]".to_owned())
}
