//! Conversion of units to SI, and of the clock's nanoseconds.

/// Millimetre, m.
pub(crate) const MM: f64 = 1.0e-3;
/// Micrometre, m.
pub(crate) const UM: f64 = 1.0e-6;
/// Percent, as a fraction.
pub(crate) const PERCENT: f64 = 1.0e-2;

/// Converts a time from ns to s. Real-time: bounded, no allocation.
#[inline]
pub(crate) fn seconds(time_ns: u64) -> f64 {
    time_ns as f64 * 1.0e-9
}

/// Converts a time from s to whole ns; a negative time to 0.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // `as` saturates
pub(crate) fn nanoseconds(time_s: f64) -> u64 {
    (time_s * 1.0e9).round() as u64
}
