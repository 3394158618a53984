//! Work of a lap on a closed path.

use super::quadrature::{Work, work};
use flotor_hal::Memory;

/// Relative work that counts as zero.
pub(super) const CONSERVATIVE: f64 = 1.0e-9;
/// Relative change between two numbers of samples that counts as converged.
const SETTLED: f64 = 1.0e-12;
/// Number of steps that a lap may cross: a motion of three harmonics meets a plane six times, and there may be two planes.
pub(super) const MOST_STEPS: f64 = 12.0;
/// Smallest energy that is compared, J.
const NO_ENERGY_J: f64 = 1.0e-9;

/// Sample of a lap.
#[derive(Clone, Copy)]
pub(super) struct Sample {
    /// Power of the model's wrench on the hand, J per lap.
    pub(super) power_j: f64,
    /// Upper bound of the power of force and torque on the path, J per lap.
    pub(super) most_j: f64,
    /// Stored energy as reported by the model, J; NaN without a report.
    pub(super) stored_j: f64,
}

/// Returns the difference between stored energy and work on a lap, relative to the energy stored on it. Zero where the
/// model reports no energy.
fn mismatch(samples: &[Sample], memory: Memory) -> f64 {
    let (mut most_j, mut least_j) = (f64::NEG_INFINITY, f64::INFINITY);
    // Stored energy plus work on the hand: constant, or falling where energy is dissipated.
    let (mut total_j, mut lowest_j, mut highest_j, mut risen_j) = (0.0, 0.0, 0.0, 0.0);
    for pair in samples.windows(2) {
        let [before, here] = pair else { continue };
        let work_j = 0.5 * (before.power_j + here.power_j) / samples.len() as f64;
        total_j += here.stored_j - before.stored_j + work_j;
        (lowest_j, highest_j) = (f64::min(lowest_j, total_j), f64::max(highest_j, total_j));
        risen_j = f64::max(risen_j, total_j - lowest_j);
        (most_j, least_j) = (most_j.max(here.stored_j), least_j.min(here.stored_j));
    }
    let stored_j = most_j - least_j;
    if samples.iter().any(|sample| sample.stored_j.is_nan()) || stored_j < NO_ENERGY_J {
        return 0.0;
    }
    match memory {
        Memory::Stateless => (highest_j - lowest_j) / stored_j,
        Memory::PathDependent => risen_j / stored_j,
    }
}

/// Expectation whether a lap may dissipate energy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Dissipation {
    /// The lap must be conservative: energy dissipated on it would be generated in the reverse direction.
    None,
    /// Dissipation by friction or damping is allowed.
    Allowed,
}

impl Dissipation {
    /// Returns the expectation for a lap at rest in each of its poses.
    pub(super) fn at_rest(memory: Memory) -> Self {
        match memory {
            Memory::Stateless => Self::None,
            Memory::PathDependent => Self::Allowed,
        }
    }
}

/// Work of one lap.
#[derive(Clone, Copy)]
pub(super) struct Lap {
    /// Work on the hand, J.
    pub(super) net_j: f64,
    /// Absolute work exchanged with the hand (integral of the magnitude of the power), J.
    pub(super) gross_j: f64,
    /// Uncertainty of the work on the hand, J.
    pub(super) uncertain_j: f64,
    /// Relative difference between stored energy and work; see [`mismatch`].
    pub(super) mismatch: f64,
}

impl Lap {
    /// Integrates the power at evenly spaced samples, J per lap.
    pub(super) fn from_powers(powers: &[f64]) -> Self {
        let mean =
            |numbers: &mut dyn Iterator<Item = f64>, count: usize| numbers.sum::<f64>() / count.max(1) as f64;
        let net_j = mean(&mut powers.iter().copied(), powers.len());
        let gross_j = mean(&mut powers.iter().map(|power| power.abs()), powers.len());
        let every_other_j = mean(&mut powers.iter().step_by(2).copied(), powers.len() / 2);
        let change_j = (net_j - every_other_j).abs();
        if change_j <= SETTLED * gross_j {
            return Self { net_j, gross_j, uncertain_j: 0.0, mismatch: 0.0 };
        }
        // Not smooth: each step between two samples offsets the rule by up to its height times the interval.
        let heights = powers.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        let steps_j = MOST_STEPS * heights.fold(0.0, f64::max) / powers.len() as f64;
        Self { net_j, gross_j, uncertain_j: (2.0 * change_j).max(steps_j), mismatch: 0.0 }
    }

    pub(super) fn from_samples(samples: &[Sample], memory: Memory) -> Self {
        let powers: Vec<f64> = samples.iter().map(|sample| sample.power_j).collect();
        Self { mismatch: mismatch(samples, memory), ..Self::from_powers(&powers) }
    }

    /// Returns the lap unchanged if it is [resolved](Self::is_resolved), otherwise with its work recomputed by [`work`]
    /// from `powers`; `None` if [`work`] returns none.
    pub(super) fn or_resolved(
        self,
        dissipation: Dissipation,
        powers: impl FnMut(&[f64]) -> Option<Vec<f64>>,
    ) -> Option<Self> {
        if self.is_resolved(dissipation) {
            return Some(self);
        }
        let Work { net_j, gross_j, uncertain_j } = work(CONSERVATIVE, powers)?;
        Some(Self { net_j, gross_j, uncertain_j, mismatch: self.mismatch })
    }

    /// Returns the generated energy beyond the uncertainty, J; with [`Dissipation::None`] dissipated energy counts as generated.
    pub(super) fn made_j(&self, dissipation: Dissipation) -> f64 {
        (self.work_j(dissipation) - self.uncertain_j).max(0.0)
    }

    /// Returns true if the uncertainty is small enough to decide between pass and fail.
    pub(super) fn is_resolved(&self, dissipation: Dissipation) -> bool {
        let bound_j = CONSERVATIVE * self.gross_j;
        self.made_j(dissipation) > bound_j || self.work_j(dissipation) + self.uncertain_j <= bound_j
    }

    fn work_j(&self, dissipation: Dissipation) -> f64 {
        match dissipation {
            Dissipation::None => self.net_j.abs(),
            Dissipation::Allowed => self.net_j,
        }
    }

    pub(super) fn is_settled(&self) -> bool {
        self.uncertain_j == 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn a_smooth_lap_is_settled_and_a_step_is_not_mistaken_for_work() {
        let powers =
            |f: &dyn Fn(f64) -> f64| -> Vec<f64> { (0..1024).map(|i| f(f64::from(i) / 1024.0)).collect() };
        let smooth = Lap::from_powers(&powers(&|part| (TAU * part).sin() * (1.0 + (TAU * part).cos())));
        assert!(smooth.is_settled() && smooth.net_j.abs() < 1.0e-15);
        // Plus one over part of the way, minus one over as much: no net work, but no grid hits both edges
        // alike.
        let steps = |part: f64| {
            f64::from((0.1234..0.3456).contains(&part)) - f64::from((0.5..0.7222).contains(&part))
        };
        let stepped = Lap::from_powers(&powers(&steps));
        assert!(!stepped.is_settled() && stepped.net_j.abs() <= stepped.uncertain_j, "{}", stepped.net_j);
    }
}
