//! Contact of a handle with the bodies of a model, and its mark: a disc at the point of contact and an arrow along the normal.

use crate::geometry::{Color, Mesh, Section, SurfacePoint, closest_surface_point, force_arrow, plate};
use flotor_hal::glam::DQuat;
use flotor_hal::{DVec3, Part, Shape};

/// Radius and thickness of the disc, and radius and length of the arrow, as fractions of the height of the scene: the disc is wide
/// enough to be visible around the force arrow and a proxy.
const DISC: f64 = 0.09;
const THICKNESS: f64 = 0.004;
const SHAFT: f64 = 0.009;
const LENGTH: f64 = 0.3;

/// Tolerance for a tool on the surface, m: far above rounding, far below any visible distance.
const ON_SURFACE_M: f64 = 1.0e-9;

/// Returns the contact of a handle inside a primitive body, with the depth of the handle; inside several bodies, the deepest
/// contact; `None` outside of all bodies.
///
/// The point of contact is the proxy, if the model draws a proxy on the surface: with friction the proxy lags behind the handle,
/// and at a box the proxy is on the face through which the handle entered. Without a proxy, the point of contact is the closest
/// point of the surface.
#[must_use]
pub fn contact(shape: &Shape, handle_m: DVec3) -> Option<SurfacePoint> {
    let bodies = shape.primitives.iter().filter(|primitive| primitive.part() == Part::Body);
    let inside = bodies.filter_map(|body| Some((body, closest_surface_point(body, handle_m)?)));
    let inside = inside.filter(|(_, closest)| closest.depth_m > 0.0);
    let (body, closest) = inside.max_by(|(_, one), (_, other)| one.depth_m.total_cmp(&other.depth_m))?;
    let tools = shape.primitives.iter().filter(|primitive| primitive.part() == Part::Tool);
    let mut on_surface = tools
        .filter_map(|tool| closest_surface_point(body, tool.pose().position()))
        .filter(|point| point.depth_m.abs() <= ON_SURFACE_M);
    let depth_m = |proxy: &SurfacePoint| (proxy.position_m - handle_m).dot(proxy.normal);
    Some(on_surface.next().map_or(closest, |proxy| SurfacePoint { depth_m: depth_m(&proxy), ..proxy }))
}

/// Adds the mark of a contact to a scene of this height, m.
pub fn append_contact(mesh: &mut Mesh, contact: &SurfacePoint, height_m: f64, color: Color) {
    let orientation = DQuat::from_rotation_arc(DVec3::Z, contact.normal);
    let section = Section { center_m: contact.position_m, orientation };
    plate(mesh, &section, DISC * height_m, THICKNESS * height_m, 1.0, color);
    let along_m = contact.normal * (LENGTH * height_m);
    force_arrow(mesh, contact.position_m, along_m, SHAFT * height_m, color);
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::{Form, Pose, Primitive};

    fn shape(primitives: Vec<Primitive>) -> Shape {
        Shape { primitives, ..Shape::default() }
    }

    fn tool(at_m: DVec3) -> Primitive {
        Primitive::sphere(Part::Tool, Pose::new(at_m, DQuat::IDENTITY), 0.0015)
    }

    #[test]
    fn a_handle_touches_the_body_in_which_it_is_deepest_and_none_from_outside() {
        let ball = |x_m: f64| Primitive::sphere(Part::Body, Pose::new(DVec3::X * x_m, DQuat::IDENTITY), 0.01);
        let handle_m = DVec3::X * 0.009;
        let solid = shape(vec![ball(0.0), ball(0.008), tool(handle_m)]);
        let found = contact(&solid, handle_m).expect("it is in both");
        assert!((found.depth_m - 0.009).abs() < 1.0e-12 && found.normal == DVec3::X, "{found:?}");
        assert_eq!(contact(&solid, DVec3::Z * 0.02), None);
    }

    #[test]
    fn the_proxy_of_a_model_is_the_point_of_contact() {
        let plane = Primitive::new(Form::Plane, Part::Body, Pose::HOME, [0.03, 0.03, 0.0]);
        let (handle_m, proxy_m) = (DVec3::new(0.002, 0.0, -0.001), DVec3::new(0.0005, 0.0, 0.0));
        let found = contact(&shape(vec![plane, tool(handle_m), tool(proxy_m)]), handle_m).expect("inside");
        assert_eq!((found.position_m, found.normal), (proxy_m, DVec3::Z));
        assert!((found.depth_m - 0.001).abs() < 1.0e-15, "{found:?}");
        // Through the upper face of a cube, and by now nearer to a side.
        let cube = Primitive::new(Form::Box, Part::Body, Pose::HOME, [0.01; 3]);
        let (handle_m, proxy_m) = (DVec3::new(0.009, 0.0, 0.005), DVec3::new(0.009, 0.0, 0.01));
        let found = contact(&shape(vec![cube, tool(handle_m), tool(proxy_m)]), handle_m).expect("inside");
        assert_eq!(found.normal, DVec3::Z);
        assert!((found.depth_m - 0.005).abs() < 1.0e-15, "{found:?}");
    }

    #[test]
    fn the_arrow_of_the_normal_ends_outside_the_body() {
        let plane = Primitive::new(Form::Plane, Part::Body, Pose::HOME, [0.03, 0.03, 0.0]);
        let found = contact(&shape(vec![plane]), DVec3::new(0.002, 0.0, -0.001)).expect("inside");
        let mut mesh = Mesh::default();
        append_contact(&mut mesh, &found, 0.02, [255; 4]);
        let highest_mm = mesh.vertices.iter().map(|vertex| vertex.position_mm[2]).fold(f32::MIN, f32::max);
        assert!((highest_mm - 6.0).abs() < 1.0e-4, "{highest_mm} mm of 0.3 times 20 mm");
    }
}
