//! Clock that drives a loop.

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
