//! Error of the computed wrenches relative to the reference.

use flotor_hal::{Demand, Input, Pose, StepStatus, Wrench};
use flotor_judge::subject::{call, input_of};
use flotor_loader::Model;
use serde::Serialize;

/// Number of ticks for a model to converge at the first pose.
const SETTLING_TICKS: u64 = 500;

/// Error of a case relative to the reference along the path; NaN without a pose to compare. A pose at which case or
/// reference has no valid wrench is counted, not compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Distance {
    /// Largest error of the force, N.
    pub force_max_n: f64,
    /// Root mean square of the force's error, N.
    pub force_rms_n: f64,
    /// Largest error of the torque, N·m.
    pub torque_max_nm: f64,
    /// Root mean square of the torque's error, N·m.
    pub torque_rms_nm: f64,
    /// Number of poses at which case or reference has no valid wrench.
    pub unanswered: usize,
}

impl Distance {
    /// Compares the wrenches of a case with the reference's wrenches, pose by pose.
    pub(super) fn between(answers: &[Option<Wrench>], truth: &[Option<Wrench>]) -> Self {
        let mut distance = Self { force_max_n: f64::NAN, torque_max_nm: f64::NAN, ..Self::default() };
        let mut compared = 0.0_f64;
        for pair in answers.iter().zip(truth) {
            let (Some(answer), Some(truth)) = pair else {
                distance.unanswered += 1;
                continue;
            };
            let force_n = (answer.force() - truth.force()).length();
            let torque_nm = (answer.torque() - truth.torque()).length();
            distance.force_max_n = distance.force_max_n.max(force_n);
            distance.torque_max_nm = distance.torque_max_nm.max(torque_nm);
            distance.force_rms_n += force_n * force_n;
            distance.torque_rms_nm += torque_nm * torque_nm;
            compared += 1.0;
        }
        // NaN without a compared pose: 0 / 0.
        distance.force_rms_n = (distance.force_rms_n / compared).sqrt();
        distance.torque_rms_nm = (distance.torque_rms_nm / compared).sqrt();
        distance
    }
}

/// Returns the model's wrench at each pose of the path, after settling at the first pose; `None` where the model returns no valid
/// wrench.
pub(super) fn walk(model: &mut Model, path: &[Pose]) -> Vec<Option<Wrench>> {
    settle(model, path);
    (SETTLING_TICKS..).zip(path).map(|(tick, pose)| answer(model, *pose, tick)).collect()
}

/// Resets a model and steps it at the first pose until it has converged.
pub(super) fn settle(model: &mut Model, path: &[Pose]) {
    model.reset();
    if let Some(first) = path.first() {
        for tick in 0..SETTLING_TICKS {
            let _ = answer(model, *first, tick);
        }
    }
}

/// Steps the model at a pose and returns its wrench; `None` if the call fails, the wrench is not finite, or the status is not
/// `ok`, `clamped` or `not_converged`.
pub(super) fn answer(model: &mut Model, pose: Pose, tick: u64) -> Option<Wrench> {
    let demand = Demand::WRENCH.limited_to(model.serves());
    let input = Input { demand, ..input_of(tick, pose) };
    let output = call(model, &input).ok()?;
    let sound =
        matches!(output.status(), Some(StepStatus::Ok | StepStatus::Clamped | StepStatus::NotConverged));
    (sound && output.wrench.is_finite()).then_some(output.wrench)
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::DVec3;

    #[test]
    fn distances_are_of_vectors_and_skip_what_is_missing() {
        let at = |force: [f64; 3]| Some(Wrench::from_force(DVec3::from_array(force)));
        let answers = [at([3.0, 4.0, 0.0]), None, at([0.0; 3])];
        let truth = [at([0.0; 3]), at([1.0; 3]), at([0.0; 3])];
        let distance = Distance::between(&answers, &truth);
        assert_eq!(distance.force_max_n, 5.0);
        assert_eq!(distance.force_rms_n, (25.0_f64 / 2.0).sqrt());
        assert_eq!(distance.unanswered, 1);
        let nothing = Distance::between(&[None, None], &truth);
        assert!(
            [nothing.force_max_n, nothing.force_rms_n, nothing.torque_max_nm, nothing.torque_rms_nm]
                .iter()
                .all(|number| number.is_nan())
        );
    }
}
