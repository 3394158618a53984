//! Text form of answers of plugins, with units, for findings.

use flotor_hal::{DVec3, DeviceState, LinearField, Output, Pose, Twist, Wrench, rotation_vector};
use std::time::Duration;

/// Returns a vector as `[x, y, z]`.
pub(crate) fn vector(vector: DVec3) -> String {
    let [x, y, z] = vector.to_array();
    format!("[{x}, {y}, {z}]")
}

/// Formats a time in the unit that suits its length, with three digits.
pub(crate) fn time(time: Duration) -> String {
    let (number, unit) = match time.as_nanos() {
        0..1_000 => (time.as_secs_f64() * 1.0e9, "ns"),
        1_000..1_000_000 => (time.as_secs_f64() * 1.0e6, "µs"),
        1_000_000..1_000_000_000 => (time.as_secs_f64() * 1.0e3, "ms"),
        _ => (time.as_secs_f64(), "s"),
    };
    let digits = if number < 10.0 { 2 } else { usize::from(number < 100.0) };
    let number = format!("{number:.digits$}");
    let short = if digits > 0 { number.trim_end_matches('0').trim_end_matches('.') } else { &number };
    format!("{short} {unit}")
}

/// Formats position, m, and rotation vector, rad, of a pose.
pub(crate) fn pose(pose: &Pose) -> String {
    let turned_rad = rotation_vector(pose.orientation());
    match turned_rad == DVec3::ZERO {
        true => format!("{} m", vector(pose.position())),
        false => format!("{} m, turned by {} rad", vector(pose.position()), vector(turned_rad)),
    }
}

/// Formats velocity, m/s, and angular velocity, rad/s, of a twist.
pub(crate) fn twist(twist: &Twist) -> String {
    format!("{} m/s and {} rad/s", vector(twist.linear()), vector(twist.angular()))
}

/// Formats force, N, and torque, N·m, of a wrench.
pub(crate) fn wrench(wrench: &Wrench) -> String {
    format!("{} N and {} N·m", vector(wrench.force()), vector(wrench.torque()))
}

/// Formats wrench, energy and status of the answer to a step.
pub(crate) fn output(output: &Output) -> String {
    let status = if output.status().is_some() { "" } else { ", with a status unknown to the contract" };
    format!("{} and {} J{status}", wrench(&output.wrench), output.energy_j)
}

/// Formats wrench and range of a local linear model.
pub(crate) fn linear_field(field: &LinearField) -> String {
    let stiffness =
        if field.stiffness.iter().flatten().all(|rate| rate.is_finite()) { "finite" } else { "not finite" };
    format!(
        "{} at {}, valid within {} m and {} rad; its stiffness is {stiffness}",
        wrench(&field.wrench),
        pose(&field.anchor),
        field.valid_m,
        field.valid_rad
    )
}

/// Formats pose, twist and delivered wrench of a sample.
pub(crate) fn sample(state: &DeviceState) -> String {
    let DVec3 { x, y, z } = state.pose.position();
    format!(
        "position [{x}, {y}, {z}] m, quaternion {}, moving with {}, delivering {}",
        state.pose.orientation(),
        twist(&state.twist),
        wrench(&state.delivered)
    )
}

#[cfg(test)]
mod tests {
    use super::time;
    use std::time::Duration;

    #[test]
    fn a_time_has_the_unit_that_suits_it() {
        let of_ns = |ns| time(Duration::from_nanos(ns));
        let shown = [0, 999, 1_500, 47_100, 500_000, 2_345_678, 10_000_000_000].map(of_ns);
        assert_eq!(shown, ["0 ns", "999 ns", "1.5 µs", "47.1 µs", "500 µs", "2.35 ms", "10 s"]);
    }
}
