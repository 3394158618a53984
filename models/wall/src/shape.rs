//! Convex solids, with their top at the origin.

use crate::surface::Surface;
use flotor_hal::{DVec3, math, restorable};

/// Solid whose highest point is the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// Half-space `z < 0`.
    Plane,
    /// Sphere.
    Sphere {
        /// Radius, m.
        radius_m: f64,
    },
    /// Cube with edges along the axes.
    Cube {
        /// Half the length of an edge, m.
        half_m: f64,
    },
}

/// Place on a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[must_use]
pub struct Place {
    /// Position from the top of the solid, m.
    pub point_m: DVec3,
    /// Outward unit normal.
    pub normal: DVec3,
}

restorable!(Place { point_m, normal });

impl Shape {
    /// Returns true for a point inside the solid, false on its surface. Real-time: bounded, no allocation.
    #[must_use]
    pub fn contains(&self, point_m: DVec3) -> bool {
        let from_centre_m = point_m - self.centre_m();
        match *self {
            Self::Plane => point_m.z < 0.0,
            Self::Sphere { radius_m } => from_centre_m.length_squared() < radius_m * radius_m,
            Self::Cube { half_m } => from_centre_m.abs().max_element() < half_m,
        }
    }

    /// Returns the place where a proxy begins after a straight path from `outside_m` to `inside_m`: nearest to the end of the
    /// path on the surface, on a cube on the face that the path crosses. Real-time: bounded, no allocation.
    pub fn entry(&self, outside_m: DVec3, inside_m: DVec3) -> Place {
        let normal = match *self {
            Self::Plane | Self::Sphere { .. } => DVec3::Z,
            Self::Cube { half_m } => self.face_crossed(outside_m, inside_m, half_m),
        };
        self.nearest(inside_m, normal)
    }

    /// Returns the place on the surface nearest to a point inside; on a cube, nearest on the face of entry, even if another
    /// face is nearer. `entered`: normal at the entry, and for a handle at the centre of a sphere. Real-time: bounded, no
    /// allocation.
    pub fn nearest(&self, inside_m: DVec3, entered: DVec3) -> Place {
        let from_centre_m = inside_m - self.centre_m();
        match *self {
            Self::Plane => Place { point_m: inside_m.with_z(0.0), normal: DVec3::Z },
            Self::Sphere { radius_m } => {
                // At the very centre all directions are equal; the direction of entry is a continuous choice.
                let normal = from_centre_m.try_normalize().unwrap_or(entered);
                Place { point_m: self.centre_m() + normal * radius_m, normal }
            }
            Self::Cube { half_m } => {
                let depth_m = half_m - from_centre_m.dot(entered);
                Place { point_m: inside_m + entered * depth_m, normal: entered }
            }
        }
    }

    /// Returns the place on the face that a point outside faces; on a cube on the plane of that face. Real-time: bounded, no
    /// allocation.
    pub fn facing(&self, outside_m: DVec3) -> Place {
        self.nearest(outside_m, self.entry(outside_m, self.centre_m()).normal)
    }

