//! Boundary wall at the edge of a device's range: a spring and a damper that push the handle back and never pull.
//!
//! The range is an ellipsoid of positions and an ellipsoid of rotation vectors; with equal semi-axes, the boundary of the thesis
//! (section 3.2), a sphere. The spring force is proportional to the distance from the ellipsoid, along the normal at the nearest
//! point: the force has a potential, so no closed path gains energy. In most ticks the handle is inside; a cheap test without
//! square root or arc tangent comes first.
//!
//! Stiffness and position of the wall come from a [`RenderedBoundary`].

use crate::rendered_boundary::RenderedBoundary;
use flotor_hal::{DVec3, DeviceState, Wrench, math, rotation_vector};
use std::f64::consts::PI;

/// Boundary wall of one device.
#[derive(Clone)]
pub struct BoundaryWall {
    position: Ellipsoid,
    rotation: Ellipsoid,
}

impl BoundaryWall {
    /// Creates the wall of a device. Not real-time.
    pub fn new(rendered: &RenderedBoundary) -> Self {
        let RenderedBoundary {
            begins_m,
            begins_rad,
            stiffness_n_per_m,
            damping_ns_per_m,
            stiffness_nm_per_rad,
            damping_nms_per_rad,
            ..
        } = *rendered;
        Self {
            position: Ellipsoid::new(begins_m, stiffness_n_per_m, damping_ns_per_m),
            rotation: Ellipsoid::new(begins_rad, stiffness_nm_per_rad, damping_nms_per_rad),
        }
    }

    /// Returns the wrench of the wall on the handle, device frame; `None` inside, and for a state with non-finite numbers.
    /// Real-time: bounded, no allocation.
    #[inline]
    pub fn push(&self, state: &DeviceState) -> Option<Wrench> {
        if self.surely_holds(state) { None } else { self.push_outside(state) }
    }

    /// Returns true only for a pose inside, but not for all of these: the test overestimates a rotation by a factor of up to π/2,
    /// and is false close to the edge. Real-time: bounded, no allocation.
    #[inline]
    pub fn surely_holds(&self, state: &DeviceState) -> bool {
        // A rotation vector is the axis times the angle, and an angle is at most pi times the sine of half the angle.
        let at_most_rad = state.pose.orientation().xyz() * PI;
        self.position.surely_holds(state.pose.position()) && self.rotation.surely_holds(at_most_rad)
    }

    fn push_outside(&self, state: &DeviceState) -> Option<Wrench> {
        if !state.is_finite() {
            return None;
        }
        let force = self.position.beyond(state.pose.position());
        let force = force.map(|beyond| self.position.push(&beyond, state.twist.linear()));
        let rotation_rad = rotation_vector(state.pose.orientation());
        let torque = self.rotation.beyond(rotation_rad).map(|beyond| {
            // A gradient along the rotation axis needs no conversion.
            let is_axis = self.rotation.shape == Shape::Sphere;
            let outward = if is_axis { beyond.outward } else { by_turning(rotation_rad, beyond.outward) };
            self.rotation.push(&Beyond { outward, ..beyond }, state.twist.angular())
        });
        if force.is_none() && torque.is_none() {
            return None;
        }
        Some(Wrench::new(force.unwrap_or(DVec3::ZERO), torque.unwrap_or(DVec3::ZERO)))
    }
}

/// Converts a gradient with respect to the rotation vector to one with respect to rotations about the fixed axes, with the inverse
/// transposed left Jacobian of SO(3) (Chirikjian, section 10.8.5).
fn by_turning(rotation_rad: DVec3, gradient: DVec3) -> DVec3 {
    let angle = rotation_rad.length();
    let (sin, cos) = math::sin_cos(angle);
    // (1/θ² - (1 + cos θ)/(2θ sin θ)), and its series where both terms cancel.
    let second = if angle < 1.0e-2 {
        1.0 / 12.0 + angle * angle / 720.0
    } else {
        1.0 / (angle * angle) - (1.0 + cos) / (2.0 * angle * sin)
    };
    let across = rotation_rad.cross(gradient);
    gradient + across * 0.5 + rotation_rad.cross(across) * second
}

