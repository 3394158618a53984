//! A law for a spring whose plates are held, with what a real coil adds to it.

use crate::contact::AxialContact;
use crate::energy::EnergyForm;
use crate::pose::Pose;
use crate::response::{Demand, Response};
use crate::wire::Wire;

/// A law for a spring whose lower plate is held, asked from tick to tick.
pub trait HeldSpring {
    /// Answer at a pose relative to the lower plate. Real-time: bounded, no allocation.
    fn respond(&mut self, pose: &Pose, demand: Demand) -> Response;

    /// Answer at a pose in the shape of the last answer, while that is on its way: the derivatives of the energy of this shape. A
    /// formula has no shape of its own. Real-time: bounded, no allocation.
    fn stay(&mut self, pose: &Pose, demand: Demand) -> Response {
        self.respond(pose, demand)
    }

    /// How much of the slope of its energy the law leaves open, as the tilt of a plate that makes such a slope (rad).
    /// Zero for a formula; for a law that solves, what its solver calls equal.
    fn noise_rad(&self) -> f64 {
        0.0
    }

    /// What the last answer cost, in evaluations of an energy. Real-time: bounded, no allocation.
    fn cost(&self) -> u32 {
        1
    }

    /// Marks the last answer as one that [`Self::go_back`] returns to. Real-time: bounded, no allocation.
    fn mark(&mut self) {}

    /// As it was when it answered what was marked: what it tried since then is forgotten. Real-time: bounded, no
    /// allocation.
    fn go_back(&mut self) {}

    /// Without load: forgets the past. Real-time: bounded, no allocation.
    fn unload(&mut self) {}
}

impl HeldSpring for EnergyForm {
    fn respond(&mut self, pose: &Pose, demand: Demand) -> Response {
        EnergyForm::respond(self, pose, demand)
    }
}

/// A law and what it leaves out of the coil, where that is wanted.
#[derive(Clone, Debug, PartialEq)]
pub struct Held<L> {
    /// The law.
    pub law: L,
    /// Touching coils, for a law that does not know them itself.
    pub contact: Option<AxialContact>,
    /// What the wire adds.
    pub wire: Option<Wire>,
}

impl<L> Held<L> {
    /// Whether the law is left as it is.
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
