//! Time limits of plugin calls, from the environment.

use std::time::Duration;

/// Environment variable with the time limit of a call before a run, in seconds.
pub const LIMIT_VARIABLE: &str = "FLOTOR_CALL_LIMIT_S";

/// Environment variable with the processor time limit of a step without a clock (virtual clock, `validate`, `stress`), in seconds.
pub const STEP_LIMIT_VARIABLE: &str = "FLOTOR_STEP_LIMIT_S";

/// Default time limit of a call before a run, or for a replacement during one: large models compute tables.
const DEFAULT_LIMIT: Duration = Duration::from_secs(60);
/// Time limit of a call after a run: the device is stopped, and nothing depends on the call.
const END_LIMIT: Duration = Duration::from_secs(5);

/// Returns the time limit of a call before a run.
pub(crate) fn limit() -> Duration {
    limit_of(LIMIT_VARIABLE).unwrap_or(DEFAULT_LIMIT)
}

/// Reads a time limit from the environment.
pub(crate) fn limit_of(variable: &str) -> Option<Duration> {
    let seconds = std::env::var(variable).ok()?.parse::<f64>().ok().filter(|seconds| *seconds > 0.0)?;
    Duration::try_from_secs_f64(seconds).ok()
}

/// Returns the time limit of a call after a run: at most the one before a run.
pub(crate) fn end_limit() -> Duration {
    END_LIMIT.min(limit())
}
