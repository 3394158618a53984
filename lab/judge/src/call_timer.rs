//! Timing of single calls.

use flotor_core::quantile;
use std::time::Instant;

/// Returns the time since `begin` less the overhead of the clock, ns; not below 0.
#[must_use]
pub fn net_ns(overhead_ns: f64, begin: Instant) -> f64 {
    (begin.elapsed().as_nanos() as f64 - overhead_ns).max(0.0)
}

/// Measures the overhead of reading the clock twice, ns: the median of 1001 measurements.
#[must_use]
pub fn overhead_ns() -> f64 {
    let mut samples: Vec<f64> = (0..1001).map(|_| net_ns(0.0, Instant::now())).collect();
    quantile(&mut samples, 0.5)
}
