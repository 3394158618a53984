//! Tube of the wire, swept along its centre with a rotation-minimising frame (parallel transport along the curve).
//!
//! Rings in a fixed plane would fold to a ribbon where the wire runs along that plane; a transported frame has no such place. The
//! number of rings is fixed beforehand, so that the last ring lies in the plate.

use super::{Body, Color, Curve, Detail, LocalStrain, Mesh, Strain};
use flotor_hal::DVec3;
use flotor_hal::glam::DVec2;
use std::f64::consts::TAU;

/// Returns the centre of the wire at the fraction `s` of the body, where it crosses the section at `fibre`, m.
fn wire_center(curve: &Curve, s: f64, fibre: DVec2) -> DVec3 {
    let section = curve.section(s);
    section.center_m + section.orientation * fibre.extend(0.0)
}

/// Returns the point where the wire crosses the section at `s`, in the section's frame, m.
fn fibre(body: &Body, s: f64) -> DVec2 {
    if !body.is_coil() {
        return DVec2::ZERO;
    }
    DVec2::from_angle(TAU * body.info.helix_turns * s) * body.info.helix_radius_m
}

/// Adds the wire with its flat ends; `color` maps the local strain to a colour.
#[allow(clippy::cast_possible_truncation)] // thousands of vertices
pub fn append_tube(
    mesh: &mut Mesh,
    body: &Body,
    curve: &Curve,
    strain: &Strain,
    detail: Detail,
    color: impl Fn(LocalStrain) -> Color,
) {
    let Detail { rings, sides } = detail;
    let place = |k: usize| k as f64 / (rings - 1) as f64;
    let fibres: Vec<DVec2> = (0..rings).map(|k| fibre(body, place(k))).collect();
    let center = |(k, fibre): (usize, &DVec2)| wire_center(curve, place(k), *fibre);
    let centers: Vec<DVec3> = fibres.iter().enumerate().map(center).collect();
    let circle: Vec<DVec2> = (0..sides).map(|i| DVec2::from_angle(TAU * i as f64 / sides as f64)).collect();
    let first = mesh.vertices.len() as u32;
    let radius_m = body.info.tube_radius_m;
    let mut across = None;
    for (k, center) in centers.iter().enumerate() {
        let tangent = tangent(&centers, k);
        let carried = carry(across, tangent);
        across = Some(carried);
        let binormal = tangent.cross(carried);
        let look = color(strain.at(place(k), fibres[k]));
        for point in &circle {
            let normal = carried * point.x + binormal * point.y;
            mesh.vertex(*center + normal * radius_m, normal, look);
        }
    }
    let sides = sides as u32;
    for k in 0..rings as u32 - 1 {
        let (a, b) = (first + k * sides, first + (k + 1) * sides);
        for i in 0..sides {
            let j = (i + 1) % sides;
            mesh.quad(a + i, a + j, b + j, b + i);
        }
    }
    for (k, outward) in [(0, -1.0), (rings - 1, 1.0)] {
        cap(mesh, first + k as u32 * sides, sides, centers[k], tangent(&centers, k) * outward, outward > 0.0);
    }
}

/// Returns the direction of the wire at ring `k`: differences of second order, one-sided at the ends.
fn tangent(centers: &[DVec3], k: usize) -> DVec3 {
    let last = centers.len() - 1;
    let direction = match k {
        _ if last < 2 => centers[last] - centers[0],
        0 => centers[1] * 4.0 - centers[0] * 3.0 - centers[2],
        k if k == last => centers[last] * 3.0 - centers[last - 1] * 4.0 + centers[last - 2],
        k => centers[k + 1] - centers[k - 1],
    };
    direction.try_normalize().unwrap_or(DVec3::Z)
}

/// Transports the normal of the last ring to the next one, without a rotation about the wire.
fn carry(across: Option<DVec3>, tangent: DVec3) -> DVec3 {
    let start = across.unwrap_or_else(|| tangent.any_orthonormal_vector());
    (start - tangent * tangent.dot(start)).try_normalize().unwrap_or_else(|| tangent.any_orthonormal_vector())
}

/// Closes an end with a flat disc, whose vertices are separate because their normal is that of the end.
#[allow(clippy::cast_possible_truncation)] // thousands of vertices
fn cap(mesh: &mut Mesh, ring: u32, sides: u32, center_m: DVec3, normal: DVec3, forward: bool) {
    let color = mesh.vertices[ring as usize].color;
    let middle = mesh.vertex(center_m, normal, color);
    let rim = mesh.vertices.len() as u32;
    for i in 0..sides {
        let mut vertex = mesh.vertices[(ring + i) as usize];
        vertex.normal = normal.as_vec3().to_array();
        mesh.vertices.push(vertex);
    }
    for i in 0..sides {
        let (a, b) = (rim + i, rim + (i + 1) % sides);
        if forward { mesh.triangle(middle, a, b) } else { mesh.triangle(middle, b, a) }
    }
}
