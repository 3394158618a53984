//! Diodes, lenses and cells: six spot coordinates of a pose, and the inverse.
//!
//! The published descriptions mention three diodes, three lateral-effect cells and an iterative solution, without
//! dimensions. This layout is synthetic: the diodes stand on a circle of 60 mm radius about the origin of the flotor frame,
//! each opposite a lens 90 mm farther out that looks inwards along the radius and images the diode on a cell 30 mm behind.
//! A diode at `q` (device frame) in front of a lens with radius `e`, tangent `t` and depth `D = L - q e` makes a spot at
//!
//! ```text
//! u = f (q t) / D,      v = f (q z) / D
//! ```
//!
//! **Inverse**: Gauss-Newton, with the last pose as initial guess. A small motion (`dx`, rotation `dr` in the device
//! frame) moves a diode by `dx + dr x (R p)`; the six linearised equations are solved repeatedly. As long as each step
//! is much shorter than the previous step, the Jacobian of an earlier iteration is reused: from one tick to the next
//! the flotor moves so little that one Jacobian serves all iterations. After a step of length `s` that follows a step
//! of length `r`, the error is about `s s / r`, the criterion of convergence. The iteration fails after a fixed number
//! of rounds, or outside a fixed region.

use crate::hand::Pose;
use crate::validation::{Domain, InvalidParameter, number};
use flotor_hal::glam::{DMat3, DQuat, DVec3};
use flotor_hal::math;
use std::f64::consts::PI;

/// Largest number of iterations: from home six suffice for every pose within the range of the cells.
const MAX_ROUNDS: usize = 12;

/// Error of the pose at convergence, m and rad alike.
const LEFT: f64 = 3.0e-11;

/// Assumed length of the step before the first step (m and rad alike): the size of the layout.
const LAYOUT_SIZE: f64 = 60.0e-3;

/// Largest ratio of successive steps for which the Jacobian is reused.
const SHRINKAGE: f64 = 0.02;

/// Radius of the region of poses, m: twice the range of motion.
const REGION_M: f64 = 24.0e-3;

/// Largest rotation of the region of poses, as the sine of half the angle (20 degrees).
const REGION_SIN_HALF: f64 = 0.174;

/// Layout of diodes, lenses and cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpticsGeometry {
    /// Azimuths of the diodes in the flotor frame, rad.
    pub diode_azimuths_rad: [f64; 3],
    /// Radius of the circle of the diodes, m.
    pub diode_radius_m: f64,
    /// Radius of the circle of the lenses, m.
    pub lens_radius_m: f64,
    /// Distance from a lens to its cell, m.
    pub image_distance_m: f64,
    /// Half the width of a cell, m.
    pub cell_half_width_m: f64,
}

impl OpticsGeometry {
    /// Synthetic layout described in the module documentation. Cells of 18 mm cover every pose of ±12 mm and ±8 degrees.
    pub const MAGLEV: Self = Self {
        diode_azimuths_rad: [0.0, 2.0 * PI / 3.0, 4.0 * PI / 3.0],
        diode_radius_m: 60.0e-3,
        lens_radius_m: 150.0e-3,
        image_distance_m: 30.0e-3,
        cell_half_width_m: 9.0e-3,
    };
}

/// Coordinates of the light spots relative to the centres of their cells, m: one component of each vector per diode.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spots {
    /// Tangential coordinates, `u`.
    pub across_m: DVec3,
    /// Vertical coordinates, `v`, positive for a diode above its lens.
    pub up_m: DVec3,
}

flotor_hal::restorable!(Spots { across_m, up_m });

/// A diode with its lens.
#[derive(Clone, Copy, Debug)]
struct Eye {
    /// Position of the diode in the flotor frame, m.
    diode: DVec3,
    /// Unit vectors outwards and along the parallel; device frame.
    radius: DVec3,
    tangent: DVec3,
}

/// The three diodes with their lenses.
#[derive(Clone, Copy, Debug)]
pub struct Optics {
    geometry: OpticsGeometry,
    eyes: [Eye; 3],
}

impl Optics {
    /// Computes positions and directions of diodes and lenses. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// If a length is not positive, the gap between diodes and lenses is not above 24 mm, an azimuth is not finite, or the diodes
    /// stand in a line: the rotation about that line would be unobservable.
    pub fn new(geometry: &OpticsGeometry) -> Result<Self, InvalidParameter> {
        number("led_radius_mm", geometry.diode_radius_m, Domain::Positive)?;
        let gap_m = geometry.lens_radius_m - geometry.diode_radius_m - REGION_M;
        number("gap between LED and lens, m", gap_m, Domain::Positive)?;
        number("image_distance_m", geometry.image_distance_m, Domain::Positive)?;
        number("cell_half_width_m", geometry.cell_half_width_m, Domain::Positive)?;
        for azimuth in geometry.diode_azimuths_rad {
            number("led_2_deg and led_3_deg", azimuth, Domain::Finite)?;
        }
        let eyes = geometry.diode_azimuths_rad.map(|azimuth| {
            let (sin, cos) = math::sin_cos(azimuth);
            let radius = DVec3::new(cos, sin, 0.0);
            Eye { diode: radius * geometry.diode_radius_m, radius, tangent: DVec3::new(-sin, cos, 0.0) }
        });
        let optics = Self { geometry: *geometry, eyes };
        optics.equations(&Pose::HOME).map(|_| optics).ok_or(InvalidParameter::DiodesInALine)
    }

