//! Forms of bodies and tools.

use rapier3d_f64::math::Vector;
use rapier3d_f64::parry::shape::{HalfSpace, SharedShape};
use std::f64::consts::PI;

/// Form of a body or of a tool, about its own origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    /// Half space below z = 0; bodies only.
    Plane,
    /// Ball.
    Ball {
        /// Radius, m.
        radius_m: f64,
    },
    /// Box with sides along the axes.
    Box {
        /// Half sides, m.
        half_m: [f64; 3],
    },
    /// Capsule along z.
    Capsule {
        /// Radius, m.
        radius_m: f64,
        /// Half the distance between the centres of its ends, m.
        half_m: f64,
    },
}

impl Form {
    /// Returns the shape for the solver.
    pub(crate) fn shape(&self) -> SharedShape {
        match *self {
            Self::Plane => SharedShape::new(HalfSpace::new(Vector::Z)),
            Self::Ball { radius_m } => SharedShape::ball(radius_m),
            Self::Box { half_m: [x, y, z] } => SharedShape::cuboid(x, y, z),
            Self::Capsule { radius_m, half_m } => SharedShape::capsule_z(half_m, radius_m),
        }
    }

    /// Returns the volume, m³; 0 for a plane, which has no mass.
    #[must_use]
    pub fn volume_m3(&self) -> f64 {
        match *self {
            Self::Plane => 0.0,
            Self::Ball { radius_m } => 4.0 / 3.0 * PI * radius_m * radius_m * radius_m,
            Self::Box { half_m: [x, y, z] } => 8.0 * x * y * z,
            Self::Capsule { radius_m, half_m } => {
                PI * radius_m * radius_m * (2.0 * half_m + 4.0 / 3.0 * radius_m)
            }
        }
    }

    /// Returns the number of contact points of the form, as a tool, on a flat surface; they share the stiffness.
    #[must_use]
    pub fn feet(&self) -> f64 {
        match self {
            Self::Plane | Self::Ball { .. } => 1.0,
            Self::Capsule { .. } => 2.0,
            Self::Box { .. } => 4.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn volumes_are_those_of_the_solver() {
        let forms = [
            Form::Ball { radius_m: 0.02 },
            Form::Box { half_m: [0.01, 0.02, 0.03] },
            Form::Capsule { radius_m: 0.01, half_m: 0.03 },
        ];
        for form in forms {
            let expected = form.shape().mass_properties(1.0).mass();
            assert!((form.volume_m3() / expected - 1.0).abs() < 1.0e-12, "{form:?}");
        }
    }
}