    /// Slides a proxy on the surface towards the place nearest to the handle, as far as Coulomb's friction requires:
    /// until the tangential spring force is at most `mu` times the normal force, `K |t| <= mu F_n`. The energy that the
    /// spring loses is dissipated. Real-time: bounded, no allocation.
    pub fn slide(&self, proxy: &Place, surface: &Surface, handle_m: DVec3, velocity_m_per_s: DVec3) -> Place {
        let nearest = self.nearest(handle_m, proxy.normal);
        if surface.friction == 0.0 {
            return nearest;
        }
        let stretch_m = proxy.point_m - handle_m;
        let depth_m = stretch_m.dot(proxy.normal);
        let normal_n = surface.normal_force_n(depth_m, velocity_m_per_s.dot(proxy.normal));
        let held_n = surface.friction * normal_n;
        let along_n = (stretch_m - proxy.normal * depth_m).length() * surface.stiffness_n_per_m;
        if along_n <= held_n {
            return *proxy;
        }
        match *self {
            Self::Plane | Self::Cube { .. } => {
                let lag_m = proxy.point_m - nearest.point_m;
                Place { point_m: nearest.point_m + lag_m * (held_n / along_n), normal: nearest.normal }
            }
            Self::Sphere { radius_m } => {
                let lag = proxy.normal - nearest.normal * proxy.normal.dot(nearest.normal);
                let aside = lag.try_normalize().unwrap_or(DVec3::ZERO);
                // Solve K r sin(a) = mu F_n = mu (K (R - r cos(a)) - B (v_r cos(a) + v_t sin(a))) for the angle a
                // between proxy and handle, from the centre; v_r away from the centre, v_t towards the proxy.
                let Surface { stiffness_n_per_m, damping_ns_per_m, friction } = *surface;
                let spring_n = stiffness_n_per_m * (handle_m - self.centre_m()).length();
                let damper_n = damping_ns_per_m * velocity_m_per_s;
                let sine_n = spring_n + friction * damper_n.dot(aside);
                let cosine_n = friction * (spring_n + damper_n.dot(nearest.normal));
                let sine = friction * stiffness_n_per_m * radius_m / math::hypot(sine_n, cosine_n);
                // Where even the nearest place has no normal force, the proxy slides there.
                let angle_rad = (math::asin(sine.min(1.0)) - math::atan2(cosine_n, sine_n)).max(0.0);
                let normal =
                    (nearest.normal * math::cos(angle_rad) + aside * math::sin(angle_rad)).normalize();
                Place { point_m: self.centre_m() + normal * radius_m, normal }
            }
        }
    }

    /// Returns the centre of the solid, from its top, m; of a plane, the origin.
    #[must_use]
    pub fn centre_m(&self) -> DVec3 {
        match *self {
            Self::Plane => DVec3::ZERO,
            Self::Sphere { radius_m: half_m } | Self::Cube { half_m } => -DVec3::Z * half_m,
        }
    }

    /// Returns the normal of the cube face that a straight path crosses: the last slab it enters.
    fn face_crossed(&self, outside_m: DVec3, inside_m: DVec3, half_m: f64) -> DVec3 {
        let (from, to) = (outside_m - self.centre_m(), inside_m - self.centre_m());
        let mut crossed = (DVec3::Z, f64::NEG_INFINITY);
        for axis in [DVec3::Z, DVec3::Y, DVec3::X] {
            let side = axis.dot(from).signum();
            let (beyond_m, moved_m) = (side * axis.dot(from) - half_m, side * axis.dot(from - to));
            let entered_at =
                if beyond_m >= 0.0 && moved_m > 0.0 { beyond_m / moved_m } else { f64::NEG_INFINITY };
            if entered_at > crossed.1 {
                crossed = (axis * side, entered_at);
            }
        }
        crossed.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CUBE: Shape = Shape::Cube { half_m: 0.01 };

    #[test]
    fn the_top_of_every_solid_is_the_origin() {
        for shape in [Shape::Plane, Shape::Sphere { radius_m: 0.02 }, CUBE] {
            assert!(shape.contains(DVec3::Z * -1.0e-9) && !shape.contains(DVec3::Z * 1.0e-9), "{shape:?}");
            assert_eq!(shape.entry(DVec3::Z, DVec3::Z * -1.0e-3).normal, DVec3::Z);
        }
    }

    #[test]
    fn a_cube_is_entered_by_the_face_the_way_crosses_and_left_by_none() {
        let inside = DVec3::new(0.0099, 0.0, -0.0005); // as near to the top as to the side, and nearer to the side
        for (outside, normal) in [
            (DVec3::new(0.0099, 0.0, 0.001), DVec3::Z),
            (DVec3::new(0.02, 0.0, -0.0005), DVec3::X),
            (DVec3::new(0.02, 0.0, 0.0001), DVec3::X), // above the top at first, below it when it reaches the side
        ] {
            assert_eq!(CUBE.entry(outside, inside).normal, normal, "{outside}");
        }
        let deep = CUBE.nearest(DVec3::Z * -0.019, DVec3::Z); // a millimetre before the bottom
        assert_eq!((deep.normal, deep.point_m), (DVec3::Z, DVec3::ZERO));
    }
}
