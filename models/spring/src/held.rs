//! Laws for a spring with clamped plates, with optional effects of a real coil.

use crate::contact::AxialContact;
use crate::energy::EnergyForm;
use crate::pose::Pose;
use crate::response::{Demand, Response};
use crate::wire::Wire;

/// Law for a spring with a clamped lower plate, evaluated from tick to tick.
pub trait HeldSpring {
    /// Returns the response at a pose relative to the lower plate. Real-time: bounded, no allocation.
    fn respond(&mut self, pose: &Pose, demand: Demand) -> Response;

    /// Returns the response at a pose with the shape of the last response, while the shape is in motion: the
    /// derivatives of the energy at this shape. A closed formula has no shape state. Real-time: bounded, no allocation.
    fn stay(&mut self, pose: &Pose, demand: Demand) -> Response {
        self.respond(pose, demand)
    }

    /// Returns the uncertainty of the energy's slope, as the tilt of a plate that causes such a slope (rad). Zero for a
    /// formula; the tolerance of the solver for an iterative law.
    fn noise_rad(&self) -> f64 {
        0.0
    }

    /// Returns the cost of the last response, in evaluations of an energy; 1 for a closed formula. Real-time: bounded, no
    /// allocation.
    fn cost(&self) -> u32 {
        1
    }

    /// Saves the state of the last response for [`Self::go_back`]. Real-time: bounded, no allocation.
    fn mark(&mut self) {}

    /// Restores the state saved by [`Self::mark`]. Real-time: bounded, no allocation.
    fn go_back(&mut self) {}

    /// Resets to the unloaded state and clears the history. Real-time: bounded, no allocation.
    fn unload(&mut self) {}
}

impl HeldSpring for EnergyForm {
    fn respond(&mut self, pose: &Pose, demand: Demand) -> Response {
        EnergyForm::respond(self, pose, demand)
    }
}

/// Law with optional effects of a real coil.
#[derive(Clone, Debug, PartialEq)]
pub struct Held<L> {
    /// Law without the effects.
    pub law: L,
    /// Contact of the coils; `None` for coils that pass through each other, and for a law with contact of its own.
    pub contact: Option<AxialContact>,
    /// Twist and off-axis ends of the wire; `None` for a law without these effects.
    pub wire: Option<Wire>,
}

impl<L> Held<L> {
    /// Returns true if the law has no additional effects.
    pub(crate) fn is_plain(&self) -> bool {
        self.contact.is_none() && self.wire.is_none()
    }

    #[inline]
    fn with_additions(&self, mut response: Response, pose: &Pose, demand: Demand) -> Response {
        if self.is_plain() || !response.validity.has_answer() {
            return response;
        }
        if let Some(contact) = &self.contact {
            response = contact.added_to(&response, pose);
        }
        match &self.wire {
            Some(wire) => wire.added_to(&response, pose, demand),
            None => response,
        }
    }
}

impl<L: HeldSpring> HeldSpring for Held<L> {
    #[inline]
    fn respond(&mut self, pose: &Pose, demand: Demand) -> Response {
        let response = self.law.respond(pose, demand);
        self.with_additions(response, pose, demand)
    }

    fn stay(&mut self, pose: &Pose, demand: Demand) -> Response {
        let response = self.law.stay(pose, demand);
        self.with_additions(response, pose, demand)
    }

    fn noise_rad(&self) -> f64 {
        self.law.noise_rad()
    }

    fn cost(&self) -> u32 {
        self.law.cost()
    }

    fn mark(&mut self) {
        self.law.mark();
    }

    fn go_back(&mut self) {
        self.law.go_back();
    }

    fn unload(&mut self) {
        self.law.unload();
    }
}
