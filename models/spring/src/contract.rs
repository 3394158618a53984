//! Between the contract's types and those of the laws.

use flotor_hal::{Input, Output, StepStatus, Wrench};

use crate::pose::Pose;
use crate::response::{Demand, Law, Response};
use crate::validity::Validity;

/// The pose of a step.
#[inline]
pub(crate) fn pose(input: &Input) -> Pose {
    Pose { position_m: input.pose.position(), orientation: input.pose.orientation() }
}

/// The demand of a step.
#[inline]
pub(crate) fn demand(input: &Input) -> Demand {
    if input.demand.contains(flotor_hal::Demand::ENERGY) {
        Demand::WrenchAndEnergy
    } else if input.demand.contains(flotor_hal::Demand::TORQUE) {
        Demand::Wrench
    } else {
        Demand::Force
    }
}

/// A step of a law that answers from the pose alone. Real-time: bounded, no allocation.
#[inline]
#[must_use]
pub fn step<L: Law>(law: &L, input: &Input) -> Output {
    output(&law.respond_at(&pose(input), demand(input)))
}

/// The answer of a step.
#[inline]
pub(crate) fn output(response: &Response) -> Output {
    let status = match response.validity {
        Validity::Ok => StepStatus::Ok,
        Validity::Clamped => StepStatus::Clamped,
        Validity::NotConverged => StepStatus::NotConverged,
        Validity::OutOfDomain => StepStatus::OutOfDomain,
        Validity::InvalidInput => StepStatus::InvalidInput,
    };
    let wrench = Wrench::new(response.force_n, response.torque_nm);
    Output::new(wrench, response.energy_j.unwrap_or(f64::NAN), status)
}
