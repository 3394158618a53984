//! The law `energy` where it is good, the exact rod where it is not, as one energy.
//!
//! The error of the law `energy` grows as its bow stiffness runs to minus infinity: with the inverse of `G0`, which is 1
//! at rest and 0 at buckling ([`crate::entire`]). Below a first bound the rod takes over, in energy and not in force,
//!
//! ```text
//! W = (1 - s) W_energy + s W_rod        F = -dW/dr = (1 - s) F_energy + s F_rod - (W_rod - W_energy) ds/dr
//! ```
//!
//! with a share `s` that goes from 0 to 1 with two continuous derivatives, in `G0` and so in the length of the chord
//! alone. So the spring stays conservative, its force continuous, and its stiffness too; and past buckling it is the rod,
//! where `energy` levels off. Elsewhere nothing but the length is computed in addition.
//!
//! The rod remembers, so this law does. It is brought along from a little earlier on, without a say, to be in equilibrium when
//! it gets one.

use crate::contact::AxialContact;
use crate::energy::EnergyForm;
use crate::entire::EntireFunctions;
use crate::held::{Held, HeldSpring};
use crate::pose::Pose;
use crate::response::{Demand, Response};
use crate::rigidity::Spring;
use crate::rod::{Accuracy, Coils, Rod, State};
use crate::validity::Validity;

/// `G0` at which the rod is brought along, at which it has a first say, and at which it has the only one.
const WARM: f64 = 0.36;
const FIRST: f64 = 0.30;
const LAST: f64 = 0.20;

/// Argument past that of [`LAST`], short of where `G0` is computed to rounding: from here on the rod is alone.
const DEEP_ARGUMENT: f64 = 7.5;

/// Both laws of one spring.
#[derive(Clone, Debug, PartialEq)]
pub struct HandOver {
    energy: Held<EnergyForm>,
    rod: Rod,
    coils: Coils,
    spring: Spring,
    share: f64,
}

/// The rod's share in the energy, and what follows from it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Share {
    value: f64,
    /// By the length of the chord (1/m).
    by_length_per_m: f64,
    is_warm: bool,
}

impl HandOver {
    /// Prepares both. Not real-time: the rod allocates.
    #[must_use]
    pub fn new(spring: &Spring, coils: Coils) -> Self {
        Self {
            energy: Held { law: EnergyForm::new(spring), contact: contact(spring, coils), wire: None },
            rod: Rod::with_coils(spring, Accuracy::Servo, coils),
            coils,
            spring: *spring,
            share: 0.0,
        }
    }

    /// Takes other parameters at a tick boundary. Real-time: bounded, no allocation.
    pub fn set_spring(&mut self, spring: &Spring) {
        self.energy.law = self.energy.law.retuned(&self.spring, spring);
        self.energy.contact = contact(spring, self.coils);
        self.rod.set_spring(spring);
        self.spring = *spring;
    }

    /// Forgets the past. Real-time: bounded, no allocation.
    pub fn reset(&mut self) {
        self.rod.reset();
        self.share = 0.0;
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

    fn share_at(&self, length_m: f64) -> Share {
        let (rigidities, free_length_m) = (self.spring.rigidities(), self.spring.geometry().free_length_m);
        let shortening_m = free_length_m - length_m;
        let ratio = rigidities.gamma_n / rigidities.beta_n;
        let unit = 0.25 * rigidities.gamma_n / rigidities.alpha_n_m2;
        let sheared_m = length_m + ratio * shortening_m;
        let argument = unit * shortening_m * sheared_m;
        if argument >= DEEP_ARGUMENT {
            return Share { value: 1.0, by_length_per_m: 0.0, is_warm: true };
        }
        if argument <= 0.0 {
            return Share { value: 0.0, by_length_per_m: 0.0, is_warm: false };
        }
        let EntireFunctions { g0, g1, .. } = EntireFunctions::at(argument);
        let passed = ((FIRST - g0) / (FIRST - LAST)).clamp(0.0, 1.0);
        // 6 t⁵ - 15 t⁴ + 10 t³: first and second derivatives vanish at both ends.
        let value = passed * passed * passed * (10.0 + passed * (6.0 * passed - 15.0));
        let slope = 30.0 * (passed * (1.0 - passed)).powi(2);
        // dG0/dz = -G1/6
        let by_argument = slope * g1 / (6.0 * (FIRST - LAST));
        let argument_by_length = unit * ((1.0 - ratio) * shortening_m - sheared_m);
        Share { value, by_length_per_m: by_argument * argument_by_length, is_warm: g0 < WARM }
    }
}

/// What the rod knows of itself.
fn contact(spring: &Spring, coils: Coils) -> Option<AxialContact> {
    match coils {
        Coils::Pass => None,
        Coils::Touch => Some(AxialContact::new(spring)),
    }
}

impl HeldSpring for HandOver {
    fn respond(&mut self, pose: &Pose, demand: Demand) -> Response {
        let Ok(chord) = pose.chord(self.spring.geometry().free_length_m) else {
            return self.energy.respond(pose, demand);
        };
        let share = self.share_at(chord.length_m);
        self.share = share.value;
        if !share.is_warm {
            return self.energy.respond(pose, demand);
        }
        let blends = share.value > 0.0 && share.value < 1.0;
        let rod = self.rod.step(pose, if blends { Demand::WrenchAndEnergy } else { demand });
        if share.value >= 1.0 {
            return rod;
        }
        let energy = self.energy.respond(pose, if blends { Demand::WrenchAndEnergy } else { demand });
        if !blends || !rod.validity.has_answer() || !energy.validity.has_answer() {
            return energy;
        }
        let (Some(rod_j), Some(energy_j)) = (rod.energy_j, energy.energy_j) else { return energy };
        let by_length_n = (rod_j - energy_j) * share.by_length_per_m;
        let torque_nm = energy.torque_nm.lerp(rod.torque_nm, share.value);
        Response {
            force_n: energy.force_n.lerp(rod.force_n, share.value)
                - chord.vector_m * (by_length_n / chord.length_m),
            torque_nm: if demand >= Demand::Wrench { torque_nm } else { 0.0 * torque_nm },
            energy_j: (demand >= Demand::WrenchAndEnergy)
                .then_some(energy_j + share.value * (rod_j - energy_j)),
            validity: if rod.validity == Validity::NotConverged { rod.validity } else { energy.validity },
        }
    }
}
