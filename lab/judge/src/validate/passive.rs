//! Passivity of a stateless law, and its stiffness near home.
//!
//! A law of pose and velocity alone is checked in two ways:
//!
//! - *On a closed path at rest* the work must be zero: reversing the path reverses the sign of the work, so nonzero work would
//!   mean generated energy in one direction. The circles lie in all fifteen planes of the three directions and three rotations.
//! - *Forward and back* through one pose, at the same speed, the part of the wrench that depends on the pose cancels. The rest
//!   is the wrench of the damping, which must dissipate energy.
//!
//! Both checks are exact except for rounding and, on a circle, for the law between two sampled points; the change of the wrench
//! from one point to the next bounds this error.

use super::outcome::{Figures, Outcome};
use super::path::{FAST, finite, walk_at};
use crate::wording;
use flotor_hal::{
    DVec3, Input, Memory, Pose, Twist, Wrench, math, orientation_from_rotation_vector, rotation_vector,
};
use flotor_loader::Model;
use std::f64::consts::TAU;

/// Points of a circle: enough to detect a gain of a hundredth of the stiffness.
const POINTS: usize = 1024;
/// Radius along directions, m, and about axes, rad.
const RADIUS_M: f64 = 1.0e-3;
const RADIUS_RAD: f64 = 1.0e-2;
/// Relative rounding tolerance: some thousand roundings of the largest term.
const ROUNDING: f64 = 1.0e-12;

/// Checks both paths, and measures stiffness and damping.
pub(super) fn passive(model: &mut Model) -> Result<Option<Figures>, Outcome> {
    if model.memory() != Memory::Stateless {
        return Err(Outcome::nothing_to_judge(
            "the model has a history, and may store energy that is not a function of the pose",
        ));
    }
    let mut largest_n: f64 = 0.0;
    for first in 0..6 {
        for second in first + 1..6 {
            largest_n = largest_n.max(circle(model, [first, second])?);
        }
    }
    let damping_ns_per_m = there_and_back(model)?;
    let stiffness_n_per_m = steepest(model)?;
    if largest_n == 0.0 && damping_ns_per_m == 0.0 {
        return Err(Outcome::nothing_to_judge("the wrench is zero on every circle, and there is no damping"));
    }
    let are_numbers = stiffness_n_per_m.is_finite() && damping_ns_per_m.is_finite();
    Ok(are_numbers.then_some(Figures { stiffness_n_per_m, damping_ns_per_m }))
}

/// Names of the six coordinates.
const COORDINATES: [&str; 6] = ["x", "y", "z", "rotation about x", "rotation about y", "rotation about z"];

fn on_circle(plane: [usize; 2], index: usize) -> Pose {
    let angle = TAU * (index % POINTS) as f64 / POINTS as f64;
    let coordinates: [f64; 6] = std::array::from_fn(|axis| {
        let size = if axis < 3 { RADIUS_M } else { RADIUS_RAD };
        let [first, second] = plane.map(|along| if along == axis { size } else { 0.0 });
        first * math::cos(angle) + second * math::sin(angle)
    });
    let [x, y, z, a, b, c] = coordinates;
    Pose::new(DVec3::new(x, y, z), orientation_from_rotation_vector(DVec3::new(a, b, c)))
}

