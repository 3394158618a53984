//! Arrows: straight for a force, bent around the axis for a torque.

use super::{Color, Frame, Mesh, revolve};
use flotor_hal::DVec3;
use flotor_hal::glam::DVec2;
use std::f64::consts::TAU;

/// Number of sides of a shaft and a head.
const SIDES: usize = 72;
/// Length and radius of a head, in radii of the shaft.
const HEAD_LENGTH: f64 = 6.0;
const HEAD_RADIUS: f64 = 2.6;

/// Adds an arrow from a point along a vector, m; adds nothing for a vector of length zero. An arrow shorter than two heads is
/// scaled down as a whole.
pub fn force_arrow(mesh: &mut Mesh, from_m: DVec3, vector_m: DVec3, shaft_radius_m: f64, color: Color) {
    let length_m = vector_m.length();
    let Some(direction) = vector_m.try_normalize() else { return };
    // A small force is a small arrow: below two heads, shaft and head shrink alike.
    let radius_m = shaft_radius_m.min(length_m / (2.0 * HEAD_LENGTH));
    let neck_m = length_m - HEAD_LENGTH * radius_m;
    let head_m = HEAD_RADIUS * radius_m;
    let profile = [(0.0, 0.0), (radius_m, 0.0), (radius_m, neck_m), (head_m, neck_m), (0.0, length_m)];
    revolve(mesh, &Frame::along(from_m, direction), &profile, SIDES, color);
}

/// Adds an arc with a head, right-handed about an axis, for a torque; `angle_rad` is the angle of the arc with its head, clamped to
/// 0.95 of a turn. Adds nothing for an axis or an angle of zero.
pub fn torque_arrow(
    mesh: &mut Mesh,
    center_m: DVec3,
    axis: DVec3,
    radius_m: f64,
    angle_rad: f64,
    shaft_radius_m: f64,
    color: Color,
) {
    const RINGS: usize = 48;
    let Some(axis) = axis.try_normalize() else { return };
    let angle_rad = angle_rad.clamp(0.0, 0.95 * TAU);
    let frame = Frame::along(center_m, axis);
    let shaft_m = shaft_radius_m.min(radius_m * angle_rad / (2.0 * HEAD_LENGTH));
    let arc_rad = angle_rad - HEAD_LENGTH * shaft_m / radius_m;
    if arc_rad <= 0.0 {
        return;
    }
    let out = |angle: f64| frame.x * angle.cos() + frame.y * angle.sin();
    mesh.sheet(RINGS + 1, |mesh, k| {
        let radial = out(arc_rad * k as f64 / RINGS as f64);
        let corner = |i: usize| {
            let around = DVec2::from_angle(TAU * i as f64 / SIDES as f64);
            let normal = radial * around.x + axis * around.y;
            mesh.vertex(center_m + radial * radius_m + normal * shaft_m, normal, color)
        };
        let mut ring: Vec<u32> = (0..SIDES).map(corner).collect();
        ring.push(ring[0]);
        ring
    });
    let tip = out(arc_rad);
    let head = Frame::along(center_m + tip * radius_m, axis.cross(tip));
    let profile = [(0.0, 0.0), (HEAD_RADIUS * shaft_m, 0.0), (0.0, HEAD_LENGTH * shaft_m)];
    revolve(mesh, &head, &profile, SIDES, color);
}
