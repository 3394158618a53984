//! Primitives and triangle surfaces of a model.

use super::{Color, Frame, MM_PER_M, Mesh, Vertex, revolve};
use flotor_hal::glam::DVec2;
use flotor_hal::{DVec3, Form, Primitive, Sides, Surface};
use std::f64::consts::{PI, TAU};

/// Thickness of the slab drawn for a plane, as a fraction of half its longer side.
const SLAB: f64 = 0.15;
/// Number of sectors of round primitives, and of rings of a ball.
const SECTORS: usize = 64;
const RINGS: usize = 32;

/// Adds a primitive; skips a primitive of an unknown form.
pub fn append_primitive(mesh: &mut Mesh, primitive: &Primitive, color: Color) {
    let (pose, [x, y, z]) = (primitive.pose(), primitive.half_sides_m());
    let frame = Frame::at(&pose);
    match primitive.form() {
        Some(Form::Plane) => {
            let half_m = 0.5 * SLAB * x.max(y);
            let middle = Frame { origin_m: frame.origin_m - frame.z * half_m, ..frame };
            cuboid(mesh, &middle, DVec3::new(x, y, half_m), color);
        }
        Some(Form::Sphere) => ball(mesh, &frame, x, color),
        Some(Form::Box) => cuboid(mesh, &frame, DVec3::new(x, y, z), color),
        Some(Form::Cylinder) => {
            revolve(mesh, &frame, &[(0.0, -z), (x, -z), (x, z), (0.0, z)], SECTORS, color);
        }
        None => {}
    }
}

fn ball(mesh: &mut Mesh, frame: &Frame, radius_m: f64, color: Color) {
    mesh.sheet(RINGS + 1, |mesh, ring| {
        let up = DVec2::from_angle(PI * (ring as f64 / RINGS as f64 - 0.5));
        let corner = |sector: usize| {
            let around = DVec2::from_angle(TAU * sector as f64 / SECTORS as f64) * up.x;
            let normal = frame.x * around.x + frame.y * around.y + frame.z * up.y;
            mesh.vertex(frame.origin_m + normal * radius_m, normal, color)
        };
        (0..=SECTORS).map(corner).collect::<Vec<u32>>()
    });
}

fn cuboid(mesh: &mut Mesh, frame: &Frame, half_m: DVec3, color: Color) {
    let axes = [(frame.x, half_m.x), (frame.y, half_m.y), (frame.z, half_m.z)];
    for face in 0..3 {
        for side in [1.0, -1.0] {
            let (out, depth) = axes[face];
            // Seen from outside, the rotation from u to v is counter-clockwise on both sides.
            let (u, v) = (axes[(face + 1) % 3], axes[(face + 2) % 3]);
            let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(a, b)| {
                let place = out * (side * depth) + u.0 * (a * u.1 * side) + v.0 * (b * v.1);
                mesh.vertex(frame.origin_m + place, out * side, color)
            });
            mesh.quad(corners[0], corners[1], corners[2], corners[3]);
        }
    }
}

/// Adds a surface coloured by the values of its vertices; a surface with two sides is also drawn from the back.
#[allow(clippy::cast_possible_truncation)] // a picture needs no more than f32, and no more than 2^32 vertices
pub fn append_surface(mesh: &mut Mesh, surface: &Surface, color: impl Fn(f64) -> Color) {
    let first = mesh.vertices.len() as u32;
    mesh.vertices.extend(surface.vertices.iter().map(|vertex| Vertex {
        position_mm: vertex.position_m.map(|x| (x * MM_PER_M) as f32),
        normal: vertex.normal.map(|x| x as f32),
        color: color(vertex.value),
    }));
    mesh.indices.extend(surface.triangles.as_flattened().iter().map(|corner| first + corner));
    if surface.sides == Sides::Both {
        let back = mesh.vertices.len() as u32;
        let corners = mesh.vertices[first as usize..].to_vec();
        mesh.vertices
            .extend(corners.into_iter().map(|corner| Vertex { normal: corner.normal.map(|x| -x), ..corner }));
        mesh.indices.extend(surface.triangles.iter().flat_map(|[a, b, c]| [back + a, back + c, back + b]));
    }
}
