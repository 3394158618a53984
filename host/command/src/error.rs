//! Errors of commands, and their exit codes.
//!
//! Exit codes are a contract:
//!
//! - 0: success
//! - 1: any other error
//! - 2: invalid usage or configuration
//! - 3: a plugin was refused or failed
//! - 4: device fault, or a run that ended by an emergency stop, the watchdog, oscillation or a device that paces the loop too fast
//! - 130 ([`INTERRUPTED`](crate::INTERRUPTED), on Windows another code): forced end, see [`stopping`](crate::stopping)

use flotor_hal::Fault;
use flotor_loader::LoadError;
use flotor_record::RecordError;
use flotor_servo::{Place, RunEnd};
use flotor_session::registry::LookupError;
use flotor_session::{Call, CallError, RunError};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Error of a command, with its exit code.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CommandError {
    /// The command line or a configuration is invalid.
    #[error("{0}")]
    Usage(String),
    /// A run could not start or be carried out.
    #[error(transparent)]
    Run(#[from] RunError),
    /// A device faulted; for commands that know neither the path of the device plugin nor the message of the device.
    #[error("device fault: {}", .0.advice())]
    DeviceFault(Fault),
    /// A device faulted, with its path and message.
    #[error("{}: device fault: {}{}", path.display(), before_advice(words), fault.advice())]
    RunFault {
        /// Path of the device plugin's shared library.
        path: PathBuf,
        /// Kind of fault.
        fault: Fault,
        /// Message of the device; may be empty.
        words: String,
    },
    /// A run ended abnormally, for a cause without an error of its own.
    #[error("{}", ended(*.0))]
    RunEnded(RunEnd),
    /// The device sets the pace, at a rate above the loop rate of the scene.
    #[error(
        "the device paces the loop with {samples_per_s} samples a second, above the loop rate of {rate_hz} Hz: ramps would be too \
         short and slew limits too high; raise `rate_hz` (or `--rate`) to at least {samples_per_s}, or set `pacing = \"host\"`"
    )]
    TooFast {
        /// Sample rate of the device, Hz.
        samples_per_s: u32,
        /// Loop rate of the scene, Hz.
        rate_hz: f64,
    },
    /// A plugin was refused, with the reason.
    #[error("{0}")]
    PluginRefused(String),
    /// A file could not be written or read.
    #[error("{}: {action}: {cause}{}", path.display(), remedy(cause))]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Text about the failed action, such as "cannot write the result".
        action: &'static str,
        /// Error of the system.
        cause: std::io::Error,
    },
    /// A recording could not be created or written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// A recording could not be read.
    #[error(transparent)]
    Read(#[from] flotor_record::ReadError),
    /// Any other failure, with its message.
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
    /// Creates the error of a file that could not be written or read; `action` is the text about the failed action.
    #[must_use]
    pub fn file(path: &Path, action: &'static str, cause: std::io::Error) -> Self {
        Self::File { path: path.into(), action, cause }
    }

    /// Creates the error of a run that ended abnormally; `rate_hz` is the loop rate of its scene.
    #[must_use]
    pub fn run_ended(end: RunEnd, rate_hz: f64) -> Self {
        match end {
            RunEnd::TooFast(samples_per_s) => Self::TooFast { samples_per_s, rate_hz },
            end => Self::RunEnded(end),
        }
    }

    /// Returns the exit code of the program.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage(_) | Self::Read(_) | Self::Record(RecordError::Exists(_)) => 2,
            Self::Run(error) => match error {
                wrong if wrong.is_configuration() => 2,
                // The device may still exert a force.
                RunError::Calls(CallError::Unresponsive(hung)) if hung.call == Call::SafeStop => 4,
                RunError::Calls(CallError::Stopped | CallError::NoThread)
                | RunError::Lookup(LookupError::Calls(CallError::Stopped | CallError::NoThread)) => 1,
                RunError::Lookup(_) | RunError::Plugin(_) | RunError::Calls(_) => 3,
                RunError::Hung { stuck, .. } => match stuck.place {
                    Place::Model(_) => 3,
                    Place::DeviceWait(_) | Place::DeviceRead(_) | Place::DeviceWrite(_) => 4,
                    Place::Waiting | Place::Host => 1,
                },
                RunError::Latched(_) => 4,
                _ => 1,
            },
            Self::PluginRefused(_) => 3,
            Self::RunEnded(end) => end.exit_code(),
            Self::TooFast { samples_per_s, .. } => RunEnd::TooFast(*samples_per_s).exit_code(),
            Self::DeviceFault(fault) | Self::RunFault { fault, .. } => {
                RunEnd::DeviceFault(*fault).exit_code()
            }
            Self::File { .. } | Self::Record(_) | Self::Failed(_) => 1,
        }
    }
}

/// Returns the remedy for an error of the system, after a semicolon; empty if the error implies none.
fn remedy(cause: &std::io::Error) -> &'static str {
    match cause.kind() {
        ErrorKind::NotFound | ErrorKind::NotADirectory => "; check the path",
        ErrorKind::PermissionDenied => "; check the permissions of the file and its folder",
        ErrorKind::IsADirectory => "; name a file instead of a folder",
        ErrorKind::ReadOnlyFilesystem => "; choose a folder where you may write",
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => "; free disk space",
        _ => "",
    }
}

/// Formats the message of a device for the place before the advice on its fault: with a trailing semicolon, or empty without a message.
#[must_use]
pub fn before_advice(words: &str) -> String {
    if words.is_empty() { String::new() } else { format!("{words}; ") }
}

/// Describes the end of a run with its remedy, for users.
fn ended(end: RunEnd) -> String {
    match end {
        RunEnd::Finished => "the run finished".to_owned(),
        RunEnd::DeviceFault(fault) => CommandError::DeviceFault(fault).to_string(),
        RunEnd::Stopped | RunEnd::TooFast(_) => end.cause(),
        RunEnd::EmergencyStop(source) => format!(
            "emergency stop ({}); all devices are stopped and exert no force until the next run",
            source.word()
        ),
        RunEnd::Watchdog(stuck) => format!(
            "tick {} exceeded the time limit, and the watchdog stopped all devices; check the machine with \
             `flotor doctor`, or raise `[limits] watchdog_ms`",
            stuck.tick
        ),
        RunEnd::Oscillation => "the force oscillated between its limits, and continued to oscillate when the host \
            attenuated it: the loop is unstable; lower the stiffness or the gain of the scene (`flotor stability` \
            computes the largest stable stiffness)"
            .to_owned(),
        RunEnd::Unguarded => "the watchdog process has ended, so no process stops the devices if this program is \
            killed; the run ended because the scene has `[limits] require_independent_stop`. Start the run again"
            .to_owned(),
        RunEnd::NotPaced => "the device does not set the pace of the loop with its present settings; remove \
            `pacing = \"device\"` from the scene"
            .to_owned(),
    }
}
