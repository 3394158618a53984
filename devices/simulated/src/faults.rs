//! Injected faults: failures of a real machine, at a set time or at random.
//!
//! A host should survive these faults. One kind of fault is chosen per run; it occurs in *episodes* of a set length:
//! one episode at a set time, or random episodes at a set mean rate. The random times come from the run's seed: runs
//! with equal seeds have equal faults.

use crate::noise::{Noise, Stream};
use crate::validation::{Domain, InvalidParameter, number};
use flotor_hal::{math, restorable};

/// Kind of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultKind {
    /// The cells lose the light spots.
    SensorLoss,
    /// Samples arrive one tick late.
    LateSample,
    /// The last sample arrives again, marked as new.
    DuplicateSample,
    /// No sample arrives; the old one is repeated, marked as old.
    DroppedSample,
    /// One coordinate (0 to 5: x, y, z and the rotations) keeps its value at the start of the fault.
    StuckAxis(usize),
    /// The coil of this index (0 to 5) does not conduct.
    CoilOpen(usize),
    /// The device reports over-temperature of a coil.
    OverTemperature,
    /// The cable is unplugged: no sample, no force.
    CablePull,
    /// The device's clock has jitter: samples are taken up to half a period early.
    ClockJitter,
}

/// Kind and times of a fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultPlan {
    /// Kind of the fault.
    pub kind: FaultKind,
    /// Start of the one planned episode, ns.
    pub start_ns: u64,
    /// Length of every episode, ns.
    pub duration_ns: u64,
    /// Mean rate of random episodes, 1/s; an episode that begins during another prolongs it. If not zero, there is no planned
    /// episode.
    pub rate_per_s: f64,
}

/// Schedule of the faults in a run.
#[derive(Clone, Debug)]
pub struct Faults {
    plan: Option<FaultPlan>,
    noise: Noise,
    /// End of the current random episode, ns.
    until_ns: u64,
}

restorable!(Faults { noise, until_ns } without { plan });

impl Faults {
    /// Creates the schedule of a run. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// If `rate_per_s` is negative or not finite.
    pub fn new(plan: Option<FaultPlan>, seed: u64) -> Result<Self, InvalidParameter> {
        number("fault_rate_per_s", plan.map_or(0.0, |plan| plan.rate_per_s), Domain::NotNegative)?;
        Ok(Self { plan, noise: Noise::new(seed, Stream::Faults), until_ns: 0 })
    }

    /// Draws whether a random episode begins, and returns the fault at `time_ns`, `dt_s` (s) after the previous call; `None`
    /// outside episodes. Real-time: bounded, no allocation.
    pub fn at(&mut self, time_ns: u64, dt_s: f64) -> Option<FaultKind> {
        let FaultPlan { kind, start_ns, duration_ns, rate_per_s } = self.plan?;
        let active = if rate_per_s > 0.0 {
            // Probability of at least one episode in dt_s, for independent episodes.
            let chance = -math::exp_m1(-rate_per_s * dt_s);
            if self.noise.uniform() < chance {
                self.until_ns = time_ns.saturating_add(duration_ns);
            }
            time_ns < self.until_ns
        } else {
            time_ns >= start_ns && time_ns - start_ns < duration_ns
        };
        active.then_some(kind)
    }

    /// Draws the time by which a sample is early under clock jitter, as a fraction (0 to 1/2) of the period. Real-time:
    /// bounded, no allocation.
    pub fn jitter(&mut self) -> f64 {
        0.5 * self.noise.uniform()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK_NS: u64 = 1_000_000;

    fn broken_ticks(plan: FaultPlan, seed: u64, ticks: u64) -> Vec<u64> {
        let mut faults = Faults::new(Some(plan), seed).expect("a sound plan");
        (0..ticks).filter(|tick| faults.at(tick * TICK_NS, 1.0e-3).is_some()).collect()
    }

    #[test]
    fn a_planned_episode_starts_and_ends_on_time() {
        let plan = FaultPlan {
            kind: FaultKind::SensorLoss,
            start_ns: 5 * TICK_NS,
            duration_ns: 3 * TICK_NS,
            rate_per_s: 0.0,
        };
        assert_eq!(broken_ticks(plan, 0, 20), [5, 6, 7]);
    }

    #[test]
    fn random_episodes_come_at_their_rate_and_repeat_with_the_seed() {
        let plan =
            FaultPlan { kind: FaultKind::DroppedSample, start_ns: 0, duration_ns: TICK_NS, rate_per_s: 20.0 };
        let ticks = 100_000;
        let broken = broken_ticks(plan, 1, ticks);
        // 1 - e^-0.02 of the ticks, four standard errors.
        let expected = 0.0198 * ticks as f64;
        assert!((broken.len() as f64 - expected).abs() < 4.0 * expected.sqrt(), "{}", broken.len());
        assert_eq!(broken, broken_ticks(plan, 1, ticks));
        assert_ne!(broken, broken_ticks(plan, 2, ticks));
    }

    #[test]
    fn without_a_plan_nothing_breaks() {
        let mut faults = Faults::new(None, 1).expect("no plan");
        assert!((0..1000).all(|tick| faults.at(tick * TICK_NS, 1.0e-3).is_none()));
    }
}
