//! Conversion of times.

/// Rounds a time in ns to a whole number; a negative time and NaN become 0.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // `as` saturates
pub(crate) fn whole_ns(ns: f64) -> u64 {
    ns.round() as u64
}
