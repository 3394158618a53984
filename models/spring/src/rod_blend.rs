//! The law `energy` where it is good, the exact rod where it is not, as one energy.
//!
//! The error of the law `energy` grows as its bow stiffness runs to minus infinity: with the inverse of `G0`, which is 1
//! at rest and 0 at buckling ([`crate::entire`]). Below a first bound the rod takes over, in energy and not in force,
//!
//! ```text
//! W = (1 - s) W_energy + s W_rod        F = -dW/dr = (1 - s) F_energy + s F_rod - (W_rod - W_energy) ds/dr
//! ```
//!
//! with a share `s` that goes from 0 to 1 with two continuous derivatives, in `G0` and so in the length of the chord, and
//! back to 0 where the chord lies down: a rod whose plates stand beside one another, or past one another, has several
//! shapes, and none that a coil could take. So the spring stays conservative, its force continuous, and its stiffness too;
//! and past buckling it is the rod, where `energy` saturates. Elsewhere nothing but the length is computed in addition.
//!
//! **A function of the pose, as far as a spring is one.** Short of buckling there is one equilibrium, and it is found
//! anew at each pose, from the shape of the linear column. Past it there are several: a bulge may point anywhere, and
//! where it points depends on how the hand came there. A choice by the pose alone would make torque jump as a plate is
//! rocked through the level, so from there the rod is followed from tick to tick, until the plates are far enough apart
//! again. A spring too short to buckle (`Region::has_buckling`) has no such poses and no memory.

use std::f64::consts::PI;

use flotor_hal::glam::DVec3;
use flotor_hal::math;

use crate::contact::AxialContact;
use crate::energy::EnergyForm;
use crate::entire::EntireFunctions;
use crate::held::{Held, HeldSpring};
use crate::pose::{Chord, Pose};
use crate::response::{Demand, Response};
use crate::rigidity::Spring;
use crate::rod::{Coils, Rod, State};
use crate::validity::Validity;

/// `G0` below which the rod has a share, and below which it is alone.
const FIRST: f64 = 0.30;
const LAST: f64 = 0.20;

/// Cosine of the chord's inclination from which on the share of the rod falls, 60 degrees (where the measures of angles
/// of `energy` cease to be the angles), and at which it is zero, 75.5 degrees.
const UPRIGHT: f64 = 0.5;
const LYING: f64 = 0.25;

/// Argument at which `G0` is [`FIRST`], rounded down.
const FIRST_ARGUMENT: f64 = 5.552;
/// Argument past that of [`LAST`], short of where `G0` is computed to rounding: from here on the rod is alone.
const DEEP_ARGUMENT: f64 = 7.5;
/// Argument at which the straight rod buckles.
const BUCKLING_ARGUMENT: f64 = PI * PI;

/// Both laws of one spring.
#[derive(Clone, Debug, PartialEq)]
pub struct RodBlend {
    energy: Held<EnergyForm>,
    rod: Rod,
    region: Region,
    coils: Coils,
    spring: Spring,
    share: f64,
    follows: Follows,
}

/// Whether the rod goes on from its last tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Follows {
    /// It is found from the pose.
    Pose,
    /// It buckled, or a search did not end: it goes on from where it is, until it has no share any more.
    LastTick,
}

/// Where the rod has a share: chords of one spring between two lengths.
///
/// The argument `z = gamma (L0 - L) Lam / (4 alpha)`, `Lam = L + (gamma/beta) (L0 - L)`, is a parabola in the length, so
/// whether a chord is in the region takes no function of `z`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Region {
    free_length_m: f64,
    /// `gamma / beta`
    ratio: f64,
    /// `gamma / (4 alpha)`
    unit_per_m2: f64,
    /// Squares of the shortest and the longest chord in it; nothing is between them where there is no region.
    squares_m2: [f64; 2],
    /// Largest argument at any length.
    largest_argument: f64,
}

/// The rod's share in the energy, and its derivative by the position of the upper plate.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Share {
    value: f64,
    by_position_per_m: DVec3,
    is_buckled: bool,
}