    /// Returns the light spots of a pose; `None` if a spot is outside its cell, or the position is more than 24 mm from
    /// home. Real-time: bounded, no allocation.
    #[must_use]
    pub fn spots(&self, pose: &Pose) -> Option<Spots> {
        let spots = self.images(pose);
        let largest_m = spots.across_m.abs().max(spots.up_m.abs()).max_element();
        let finite = spots.across_m.is_finite() && spots.up_m.is_finite();
        // A diode behind its lens would also give a spot, upside down.
        let in_front = pose.position_m.length_squared() <= REGION_M * REGION_M;
        (finite && in_front && largest_m <= self.geometry.cell_half_width_m).then_some(spots)
    }

    /// Returns the spots with the radial distortion of the cells: outwards by `edge` (a fraction of the half width) at
    /// the edge.
    ///
    /// Real-time: bounded, no allocation.
    #[must_use]
    pub fn bent(&self, spots: &Spots, edge: f64) -> Spots {
        let half_m = self.geometry.cell_half_width_m;
        // Radial distortion of third order: r (1 + edge (r / half width)²).
        let square = spots.across_m * spots.across_m + spots.up_m * spots.up_m;
        let factor = 1.0 + square * (edge / (half_m * half_m));
        Spots { across_m: spots.across_m * factor, up_m: spots.up_m * factor }
    }

    /// Returns the ratio of spot to diode displacement at home (pure number). Real-time: bounded, no allocation.
    #[must_use]
    pub fn magnification(&self) -> f64 {
        self.geometry.image_distance_m / (self.geometry.lens_radius_m - self.geometry.diode_radius_m)
    }

    /// Solves for the pose with these spots (m) by iteration from the initial guess `near`; `None` without convergence,
    /// or more than 24 mm or 20 degrees from home.
    ///
    /// Real-time: bounded, no allocation.
    #[must_use]
    pub fn find(&self, spots: &Spots, near: &Pose) -> Option<Pose> {
        let mut pose = *near;
        let mut previous = LAYOUT_SIZE;
        let mut known = None;
        for _ in 0..MAX_ROUNDS {
            let images = self.images(&pose);
            let equations = match known {
                Some(equations) => equations,
                None => self.equations(&pose)?,
            };
            let missing =
                Spots { across_m: spots.across_m - images.across_m, up_m: spots.up_m - images.up_m };
            let step = move_by(&mut pose, equations.motion(&missing));
            // Written so that NaN leaves the region.
            let inside = pose.position_m.length_squared() <= REGION_M * REGION_M
                && pose.orientation.xyz().length_squared() <= REGION_SIN_HALF * REGION_SIN_HALF;
            if !inside {
                return None;
            }
            if step * step <= LEFT * previous {
                return Some(pose);
            }
            known = (step <= SHRINKAGE * previous).then_some(equations);
            previous = step;
        }
        None
    }

    /// Returns the spots of a pose without the limits of the cells.
    #[inline]
    fn images(&self, pose: &Pose) -> Spots {
        let attitude = DMat3::from_quat(pose.orientation);
        let [first, second, third] = &self.eyes;
        let first = self.image(first, pose.position_m, &attitude);
        let second = self.image(second, pose.position_m, &attitude);
        let third = self.image(third, pose.position_m, &attitude);
        Spots {
            across_m: DVec3::new(first.0, second.0, third.0),
            up_m: DVec3::new(first.1, second.1, third.1),
        }
    }

    /// Returns the spot of one lens: across and up, m.
    #[inline]
    fn image(&self, eye: &Eye, position_m: DVec3, attitude: &DMat3) -> (f64, f64) {
        let at = position_m + *attitude * eye.diode;
        let scale = self.scale(eye, at);
        (scale * at.dot(eye.tangent), scale * at.z)
    }

    /// Returns the ratio of image to object size for a diode at `at`.
    #[inline]
    fn scale(&self, eye: &Eye, at: DVec3) -> f64 {
        self.geometry.image_distance_m / (self.geometry.lens_radius_m - at.dot(eye.radius))
    }

