//! Clock that drives a loop, and conversion of times to nanoseconds.

/// Clock that drives the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// The machine's monotonic clock.
    Real,
    /// Simulated time without waiting: the next tick starts when the last one is done. Runs repeat bit by bit.
    Virtual,
}

impl Clock {
    /// Returns the word for the clock in summaries.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Real => "real",
            Self::Virtual => "virtual",
        }
    }
}

/// Converts a time from s to whole ns, rounded and saturated: 0 for a negative time and for NaN.
#[must_use]
pub fn to_ns(time_s: f64) -> u64 {
    rounded(time_s * 1.0e9)
}

/// Converts a rate in Hz to its period in whole ns, rounded and saturated: 0 for a negative rate and for NaN.
#[must_use]
pub fn period_ns(rate_hz: f64) -> u64 {
    rounded(1.0e9 / rate_hz)
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // `as` limits the number to the range
fn rounded(time_ns: f64) -> u64 {
    time_ns.round() as u64
}