/// From 0 to 1 as a quantity goes from one bound to another, and its derivative by the quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Passage {
    value: f64,
    slope: f64,
}

impl Passage {
    /// `6 t⁵ - 15 t⁴ + 10 t³`: first and second derivatives vanish at both ends.
    fn at(quantity: f64, from: f64, to: f64) -> Self {
        let passed = ((quantity - from) / (to - from)).clamp(0.0, 1.0);
        Self {
            value: passed * passed * passed * (10.0 + passed * (6.0 * passed - 15.0)),
            slope: 30.0 * math::powi(passed * (1.0 - passed), 2) / (to - from),
        }
    }
}

impl Region {
    fn new(spring: &Spring) -> Self {
        let (rigidities, free_length_m) = (spring.rigidities(), spring.geometry().free_length_m);
        let ratio = rigidities.gamma_n / rigidities.beta_n;
        let unit_per_m2 = 0.25 * rigidities.gamma_n / rigidities.alpha_n_m2;
        // z = load p (1 - excess p) with the compression p = 1 - L/L0, at most 1.
        let (load, excess) = (unit_per_m2 * free_length_m * free_length_m, 1.0 - ratio);
        let crest = if excess > 0.5 { 0.5 / excess } else { 1.0 };
        let largest_argument = load * crest * (1.0 - excess * crest);
        let discriminant = 1.0 - 4.0 * excess * FIRST_ARGUMENT / load;
        let squares_m2 = if largest_argument < FIRST_ARGUMENT || discriminant < 0.0 {
            [0.0; 2]
        } else {
            // The smaller root without cancellation; the other one only where the crest is passed within the stroke.
            let root = discriminant.sqrt();
            let first = 2.0 * FIRST_ARGUMENT / (load * (1.0 + root));
            let last = if excess > 0.5 { ((1.0 + root) / (2.0 * excess)).min(1.0) } else { 1.0 };
            [last, first].map(|compression| math::powi(free_length_m * (1.0 - compression), 2))
        };
        Self { free_length_m, ratio, unit_per_m2, squares_m2, largest_argument }
    }

    /// Whether the straight rod buckles at any length.
    fn has_buckling(&self) -> bool {
        self.largest_argument > BUCKLING_ARGUMENT
    }

    /// Whether the rod has a share at a position of the upper plate. NaN is nowhere.
    #[inline]
    fn holds(&self, pose: &Pose) -> bool {
        let position_m = pose.position_m;
        let height_m = position_m.z + self.free_length_m;
        let square_m2 = position_m.truncate().length_squared() + height_m * height_m;
        let [shortest, longest] = self.squares_m2;
        let is_lying = height_m <= 0.0 || height_m * height_m <= LYING * LYING * square_m2;
        square_m2 >= shortest && square_m2 < longest && !is_lying
    }

    fn share_at(&self, chord: &Chord) -> Share {
        let Chord { vector_m, length_m, shortening_m } = *chord;
        let sheared_m = length_m + self.ratio * shortening_m;
        let argument = self.unit_per_m2 * shortening_m * sheared_m;
        let (short, by_length_per_m) = if argument >= DEEP_ARGUMENT {
            (1.0, 0.0)
        } else {
            let EntireFunctions { g0, g1, .. } = EntireFunctions::at(argument);
            let passage = Passage::at(g0, FIRST, LAST);
            let argument_by_length = self.unit_per_m2 * ((1.0 - self.ratio) * shortening_m - sheared_m);
            // dG0/dz = -G1/6
            (passage.value, -passage.slope * g1 / 6.0 * argument_by_length)
        };
        let direction = vector_m / length_m;
        let upright = Passage::at(direction.z, LYING, UPRIGHT);
        let by_direction = (DVec3::Z - direction * direction.z) * (short * upright.slope / length_m);
        Share {
            value: short * upright.value,
            by_position_per_m: direction * (by_length_per_m * upright.value) + by_direction,
            is_buckled: argument >= BUCKLING_ARGUMENT,
        }
    }
}

