//! Demand on a law, and its response.

use flotor_hal::glam::DVec3;

use crate::pose::{Coordinates, Pose};
use crate::validity::Validity;
use flotor_lanes::{Real, Vector};

/// Requested outputs; each level includes the outputs of the levels before. Other outputs are not computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Demand {
    /// Force alone; the torque of the response is zero.
    Force,
    /// Force and torque.
    Wrench,
    /// Force, torque and, from a law that has one, the stored energy.
    WrenchAndEnergy,
}

/// Response of a law: wrench of the spring **on the hand**, at the centre of the upper plate, components in the model
/// frame.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Response {
    /// Force (N).
    pub force_n: DVec3,
    /// Torque (N·m).
    pub torque_nm: DVec3,
    /// Stored energy (J), zero at rest; `None` if not demanded, not available from this law, or without an answer.
    pub energy_j: Option<f64>,
    /// Validity of the response.
    pub validity: Validity,
}

flotor_hal::restorable!(Response { force_n, torque_nm, energy_j, validity });

impl Response {
    /// Returns a response without a wrench, with the reason.
    pub(crate) fn none(validity: Validity) -> Self {
        Self { force_n: DVec3::ZERO, torque_nm: DVec3::ZERO, energy_j: None, validity }
    }

    /// Returns the demanded parts of a complete response.
    pub(crate) fn limited_to(self, demand: Demand) -> Self {
        match demand {
            Demand::Force => Self { torque_nm: DVec3::ZERO, energy_j: None, ..self },
            Demand::Wrench => Self { energy_j: None, ..self },
            Demand::WrenchAndEnergy => self,
        }
    }

    /// Returns the response if finite, otherwise no wrench: overflow beside a pole is not an answer.
    pub(crate) fn if_finite(self) -> Self {
        // One sum instead of six tests: the sum is finite only if every term is.
        let sum = self.force_n.element_sum() + self.torque_nm.element_sum() + self.energy_j.unwrap_or(0.0);
        if sum.is_finite() { self } else { Self::none(Validity::OutOfDomain) }
    }
}

/// Stateless law of the pose, written once for one pose and for several in lanes.
pub trait Law {
    /// True if the law has a stored energy.
    const HAS_ENERGY: bool;

    /// Evaluates the law at a pose, or at one pose per lane. Real-time: bounded, no allocation.
    ///
    /// The numbers of a lane without an answer are meaningless. Outputs not demanded are not computed and zero.
    fn evaluate<R: Real>(&self, at: &Coordinates<R>, demand: Demand) -> LaneResponse<R>;

    /// Returns the response at one pose. Real-time: bounded, no allocation.
    #[inline(always)] // into the instructions of a step, see `contract`
    fn respond_at(&self, pose: &Pose, demand: Demand) -> Response {
        let LaneResponse { force_n, torque_nm, energy_j, answered, trusted } =
            self.evaluate(&pose.coordinates(), demand);
        if !answered {
            return Response::none(pose.failure_reason());
        }
        let has_energy = Self::HAS_ENERGY && demand >= Demand::WrenchAndEnergy;
        Response {
            force_n: DVec3::new(force_n.x, force_n.y, force_n.z),
            torque_nm: DVec3::new(torque_nm.x, torque_nm.y, torque_nm.z),
            energy_j: has_energy.then_some(energy_j),
            validity: if trusted { Validity::Ok } else { Validity::Clamped },
        }
    }
}

/// Response of a [`Law`] at a pose, or at one pose per lane.
#[derive(Clone, Copy, Debug)]
pub struct LaneResponse<R: Real> {
    /// Force on the hand (N).
    pub force_n: Vector<R>,
    /// Torque on the hand (N·m).
    pub torque_nm: Vector<R>,
    /// Stored energy (J), of a law that has one.
    pub energy_j: R,
    /// Lanes that have an answer.
    pub answered: R::Mask,
    /// Answered lanes within the range of the law.
    pub trusted: R::Mask,
}

impl<R: Real> LaneResponse<R> {
    /// Returns zeros for all lanes; `answered` must be false in every lane.
    #[inline(always)]
    pub(crate) fn none(like: R, answered: R::Mask) -> Self {
        let zero = like.like(0.0);
        let nothing = Vector::new(zero, zero, zero);
        Self { force_n: nothing, torque_nm: nothing, energy_j: zero, answered, trusted: answered }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pole_is_no_answer() {
        let at_pole = Response {
            force_n: DVec3::new(0.0, f64::INFINITY, 1.0),
            torque_nm: DVec3::ZERO,
            energy_j: None,
            validity: Validity::Ok,
        };
        assert_eq!(at_pole.if_finite(), Response::none(Validity::OutOfDomain));
        let nan_energy = Response { force_n: DVec3::X, energy_j: Some(f64::NAN), ..at_pole };
        assert_eq!(nan_energy.if_finite(), Response::none(Validity::OutOfDomain));
        let regular = Response { force_n: DVec3::X, energy_j: Some(1.0), ..at_pole };
        assert_eq!(regular.if_finite(), regular);
    }
}