/// Checks the work on the hand once round the circle, by the trapezoidal rule: the error of a segment is at most the
/// change of the wrench over it times its length. Returns the largest wrench, its torque at an arm of a metre, N.
fn circle(model: &mut Model, plane: [usize; 2]) -> Result<f64, String> {
    let (mut given_j, mut uncertain_j, mut largest_n) = (0.0, 0.0, 0.0_f64);
    let mut before = (on_circle(plane, 0), finite(model, &Input::at_rest(on_circle(plane, 0)))?.wrench);
    for index in 1..=POINTS {
        let pose = on_circle(plane, index);
        let wrench = finite(model, &Input::at_rest(pose))?.wrench;
        largest_n = largest_n.max(wrench.force().length() + wrench.torque().length());
        let (pose_before, wrench_before) = std::mem::replace(&mut before, (pose, wrench));
        let moved_m = pose.position() - pose_before.position();
        let turned_rad = rotation_vector(pose.orientation() * pose_before.orientation().inverse());
        let (mean, change) = ((wrench + wrench_before) * 0.5, wrench - wrench_before);
        given_j += mean.force().dot(moved_m) + mean.torque().dot(turned_rad);
        let largest_j = |wrench: &Wrench| {
            wrench.force().length() * moved_m.length() + wrench.torque().length() * turned_rad.length()
        };
        uncertain_j += largest_j(&change) + ROUNDING * largest_j(&mean);
    }
    if given_j.abs() <= uncertain_j {
        return Ok(largest_n);
    }
    let [first, second] = plane.map(|axis| COORDINATES.get(axis).copied().unwrap_or_default());
    Err(format!(
        "once round a circle in {first} and {second} ({} mm, {} rad) the model generates {:.3e} J; a model without \
         a history must not generate energy",
        RADIUS_M * 1.0e3,
        RADIUS_RAD,
        given_j.abs()
    ))
}

/// Returns the power of a wrench at a twist, W.
fn power_w(wrench: Wrench, twist: &Twist) -> f64 {
    wrench.force().dot(twist.linear()) + wrench.torque().dot(twist.angular())
}

/// Checks forward and back; returns the strongest damping, N·s/m.
fn there_and_back(model: &mut Model) -> Result<f64, String> {
    let mut strongest_ns_per_m: f64 = 0.0;
    for speed in [1.0, FAST] {
        for there in walk_at(speed, 2000).skip(1).step_by(10) {
            let reversed = Twist::new(-there.twist.linear(), -there.twist.angular());
            let back = Input { twist: reversed, ..there };
            let [ahead, behind] = [finite(model, &there)?.wrench, finite(model, &back)?.wrench];
            let given_w = power_w(ahead - behind, &there.twist);
            let (linear, angular) = (there.twist.linear(), there.twist.angular());
            let largest_n = ahead.force().length() + behind.force().length();
            let largest_nm = ahead.torque().length() + behind.torque().length();
            if given_w > ROUNDING * (largest_n * linear.length() + largest_nm * angular.length()) {
                return Err(format!(
                    "forward and back at {:.3} m/s through {} the model generates {given_w:.3e} W; damping must dissipate energy",
                    linear.length(),
                    wording::pose(&there.pose)
                ));
            }
            let damping_ns_per_m = -(ahead - behind).force().dot(linear) / (2.0 * linear.length_squared());
            strongest_ns_per_m = strongest_ns_per_m.max(damping_ns_per_m);
        }
    }
    Ok(strongest_ns_per_m)
}

/// Returns the largest change of force for a hundredth of a millimetre away from home, N/m.
fn steepest(model: &mut Model) -> Result<f64, String> {
    const STEP_M: f64 = 1.0e-5;
    let home = finite(model, &Input::at_rest(Pose::HOME))?.wrench;
    let mut steepest: f64 = 0.0;
    for along in DVec3::AXES.into_iter().flat_map(|axis| [axis, -axis]) {
        let pose = Pose { position_m: (along * STEP_M).to_array(), ..Pose::HOME };
        let wrench = finite(model, &Input::at_rest(pose))?.wrench;
        steepest = steepest.max((wrench - home).force().length() / STEP_M);
    }
    Ok(steepest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_circle_ends_where_it_began_and_moves_in_its_plane_only() {
        let [start, end] = [0, POINTS].map(|index| on_circle([0, 4], index));
        assert_eq!(start, end);
        let quarter = on_circle([0, 4], POINTS / 4);
        assert!(quarter.position().length() < 1.0e-18);
        assert!((rotation_vector(quarter.orientation()) - DVec3::Y * RADIUS_RAD).length() < 1.0e-15);
    }
}
