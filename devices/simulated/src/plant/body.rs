//! Mass and forces of what moves: the flotor alone, or the flotor with the mass, spring and damper of a hand.

use super::motion::Motion;
use super::translation::Oscillator;
use super::{Drag, FlotorParameters, rotation};
use crate::hand::Impedance;
use crate::ledger::MechanicalEnergy;
use flotor_hal::glam::{DMat3, DVec3};

/// A rigid body and the linear laws that act on it, prepared for the integrator.
#[derive(Clone, Copy, Debug)]
pub(super) struct Body {
    /// The flotor in it.
    flotor: FlotorParameters,
    /// The hand on it; all zero when there is none.
    pub(super) hand: Impedance,
    /// Drag of the field.
    pub(super) drag: Drag,
    /// One over the mass of both, 1/kg.
    pub(super) inverse_mass_per_kg: f64,
    /// Common centre of mass, flotor frame, m.
    pub(super) centre_of_mass_m: DVec3,
    /// Inertia of both about the common centre of mass, flotor frame, kg m².
    pub(super) inertia_kg_m2: DMat3,
    /// Its inverse, 1/(kg m²).
    pub(super) inverse_inertia: DMat3,
    /// Upward compensation force at the flotor's centre of mass, N.
    pub(super) feed_forward_n: f64,
    /// Compensation less weight, device frame, N: exactly zero when they are set equal.
    pub(super) lift_n: DVec3,
    /// How far the flotor's centre of mass lies beyond the common one, in units of the distance from the
    /// origin to that: mass of the hand divided by that of the flotor (law of the lever).
    pub(super) lift_lever: f64,
    /// Damping of drag and hand together, per axis, N s/m.
    pub(super) damping_ns_per_m: DVec3,
    /// Damping of drag and hand together, N·m s/rad.
    pub(super) rotational_damping_nms_per_rad: f64,
    /// Translation as three oscillators.
    pub(super) oscillator: Oscillator,
    /// Bound of the rates of rotation, 1/s.
    pub(super) rotation_rate_per_s: f64,
}

/// No hand.
const NO_HAND: Impedance = Impedance {
    stiffness_n_per_m: DVec3::ZERO,
    damping_ns_per_m: DVec3::ZERO,
    rotational_stiffness_nm_per_rad: 0.0,
    rotational_damping_nms_per_rad: 0.0,
    mass_kg: 0.0,
};

impl Body {
    /// The flotor alone. Real-time: bounded, no allocation.
    pub(super) fn free(flotor: &FlotorParameters) -> Self {
        Self::held(flotor, &NO_HAND)
    }

    /// The flotor in a hand whose mass sits at the origin of the flotor frame. Real-time: bounded, no
    /// allocation.
    pub(super) fn held(flotor: &FlotorParameters, hand: &Impedance) -> Self {
        let mass_kg = flotor.mass_kg + hand.mass_kg;
        let flotor_share = flotor.mass_kg / mass_kg;
        let centre_of_mass_m = flotor.centre_of_mass_m * flotor_share;
        // Two masses at distance c turn about their common centre like their reduced mass at c (Koenig,
        // Steiner).
        let reduced_mass_kg = hand.mass_kg * flotor_share;
        let inertia_kg_m2 = DMat3::from_diagonal(flotor.inertia_kg_m2)
            + rotation::point_inertia(flotor.centre_of_mass_m) * reduced_mass_kg;
        let damping_ns_per_m = hand.damping_ns_per_m + flotor.drag.translational_ns_per_m;
        let mut body = Self {
            flotor: *flotor,
            hand: *hand,
            drag: flotor.drag,
            inverse_mass_per_kg: 1.0 / mass_kg,
            centre_of_mass_m,
            inertia_kg_m2,
            inverse_inertia: inertia_kg_m2.inverse(),
            feed_forward_n: flotor.feed_forward_n(),
            lift_n: DVec3::Z * (flotor.feed_forward_n() - flotor.mass_kg * flotor.gravity_m_per_s2),
            lift_lever: hand.mass_kg / flotor.mass_kg,
            damping_ns_per_m,
            rotational_damping_nms_per_rad: hand.rotational_damping_nms_per_rad
                + flotor.drag.rotational_nms_per_rad,
            oscillator: Oscillator {
                damping_per_s: damping_ns_per_m / mass_kg,
                stiffness_per_s2: hand.stiffness_n_per_m / mass_kg,
            },
            rotation_rate_per_s: 0.0,
        };
        body.rotation_rate_per_s = body.rotation_rate();
        body
    }

    /// Bound of the rates of rotation, 1/s: its own laws plus those of translation on the arm of the centre
    /// of mass, over the least moment of inertia.
    fn rotation_rate(&self) -> f64 {
        let arm_m = self.centre_of_mass_m.length();
        // Largest rates of a damped oscillator: sqrt(K / I) and B / I.
        let stiffness_nm = self.hand.rotational_stiffness_nm_per_rad
            + self.hand.stiffness_n_per_m.max_element() * arm_m * arm_m
            + self.lift_n.length() * self.lift_lever * arm_m;
        let damping_nms =
            self.rotational_damping_nms_per_rad + self.damping_ns_per_m.max_element() * arm_m * arm_m;
        let least_kg_m2 = self.flotor.inertia_kg_m2.min_element();
        (stiffness_nm / least_kg_m2).sqrt().max(damping_nms / least_kg_m2)
    }

    /// Kinetic energy of the flotor and its potential energy above home. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn energy(&self, motion: &Motion) -> MechanicalEnergy {
        let (centre_m, spin) = (self.flotor.centre_of_mass_m, motion.spin_rad_per_s);
        let mut velocity = motion.velocity_m_per_s;
        let mut turning_j = 0.0;
        if spin != DVec3::ZERO {
            velocity += motion.turned(spin.cross(centre_m));
            turning_j = 0.5 * spin.dot(self.flotor.inertia_kg_m2 * spin);
        }
        // Of the centre of mass: m v² / 2 + w.I w / 2, and m g h above home.
        let height_m = motion.position_m.z + (motion.turned(centre_m) - centre_m).z;
        MechanicalEnergy {
            kinetic_j: 0.5 * self.flotor.mass_kg * velocity.length_squared() + turning_j,
            potential_j: self.flotor.mass_kg * self.flotor.gravity_m_per_s2 * height_m,
        }
    }
}
