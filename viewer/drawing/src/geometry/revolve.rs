//! Surfaces of revolution: plates, arrows, knobs.

use super::{Color, Mesh, Section};
use flotor_hal::glam::DVec2;
use flotor_hal::{DVec3, Pose};
use std::f64::consts::TAU;

/// Frame of an axis: origin and three unit vectors, z along the axis.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// Origin, m.
    pub origin_m: DVec3,
    /// First unit vector perpendicular to the axis.
    pub x: DVec3,
    /// Second unit vector perpendicular to the axis.
    pub y: DVec3,
    /// Unit vector along the axis.
    pub z: DVec3,
}

impl Frame {
    /// Returns a frame at a point, with the axis along a unit vector; its rotation about the axis is arbitrary.
    #[must_use]
    pub fn along(origin_m: DVec3, direction: DVec3) -> Self {
        let (x, y) = direction.any_orthonormal_pair();
        Self { origin_m, x, y, z: direction }
    }

    /// Returns the frame of a section.
    #[must_use]
    pub fn of(section: &Section) -> Self {
        Self::at(&Pose::new(section.center_m, section.orientation))
    }

    /// Returns the frame of a pose.
    #[must_use]
    pub fn at(pose: &Pose) -> Self {
        let turn = pose.orientation();
        Self { origin_m: pose.position(), x: turn * DVec3::X, y: turn * DVec3::Y, z: turn * DVec3::Z }
    }
}

/// Sweeps a profile of points `(radius, height)`, m, about the z axis of a frame. The profile runs upwards on the
/// outside; all its edges are sharp.
pub fn revolve(mesh: &mut Mesh, frame: &Frame, profile: &[(f64, f64)], sides: usize, color: Color) {
    for pair in profile.windows(2) {
        let [(r0, z0), (r1, z1)] = [pair[0], pair[1]];
        let slope = DVec2::new(z1 - z0, r0 - r1).normalize_or_zero();
        mesh.sheet(sides + 1, |mesh, i| {
            let around = DVec2::from_angle(TAU * i as f64 / sides as f64);
            let out = frame.x * around.x + frame.y * around.y;
            let normal = out * slope.x + frame.z * slope.y;
            [(r0, z0), (r1, z1)]
                .map(|(r, z)| mesh.vertex(frame.origin_m + out * r + frame.z * z, normal, color))
        });
    }
}

/// Adds an end plate: a disc with chamfered rims, with one face in the plane of a section and the other beyond the body. `outward`
/// is +1 for the end at the handle and -1 for the fixed end.
pub fn plate(
    mesh: &mut Mesh,
    section: &Section,
    radius_m: f64,
    thickness_m: f64,
    outward: f64,
    color: Color,
) {
    const SIDES: usize = 96;
    let chamfer_m = 0.25 * thickness_m;
    let (low, high) = if outward > 0.0 { (0.0, thickness_m) } else { (-thickness_m, 0.0) };
    let profile = [
        (0.0, low),
        (radius_m - chamfer_m, low),
        (radius_m, low + chamfer_m),
        (radius_m, high - chamfer_m),
        (radius_m - chamfer_m, high),
        (0.0, high),
    ];
    revolve(mesh, &Frame::of(section), &profile, SIDES, color);
}
