//! Blending of the law `energy`, with its remainder, and the exact rod, as one energy: the rod where the law is not accurate.
//!
//! The weight `s` of the rod, from `rod_share`, depends on the pose alone: on a bound of the error against the
//! tolerance, and on the nearness of the rod to buckling. The energies are blended, not the forces,
//!
//! ```text
//! W = (1 - s) W_law + s W_rod        F = -dW/dr = (1 - s) F_law + s F_rod - (W_rod - W_law) ds/dr
//! ```
//!
//! So the spring stays conservative, and force and stiffness continuous. The last term is a force of the blending
//! itself: it is as small as the difference of the energies, so `s` has to reach 1 before this difference is large.
//! Past buckling, where `energy` saturates, the spring is the rod.
//!
//! **Path dependence.** Short of buckling there is one equilibrium, which is found anew at each pose, from the straight column.
//! Past buckling there are several equilibria: a bulge may point anywhere, and its direction depends on the path of the hand. A
//! choice by the pose alone would make the torque jump as a plate is rocked through the level, so past buckling the rod is followed
//! from tick to tick, until the plates are far enough apart again. A spring too short to buckle (`RodWeight::has_buckling`) has no
//! such poses and no history.

use flotor_hal::glam::DVec3;
use flotor_hal::restorable;
use pulp::NullaryFnOnce;

use crate::contract;
use crate::directions::{Directions, Gradient};
use crate::energy::EnergyForm;
use crate::held::HeldSpring;
use crate::pace::Advance;
use crate::pose::Pose;
use crate::remainder::{Remainder, RemainderEnergy};
use crate::response::{Demand, Law as _, Response};
use crate::rigidity::Spring;
use crate::rod::{Rod, State};
use crate::rod_share::{Law, RodWeight};
use crate::validity::Validity;

/// Default tolerance of the force (N): the zero-order-hold error of a 1 kHz loop with an exact model, 5.4 mN rms
/// (`flotor bench`, column *hold*).
pub const TOLERANCE_N: f64 = 0.005;

/// Law `energy` and exact rod of one spring, blended.
#[derive(Clone, Debug, PartialEq)]
#[must_use]
pub struct RodBlend {
    /// Law for poses that need neither remainder nor rod.
    pub(crate) energy: EnergyForm,
    remainder: Option<Remainder>,
    rod: Rod,
    shares: RodWeight,
    spring: Spring,
    tolerance_n: f64,
    share: f64,
    follows: Follows,
    /// Saved `share` and `follows`.
    marked: (f64, Follows),
}

restorable!(RodBlend { rod, share, follows, marked }
    without { energy, remainder, shares, spring, tolerance_n });

/// Origin of the rod's equilibrium.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Follows {
    /// Found anew from the pose.
    Pose,
    /// Followed from the last tick, after buckling or an unfinished search, until the rod's weight is zero.
    LastTick,
}

restorable!(Follows = Pose | LastTick);

impl RodBlend {
    /// Prepares both laws for the default tolerance. Not real-time: the rod allocates.
    pub fn new(spring: &Spring) -> Self {
        Self::within(spring, TOLERANCE_N)
    }

    /// Prepares both laws for a tolerance of the force. Not real-time: the rod allocates.
    pub fn within(spring: &Spring, tolerance_n: f64) -> Self {
        let (energy, mut rod) = (EnergyForm::new(spring), Rod::for_a_blend(spring));
        let remainder = Remainder::new(spring, &energy, &mut rod);
        Self {
            energy,
            remainder,
            rod,
            shares: shares(spring, tolerance_n, remainder.as_ref()),
            spring: *spring,
            tolerance_n,
            share: 0.0,
            follows: Follows::Pose,
            marked: (0.0, Follows::Pose),
        }
    }

    /// Sets the parameters at a tick boundary. Real-time: bounded, no allocation; for a spring of different proportions
    /// ([`Spring::is_proportional_to`]) the remainder is recomputed with 38 equilibrium solves of the rod.
    pub fn set_spring(&mut self, spring: &Spring) {
        self.set(spring, self.tolerance_n);
    }

    /// Sets parameters and tolerance at a tick boundary, see [`Self::set_spring`].
    pub(crate) fn set(&mut self, spring: &Spring, tolerance_n: f64) {
        self.tolerance_n = tolerance_n;
        self.energy = self.energy.retuned(&self.spring, spring);
        self.rod.set_spring(spring);
        if !spring.is_proportional_to(&self.spring) {
            self.remainder = Remainder::new(spring, &self.energy, &mut self.rod);
        } else if let Some(remainder) = &mut self.remainder {
            remainder.restiffen(spring);
        }
        self.shares = shares(spring, self.tolerance_n, self.remainder.as_ref());
        self.spring = *spring;
    }

    /// Clears the history. Real-time: bounded, no allocation.
    pub fn reset(&mut self) {
        self.rod.reset();
        self.reset_weight();
    }

    /// Returns true if a response may depend on earlier poses, because the spring can buckle.
    #[must_use]
    pub fn remembers(&self) -> bool {
        self.shares.has_buckling
    }

