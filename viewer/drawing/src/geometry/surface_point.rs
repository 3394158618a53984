//! Search for the point of a primitive's surface that is closest to a point of the scene, with its normal.

use super::Frame;
use flotor_hal::{DVec3, Form, Primitive};

/// Closest point of a surface to a query point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Position, m.
    pub position_m: DVec3,
    /// Unit vector out of the body.
    pub normal: DVec3,
    /// Depth of the query point inside the body, m; negative outside.
    pub depth_m: f64,
}

/// Returns the point of a primitive's surface that is closest to a point, m. A plane is infinite here, as in a model. `None` for
/// forms of a later contract, at the centre of a ball and on the axis of a cylinder, where many points of the surface are equally
/// close.
#[must_use]
pub fn closest_surface_point(primitive: &Primitive, to_m: DVec3) -> Option<SurfacePoint> {
    let frame = Frame::at(&primitive.pose());
    let from_centre_m = to_m - frame.origin_m;
    let local_m =
        DVec3::new(from_centre_m.dot(frame.x), from_centre_m.dot(frame.y), from_centre_m.dot(frame.z));
    let half_m = DVec3::from_array(primitive.half_sides_m());
    let (position_m, normal, depth_m) = match primitive.form()? {
        Form::Plane => (local_m.with_z(0.0), DVec3::Z, -local_m.z),
        Form::Sphere => {
            let normal = local_m.try_normalize()?;
            (normal * half_m.x, normal, half_m.x - local_m.length())
        }
        Form::Box => closest_of_box(half_m, local_m)?,
        Form::Cylinder => {
            // In the plane through the axis and the point, a cylinder is a rectangle.
            let radial = local_m.with_z(0.0).try_normalize()?;
            let in_plane_m = DVec3::new(local_m.dot(radial), 0.0, local_m.z);
            let (position_m, normal, depth_m) = closest_of_box(half_m.with_y(f64::INFINITY), in_plane_m)?;
            let turned = |vector: DVec3| radial * vector.x + DVec3::Z * vector.z;
            (turned(position_m), turned(normal), depth_m)
        }
    };
    let turned = |vector: DVec3| frame.x * vector.x + frame.y * vector.y + frame.z * vector.z;
    Some(SurfacePoint { position_m: frame.origin_m + turned(position_m), normal: turned(normal), depth_m })
}

/// Returns position, normal and depth of the surface point of a box about the origin that is closest to `local_m`; for a point
/// inside, the closest point of the nearest face.
fn closest_of_box(half_m: DVec3, local_m: DVec3) -> Option<(DVec3, DVec3, f64)> {
    let outside_m = local_m - local_m.clamp(-half_m, half_m);
    if let Some(normal) = outside_m.try_normalize() {
        return Some((local_m - outside_m, normal, -outside_m.length()));
    }
    let depths_m = half_m - local_m.abs();
    let by_depth = (0..3).map(|axis| (axis, depths_m[axis]));
    let (axis, depth_m) = by_depth.min_by(|(_, one), (_, other)| one.total_cmp(other))?;
    let mut normal = DVec3::ZERO;
    normal[axis] = 1.0_f64.copysign(local_m[axis]);
    Some((local_m + normal * depth_m, normal, depth_m))
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::glam::DQuat;
    use flotor_hal::{Part, Pose};

    /// Forms of a known surface, turned and moved.
    fn turned() -> (Pose, [Primitive; 4]) {
        let turn = DQuat::from_rotation_y(0.4) * DQuat::from_rotation_x(-0.9);
        let pose = Pose::new(DVec3::new(0.01, -0.02, 0.003), turn);
        let forms = [
            (Form::Plane, [0.03, 0.03, 0.0]),
            (Form::Sphere, [0.01; 3]),
            (Form::Box, [0.01, 0.006, 0.004]),
            (Form::Cylinder, [0.01, 0.01, 0.004]),
        ];
        (pose, forms.map(|(form, half_sides_m)| Primitive::new(form, Part::Body, pose, half_sides_m)))
    }

    /// Coordinates of tens of millimetres have rounding errors far below a picometre.
    #[test]
    fn the_surface_lies_at_the_depth_along_the_normal() {
        let (pose, primitives) = turned();
        for primitive in primitives {
            for local_m in
                [[0.001, -0.002, -0.003], [0.004, 0.005, 0.001], [0.02, 0.01, 0.03], [-0.02, 0.001, 0.002]]
            {
                let point_m = pose.position() + pose.orientation() * DVec3::from_array(local_m);
                let found = closest_surface_point(&primitive, point_m).expect("a known form");
                let case = format!("{:?} {local_m:?}: {found:?}", primitive.form());
                assert!((found.normal.length() - 1.0).abs() < 1.0e-12, "{case}");
                assert!(
                    (point_m + found.normal * found.depth_m - found.position_m).length() < 1.0e-12,
                    "{case}"
                );
                let there = closest_surface_point(&primitive, found.position_m).expect("a known form");
                assert!(there.depth_m.abs() < 1.0e-12, "{case}");
            }
        }
    }

    #[test]
    fn inside_a_box_the_nearest_face_counts_and_outside_an_edge_does() {
        let primitive = Primitive::new(Form::Box, Part::Body, Pose::HOME, [0.01, 0.01, 0.004]);
        let inside = closest_surface_point(&primitive, DVec3::new(0.001, 0.0, -0.003)).expect("a box");
        assert_eq!((inside.normal, inside.position_m.z), (-DVec3::Z, -0.004));
        assert!((inside.depth_m - 0.001).abs() < 1.0e-15);
        let edge = closest_surface_point(&primitive, DVec3::new(0.013, 0.0, 0.008)).expect("a box");
        assert!((edge.normal - DVec3::new(0.6, 0.0, 0.8)).length() < 1.0e-12);
        assert!((edge.depth_m + 0.005).abs() < 1.0e-12);
    }

    #[test]
    fn inside_a_cylinder_the_shell_or_an_end_counts_and_outside_the_rim_does() {
        let primitive = Primitive::new(Form::Cylinder, Part::Body, Pose::HOME, [0.01, 0.01, 0.004]);
        let at = |point_m| closest_surface_point(&primitive, point_m).expect("off the axis");
        let out = DVec3::new(0.6, 0.8, 0.0);
        let (shell, end, rim) =
            (at(out * 0.009), at(out * 0.002 - DVec3::Z * 0.003), at(out * 0.013 + DVec3::Z * 0.008));
        assert!(
            (shell.normal - out).length() < 1.0e-12 && (shell.depth_m - 0.001).abs() < 1.0e-15,
            "{shell:?}"
        );
        assert!(
            (end.normal + DVec3::Z).length() < 1.0e-12 && (end.depth_m - 0.001).abs() < 1.0e-15,
            "{end:?}"
        );
        assert!((rim.normal - (out * 0.6 + DVec3::Z * 0.8)).length() < 1.0e-12, "{rim:?}");
        assert!((rim.depth_m + 0.005).abs() < 1.0e-12, "{rim:?}");
    }

    #[test]
    fn the_axis_of_a_cylinder_and_the_middle_of_a_ball_have_none() {
        let of = |form| Primitive::new(form, Part::Body, Pose::HOME, [0.01; 3]);
        assert_eq!(
            [Form::Cylinder, Form::Sphere].map(|form| closest_surface_point(&of(form), DVec3::ZERO)),
            [None; 2]
        );
    }
}
