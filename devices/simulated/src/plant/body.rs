//! Mass and forces of the moving body: the flotor alone, or with the mass, spring and damper of a hand.

use super::flotor::{Drag, FlotorParameters};
use super::motion::Motion;
use super::rotation;
use super::translation::Oscillator;
use crate::hand::Impedance;
use crate::ledger::MechanicalEnergy;
use flotor_hal::glam::{DMat3, DVec3};

/// A rigid body with its linear force laws, prepared for the integrator.
#[derive(Clone, Copy, Debug)]
pub(super) struct Body {
    /// The flotor as part of the body.
    flotor: FlotorParameters,
    /// Impedance of the hand; all zero without one.
    pub(super) hand: Impedance,
    /// Drag of the field.
    pub(super) drag: Drag,
    /// Inverse of the total mass, 1/kg.
    pub(super) inverse_mass_per_kg: f64,
    /// Common centre of mass, flotor frame, m.
    pub(super) centre_of_mass_m: DVec3,
    /// Inertia of flotor and hand about the common centre of mass, flotor frame, kg m².
    pub(super) inertia_kg_m2: DMat3,
    /// Inverse of `inertia_kg_m2`, 1/(kg m²).
    pub(super) inverse_inertia: DMat3,
    /// Upward compensation force at the flotor's centre of mass, N.
    pub(super) feed_forward_n: f64,
    /// Compensation minus weight, device frame, N: exactly zero if set equal.
    pub(super) lift_n: DVec3,
    /// Distance of the flotor's centre of mass from the common centre of mass, relative to the distance of the common
    /// centre from the origin: mass of the hand divided by the mass of the flotor (law of the lever).
    pub(super) lift_lever: f64,
    /// Damping of drag and hand together, per axis, N s/m.
    pub(super) damping_ns_per_m: DVec3,
    /// Damping of drag and hand together, N·m s/rad.
    pub(super) rotational_damping_nms_per_rad: f64,
    /// Translation as three oscillators.
    pub(super) oscillator: Oscillator,
    /// Upper bound of the rotational rates, 1/s.
    pub(super) rotation_rate_per_s: f64,
}

/// Impedance of an absent hand.
const NO_HAND: Impedance = Impedance {
    stiffness_n_per_m: DVec3::ZERO,
    damping_ns_per_m: DVec3::ZERO,
    rotational_stiffness_nm_per_rad: 0.0,
    rotational_damping_nms_per_rad: 0.0,
    mass_kg: 0.0,
};

impl Body {
    /// Creates the body of the flotor alone. Real-time: bounded, no allocation.
    pub(super) fn free(flotor: &FlotorParameters) -> Self {
        Self::held(flotor, &NO_HAND)
    }

    /// Creates the body of the flotor in a hand with its mass at the origin of the flotor frame. Real-time: bounded, no
    /// allocation.
    pub(super) fn held(flotor: &FlotorParameters, hand: &Impedance) -> Self {
        let mass_kg = flotor.mass_kg + hand.mass_kg;
        let flotor_share = flotor.mass_kg / mass_kg;
        let centre_of_mass_m = flotor.centre_of_mass_m * flotor_share;
        // Two masses at distance c rotate about their common centre like their reduced mass at c (Koenig, Steiner).
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

    /// Returns an upper bound of the rotational rates, 1/s: rotational stiffness and damping plus those of translation on
    /// the arm of the centre of mass, over the least moment of inertia.
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

    /// Returns the kinetic energy of the flotor, and its gravitational potential energy relative to home. Real-time: bounded, no
    /// allocation.
    #[inline]
    pub(super) fn energy(&self, motion: &Motion) -> MechanicalEnergy {
        let (centre_m, spin) = (self.flotor.centre_of_mass_m, motion.spin_rad_per_s);
        let mut velocity = motion.velocity_m_per_s;
        let mut turning_j = 0.0;
        if spin != DVec3::ZERO {
            velocity += motion.turned(spin.cross(centre_m));
            turning_j = 0.5 * spin.dot(self.flotor.inertia_kg_m2 * spin);
        }
        // Energy of the centre of mass: m v² / 2 + w.I w / 2, and m g h above home.
        let height_m = motion.position_m.z + (motion.turned(centre_m) - centre_m).z;
        MechanicalEnergy {
            kinetic_j: 0.5 * self.flotor.mass_kg * velocity.length_squared() + turning_j,
            potential_j: self.flotor.mass_kg * self.flotor.gravity_m_per_s2 * height_m,
        }
    }
}
