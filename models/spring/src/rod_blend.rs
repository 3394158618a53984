//! The law `energy` where it is good, the exact rod where it is not, as one energy.
//!
//! Where each is, `rod_share` says, by the pose alone: by an estimate of the error of `energy`, from the angles and
//! from how near the rod is to buckling. In between the energies are mixed, and not the forces,
//!
//! ```text
//! W = (1 - s) W_energy + s W_rod        F = -dW/dr = (1 - s) F_energy + s F_rod - (W_rod - W_energy) ds/dr
//! ```
//!
//! So the spring stays conservative, and force and stiffness continuous. The last term is a force of its own: it is as
//! small as the difference of the energies, so `s` has to reach 1 before that is large. Past buckling the spring is the
//! rod, where `energy` saturates.
//!
//! **A function of the pose, as far as a spring is one.** Short of buckling there is one equilibrium, and it is found
//! anew at each pose, from the straight column. Past it there are several: a bulge may point anywhere, and
//! where it points depends on how the hand came there. A choice by the pose alone would make torque jump as a plate is
//! rocked through the level, so from there the rod is followed from tick to tick, until the plates are far enough apart
//! again. A spring too short to buckle (`ShareOfRod::has_buckling`) has no such poses and no memory.

use flotor_hal::glam::DVec3;

use crate::energy::EnergyForm;
use crate::held::HeldSpring;
use crate::pose::Pose;
use crate::response::{Demand, Response};
use crate::rigidity::Spring;
use crate::rod::{Rod, State};
use crate::rod_share::{Share, ShareOfRod};
use crate::validity::Validity;

/// Both laws of one spring.
#[derive(Clone, Debug, PartialEq)]
pub struct RodBlend {
    energy: EnergyForm,
    rod: Rod,
    shares: ShareOfRod,
    spring: Spring,
    share: f64,
    follows: Follows,
    /// The last two as they were marked.
    marked: (f64, Follows),
}

/// Whether the rod goes on from its last tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Follows {
    /// It is found from the pose.
    Pose,
    /// It buckled, or a search did not end: it goes on from where it is, until it has no share any more.
    LastTick,
}

impl RodBlend {
    /// Prepares both. Not real-time: the rod allocates.
    #[must_use]
    pub fn new(spring: &Spring) -> Self {
        Self {
            energy: EnergyForm::new(spring),
            rod: Rod::for_a_blend(spring),
            shares: ShareOfRod::new(spring),
            spring: *spring,
            share: 0.0,
            follows: Follows::Pose,
            marked: (0.0, Follows::Pose),
        }
    }

    /// Takes other parameters at a tick boundary. Real-time: bounded, no allocation.
    pub fn set_spring(&mut self, spring: &Spring) {
        self.energy = self.energy.retuned(&self.spring, spring);
        self.rod.set_spring(spring);
        self.shares = ShareOfRod::new(spring);
        self.spring = *spring;
    }

    /// Forgets the past. Real-time: bounded, no allocation.
    pub fn reset(&mut self) {
        self.rod.reset();
        self.leave();
    }

    /// Whether an answer may depend on earlier poses: the spring can buckle.
    #[must_use]
    pub fn remembers(&self) -> bool {
        self.shares.has_buckling()
    }

    /// The rod's share in the last answer, 0 to 1.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.share
    }

    /// About the rod, where it has a share.
    #[must_use]
    pub fn rod_state(&self) -> Option<State> {
        (self.share > 0.0).then(|| self.rod.state())
    }

    /// The rod, where it is alone.
    pub(crate) fn rod_alone(&mut self) -> Option<&mut Rod> {
        (self.share >= 1.0).then_some(&mut self.rod)
    }

    /// The law that answers wherever the rod has no share.
    pub(crate) fn energy(&self) -> &EnergyForm {
        &self.energy
    }

    /// Whether the rod has a share at a pose.
    #[inline]
    pub(crate) fn blends(&self, pose: &Pose) -> bool {
        self.shares.is_any(pose)
    }

    /// The hand is where the rod has no share: nothing is left to follow.
    #[inline]
    pub(crate) fn leave(&mut self) {
        self.share = 0.0;
        self.follows = Follows::Pose;
    }

    /// The rod's answer, by the pose alone as long as that says which of its equilibria is meant.
    fn ask_rod(&mut self, pose: &Pose, is_buckled: bool, demand: Demand) -> Response {
        let response = match self.follows {
            Follows::Pose => self.rod.find(&self.spring, pose, demand),
            Follows::LastTick => self.rod.step(pose, demand),
        };
        if is_buckled || (response.validity == Validity::NotConverged && self.remembers()) {
            self.follows = Follows::LastTick;
        }
        response
    }

    /// Where the rod has a share, and answers by `rod`.
    fn blend(
        &mut self,
        pose: &Pose,
        share: &Share,
        demand: Demand,
        rod: impl FnOnce(&mut Self, Demand) -> Response,
    ) -> Response {
        self.share = share.value;
        if share.value >= 1.0 {
            return rod(self, demand);
        }
        let (rod, energy) =
            (rod(self, Demand::WrenchAndEnergy), self.energy.respond(pose, Demand::WrenchAndEnergy));
        let (Some(rod_j), Some(energy_j)) = (rod.energy_j, energy.energy_j) else {
            return self.energy.respond(pose, demand);
        };
        // F = (1 - s) F_energy + s F_rod - (W_rod - W_energy) ds/dr of the module documentation, and the torque alike.
        let difference_j = rod_j - energy_j;
        let force_n = energy.force_n.lerp(rod.force_n, share.value) - share.by_position_per_m * difference_j;
        let torque_nm =
            energy.torque_nm.lerp(rod.torque_nm, share.value) - share.by_rotation_per_rad * difference_j;
        Response {
            force_n,
            torque_nm: if demand >= Demand::Wrench { torque_nm } else { DVec3::ZERO },
            energy_j: (demand >= Demand::WrenchAndEnergy).then_some(energy_j + share.value * difference_j),
            validity: if rod.validity == Validity::NotConverged { rod.validity } else { energy.validity },
        }
    }
}

impl HeldSpring for RodBlend {
    #[inline]
    fn respond(&mut self, pose: &Pose, demand: Demand) -> Response {
        let share = self.shares.at(pose);
        if share.value > 0.0 {
            return self
                .blend(pose, &share, demand, |blend, demand| blend.ask_rod(pose, share.is_buckled, demand));
        }
        self.leave();
        self.energy.respond(pose, demand)
    }

    fn stay(&mut self, pose: &Pose, demand: Demand) -> Response {
        let share = self.shares.at(pose);
        if share.value > 0.0 && self.share > 0.0 {
            return self.blend(pose, &share, demand, |blend, demand| blend.rod.stay(pose, demand));
        }
        self.respond(pose, demand)
    }

    fn noise_rad(&self) -> f64 {
        if self.share > 0.0 { self.rod.noise_rad() } else { 0.0 }
    }

    fn cost(&self) -> u32 {
        if self.share > 0.0 { 1 + self.rod.work().cost() } else { 1 }
    }

    fn mark(&mut self) {
        self.rod.mark();
        self.marked = (self.share, self.follows);
    }

    fn go_back(&mut self) {
        self.rod.go_back();
        (self.share, self.follows) = self.marked;
    }

    fn unload(&mut self) {
        self.reset();
    }
}