    /// Returns the weight of the rod in the last response, 0 to 1.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.share
    }

    /// Returns the state of the rod; `None` if its weight is zero.
    #[must_use]
    pub fn rod_state(&self) -> Option<State> {
        (self.share > 0.0).then(|| self.rod.state())
    }

    /// Returns the rod if its weight is 1, else `None`.
    pub(crate) fn rod_alone(&mut self) -> Option<&mut Rod> {
        (self.share >= 1.0).then_some(&mut self.rod)
    }

    /// Returns the [`Directions`] of a pose at which the remainder or the rod may contribute. Returns `None` in the middle of the
    /// workspace, where [`Self::energy`] is sufficient, and at poses where neither is used (unusable chord, or an angle or twist of
    /// 78 degrees or more). Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn examine(&self, pose: &Pose) -> Option<Directions> {
        self.shares.examine(pose)
    }

    /// Sets the rod's weight to zero; its shape is found anew later.
    #[inline]
    pub(crate) fn reset_weight(&mut self) {
        self.share = 0.0;
        self.follows = Follows::Pose;
    }

    #[inline]
    fn advanced(&mut self, advance: Advance, pose: &Pose, demand: Demand) -> Response {
        match self.examine(pose) {
            Some(at) => self.respond_examined(advance, pose, &at, demand),
            None => {
                self.reset_weight();
                self.energy.respond(pose, demand)
            }
        }
    }

    /// Returns the rod's response: at an equilibrium found from the pose alone, or followed from the last tick, see [`Follows`].
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

    /// Returns the response at a pose with the directions from [`Self::examine`]. Real-time: bounded, no allocation.
    pub(crate) fn respond_examined(
        &mut self,
        advance: Advance,
        pose: &Pose,
        at: &Directions,
        demand: Demand,
    ) -> Response {
        let upright = at.upright();
        let share = self.shares.share(at, upright);
        let Self { energy, remainder, .. } = &*self;
        let corrected = Corrected { energy, remainder: remainder.as_ref(), pose, at, upright };
        if share.value == 0.0 {
            let response = corrected.respond(demand);
            self.reset_weight();
            return response;
        }
        let law = (share.value < 1.0).then(|| corrected.respond(Demand::WrenchAndEnergy));
        let stays = advance == Advance::Stay && self.share > 0.0;
        self.share = share.value;
        let rod_demand = if law.is_some() { Demand::WrenchAndEnergy } else { demand };
        let rod = if stays {
            self.rod.stay(pose, rod_demand)
        } else {
            self.ask_rod(pose, share.is_buckled, rod_demand)
        };
        let Some(law) = law else { return rod };
        let (Some(rod_j), Some(law_j)) = (rod.energy_j, law.energy_j) else { return law.limited_to(demand) };
        // F = (1 - s) F_law + s F_rod - (W_rod - W_law) ds/dr of the module documentation, and the torque alike.
        let difference_j = rod_j - law_j;
        let Gradient { by_position_per_m, by_rotation_per_rad } = share.gradient;
        let force_n = law.force_n.lerp(rod.force_n, share.value) - by_position_per_m * difference_j;
        let torque_nm = law.torque_nm.lerp(rod.torque_nm, share.value) - by_rotation_per_rad * difference_j;
        let energy_j = Some(law_j + share.value * difference_j);
        let validity = if rod.validity == Validity::NotConverged { rod.validity } else { law.validity };
        Response { force_n, torque_nm, energy_j, validity }.limited_to(demand)
    }
}

/// Law `energy` with its remainder at a pose.
#[derive(Clone, Copy)]
struct Corrected<'a> {
    energy: &'a EnergyForm,
    remainder: Option<&'a Remainder>,
    pose: &'a Pose,
    at: &'a Directions,
    /// See [`Directions::upright`].
    upright: (f64, Gradient),
}

impl Corrected<'_> {
    fn respond(self, demand: Demand) -> Response {
        contract::with_all_instructions(Answering { law: self, demand })
    }
}

/// Response of a corrected law, compiled for several instruction sets.
struct Answering<'a> {
    law: Corrected<'a>,
    demand: Demand,
}

impl NullaryFnOnce for Answering<'_> {
    type Output = Response;

    #[inline(always)] // as `contract::Step::call`
    fn call(self) -> Response {
        let Self { law: Corrected { energy, remainder, pose, at, upright }, demand } = self;
        let plain = energy.respond_at(pose, demand);
        let Some(RemainderEnergy { energy_j, gradient }) =
            remainder.and_then(|remainder| remainder.at(at, upright))
        else {
            return plain;
        };
        Response {
            force_n: plain.force_n - gradient.by_position_per_m,
            torque_nm: if demand >= Demand::Wrench {
                plain.torque_nm - gradient.by_rotation_per_rad
            } else {
                DVec3::ZERO
            },
            energy_j: plain.energy_j.map(|plain_j| plain_j + energy_j),
            validity: plain.validity,
        }
    }
}

/// Returns the weight function that blends the exact rod with the law: with the corrected law if there is a remainder,
/// with the plain law otherwise.
fn shares(spring: &Spring, tolerance_n: f64, remainder: Option<&Remainder>) -> RodWeight {
    RodWeight::new(spring, tolerance_n, if remainder.is_some() { Law::Corrected } else { Law::Plain })
}

impl HeldSpring for RodBlend {
    #[inline]
    fn respond(&mut self, pose: &Pose, demand: Demand) -> Response {
        self.advanced(Advance::Step, pose, demand)
    }

    fn stay(&mut self, pose: &Pose, demand: Demand) -> Response {
        self.advanced(Advance::Stay, pose, demand)
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
