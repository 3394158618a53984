//! Mechanical impedance of the hand at the handle, with published values.

use crate::validation::{Check, Domain, number, vector};
use flotor_hal::glam::{BVec3, DVec3};
use serde::Deserialize;

/// Named grip of a hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Grip {
    /// Firm grip: [`Impedance::FIRM`].
    Firm,
    /// Relaxed arm: [`Impedance::RELAXED`].
    Relaxed,
}

impl Grip {
    /// Returns the published impedance of the grip. Real-time: bounded, no allocation.
    #[must_use]
    pub const fn impedance(self) -> Impedance {
        match self {
            Self::Firm => Impedance::FIRM,
            Self::Relaxed => Impedance::RELAXED,
        }
    }
}

/// Spring, damper and mass of the hand at the handle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Impedance {
    /// Translational stiffness along x, y, z of the device frame, N/m.
    pub stiffness_n_per_m: DVec3,
    /// Translational damping along x, y, z of the device frame, N s/m.
    pub damping_ns_per_m: DVec3,
    /// Rotational stiffness about every axis, N·m/rad.
    pub rotational_stiffness_nm_per_rad: f64,
    /// Rotational damping about every axis, N·m s/rad.
    pub rotational_damping_nms_per_rad: f64,
    /// Mass that moves with the handle while it is held, kg; 0 for a hand without inertia.
    pub mass_kg: f64,
}

impl Impedance {
    /// A relaxed arm in a constant posture: 0.554 kg, 6.45 N s/m, 135 N/m (typical trial of van Beek, Bergmann Tiest, Mugge
    /// and Kappers 2015, Sci. Rep. 5:18004).
    ///
    /// Rotation is an estimate: a passive wrist has 1 to 2 N·m/rad (Formica et al. 2012, J. Neurophysiol.
    /// 108:1158); the damping, with the drag of the flotor (4e-3 kg m² about the handle), gives a damping ratio of about 0.4.
    pub const RELAXED: Self = Self {
        stiffness_n_per_m: DVec3::splat(135.0),
        damping_ns_per_m: DVec3::splat(6.45),
        rotational_stiffness_nm_per_rad: 1.5,
        rotational_damping_nms_per_rad: 0.04,
        mass_kg: 0.554,
    };

    /// A firm grip: 0.5 kg, 70 N s/m, 2000 N/m, the operator usually quoted from Hashtrudi-Zaad and Salcudean's studies of
    /// teleoperation. Stiff enough to compress a spring of 1 N/mm with an intended depth of only 1.5 times the compression.
    ///
    /// Rotation is an estimate: the upper end of the range of a passive wrist (see [`Self::RELAXED`]), damping ratio with the drag
    /// of the flotor about 0.45.
    pub const FIRM: Self = Self {
        stiffness_n_per_m: DVec3::splat(2000.0),
        damping_ns_per_m: DVec3::splat(70.0),
        rotational_stiffness_nm_per_rad: 2.0,
        rotational_damping_nms_per_rad: 0.06,
        mass_kg: 0.5,
    };

    /// Returns this impedance with no stiffness along the axes of `yielding`, along which the hand intends a force.
    ///
    /// Real-time: bounded, no allocation.
    #[must_use]
    pub fn yielding(self, yielding: BVec3) -> Self {
        Self { stiffness_n_per_m: DVec3::select(yielding, DVec3::ZERO, self.stiffness_n_per_m), ..self }
    }

    /// Checks all parameters. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// If a number is negative or not finite; the error contains its name.
    pub(super) fn check(&self) -> Check {
        let least_zero = Domain::NotNegative;
        vector("hand stiffness_n_per_m", self.stiffness_n_per_m, least_zero)?;
        vector("hand damping_ns_per_m", self.damping_ns_per_m, least_zero)?;
        number("hand rotational_stiffness_nm_per_rad", self.rotational_stiffness_nm_per_rad, least_zero)?;
        number("hand rotational_damping_nms_per_rad", self.rotational_damping_nms_per_rad, least_zero)?;
        number("hand mass_kg", self.mass_kg, least_zero)
    }
}
