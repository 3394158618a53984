//! Camera of the 3D view: an orbit around a target point, z up.

use flotor_hal::DVec3;
use flotor_hal::glam::dcamera::rh::proj::directx::perspective;
use flotor_hal::glam::dcamera::rh::view::look_at_mat4;
use flotor_hal::glam::{DMat4, DVec4};

/// Orbit camera: an eye on a sphere around its target.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Camera {
    /// Rotation about the vertical, rad; 0 looks along +y, away from the user; positive: the eye is further right (+x).
    pub azimuth_rad: f64,
    /// Elevation of the eye above the target, rad.
    pub inclination_rad: f64,
    /// Distance of the eye from the target, mm.
    pub distance_mm: f64,
    /// Position of the target, which is in the middle of the picture, mm.
    pub target_mm: DVec3,
}

/// Size of a row of bodies side by side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Height of the tallest body, mm.
    pub height_mm: f64,
    /// Distance from the first body to the last, mm; 0 for one body.
    pub width_mm: f64,
}

/// Direction and zoom of a view, parsed from `AZIMUTH,INCLINATION` or `AZIMUTH,INCLINATION,ZOOM` with angles in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    azimuth_rad: f64,
    inclination_rad: f64,
    zoom: f64,
}

impl std::str::FromStr for View {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "`{text}` is not a view; write AZIMUTH,INCLINATION or AZIMUTH,INCLINATION,ZOOM, such as 30,15 or \
                 30,15,2: degrees to \
                 the right, -360 to 360, and above the horizon, -2 to 88, and a zoom, 0.2 to 3"
            )
        };
        let numbers = text.split(',').map(|part| part.trim().parse::<f64>().map_err(|_| wrong()));
        let numbers = numbers.collect::<Result<Vec<f64>, String>>()?;
        let (azimuth, inclination, zoom) = match numbers.as_slice() {
            [azimuth, inclination] => (*azimuth, *inclination, 1.0),
            [azimuth, inclination, zoom] => (*azimuth, *inclination, *zoom),
            _ => return Err(wrong()),
        };
        let is_legal = (-360.0..=360.0).contains(&azimuth)
            && (-2.0..=88.0).contains(&inclination)
            && (0.2..=3.0).contains(&zoom);
        let (azimuth_rad, inclination_rad) = (azimuth.to_radians(), inclination.to_radians());
        if is_legal { Ok(Self { azimuth_rad, inclination_rad, zoom }) } else { Err(wrong()) }
    }
}

/// Vertical field of view, rad: that of a 70 mm lens on a full frame, for a moderate perspective.
const FIELD_OF_VIEW_RAD: f64 = 0.34;
/// Half the width of a body with its plates, as a fraction of its height.
const HALF_BODY: f64 = 0.35;
/// Legal inclinations, rad: a little below the ground to straight above.
const INCLINATION_RAD: std::ops::RangeInclusive<f64> = -0.05..=1.55;
/// Nearest and farthest distance of the eye, as multiples of the height of the bodies.
const NEAREST: f64 = 1.5;
const FARTHEST: f64 = 30.0;

impl Camera {
    /// Returns the default view: from the front, right and above, with a whole body of this height visible.
    pub fn experimenter(height_mm: f64) -> Self {
        Self {
            azimuth_rad: 0.55,
            inclination_rad: 0.24,
            distance_mm: 4.6 * height_mm,
            target_mm: DVec3::new(0.0, 0.0, -0.40 * height_mm),
        }
    }

