//! Which clock drives a loop.

/// Which clock drives the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// The machine's monotonic clock.
    Real,
    /// No waiting: the next tick is due when the last one is done. Bit-exact.
    Virtual,
}
