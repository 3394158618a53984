//! Plugin calls by name, and their errors.

use super::limits::LIMIT_VARIABLE;
use flotor_servo::THREAD_ADVICE;
use std::fmt;
use std::time::Duration;

/// Plugin call outside the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Call {
    /// Loading the file, which runs its initialisers.
    Load,
    /// Creating a model.
    Create,
    /// Preparing a model for the loop.
    Prepare,
    /// Opening a device and reading its capabilities.
    Open,
    /// Energising a device.
    Activate,
    /// Stopping a device at the end of a run.
    SafeStop,
    /// Ending the energy balance of a device and de-energising it.
    Deactivate,
    /// Reading the message about a failed call.
    LastMessage,
    /// Freeing a model.
    Destroy,
    /// Closing a device.
    Close,
}

impl fmt::Display for Call {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Load => "its initialisers",
            Self::Create => "`create`",
            Self::Prepare => "`prepare`",
            Self::Open => "`open`",
            Self::Activate => "`activate`",
            Self::SafeStop => "`safe_stop`",
            Self::Deactivate => "`deactivate`",
            Self::LastMessage => "`last_message`",
            Self::Destroy => "`destroy`",
            Self::Close => "`close`",
        })
    }
}

/// Call that did not return in time: its thread is abandoned, and the process should end soon.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{who}` did not return from {call} within {} s, the time limit; check the plugin, or raise the limit with `{LIMIT_VARIABLE}`",
    limit.as_secs_f64()
)]
pub struct Unresponsive {
    /// Name in the scene, or path of the file.
    pub who: String,
    /// Call that did not return.
    pub call: Call,
    /// Time limit of the call.
    pub limit: Duration,
}

/// Reason why a call has no result.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CallError {
    /// The call did not return in time.
    #[error(transparent)]
    Unresponsive(#[from] Unresponsive),
    /// The system has no thread for the call.
    #[error("cannot start a thread for the calls of a plugin; {THREAD_ADVICE}")]
    NoThread,
    /// The run was stopped or over before the call returned.
    #[error("the run was stopped before `create`, `open` or another call returned; start the run again")]
    Stopped,
}
