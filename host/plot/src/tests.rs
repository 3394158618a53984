//! What the pictures promise: round ticks, no lost peak, gaps where samples are bad, and well-formed text
//! whatever goes in.

mod numbers;
mod pictures;

use super::axis::{Domain, Scale};
use super::decimate::Point;

/// Deterministic numbers in 0..1 (64-bit linear congruential generator, Knuth's MMIX constants).
struct Sequence(u64);

impl Sequence {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn linear(low: f64, high: f64) -> Domain {
    Domain { scale: Scale::Linear, low, high }
}

/// A noisy series of 600 000 samples (ten minutes at 1 kHz) with single-sample peaks.
fn ten_minutes() -> Vec<Point> {
    let mut random = Sequence(3);
    let peak = |tick: u32| if tick % 99_991 == 41_234 { 5.0 } else { 0.0 };
    (0..600_000).map(|tick| (f64::from(tick) * 1e-3, random.next() + peak(tick))).collect()
}
