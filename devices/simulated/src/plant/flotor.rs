//! Physical parameters of the flotor, with published values.

use crate::validation::{Domain, InvalidParameter, number, vector};
use flotor_hal::glam::DVec3;

/// Standard gravity, m/s² (ISO 80000-3).
pub const STANDARD_GRAVITY_M_PER_S2: f64 = 9.806_65;

/// Upward force that compensates gravity, acting at the centre of mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FeedForward {
    /// Exactly the weight: the flotor floats.
    Weight,
    /// Given force, N; its difference from the weight accelerates the flotor.
    Force(f64),
}

/// Eddy-current drag, acting at the origin of the flotor frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drag {
    /// Drag coefficient of translation, N s/m.
    pub translational_ns_per_m: f64,
    /// Drag coefficient of rotation, N·m s/rad.
    pub rotational_nms_per_rad: f64,
}

/// Physical parameters of the flotor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlotorParameters {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Principal moments of inertia about the centre of mass, along the axes of the flotor frame, kg m².
    pub inertia_kg_m2: DVec3,
    /// Centre of mass in the flotor frame, m.
    pub centre_of_mass_m: DVec3,
    /// Gravitational acceleration, m/s², downwards.
    pub gravity_m_per_s2: f64,
    /// Feed-forward that compensates gravity.
    pub feed_forward: FeedForward,
    /// Eddy-current drag.
    pub drag: Drag,
}

impl FlotorParameters {
    /// The thesis's flotor: 580 g (Varadharajan 2007, section 3.2), centre of mass on the axis.
    ///
    /// The centre of mass lies as deep as measured on a sister device ([`Self::UTAH`]). The inertia was never
    /// published. Estimate: a thin hemisphere of 115 mm radius plus a handle that raises the centre of mass to that
    /// depth; depending on the handle's mass this gives 3.0 to 3.7 g m² about x and y, and 3.4 to 3.9 g m² about z; the
    /// values here are the midpoints. Drag is an estimate too: "damped oscillation" (thesis section 3.2) at 1 kHz needs
    /// more than half the stiffness times the period, 0.4 to 1.6 N s/m for the thesis's springs (Colgate and Schenkel
    /// 1997); the rotational drag assumes the translational drag spread evenly over the hemisphere, `2/3 b R^2`.
    pub const THESIS: Self = Self {
        mass_kg: 0.580,
        inertia_kg_m2: DVec3::new(3.35e-3, 3.35e-3, 3.65e-3),
        centre_of_mass_m: DVec3::new(0.0, 0.0, -31.7e-3),
        gravity_m_per_s2: STANDARD_GRAVITY_M_PER_S2,
        feed_forward: FeedForward::Weight,
        drag: Drag { translational_ns_per_m: 2.0, rotational_nms_per_rad: 0.0176 },
    };

    /// The flotor of the University of Utah's device: mass and centre of mass from its control program (repository
    /// n-fallahinia/UoU_Soft_V2.0), which compensates 5.674 N. All else as in [`Self::THESIS`].
    pub const UTAH: Self =
        Self { mass_kg: 0.555, centre_of_mass_m: DVec3::new(0.614e-3, 1.225e-3, -31.669e-3), ..Self::THESIS };

    /// Returns the upward compensation force, N. Real-time: bounded, no allocation.
    #[must_use]
    pub fn feed_forward_n(&self) -> f64 {
        match self.feed_forward {
            FeedForward::Weight => self.mass_kg * self.gravity_m_per_s2,
            FeedForward::Force(force_n) => force_n,
        }
    }

    /// Checks all parameters. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// If a parameter is not finite, out of its range, or physically impossible; the error contains its name.
    pub fn check(&self) -> Result<(), InvalidParameter> {
        number("mass_kg", self.mass_kg, Domain::Positive)?;
        vector("inertia_kg_m2", self.inertia_kg_m2, Domain::Positive)?;
        // The moments of a flat body just meet the triangle inequality: allow for rounding.
        let sum_kg_m2 = self.inertia_kg_m2.element_sum();
        if 2.0 * self.inertia_kg_m2.max_element() > sum_kg_m2 * (1.0 + 1.0e-12) {
            return Err(InvalidParameter::ImpossibleInertia { principal_kg_m2: self.inertia_kg_m2 });
        }
        vector("centre_of_mass_m", self.centre_of_mass_m, Domain::Finite)?;
        number("gravity_m_per_s2", self.gravity_m_per_s2, Domain::Finite)?;
        number("feed_forward_n", self.feed_forward_n(), Domain::Finite)?;
        number("translational_ns_per_m", self.drag.translational_ns_per_m, Domain::NotNegative)?;
        number("rotational_nms_per_rad", self.drag.rotational_nms_per_rad, Domain::NotNegative)
    }
}
