//! The whole loop: how far the force that reaches the hand lies from the reference's force at the true pose.
//!
//! A hand moves along the smooth path. The device sees it through its sensor (steps of a quantum), the model answers,
//! the device holds that force from a delay later until the next answer. In between the hand moves on, and the true
//! force changes: that, too, is an error the hand feels. Each cause is measured alone, and all together; a model more
//! exact than what sampling and sensing lose anyway buys nothing.

use super::error::answer;
use super::path::Hand;
use flotor_hal::abi::loader::Model;
use flotor_hal::{DVec3, Pose};
use flotor_judge::trajectory::{Trajectory, sensed};
use serde::Serialize;

/// How a device samples a hand.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sampling {
    /// Whole periods between a sample and the force that answers it.
    pub delay_ticks: u64,
    /// Step of the position sensor, m.
    pub quantum_m: f64,
    /// Step of the orientation, rad.
    pub quantum_rad: f64,
}

impl Sampling {
    /// Preset `full` of the simulated flotor: one tick, 5 µm; over an arm of 50 mm between light and axis that is
    /// 0.1 mrad (literature A2).
    pub const FULL: Sampling = Sampling { delay_ticks: 1, quantum_m: 5.0e-6, quantum_rad: 1.0e-4 };
    const NONE: Sampling = Sampling { delay_ticks: 0, quantum_m: 0.0, quantum_rad: 0.0 };

    fn sees(self, pose: Pose) -> Pose {
        sensed(pose, self.quantum_m, self.quantum_rad)
    }
}

/// Root mean square error of the force on the hand, N, by cause.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Losses {
    /// The model, asked at the true pose.
    pub model_n: f64,
    /// An exact model whose force is held for a period.
    pub hold_n: f64,
    /// The same, and late.
    pub delay_n: f64,
    /// An exact model that sees the sensor's steps.
    pub quantum_n: f64,
    /// Everything together.
    pub all_n: f64,
}

/// Length of the path, ticks.
const TICKS: u64 = 500;
/// Moments within a period at which the hand feels the difference.
const MOMENTS: u64 = 4;

/// Measures the causes. `exact` is the reference, `used` the model in the loop.
pub(super) fn losses(exact: &mut Model, used: &mut Model, hand: Hand, sampling: Sampling) -> Losses {
    let truth = Truth::new(exact, hand);
    let none = Sampling::NONE;
    let late = Sampling { delay_ticks: sampling.delay_ticks, ..none };
    let coarse = Sampling { delay_ticks: 0, ..sampling };
    Losses {
        model_n: truth.at_samples(used, none),
        hold_n: truth.held(exact, none),
        delay_n: truth.held(exact, late),
        quantum_n: truth.at_samples(exact, coarse),
        all_n: truth.held(used, sampling),
    }
}

/// The reference's force at every moment.
struct Truth {
    hand: Trajectory,
    forces_n: Vec<Option<DVec3>>,
}

impl Truth {
    fn new(exact: &mut Model, hand: Hand) -> Self {
        exact.reset();
        let hand = hand.trajectory();
        let forces = (0..TICKS * MOMENTS).map(|moment| {
            let time_s = moment as f64 / MOMENTS as f64 * 1.0e-3;
            answer(exact, hand.pose(time_s), moment).map(|wrench| wrench.force())
        });
        let forces_n = forces.collect();
        Self { hand, forces_n }
    }

    fn at(&self, moment: u64) -> Option<DVec3> {
        usize::try_from(moment).ok().and_then(|moment| self.forces_n.get(moment)).copied().flatten()
    }

    /// Error at the moments of sampling themselves.
    fn at_samples(&self, model: &mut Model, sampling: Sampling) -> f64 {
        let answers = answers(model, &self.hand, sampling);
        let errors =
            (0..).zip(answers).map(|(tick, force)| Some((force? - self.at(tick * MOMENTS)?).length()));
        root_mean_square(errors.skip(SETTLED))
    }

    /// Error at every moment, of a force that is held, from `delay_ticks` after its sample.
    fn held(&self, model: &mut Model, sampling: Sampling) -> f64 {
        let answers = answers(model, &self.hand, sampling);
        let errors = (0..TICKS * MOMENTS).map(|moment| {
            let sample = (moment / MOMENTS).checked_sub(sampling.delay_ticks)?;
            let held = answers.get(usize::try_from(sample).ok()?).copied().flatten()?;
            Some((held - self.at(moment)?).length())
        });
        #[allow(clippy::cast_possible_truncation)] // 4
        root_mean_square(errors.skip(SETTLED * MOMENTS as usize))
    }
}

/// Ticks at the start that are not counted: a model with memory finds its branch.
const SETTLED: usize = 20;

fn answers(model: &mut Model, hand: &Trajectory, sampling: Sampling) -> Vec<Option<DVec3>> {
    model.reset();
    let answers = (0..TICKS).map(|tick| {
        let seen = sampling.sees(hand.pose(tick as f64 * 1.0e-3));
        answer(model, seen, tick).map(|wrench| wrench.force())
    });
    answers.collect()
}

fn root_mean_square(errors: impl Iterator<Item = Option<f64>>) -> f64 {
    let (sum, count) =
        errors.flatten().fold((0.0, 0.0_f64), |(sum, count), error| (sum + error * error, count + 1.0));
    (sum / count.max(1.0)).sqrt()
}