/// Range of positions (m, N) or of rotation vectors (rad, N·m), with spring and damper outside.
#[derive(Clone)]
struct Ellipsoid {
    /// Infinite on an axis without a range: such an axis is ignored.
    semi_axes: DVec3,
    /// Reciprocals of the semi-axes.
    per_semi_axis: DVec3,
    shape: Shape,
    /// Stiffness of the spring, N/m or N·m/rad.
    stiffness: f64,
    /// Damping, N·s/m or N·m·s/rad.
    damping: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shape {
    /// All axes with a range are equal.
    Sphere,
    Unequal,
}

/// Distance and direction of a point outside an ellipsoid.
struct Beyond {
    /// Distance from the ellipsoid, m or rad.
    depth: f64,
    /// Unit normal at the nearest point.
    outward: DVec3,
}

/// Squared distance from the centre, in semi-axes, below which a point is inside despite rounding.
const SURELY_INSIDE: f64 = 1.0 - 1.0e-12;

impl Ellipsoid {
    fn new(semi_axes: [f64; 3], stiffness: f64, damping: f64) -> Self {
        let finite = || semi_axes.into_iter().filter(|axis| axis.is_finite());
        let is_sphere = finite().all(|axis| finite().all(|other| axis.total_cmp(&other).is_eq()));
        let shape = if is_sphere { Shape::Sphere } else { Shape::Unequal };
        let semi_axes = DVec3::from_array(semi_axes);
        Self { semi_axes, per_semi_axis: semi_axes.recip(), shape, stiffness, damping }
    }

    /// Returns true only for a point inside; possibly false for a point inside but close to the edge.
    #[inline]
    fn surely_holds(&self, at: DVec3) -> bool {
        (at * self.per_semi_axis).length_squared() < SURELY_INSIDE // false for NaN
    }

    /// Returns distance and direction of a point outside; `None` for a point inside.
    fn beyond(&self, at: DVec3) -> Option<Beyond> {
        let has_no_range = self.semi_axes.cmpeq(DVec3::INFINITY);
        let at = DVec3::select(has_no_range, DVec3::ZERO, at);
        let distances = (at / self.semi_axes).length();
        if distances.is_nan() || distances <= 1.0 {
            return None;
        }
        Some(match self.shape {
            Shape::Sphere => {
                let distance = at.length();
                Beyond { depth: distance - distance / distances, outward: at / distance }
            }
            Shape::Unequal => {
                let semi_axes = DVec3::select(has_no_range, DVec3::ONE, self.semi_axes);
                beyond_unequal(semi_axes * semi_axes, semi_axes * at, at)
            }
        })
    }

    /// Returns the force or torque of spring and damper. Only an outward velocity is damped: the wall never pulls.
    fn push(&self, beyond: &Beyond, velocity: DVec3) -> DVec3 {
        let Beyond { depth, outward } = *beyond;
        outward * -(self.stiffness * depth + self.damping * velocity.dot(outward).max(0.0)).max(0.0)
    }
}

/// Maximum number of Newton steps: four reach rounding accuracy within a tenth of a semi-axis, twelve at a hundred semi-axes.
const MAX_STEPS: usize = 20;

/// Returns distance and direction of the point `at` outside an ellipsoid; `squares`: squared semi-axes, `scaled`: `at` times the
/// semi-axes.
///
/// The nearest point is `a² p / (a² + t)` on each axis, where t makes `|a p / (a² + t)|` one (Eberly). The reciprocal of that
/// length is concave in t, so Newton's method from t = 0 approaches from below, and takes one step on a sphere.
fn beyond_unequal(squares: DVec3, scaled: DVec3, at: DVec3) -> Beyond {
    let mut t = 0.0;
    for _ in 0..MAX_STEPS {
        let part = scaled / (squares + t);
        let length = part.length();
        let slope = (part * part / (squares + t)).element_sum();
        let step = (length - 1.0) * length * length / slope;
        if step <= t * f64::EPSILON {
            break;
        }
        t += step;
    }
    let normal = at / (squares + t);
    let length = normal.length();
    Beyond { depth: t * length, outward: normal / length }
}

#[cfg(test)]
mod tests;
