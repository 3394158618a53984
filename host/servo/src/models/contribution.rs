//! Input and result of a step: the sample of a device, and the wrench, energy and effort at it.

use flotor_core::demand::TickDemand;
use flotor_hal::extension::world::MAX_PORTS;
use flotor_hal::{Demand, DeviceState, GripState, Output, Wrench};

/// State of a device and of its grip, and demanded outputs of a step.
#[derive(Clone, Copy)]
pub(crate) struct Sample<'a> {
    pub(crate) state: &'a DeviceState,
    pub(crate) grip: Option<&'a GripState>,
    pub(crate) demand: TickDemand,
}

/// Wrench, energy and effort of one layer, or of all, in a tick. An output that was not computed is NaN.
#[derive(Clone, Copy)]
pub(crate) struct Contribution {
    /// Wrench in the device frame; the torque is NaN if it is not finite and only an observer requests it.
    pub(crate) wrench: Wrench,
    /// Stored energy scaled to the device, J; NaN where it is not finite.
    pub(crate) energy_j: f64,
    /// Effort at the grip scaled to the device, N or N·m; 0 without a grip.
    pub(crate) effort: f64,
}

/// Contributions that add up with weights: at one device, or at each of several.
pub(crate) trait Share: Copy {
    /// No wrench, no energy and no effort.
    const NONE: Self;

    /// Scales the contributions. Real-time: bounded, no allocation.
    fn times(self, part: f64) -> Self;

    /// Adds contributions. Real-time: bounded, no allocation.
    fn plus(self, other: Self) -> Self;
}

impl Share for Contribution {
    const NONE: Self = Self { wrench: Wrench::ZERO, energy_j: 0.0, effort: 0.0 };

    #[inline]
    fn times(self, part: f64) -> Self {
        Self { wrench: self.wrench * part, energy_j: self.energy_j * part, effort: self.effort * part }
    }

    #[inline]
    fn plus(self, other: Self) -> Self {
        let (wrench, effort) = (self.wrench + other.wrench, self.effort + other.effort);
        Self { wrench, energy_j: self.energy_j + other.energy_j, effort }
    }
}

/// Contributions at the ports of a shared object.
impl Share for [Contribution; MAX_PORTS] {
    const NONE: Self = [Contribution::NONE; MAX_PORTS];

    fn times(self, part: f64) -> Self {
        self.map(|share| share.times(part))
    }

    fn plus(mut self, other: Self) -> Self {
        self.iter_mut().zip(other).for_each(|(share, other)| *share = share.plus(other));
        self
    }
}

/// Replaces each output that was not requested, or that is not finite and reaches observers only, with NaN. Returns `None` if an
/// output that reaches the hand is not finite, or the status is unknown. Real-time: bounded, no allocation.
#[inline(always)] // in the middle of a tick
pub(super) fn usable(demand: TickDemand, mut output: Output) -> Option<Output> {
    output.status()?;
    if demand.at_hand().contains(Demand::TORQUE) {
        if !output.wrench.is_finite() {
            return None;
        }
    } else {
        if !output.wrench.force().is_finite() {
            return None;
        }
        if !(demand.computed().contains(Demand::TORQUE) && output.wrench.torque().is_finite()) {
            output.wrench.torque_nm = [f64::NAN; 3];
        }
    }
    if !(demand.computed().contains(Demand::ENERGY) && output.energy_j.is_finite()) {
        output.energy_j = f64::NAN;
    }
    Some(output)
}
