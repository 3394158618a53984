//! Conversions between the types of the plugin contract and of the laws.

use flotor_hal::{Input, Output, StepStatus, Wrench};
use pulp::NullaryFnOnce;

use crate::pose::Pose;
use crate::response::{Demand, Law, Response};
use crate::validity::Validity;

/// Returns the pose of a step's input.
#[inline]
pub(crate) fn pose(input: &Input) -> Pose {
    Pose { position_m: input.pose.position(), orientation: input.pose.orientation() }
}

/// Converts the demand of a step's input: with energy to wrench and energy, else with torque to wrench, else to force.
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

/// Evaluates one step of a stateless law. Real-time: bounded, no allocation.
#[inline]
#[must_use]
pub fn step<L: Law>(law: &L, input: &Input) -> Output {
    with_all_instructions(Step { law, input })
}

/// Runs a computation with AVX2 (x86-64-v3) if this machine has it, else with the baseline instruction set. The result is
/// bit-identical with both.
#[inline]
pub(crate) fn with_all_instructions<C: NullaryFnOnce>(computation: C) -> C::Output {
    #[cfg(target_arch = "x86_64")]
    if let Some(avx2) = pulp::x86::V3::try_new() {
        return avx2.vectorize(computation);
    }
    computation.call()
}

/// Step to be compiled for several instruction sets.
struct Step<'a, L> {
    law: &'a L,
    input: &'a Input,
}

impl<L: Law> NullaryFnOnce for Step<'_, L> {
    type Output = Output;

    #[inline(always)] // into the instructions that `vectorize` chooses: 16 ns of a tick with what it calls
    fn call(self) -> Output {
        output(&self.law.respond_at(&pose(self.input), demand(self.input)))
    }
}

/// Converts a response to the output of a step.
#[inline(always)] // as `Step::call`
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
