//! Rounding of times to whole nanoseconds.

/// Rounds a time, ns, to a whole number; negative times and NaN become 0, times beyond the range the largest number.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // `as` saturates
pub(crate) fn whole_ns(ns: f64) -> u64 {
    ns.round() as u64
}
