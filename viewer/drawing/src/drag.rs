//! Dragging a point of the scene with a pointer: rays through the picture, and the plane in which the point moves.

use crate::camera::Camera;
use flotor_hal::DVec3;

/// Inclination above which a point is dragged in a horizontal plane, rad; below, a vertical plane is seen less obliquely.
const FROM_ABOVE_RAD: f64 = std::f64::consts::FRAC_PI_4;

/// Smallest angle between a ray and the plane, as a sine: nearer to grazing, a pixel would be many millimetres.
const LEAST_SINE: f64 = 0.02;

/// Half-line from the eye through a point of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Position of the eye, mm.
    pub origin_mm: DVec3,
    /// Unit vector away from the eye.
    pub direction: DVec3,
}

impl Ray {
    /// Casts the ray through a point of the picture, in fractions of width and height from the upper left: the inverse of
    /// [`Camera::on_screen`].
    #[must_use]
    pub fn through(camera: &Camera, [x, y]: [f64; 2], aspect: f64) -> Self {
        let origin_mm = camera.eye_mm();
        let ahead = (camera.target_mm - origin_mm).normalize();
        let (right, up) = camera.right_and_up();
        let half_height = 0.5 / camera.pixels_per_mm(1.0) / camera.distance_mm;
        let beside = right * ((2.0 * x - 1.0) * half_height * aspect) + up * ((1.0 - 2.0 * y) * half_height);
        Self { origin_mm, direction: (ahead + beside).normalize() }
    }
}

/// Plane in which a point is dragged: vertical, so that a pointer that moves down moves the point straight down, or horizontal in a
/// view from above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DragPlane {
    point_mm: DVec3,
    /// Unit normal of the plane, away from the eye.
    away: DVec3,
}

impl DragPlane {
    /// Returns the plane through a point (mm): vertical and across the view, or horizontal if the camera looks down steeply.
    #[must_use]
    pub fn facing(camera: &Camera, point_mm: DVec3) -> Self {
        let away = if camera.inclination_rad > FROM_ABOVE_RAD {
            -DVec3::Z
        } else {
            (camera.target_mm - camera.eye_mm()).with_z(0.0).normalize()
        };
        Self { point_mm, away }
    }

    /// Intersects the plane with a ray, mm; `None` for a ray that grazes the plane or leads away from it.
    #[must_use]
    pub fn hit_mm(&self, ray: &Ray) -> Option<DVec3> {
        let sine = ray.direction.dot(self.away);
        let distance_mm = (self.point_mm - ray.origin_mm).dot(self.away) / sine;
        (sine.abs() > LEAST_SINE && distance_mm > 0.0).then(|| ray.origin_mm + ray.direction * distance_mm)
    }

    /// Returns the displacement of a point when the pointer moves from one ray to another and by `depth_mm` away from the eye, mm.
    /// The displacement within the plane is zero if one of the rays misses the plane.
    #[must_use]
    pub fn moved_mm(&self, [from, to]: [&Ray; 2], depth_mm: f64) -> DVec3 {
        let along = self.hit_mm(from).zip(self.hit_mm(to)).map_or(DVec3::ZERO, |(from, to)| to - from);
        along + self.away * depth_mm
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ASPECT: f64 = 1.6;

    fn cameras() -> [Camera; 3] {
        let first = Camera::experimenter(25.0);
        [first, Camera { azimuth_rad: -2.1, ..first }, Camera { inclination_rad: 1.4, ..first }]
    }

    #[test]
    fn a_ray_goes_through_the_points_that_appear_at_its_place() {
        for camera in cameras() {
            for point_mm in [DVec3::ZERO, DVec3::new(3.0, -2.0, 5.0), DVec3::new(-8.0, 9.0, -20.0)] {
                let place = camera.on_screen(point_mm, ASPECT).expect("in front of the eye");
                let ray = Ray::through(&camera, place, ASPECT);
                let off_mm = (point_mm - ray.origin_mm).cross(ray.direction).length();
                assert!(off_mm < 1.0e-9, "{point_mm}: {off_mm} mm beside it");
            }
        }
    }

    /// A point that is dragged stays under the pointer.
    #[test]
    fn a_dragged_point_appears_where_the_pointer_is() {
        for camera in cameras() {
            let point_mm = DVec3::new(2.0, 1.0, -3.0);
            let plane = DragPlane::facing(&camera, point_mm);
            let from = camera.on_screen(point_mm, ASPECT).expect("in front of the eye");
            let to = [from[0] + 0.07, from[1] - 0.11];
            let [from, ray] = [from, to].map(|place| Ray::through(&camera, place, ASPECT));
            let moved_mm = point_mm + plane.moved_mm([&from, &ray], 0.0);
            let [x, y] = camera.on_screen(moved_mm, ASPECT).expect("in front of the eye");
            assert!((x - to[0]).abs() < 1.0e-12 && (y - to[1]).abs() < 1.0e-12, "{x} {y}");
        }
    }

    #[test]
    fn a_pointer_that_goes_down_moves_the_point_down_and_the_wheel_moves_it_away() {
        let [side, _, above] = cameras();
        let straight = |camera: &Camera| {
            let plane = DragPlane::facing(camera, DVec3::ZERO);
            let [from, to] = [[0.5, 0.4], [0.5, 0.5]].map(|place| Ray::through(camera, place, ASPECT));
            (plane.moved_mm([&from, &to], 0.0), plane.moved_mm([&from, &from], 1.0))
        };
        let (down, away) = straight(&side);
        assert!(down.z < 0.0 && down.truncate().length() < 1.0e-12 * down.z.abs().max(1.0), "{down}");
        assert!(away.z == 0.0 && (away.length() - 1.0).abs() < 1.0e-12, "{away}");
        assert!(away.dot(side.target_mm - side.eye_mm()) > 0.0, "away from the eye");
        let (nearer, deeper) = straight(&above);
        assert!(nearer.z.abs() < 1.0e-12 && nearer.length() > 0.1, "{nearer}");
        assert_eq!(deeper, -DVec3::Z);
    }

    #[test]
    fn a_ray_that_misses_the_plane_moves_nothing() {
        let camera = Camera { inclination_rad: 0.0, ..Camera::experimenter(25.0) };
        let plane = DragPlane { point_mm: camera.target_mm, away: -DVec3::Z };
        let [at, grazing] = [[0.5, 0.9], [0.5, 0.5]].map(|place| Ray::through(&camera, place, ASPECT));
        assert_eq!(plane.hit_mm(&grazing), None);
        assert_eq!(plane.moved_mm([&at, &grazing], 0.0), DVec3::ZERO);
    }
}
