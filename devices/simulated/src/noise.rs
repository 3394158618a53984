//! Seeded pseudorandom numbers: the same seed gives the same noise on every machine.
//!
//! The generator is PCG (O'Neill 2014), fixed here so that an update of a library cannot change a run. Every source of
//! noise has its own stream: switching a source on or off does not change the others.

use flotor_hal::{Restorable, StateBytes, math};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::f64::consts::TAU;

/// Source of noise; each has its own stream of random numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stream {
    /// Noise of the position cells.
    Sensor = 1,
    /// Times of random faults.
    Faults = 2,
    /// Tremor and force noise of the hand.
    Hand = 3,
}

/// Generator of one stream of random numbers.
#[derive(Clone, Debug)]
pub(crate) struct Noise {
    generator: Pcg64Mcg,
}

impl Restorable for Noise {
    fn pass(&mut self, bytes: &mut StateBytes<'_>) {
        let mut state = self.generator.state();
        state.pass(bytes);
        self.generator = Pcg64Mcg::new(state);
    }
}

impl Noise {
    /// Creates the stream of one source in a run with this seed. Real-time: bounded, no allocation.
    pub(crate) fn new(seed: u64, stream: Stream) -> Self {
        // An odd constant (the golden ratio in 64 bits) separates neighbouring seeds and streams.
        let mixed = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(stream as u64);
        Self { generator: Pcg64Mcg::seed_from_u64(mixed) }
    }

    /// Draws a sample of the uniform distribution from 0 (included) to 1 (excluded). Real-time: bounded, no allocation.
    pub(crate) fn uniform(&mut self) -> f64 {
        /// 2^-53: the 53 highest bits fill the mantissa.
        const STEP: f64 = 1.0 / (1_u64 << 53) as f64;
        (self.generator.next_u64() >> 11) as f64 * STEP
    }

    /// Draws two independent samples of the standard normal distribution (Box and Muller 1958).
    ///
    /// Real-time: bounded, no allocation.
    pub(crate) fn normal_pair(&mut self) -> [f64; 2] {
        // 1 - u is never zero, so the logarithm is finite.
        let radius = (-2.0 * math::ln(1.0 - self.uniform())).sqrt();
        let (sin, cos) = math::sin_cos(TAU * self.uniform());
        [radius * cos, radius * sin]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_repeats_and_streams_differ() {
        let draw = |seed, stream| {
            let mut noise = Noise::new(seed, stream);
            [noise.uniform(), noise.uniform(), noise.uniform()]
        };
        assert_eq!(draw(7, Stream::Sensor), draw(7, Stream::Sensor));
        assert_ne!(draw(7, Stream::Sensor), draw(8, Stream::Sensor));
        assert_ne!(draw(7, Stream::Sensor), draw(7, Stream::Faults));
    }

    #[test]
    fn the_normal_distribution_has_its_moments() {
        let mut noise = Noise::new(1, Stream::Sensor);
        let (mut mean, mut square, mut fourth) = (0.0, 0.0, 0.0);
        const PAIRS: u32 = 100_000;
        for x in (0..PAIRS).flat_map(|_| noise.normal_pair()) {
            mean += x;
            square += x * x;
            fourth += x * x * x * x;
        }
        let count = 2.0 * f64::from(PAIRS);
        // Four standard errors: 1, sqrt 2 and sqrt 96 over the root of the count.
        let bound = 4.0 / count.sqrt();
        assert!((mean / count).abs() < bound);
        assert!((square / count - 1.0).abs() < 2.0_f64.sqrt() * bound);
        assert!((fourth / count - 3.0).abs() < 96.0_f64.sqrt() * bound);
    }
}
