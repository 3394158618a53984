//! Clock that drives a loop, and times in nanoseconds.

/// Clock that drives the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// The machine's monotonic clock.
    Real,
    /// Simulated time without waiting: the next tick is due when the last one is done. Bit-exact.
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

/// Returns a time in nanoseconds, rounded; 0 for a negative time and for NaN.
#[must_use]
pub fn to_ns(time_s: f64) -> u64 {
    rounded(time_s * 1.0e9)
}

/// Returns the period of a rate in nanoseconds, rounded.
#[must_use]
pub fn period_ns(rate_hz: f64) -> u64 {
    rounded(1.0e9 / rate_hz)
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // `as` limits the number to the range
fn rounded(time_ns: f64) -> u64 {
    time_ns.round() as u64
}