    /// Returns the factorised Jacobian of the spots at a pose; `None` if the spots do not determine the motion.
    #[inline]
    fn equations(&self, pose: &Pose) -> Option<Equations> {
        let attitude = DMat3::from_quat(pose.orientation);
        let [first, second, third] = &self.eyes;
        let (u1, v1) = self.rows(first, pose.position_m, &attitude);
        let (u2, v2) = self.rows(second, pose.position_m, &attitude);
        let (u3, v3) = self.rows(third, pose.position_m, &attitude);
        let matrix = |a, b, c| DMat3::from_cols(a, b, c).transpose();
        let size = math::powi(self.magnification(), 3) * self.geometry.diode_radius_m;
        Equations::new(
            [matrix(u1.0, u2.0, u3.0), matrix(u1.1, u2.1, u3.1)],
            [matrix(v1.0, v2.0, v3.0), matrix(v1.1, v2.1, v3.1)],
            [size, size * self.geometry.diode_radius_m],
        )
    }

    /// Returns the rows of the Jacobian for the spot of one diode: the tangential and the vertical coordinate.
    #[inline]
    fn rows(&self, eye: &Eye, position_m: DVec3, attitude: &DMat3) -> (Row, Row) {
        let arm = *attitude * eye.diode;
        let at = position_m + arm;
        let scale = self.scale(eye, at);
        let per_image_m = 1.0 / self.geometry.image_distance_m;
        let row = |direction: DVec3| {
            // d(f q t / D) = f (t + (q t / D) e) dq / D.
            let along = scale * (direction + eye.radius * (scale * at.dot(direction) * per_image_m));
            // (dr x arm) along = dr (arm x along).
            let turned = arm.cross(along);
            (DVec3::new(along.x, along.y, turned.z), DVec3::new(along.z, turned.x, turned.y))
        };
        (row(eye.tangent), row(DVec3::Z))
    }
}

/// Derivative of one spot coordinate with respect to (x, y, yaw) and to (z, pitch, roll).
type Row = (DVec3, DVec3);

/// Factorised Jacobian of the six spot coordinates, in blocks: the tangential coordinates depend mostly on `x, y` and
/// yaw, the vertical coordinates mostly on `z`, pitch and roll. The cross terms are small, so that the two halves are
/// solved one after the other without pivoting.
#[derive(Clone, Copy)]
struct Equations {
    /// `across = A (x, y, yaw) + B (z, pitch, roll)`, `up = C (x, y, yaw) + D (z, pitch, roll)`.
    inverse_a: DMat3,
    b: DMat3,
    c: DMat3,
    /// Inverse of the Schur complement `D - C A^-1 B`.
    inverse_rest: DMat3,
}

impl Equations {
    /// Smallest determinant, relative to the determinant expected from the size of the layout (pure number; 2.6 for
    /// three diodes evenly around a circle).
    const LEAST_DETERMINANT: f64 = 1.0e-3;

    /// Factorises the Jacobian; `across` is `[A, B]`, `up` is `[C, D]`, `sizes` the expected determinants of A and D.
    #[inline]
    fn new([a, b]: [DMat3; 2], [c, d]: [DMat3; 2], sizes: [f64; 2]) -> Option<Self> {
        let invertible = |matrix: &DMat3, size: f64| {
            let determinant = matrix.determinant().abs();
            // Infinite entries are rejected like dependent rows.
            determinant > Self::LEAST_DETERMINANT * size && determinant.is_finite()
        };
        if !invertible(&a, sizes[0]) {
            return None;
        }
        let inverse_a = a.inverse();
        let rest = d - c * (inverse_a * b);
        invertible(&rest, sizes[1]).then(|| Self { inverse_a, b, c, inverse_rest: rest.inverse() })
    }

    /// Returns the small motion (m, rad) that displaces the spots by `spots`.
    #[inline]
    fn motion(&self, spots: &Spots) -> Motion {
        let first = self.inverse_a * spots.across_m;
        let second = self.inverse_rest * (spots.up_m - self.c * first);
        let first = first - self.inverse_a * (self.b * second);
        Motion {
            shift_m: DVec3::new(first.x, first.y, second.x),
            turn_rad: DVec3::new(second.y, second.z, first.z),
        }
    }
}

/// A small motion, device frame.
struct Motion {
    shift_m: DVec3,
    turn_rad: DVec3,
}

/// Moves a pose and returns the length of the motion, m and rad alike.
#[inline]
fn move_by(pose: &mut Pose, Motion { shift_m, turn_rad }: Motion) -> f64 {
    pose.position_m += shift_m;
    // Accurate to second order in the step, which vanishes at convergence.
    let half = turn_rad * 0.5;
    pose.orientation = (DQuat::from_xyzw(half.x, half.y, half.z, 1.0) * pose.orientation).normalize();
    (shift_m.length_squared() + turn_rad.length_squared()).sqrt()
}