    /// Returns the default view of bodies side by side, from so far away that all of them fit into a picture of this aspect ratio
    /// (width over height).
    pub fn fitting(extent: Extent, aspect: f64) -> Self {
        /// Fraction of half the picture filled by the bodies.
        const FILLED: f64 = 0.92;
        let mut camera = Self::experimenter(extent.height_mm);
        let half_mm = 0.5 * extent.width_mm;
        // The body at the right is nearer than the target.
        let nearer_mm = half_mm * camera.azimuth_rad.sin();
        let beside_mm = half_mm * camera.azimuth_rad.cos() + HALF_BODY * extent.height_mm;
        let seen = (0.5 * FIELD_OF_VIEW_RAD).tan() * FILLED * aspect.max(1.0e-3);
        camera.distance_mm = camera.distance_mm.max(nearer_mm + beside_mm / seen);
        camera
    }

    /// Returns the requested view of bodies in a picture of this aspect ratio, or the default view without a request.
    pub fn of(view: Option<View>, extent: Extent, aspect: f64) -> Self {
        let mut camera = Self::fitting(extent, aspect);
        if let Some(View { azimuth_rad, inclination_rad, zoom }) = view {
            (camera.azimuth_rad, camera.inclination_rad) = (azimuth_rad, inclination_rad);
            camera.zoom(zoom, extent.height_mm);
        }
        camera
    }

    /// Returns the position of the eye, mm.
    #[must_use]
    pub fn eye_mm(&self) -> DVec3 {
        let (sine, cosine) = self.inclination_rad.sin_cos();
        let out = DVec3::new(cosine * self.azimuth_rad.sin(), -cosine * self.azimuth_rad.cos(), sine);
        self.target_mm + out * self.distance_mm
    }

    /// Turns the eye about the target by two angles, rad, within the legal inclinations.
    pub fn orbit(&mut self, azimuth_rad: f64, inclination_rad: f64) {
        self.azimuth_rad = (self.azimuth_rad + azimuth_rad) % std::f64::consts::TAU;
        let inclined = self.inclination_rad + inclination_rad;
        self.inclination_rad = inclined.clamp(*INCLINATION_RAD.start(), *INCLINATION_RAD.end());
    }

    /// Divides the distance by a factor (above 1: nearer), within the limits for a body of this height.
    pub fn zoom(&mut self, factor: f64, height_mm: f64) {
        let distance_mm = self.distance_mm / factor.max(f64::MIN_POSITIVE);
        self.distance_mm = distance_mm.clamp(NEAREST * height_mm, FARTHEST * height_mm);
    }

    /// Returns the view-projection matrix from mm to clip coordinates with depth 0 to 1, for a picture of this aspect ratio.
    #[must_use]
    pub fn projection(&self, aspect: f64) -> DMat4 {
        let (near_mm, far_mm) = (0.05 * self.distance_mm, 20.0 * self.distance_mm);
        perspective(FIELD_OF_VIEW_RAD, aspect.max(1.0e-3), near_mm, far_mm)
            * look_at_mat4(self.eye_mm(), self.target_mm, DVec3::Z)
    }

    /// Projects a point (mm) into the picture: fractions of width and height from the upper left; `None` behind the eye.
    #[must_use]
    pub fn on_screen(&self, point_mm: DVec3, aspect: f64) -> Option<[f64; 2]> {
        let DVec4 { x, y, w, .. } = self.projection(aspect) * point_mm.extend(1.0);
        (w > 0.0).then(|| [0.5 + 0.5 * x / w, 0.5 - 0.5 * y / w])
    }

    /// Returns the unit vectors to the right and upwards in the picture.
    #[must_use]
    pub fn right_and_up(&self) -> (DVec3, DVec3) {
        let ahead = (self.target_mm - self.eye_mm()).normalize();
        let right = ahead.cross(DVec3::Z).normalize();
        (right, right.cross(ahead))
    }

