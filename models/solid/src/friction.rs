//! Coulomb friction of a sphere: a spring and a slider in series along the face, as in the wall.
//!
//! The spring has the constant stiffness of a sticking contact with a quarter of the sphere's radius. Its plane is constant
//! while a contact lasts. So the spring's force has a potential, and the slider only dissipates energy.

use flotor_hal::{DVec3, restorable};

/// State of the friction between a sphere and a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction {
    coefficient: f64,
    /// Stiffness along the face for a modulus of 1 Pa, m.
    stiffness_m: f64,
    contact: Option<Slider>,
}

restorable!(Friction { contact } without { coefficient, stiffness_m });

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Slider {
    /// Anchor of the spring, m.
    anchor_m: DVec3,
    /// Normal of the face at first contact.
    normal: DVec3,
}

restorable!(Slider { anchor_m, normal });

impl Friction {
    /// Prepares the friction between a sphere and a solid, without contact. Not real-time.
    #[must_use]
    pub fn new(coefficient: f64, poisson_ratio: f64, radius_m: f64) -> Self {
        // A bonded disc of radius a moves by Q (2 - nu) / (8 G a): Mindlin 1949, J. Appl. Mech. 16, 259-268.
        let shear = 1.0 / (2.0 * (1.0 + poisson_ratio));
        let stiffness_m = 8.0 * shear * 0.25 * radius_m / (2.0 - poisson_ratio);
        Self { coefficient, stiffness_m, contact: None }
    }

    /// Returns true if the coefficient is zero.
    #[must_use]
    pub fn is_smooth(&self) -> bool {
        self.coefficient == 0.0
    }

    /// Ends the contact: the slider starts anew at the next contact. Real-time: bounded, no allocation.
    pub fn release(&mut self) {
        self.contact = None;
    }

    /// Moves the slider for a handle at `position_m` under the force `pressing_n` of the smooth contact on the sphere; a zero force
    /// ends the contact. Returns the force along the face, N, and the spring's energy, J. Real-time: bounded, no allocation.
    pub fn follow(&mut self, position_m: DVec3, pressing_n: DVec3, modulus_pa: f64) -> (DVec3, f64) {
        if self.is_smooth() {
            return (DVec3::ZERO, 0.0);
        }
        if pressing_n == DVec3::ZERO {
            self.contact = None;
            return (DVec3::ZERO, 0.0);
        }
        let fresh = Slider { anchor_m: position_m, normal: main_direction(pressing_n) };
        let slider = self.contact.unwrap_or(fresh);
        let stiffness_n_per_m = self.stiffness_m * modulus_pa;
        let from_anchor_m = position_m - slider.anchor_m;
        let along_m = from_anchor_m - slider.normal * from_anchor_m.dot(slider.normal);
        let most_n = self.coefficient * pressing_n.dot(slider.normal).max(0.0);
        let lag_m = along_m.clamp_length_max(most_n / stiffness_n_per_m);
        self.contact = Some(Slider { anchor_m: slider.anchor_m + (along_m - lag_m), ..slider });
        (lag_m * -stiffness_n_per_m, 0.5 * stiffness_n_per_m * lag_m.length_squared())
    }
}

/// Returns the coordinate axis nearest to a direction.
fn main_direction(v: DVec3) -> DVec3 {
    let size = v.abs();
    let axis = if size.z >= size.x && size.z >= size.y {
        DVec3::Z
    } else if size.x >= size.y {
        DVec3::X
    } else {
        DVec3::Y
    };
    axis * v.dot(axis).signum()
}
