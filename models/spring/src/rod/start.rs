//! Initial shape where there is no shape of a last tick: the shape of the linear beam-column between the same plates.
//!
//! Short of buckling this shape is the equilibrium to first order in the angles of the ends from the chord, so Newton's
//! method converges from it. The shape depends on the pose alone, so the equilibrium found is a function of the pose.

use flotor_hal::glam::{DVec2, DVec3};

use crate::pose::Pose;
use crate::rigidity::Spring;
use crate::shape::{Shape, saturated_argument};
use flotor_lanes::basis::Basis;

/// Largest lean of an initial shape from the chord (rad). Close to buckling the linear shape has no bound, but the
/// rod's amplitude does.
const LARGEST_LEAN_RAD: f64 = 0.8;

/// Returns the coefficients `[c][k]` of bubble `k` in component `c`, for the shape without and the shape with the bow; `None` if
/// the linear column has no shape.
///
/// Relative to the chord the ends lean by `theta_L` and `theta_U`, and the column by `theta(u)` between ([`crate::shape`]). The
/// slopes of the bubbles are orthonormal and of mean zero, so a coefficient is the integral of the product of a bubble's slope and
/// the derivative of `p` ([`rate`]). Real-time: bounded, no allocation.
pub(crate) fn linear<const K: usize, const Q: usize>(
    basis: &Basis<K, Q>,
    spring: &Spring,
    pose: &Pose,
) -> Option<[[[f64; K]; 2]; 2]> {
    let (rigidities, free_length_m) = (spring.rigidities(), spring.geometry().free_length_m);
    let chord = pose.chord(free_length_m).ok()?;
    let direction = chord.vector_m / chord.length_m;
    let argument = Shape::argument(rigidities, free_length_m, chord.length_m)?;
    let shape = Shape::new(rigidities, free_length_m, chord.length_m, saturated_argument(argument).value)?;
    let lean_of = |normal: DVec3| normal - direction * normal.dot(direction);
    let (lower, upper) = (lean_of(DVec3::Z), lean_of(pose.orientation * DVec3::Z));
    let (sway, bow) = (0.5 * (upper + lower), 0.5 * (upper - lower));
    // The bow is widest a quarter of the rod from its ends, or at them.
    let widest = [0.25, 0.5].map(|u| shape.lean(u)[1].value.abs()).into_iter().fold(0.0, f64::max);
    let bow = bow * (LARGEST_LEAN_RAD / (widest * bow.length()).max(LARGEST_LEAN_RAD));

    let shape_of = |bow: DVec3| {
        let mut coefficients = [[0.0; K]; 2];
        for i in 0..Q {
            let [of_sway, of_bow] = shape.lean(basis.station[i] - 0.5);
            let rate = rate(
                direction + of_sway.value * sway + of_bow.value * bow,
                of_sway.slope * sway + of_bow.slope * bow,
            );
            for (component, rate) in coefficients.iter_mut().zip(rate.to_array()) {
                for (coefficient, slope) in component.iter_mut().zip(&basis.slope_at[i]) {
                    *coefficient += basis.weight[i] * rate * slope;
                }
            }
        }
        coefficients
    };
    let shapes = [shape_of(DVec3::ZERO), shape_of(bow)];
    shapes.as_flattened().as_flattened().iter().all(|coefficient| coefficient.is_finite()).then_some(shapes)
}

/// Returns the derivative of `p = d_xy / (1 + d_z)` for a direction `d` along `along`, with derivative `by_s`.
fn rate(along: DVec3, by_s: DVec3) -> DVec2 {
    let inverse = 1.0 / along.length();
    let direction = along * inverse;
    let turning = (by_s - direction * direction.dot(by_s)) * inverse;
    let overturn = 1.0 / (1.0 + direction.z);
    (turning.truncate() - direction.truncate() * (overturn * turning.z)) * overturn
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preset::Preset;
    use flotor_lanes::basis::bubbles;

    #[test]
    fn the_start_is_the_linear_column() {
        let spring = Preset::Thesis1.spring();
        let basis = Basis::<10, 14>::default();
        // Small enough for squares of the angles not to count.
        let (shear_m, tilt_rad) = (2.5e-6, 2e-4);
        let pose =
            Pose::from_rotation_vector(DVec3::new(shear_m, 0.0, -5e-3), DVec3::new(0.0, tilt_rad, 0.0));
        let [_, [along, across]] = linear(&basis, &spring, &pose).unwrap();
        assert!(across.iter().all(|coefficient| coefficient.abs() < 1e-12), "{across:?}");
        let length_m = 20e-3;
        let rigidities = spring.rigidities();
        let argument = Shape::argument(rigidities, 25e-3, length_m).unwrap();
        let shape = Shape::new(rigidities, 25e-3, length_m, argument).unwrap();
        let chord_rad = shear_m / length_m;
        let (lower, upper) = (-chord_rad, tilt_rad - chord_rad);
        for step in 0..=10 {
            let s = 0.1 * f64::from(step);
            let [sway, bow] = shape.lean(s - 0.5);
            let lean_rad = chord_rad + 0.5 * ((upper + lower) * sway.value + (upper - lower) * bow.value);
            let (bubble, _) = bubbles::<10>(2.0 * s - 1.0);
            let own: f64 = bubble.iter().zip(&along).map(|(bubble, coefficient)| bubble * coefficient).sum();
            // p = tan(angle / 2) is half the lean; third order in it.
            let found = own + 0.5 * tilt_rad * s;
            assert!((found - 0.5 * lean_rad).abs() < 1e-10, "{s}: {found:e} {:e}", 0.5 * lean_rad);
        }
    }
}
