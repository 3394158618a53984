//! Unintended motion of the hand: tremor, and force noise in proportion to the force.
//!
//! **Tremor** moves the intended position. Physiological tremor of the hand has its peak at 8 to 10 Hz, independent of the
//! force (Sutton and Sykes 1967, J. Physiol. 191:699), and several frequencies at a time up to 12 Hz (Veluvolu and Ang
//! 2011, Sensors 11:3020). Instruments held in a braced hand move by 15 to 250 µm rms (Becker and others, PMC3032442,
//! figure 4).
//!
//! **Force noise** multiplies the intended force: its amplitude grows in proportion to the force, over the whole measured
//! band of 0.25 to 12.5 Hz, and is largest at low frequencies (Sutton and Sykes 1967). A fraction of 3 to 5 % is usual.
//!
//! Both are sums of sines with random phases (Shinozuka and Deodatis 1991, Appl. Mech. Rev. 44:191): functions of time and
//! seed alone, so that the hand is the same for ticks of any length.

use crate::noise::{Noise, Stream};
use crate::validation::{Check, Domain, number};
use flotor_hal::glam::DVec3;
use flotor_hal::math;
use std::f64::consts::{SQRT_2, TAU};

/// Band of tremor, Hz (see the module).
const TREMOR_BAND_HZ: [f64; 2] = [8.0, 12.0];

/// Band of the force noise, Hz (see the module).
const FORCE_BAND_HZ: [f64; 2] = [0.25, 12.5];

/// Number of sines in a sum: enough for a distribution close to normal.
const SINES: usize = 8;

/// Unsteadiness of a hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unsteadiness {
    /// Tremor of the intended position along each axis, root mean square, m.
    pub tremor_m: f64,
    /// Noise of an intended force, root mean square, as a fraction of the force.
    pub force_share: f64,
}

impl Unsteadiness {
    /// A perfectly steady hand.
    pub const NONE: Self = Self { tremor_m: 0.0, force_share: 0.0 };

    pub(super) fn check(&self) -> Check {
        number("hand_tremor_um", self.tremor_m, Domain::NotNegative)?;
        number("hand_force_noise_percent", self.force_share, Domain::NotNegative)
    }
}

/// Generator of the hand's tremor and force noise in one run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wavering {
    size: Unsteadiness,
    tremor: [Waves; 3],
    force: Waves,
}

impl Wavering {
    /// Draws the frequencies and phases of a run from its seed. Real-time: bounded, no allocation.
    pub(crate) fn new(size: Unsteadiness, seed: u64) -> Self {
        let mut noise = Noise::new(seed, Stream::Hand);
        let tremor = [(); 3].map(|()| Waves::new(TREMOR_BAND_HZ, &mut noise));
        Self { size, tremor, force: Waves::new(FORCE_BAND_HZ, &mut noise) }
    }

    /// Returns the tremor of the intended position at a time since the start of the run, m. Real-time: bounded, no
    /// allocation.
    #[inline]
    pub(crate) fn offset_m(&self, time_s: f64) -> DVec3 {
        if self.size.tremor_m == 0.0 {
            return DVec3::ZERO;
        }
        DVec3::from_array(self.tremor.map(|waves| waves.at(time_s))) * self.size.tremor_m
    }

    /// Returns the intended force with noise, N, at a time since the start of the run. Real-time: bounded, no
    /// allocation.
    #[inline]
    pub(crate) fn force_n(&self, intended_n: DVec3, time_s: f64) -> DVec3 {
        if self.size.force_share == 0.0 || intended_n == DVec3::ZERO {
            return intended_n;
        }
        intended_n * (1.0 + self.size.force_share * self.force.at(time_s))
    }
}

/// Sines of equal amplitude with frequencies spread evenly, on a logarithmic scale, over a band.
#[derive(Clone, Copy, Debug)]
struct Waves([Sine; SINES]);

#[derive(Clone, Copy, Debug)]
struct Sine {
    rate_per_s: f64,
    phase: f64,
}

impl Waves {
    fn new([lowest_hz, highest_hz]: [f64; 2], noise: &mut Noise) -> Self {
        let mut share = 0.0;
        Self([(); SINES].map(|()| {
            // A random frequency in each part of the band, so that the sum is not periodic.
            let frequency_hz =
                lowest_hz * math::pow(highest_hz / lowest_hz, (share + noise.uniform()) / SINES as f64);
            share += 1.0;
            Sine { rate_per_s: TAU * frequency_hz, phase: TAU * noise.uniform() }
        }))
    }

    /// Returns the sum at a time; its mean square is 1 over a long time.
    fn at(&self, time_s: f64) -> f64 {
        let sum: f64 = self.0.iter().map(|sine| math::sin(sine.rate_per_s * time_s + sine.phase)).sum();
        sum * (SQRT_2 / (SINES as f64).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNSTEADY: Unsteadiness = Unsteadiness { tremor_m: 50.0e-6, force_share: 0.04 };

    /// Ten minutes of samples, a millisecond apart.
    fn seconds() -> impl Iterator<Item = f64> {
        (0..600_000).map(|ms| f64::from(ms) * 1.0e-3)
    }

    #[test]
    fn tremor_has_its_size_and_its_band() {
        let wavering = Wavering::new(UNSTEADY, 1);
        let (mut square, mut rate_square) = (DVec3::ZERO, DVec3::ZERO);
        let mut before = wavering.offset_m(0.0);
        for time_s in seconds().skip(1) {
            let now = wavering.offset_m(time_s);
            let rate = (now - before) / 1.0e-3;
            (square, rate_square, before) = (square + now * now, rate_square + rate * rate, now);
        }
        let rms = (square / 600_000.0).map(f64::sqrt);
        // Eight sines over thousands of periods: cross terms are a thousandth; the rest is exact.
        assert!((rms / UNSTEADY.tremor_m - 1.0).abs().max_element() < 0.01, "{rms}");
        // Root mean square frequency (Rice): inside the band.
        let frequency_hz = (rate_square / square).map(f64::sqrt) / TAU;
        assert!(frequency_hz.min_element() > 8.0 && frequency_hz.max_element() < 12.0, "{frequency_hz}");
    }

    #[test]
    fn noise_of_force_grows_with_the_force_and_keeps_its_direction() {
        let wavering = Wavering::new(UNSTEADY, 2);
        let meant_n = DVec3::new(3.0, 0.0, -4.0);
        let mut square = 0.0;
        for time_s in seconds() {
            let force_n = wavering.force_n(meant_n, time_s);
            assert!(force_n.cross(meant_n).length() < 1.0e-12);
            assert!((wavering.force_n(meant_n * 2.0, time_s) - force_n * 2.0).length() < 1.0e-12);
            square += (force_n - meant_n).length_squared();
        }
        let share = (square / 600_000.0).sqrt() / meant_n.length();
        // The slowest sine has 150 periods: a hundredth.
        assert!((share / UNSTEADY.force_share - 1.0).abs() < 0.02, "{share}");
    }

    #[test]
    fn a_seed_repeats_and_another_differs() {
        let at = |seed| Wavering::new(UNSTEADY, seed).offset_m(0.123);
        assert_eq!(at(5), at(5));
        assert_ne!(at(5), at(6));
        assert_eq!(Wavering::new(Unsteadiness::NONE, 5).offset_m(0.123), DVec3::ZERO);
    }
}
