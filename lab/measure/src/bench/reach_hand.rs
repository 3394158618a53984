//! Whole loop: error of the force on the hand, relative to the reference's force at the true pose.
//!
//! A hand moves along the smooth path. The device measures it through its sensor (with a quantum), the model answers,
//! and the device holds that force, after a delay, until the next answer. Meanwhile the hand moves on, and the true
//! force changes: that is an error on the hand too. Each cause is measured alone, and all together; a model far more
//! accurate than sampling and sensing has no benefit.
//!
//! The path is thirty periods of its slowest sine long. Within a period of the loop the squared error is integrated by
//! Gauss's rule of two points, exact for a force that changes linearly: a held force then has an error of its rate
//! times the period over √3, and √7 times that with a delay of a period.

use super::error::{Distance, answer, settle, walk};
use super::path::Hand;
use flotor_hal::{DVec3, Pose, Wrench};
use flotor_judge::trajectory::sensed;
use flotor_loader::Model;
use serde::Serialize;

/// Delay and sensor resolution of a loop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sampling {
    /// Whole periods between a sample and its force.
    pub delay_ticks: usize,
    /// Step of the position sensor, m.
    pub quantum_m: f64,
    /// Step of the orientation, rad.
    pub quantum_rad: f64,
}

impl Sampling {
    /// Preset `full` of the simulated flotor: one tick, 2 µm; over an arm of 50 mm between light and axis that is 0.04
    /// mrad (literature A2).
    pub const FULL: Sampling = Sampling { delay_ticks: 1, quantum_m: 2.0e-6, quantum_rad: 4.0e-5 };

    fn sees(self, pose: Pose) -> Pose {
        sensed(pose, self.quantum_m, self.quantum_rad)
    }
}

/// Root mean square error of the force on the hand, N, by cause.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Losses {
    /// Error of the model at the true pose.
    pub model_n: f64,
    /// Error of an exact model whose force is held for a period.
    pub hold_n: f64,
    /// Error of an exact model whose force is held for a period, and delayed.
    pub delay_n: f64,
    /// Error of an exact model at poses quantised by the sensor.
    pub quantum_n: f64,
    /// Error with all causes together.
    pub all_n: f64,
}

/// Length of the path, ticks: thirty periods of its slowest sine.
const TICKS: u64 = 30_000;
/// Period of the loop, s.
const PERIOD_S: f64 = 1.0e-3;
/// Gauss's points within a period, as fractions: (1 - 1/√3)/2 and (1 + 1/√3)/2, each with half of the weight.
const MOMENTS: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];

/// Answers of the reference along the path, with the losses that are independent of the model in the loop.
pub(super) struct Truth {
    path: Vec<Pose>,
    sampling: Sampling,
    /// Answer at each tick.
    at_ticks: Vec<Option<Wrench>>,
    /// Forces between each tick and the next.
    between: Vec<[Option<DVec3>; 2]>,
    hold_n: f64,
    delay_n: f64,
    quantum_n: f64,
}

impl Truth {
    /// Evaluates the reference along the path, at true and at sensed poses.
    pub(super) fn new(exact: &mut Model, hand: Hand, sampling: Sampling) -> Self {
        let trajectory = hand.trajectory();
        let pose = |tick: u64, part: f64| trajectory.pose((tick as f64 + part) * PERIOD_S);
        let path: Vec<Pose> = (0..TICKS).map(|tick| pose(tick, 0.0)).collect();
        let at_ticks = walk(exact, &path);
        settle(exact, &path);
        let force = |pose: Pose, tick: u64| answer(exact, pose, tick).map(|wrench| wrench.force());
        let between =
            (0..TICKS).scan(force, |force, tick| Some(MOMENTS.map(|part| force(pose(tick, part), tick))));
        let between = between.collect();
        let mut truth = Self { path, sampling, at_ticks, between, hold_n: 0.0, delay_n: 0.0, quantum_n: 0.0 };
        truth.hold_n = truth.held(&truth.at_ticks, 0);
        truth.delay_n = truth.held(&truth.at_ticks, sampling.delay_ticks);
        truth.quantum_n = truth.distance(&truth.sensed(exact)).force_rms_n;
        truth
    }

    /// Measures a model: its error at the true poses, and the error of the force on the hand with the model in the
    /// loop.
    pub(super) fn measure(&self, used: &mut Model) -> (Distance, Losses) {
        let Self { sampling, hold_n, delay_n, quantum_n, .. } = *self;
        let distance = self.distance(&walk(used, &self.path));
        let all_n = self.held(&self.sensed(used), sampling.delay_ticks);
        (distance, Losses { model_n: distance.force_rms_n, hold_n, delay_n, quantum_n, all_n })
    }

    fn distance(&self, answers: &[Option<Wrench>]) -> Distance {
        Distance::between(answers, &self.at_ticks)
    }

    /// Returns the answers of a model at the sensed poses.
    fn sensed(&self, model: &mut Model) -> Vec<Option<Wrench>> {
        let path: Vec<Pose> = self.path.iter().map(|pose| self.sampling.sees(*pose)).collect();
        walk(model, &path)
    }

    /// Returns the error of a force that is held for a period, from `delay_ticks` after its sample.
    fn held(&self, answers: &[Option<Wrench>], delay_ticks: usize) -> f64 {
        let periods = answers.iter().zip(self.between.iter().skip(delay_ticks));
        let squares = periods.flat_map(|(wrench, truths)| {
            truths.iter().filter_map(|truth| Some(((*wrench)?.force() - (*truth)?).length_squared()))
        });
        let (sum, count) = squares.fold((0.0, 0.0_f64), |(sum, count), square| (sum + square, count + 1.0));
        (sum / count).sqrt()
    }
}