    /// Returns the pixels per millimetre at the target, for a picture of this height in pixels.
    #[must_use]
    pub fn pixels_per_mm(&self, height_px: f64) -> f64 {
        0.5 * height_px / (self.distance_mm * (0.5 * FIELD_OF_VIEW_RAD).tan())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_point_looked_at_is_in_the_middle_and_up_is_up() {
        let camera = Camera::experimenter(25.0);
        let [x, y] = camera.on_screen(camera.target_mm, 1.6).unwrap();
        assert!((x - 0.5).abs() < 1.0e-12 && (y - 0.5).abs() < 1.0e-12);
        let [_, above] = camera.on_screen(camera.target_mm + DVec3::Z, 1.6).unwrap();
        assert!(above < 0.5);
        let [right, _] =
            Camera { azimuth_rad: 0.0, ..camera }.on_screen(camera.target_mm + DVec3::X, 1.6).unwrap();
        assert!(right > 0.5, "seen from the user, x is to the right");
    }

    /// The bodies fill the picture from 60 % of its width or 90 % of the usual height on, and are inside.
    #[test]
    fn bodies_side_by_side_are_in_a_picture_of_any_shape_and_fill_it() {
        for (bodies, aspect) in
            [(1.0, 0.4), (1.0, 3.0), (2.0, 1.0), (3.0, 0.6), (3.0, 2.0), (4.0, 1.5), (4.0, 4.0)]
        {
            let extent = Extent { height_mm: 25.0, width_mm: 27.5 * (bodies - 1.0) };
            let camera = Camera::fitting(extent, aspect);
            let on_screen =
                |x: f64| camera.on_screen(DVec3::new(x, 0.0, -10.0), aspect).expect("before the eye");
            let half_mm = 0.5 * extent.width_mm + HALF_BODY * extent.height_mm;
            let [left, right] = [-1.0, 1.0].map(|side| on_screen(side * half_mm)[0]);
            assert!(left > 0.0 && right < 1.0, "{bodies} bodies at {aspect}: {left} to {right}");
            let is_near = camera.distance_mm < 1.1 * Camera::experimenter(25.0).distance_mm;
            assert!(is_near || right - left > 0.6, "{bodies} bodies at {aspect}: {left} to {right}");
        }
    }

    #[test]
    fn a_millimetre_has_the_size_it_says() {
        let camera = Camera { inclination_rad: 0.0, ..Camera::experimenter(25.0) };
        let [_, y] = camera.on_screen(camera.target_mm + DVec3::Z * 1.0e-3, 1.6).unwrap();
        assert!(((0.5 - y) * 600.0 * 1.0e3 / camera.pixels_per_mm(600.0) - 1.0).abs() < 1.0e-6);
    }

    #[test]
    fn orbit_and_zoom_stay_within_sense() {
        let mut camera = Camera::experimenter(25.0);
        camera.orbit(100.0, 100.0);
        camera.zoom(1.0e9, 25.0);
        assert_eq!((camera.inclination_rad, camera.distance_mm), (1.55, 37.5));
        camera.orbit(0.0, -100.0);
        camera.zoom(0.0, 25.0);
        assert_eq!((camera.inclination_rad, camera.distance_mm), (-0.05, 750.0));
    }

    #[test]
    fn a_view_is_read_in_degrees_and_what_is_none_is_refused() {
        let of_one = Extent { height_mm: 25.0, width_mm: 0.0 };
        let camera = Camera::of(Some("90,30,2".parse().expect("a view")), of_one, 1.6);
        let eye = camera.eye_mm() - camera.target_mm;
        assert!(eye.x > 0.0 && eye.y.abs() < 1.0e-9 * eye.x, "from the right: {eye}");
        assert!((eye.z / eye.length() - 0.5).abs() < 1.0e-12, "30 degrees above the horizon");
        assert!((camera.distance_mm - 0.5 * Camera::experimenter(25.0).distance_mm).abs() < 1.0e-9);
        assert_eq!(Camera::of(None, of_one, 1.6), Camera::experimenter(25.0));
        for wrong in ["", "30", "30,95", "a,b", "30,15,9", "1,2,1,1", "NaN,0"] {
            assert!(wrong.parse::<View>().is_err(), "{wrong}");
        }
    }
}
