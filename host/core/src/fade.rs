//! Smooth step of a force that fades in or out.

/// Returns a smooth step (cubic) from 0 to 1 over `length_ns`, with zero slope at both ends. Real-time: bounded, no allocation.
#[inline]
#[must_use]
pub fn fade(elapsed_ns: u64, length_ns: u64) -> f64 {
    if elapsed_ns >= length_ns {
        return 1.0;
    }
    let part = elapsed_ns as f64 / length_ns as f64;
    part * part * (3.0 - 2.0 * part)
}
