//! Plugin calls by name, with their time limits and errors.

use flotor_servo::THREAD_ADVICE;
use std::fmt;
use std::time::Duration;

/// Environment variable with the time limit of a call before a run, s; 60 by default.
pub const LIMIT_VARIABLE: &str = "FLOTOR_CALL_LIMIT_S";

/// Environment variable with the limit on the processor time of a step on the virtual clock, in `validate` and in `stress`, s; 1 by
/// default.
pub const STEP_LIMIT_VARIABLE: &str = "FLOTOR_STEP_LIMIT_S";

/// Default time limit of a call before a run, or for a replacement during a run: large models compute tables.
const DEFAULT_LIMIT: Duration = Duration::from_secs(60);
/// Time limit of a call after a run: short, because the devices are stopped and nothing depends on the call.
const END_LIMIT: Duration = Duration::from_secs(5);

/// Plugin call outside the loop, for time limits and messages.
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
    /// Reading the energy balance and the last message of a device, and de-energising the device.
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

/// Error of a plugin call that did not return in time: the thread of the call is abandoned, and the process should end soon.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{who}` did not return from {call} within {} s, the time limit; check the plugin{}",
    limit.as_secs_f64(),
    advice(*call)
)]
pub struct Unresponsive {
    /// Name of the device or model in the scene, or path of the plugin file.
    pub who: String,
    /// Call that did not return.
    pub call: Call,
    /// Time limit of the call.
    pub limit: Duration,
}

/// Returns the advice to raise the limit of a call before a run; empty for other calls, whose limit is never above [`END_LIMIT`].
fn advice(call: Call) -> String {
    match call {
        Call::Load | Call::Create | Call::Prepare | Call::Open | Call::Activate => {
            format!(", or raise the limit with the environment variable `{LIMIT_VARIABLE}`")
        }
        _ => String::new(),
    }
}

/// Reason why a call has no result.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CallError {
    /// The call did not return in time.
    #[error(transparent)]
    Unresponsive(#[from] Unresponsive),
    /// The system cannot start a thread for the call.
    #[error("cannot start a thread for the calls of a plugin; {THREAD_ADVICE}")]
    NoThread,
    /// A stop was requested, or the run ended, before the call returned.
    #[error("the run was stopped before `create`, `open` or another call returned; start the run again")]
    Stopped,
}

/// Returns the time limit of a call before a run: the value of [`LIMIT_VARIABLE`], or the default.
pub(crate) fn limit() -> Duration {
    limit_of(LIMIT_VARIABLE).unwrap_or(DEFAULT_LIMIT)
}

/// Reads a time limit, s, from an environment variable; `None` if the variable is unset or not a positive number.
pub(crate) fn limit_of(variable: &str) -> Option<Duration> {
    let seconds = std::env::var(variable).ok()?.parse::<f64>().ok().filter(|seconds| *seconds > 0.0)?;
    Duration::try_from_secs_f64(seconds).ok()
}

/// Returns the time limit of a call after a run: 5 s, or the limit before a run if that is shorter.
pub(crate) fn end_limit() -> Duration {
    END_LIMIT.min(limit())
}