impl RodBlend {
    /// Prepares both. Not real-time: the rod allocates.
    #[must_use]
    pub fn new(spring: &Spring, coils: Coils) -> Self {
        Self {
            energy: Held { law: EnergyForm::new(spring), contact: contact(spring, coils), wire: None },
            rod: Rod::to_rounding(spring, coils),
            region: Region::new(spring),
            coils,
            spring: *spring,
            share: 0.0,
            follows: Follows::Pose,
        }
    }

    /// Takes other parameters at a tick boundary. Real-time: bounded, no allocation.
    pub fn set_spring(&mut self, spring: &Spring) {
        self.energy.law = self.energy.law.retuned(&self.spring, spring);
        self.energy.contact = contact(spring, self.coils);
        self.rod.set_spring(spring);
        self.region = Region::new(spring);
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
        self.region.has_buckling()
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
    pub(crate) fn energy(&self) -> &Held<EnergyForm> {
        &self.energy
    }

    /// Whether the rod has a share at a pose.
    #[inline]
    pub(crate) fn blends(&self, pose: &Pose) -> bool {
        self.region.holds(pose)
    }

    /// Whether at a pose the law `energy` answers alone and as it is.
    #[inline]
    pub(crate) fn is_energy_alone(&self, pose: &Pose) -> bool {
        self.energy.is_plain() && !self.blends(pose)
    }

    /// The hand is where the rod has no share: nothing is left to follow.
    #[inline]
    pub(crate) fn leave(&mut self) {
        self.share = 0.0;
        self.follows = Follows::Pose;
    }

    /// The rod's answer, by the pose alone as long as that says which of its equilibria is meant.
    fn ask_rod(&mut self, pose: &Pose, share: Share, demand: Demand) -> Response {
        let response = match self.follows {
            Follows::Pose => self.rod.find(&self.spring, pose, demand),
            Follows::LastTick => self.rod.step(pose, demand),
        };
        if share.is_buckled || response.validity == Validity::NotConverged {
            self.follows = Follows::LastTick;
        }
        response
    }

    /// Where the rod has a share.
    fn blend(&mut self, pose: &Pose, demand: Demand) -> Response {
        let Ok(chord) = pose.chord(self.spring.geometry().free_length_m) else {
            self.leave();
            return self.energy.respond(pose, demand);
        };
        let share = self.region.share_at(&chord);
        self.share = share.value;
        if share.value >= 1.0 {
            return self.ask_rod(pose, share, demand);
        }
        let (rod, energy) = (
            self.ask_rod(pose, share, Demand::WrenchAndEnergy),
            self.energy.respond(pose, Demand::WrenchAndEnergy),
        );
        let (Some(rod_j), Some(energy_j)) = (rod.energy_j, energy.energy_j) else {
            return self.energy.respond(pose, demand);
        };
        // F = (1 - s) F_energy + s F_rod - (W_rod - W_energy) ds/dr of the module documentation.
        let torque_nm = energy.torque_nm.lerp(rod.torque_nm, share.value);
        Response {
            force_n: energy.force_n.lerp(rod.force_n, share.value)
                - share.by_position_per_m * (rod_j - energy_j),
            torque_nm: if demand >= Demand::Wrench { torque_nm } else { DVec3::ZERO },
            energy_j: (demand >= Demand::WrenchAndEnergy)
                .then_some(energy_j + share.value * (rod_j - energy_j)),
            validity: if rod.validity == Validity::NotConverged { rod.validity } else { energy.validity },
        }
    }
}

/// What the energy form knows of coils that touch.
fn contact(spring: &Spring, coils: Coils) -> Option<AxialContact> {
    match coils {
        Coils::Pass => None,
        Coils::Touch => Some(AxialContact::new(spring)),
    }
}

impl HeldSpring for RodBlend {
    #[inline]
    fn respond(&mut self, pose: &Pose, demand: Demand) -> Response {
        if self.blends(pose) {
            return self.blend(pose, demand);
        }
        self.leave();
        self.energy.respond(pose, demand)
    }

    fn noise_rad(&self) -> f64 {
        if self.share > 0.0 { self.rod.noise_rad() } else { 0.0 }
    }
}
