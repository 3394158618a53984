//! Picture of the surface, the tool, and the contact with its normal. Not real-time.

use crate::surface::Surface;
use crate::touch::{Answer, Friction};
use crate::weld::{Numbers, mix};
use flotor_hal::{DQuat, DVec3, Form, Part, Pose, Primitive, Shape, Sides, SurfaceVertex};

/// Maximum number of triangles of a picture: the limit of the contract.
const MOST_TRIANGLES: usize = (1 << 20) - 1;
/// Radius of a drawn point and of a contact, m.
const POINT_M: f64 = 3.0e-4;
/// Length of the drawn normal, m.
const NORMAL_M: f64 = 4.0e-3;
/// Radius of the drawn normal, m; doubled while the proxy sticks.
const LINE_M: f64 = 1.0e-4;

/// Returns the triangles of a surface with its smooth normals; only every n-th triangle if there are more than the contract
/// permits.
#[allow(clippy::cast_possible_truncation)] // fewer than 2^20
pub(crate) fn body(surface: &Surface) -> Shape {
    let every = surface.count().div_ceil(MOST_TRIANGLES).max(1);
    let mut shape = Shape::default();
    let mut numbers = Numbers::new(surface.count());
    let drawn = &mut shape.surface;
    for patch in surface.patches().iter().step_by(every) {
        let mut triangle = [0; 3];
        for (corner, number) in triangle.iter_mut().enumerate() {
            let mut at = [0.0; 3];
            at[corner] = 1.0;
            let vertex = SurfaceVertex {
                position_m: patch.corners_m[corner].to_array(),
                normal: patch.normal(at).to_array(),
                value: 0.0,
            };
            let next = drawn.vertices.len() as u32;
            if drawn.vertices.len() + 1 >= MOST_TRIANGLES {
                return shape;
            }
            let hash = mix(&vertex.position_m.map(f64::to_bits));
            let same = |other: u32| {
                let other: &SurfaceVertex = &drawn.vertices[other as usize];
                let bent = DVec3::from_array(other.normal).dot(DVec3::from_array(vertex.normal));
                other.position_m == vertex.position_m && bent > 0.999
            };
            *number = numbers.find_or_insert(hash, next, same);
            if *number == next {
                drawn.vertices.push(vertex);
            }
        }
        drawn.triangles.push(triangle);
    }
    drawn.sides = if surface.has_borders() { Sides::Both } else { Sides::Outer };
    shape
}

/// Draws the tool and the contact.
pub(crate) fn tool(shape: &mut Shape, tool: Pose, radius_m: f64, proxy_m: Option<DVec3>, answer: &Answer) {
    shape.primitives.clear();
    shape.primitives.push(Primitive::sphere(Part::Tool, tool, radius_m.max(POINT_M)));
    let Some((point_m, normal)) = answer.contact else { return };
    let at = |position_m| Pose::new(position_m, DQuat::IDENTITY);
    shape.primitives.push(Primitive::sphere(Part::Tool, at(point_m), POINT_M));
    if let Some(proxy_m) = proxy_m {
        shape.primitives.push(Primitive::sphere(Part::Tool, at(proxy_m), radius_m.max(POINT_M)));
    }
    let thick_m = if answer.friction == Friction::Sticks { 2.0 * LINE_M } else { LINE_M };
    let turn = DQuat::from_rotation_arc(DVec3::Z, normal);
    let middle = Pose::new(point_m + normal * (0.5 * NORMAL_M), turn);
    shape.primitives.push(Primitive::new(
        Form::Cylinder,
        Part::Tool,
        middle,
        [thick_m, thick_m, 0.5 * NORMAL_M],
    ));
}
