//! What a law is asked for and what it answers.

use flotor_hal::glam::DVec3;

use crate::validity::Validity;

/// Outputs the caller needs; each level includes those before it. What is not demanded is not computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Demand {
    /// Force alone; the torque of the response is zero.
    Force,
    /// Force and torque.
    Wrench,
    /// Force, torque and, from a law that has one, the stored energy.
    WrenchAndEnergy,
}

/// Answer of a law: what the spring exerts **on the hand**, at the centre of the upper plate, components in the
/// model frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Response {
    /// Force (N).
    pub force_n: DVec3,
    /// Torque (N·m).
    pub torque_nm: DVec3,
    /// Stored energy (J), zero at rest; `None` if not demanded, not available from this law, or without an answer.
    pub energy_j: Option<f64>,
    /// How far the above can be trusted.
    pub validity: Validity,
}

impl Response {
    /// No wrench and the reason.
    pub(crate) fn none(validity: Validity) -> Self {
        Self { force_n: DVec3::ZERO, torque_nm: DVec3::ZERO, energy_j: None, validity }
    }

    /// The response itself if it is finite, otherwise no wrench: overflow beside a pole is no answer.
    pub(crate) fn if_finite(self) -> Self {
        // One sum instead of six tests: it is finite only if every term is.
        let sum = self.force_n.element_sum() + self.torque_nm.element_sum() + self.energy_j.unwrap_or(0.0);
        if sum.is_finite() { self } else { Self::none(Validity::OutOfDomain) }
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
