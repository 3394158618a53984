//! Why a command failed, and its exit code.
//!
//! Exit codes are a contract: 0 ok, 2 usage or configuration, 3 a plugin was refused, 4 device fault, 1 else;
//! 130 after the third signal that asks for an end.

use flotor_hal::Fault;
use flotor_hal::abi::loader::LoadError;
use flotor_servo::{EmergencySource, Place, Stuck};
use flotor_session::RunError;
use flotor_session::registry::LookupError;
use std::path::{Path, PathBuf};

/// Why a command failed, with its exit code.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CommandError {
    /// The command line or a configuration says something that cannot be.
    #[error("{0}")]
    Usage(String),
    /// A run could not start.
    #[error(transparent)]
    Run(#[from] RunError),
    /// A device faulted.
    #[error("device fault: {}", .0.advice())]
    DeviceFault(Fault),
    /// A device faulted in a run.
    #[error("{}: device fault: {}{}", path.display(), before_advice(words), fault.advice())]
    RunFault {
        /// The plugin's file.
        path: PathBuf,
        /// What is wrong, and what to do.
        fault: Fault,
        /// What the device itself said; may be empty.
        words: String,
    },
    /// Somebody pressed the emergency stop.
    #[error("emergency stop ({}); the device is stopped and gives no force until the next run", .0.word())]
    EmergencyStop(EmergencySource),
    /// A tick took so long that the watchdog stopped the device.
    #[error(
        "tick {} took longer than the watchdog allows, and it stopped the device; look at the machine with \
         `flotor doctor`, or allow more with `[limits] watchdog_ms`", .0.tick
    )]
    Watchdog(Stuck),
    /// The device sets the pace, and it is a faster one.
    #[error(
        "the device sends {samples_per_s} samples a second and sets the pace, the scene counts {rate_hz} ticks: every limit per \
         second would be too high; set `rate_hz = {samples_per_s}`, or `pacing = \"host\"`"
    )]
    TooFast {
        /// What the device sends.
        samples_per_s: u32,
        /// What the scene says.
        rate_hz: f64,
    },
    /// A plugin was refused.
    #[error("{0}")]
    PluginRefused(String),
    /// A file could not be written or read.
    #[error("{}: {action}: {cause}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What was attempted.
        action: &'static str,
        /// What the system said.
        cause: std::io::Error,
    },
    /// A recording could not be written or read.
    #[error(transparent)]
    Record(#[from] flotor_record::RecordError),
    /// A recording could not be replayed.
    #[error(transparent)]
    Read(#[from] flotor_record::ReadError),
    /// Something found wrong that the output has already told.
    #[error("{0}")]
    Failed(String),
}

impl From<LookupError> for CommandError {
    fn from(error: LookupError) -> Self {
        Self::Run(error.into())
    }
}

impl From<LoadError> for CommandError {
    fn from(error: LoadError) -> Self {
        Self::Run(error.into())
    }
}

impl CommandError {
    /// A file could not be written or read.
    #[must_use]
    pub fn file(path: &Path, action: &'static str, cause: std::io::Error) -> Self {
        Self::File { path: path.into(), action, cause }
    }

    /// The exit code of the program.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) | Self::Read(_) => 2,
            Self::Run(error) => match error {
                RunError::Scene(_) | RunError::Mismatch { .. } => 2,
                RunError::Lookup(LookupError::Unknown { .. }) => 2,
                RunError::Lookup(LookupError::Refused(error)) | RunError::Plugin(error) => {
                    refusal_code(error)
                }
                RunError::Hung { stuck, .. } => match stuck.place {
                    Place::Model(_) => 3,
                    Place::DeviceWait(_) | Place::DeviceRead(_) | Place::DeviceWrite(_) => 4,
                    Place::Waiting | Place::Host => 1,
                },
                RunError::Thread(_) | _ => 1,
            },
            Self::PluginRefused(_) => 3,
            Self::DeviceFault(_)
            | Self::RunFault { .. }
            | Self::EmergencyStop(_)
            | Self::TooFast { .. }
            | Self::Watchdog(_) => 4,
            Self::File { .. } | Self::Record(_) | Self::Failed(_) => 1,
        }
    }
}

/// What a device said, in front of the advice for its fault.
#[must_use]
pub fn before_advice(words: &str) -> String {
    if words.is_empty() { String::new() } else { format!("{words}; ") }
}

/// A plugin that says its parameters do not fit is a configuration error; everything else is a refused plugin.
fn refusal_code(error: &LoadError) -> u8 {
    match error {
        LoadError::Refused { refusal, .. } if refusal.kind == flotor_hal::RefusalKind::Parameter => 2,
        _ => 3,
    }
}
