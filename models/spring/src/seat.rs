//! A spring that merely stands on its seat: the lower plate rolls up on its rim and lifts off.
//!
//! The laws hold the lower plate. A real spring is only put down: as soon as the moment at the base exceeds
//! the axial force times the radius of the seat, the plate tips over its rim, and it cannot be pulled at all.
//! The base takes the tilt of least stored energy,
//!
//! ```text
//! W_free(pose) = min over tilts of W(pose relative to the tilted base),
//! ```
//!
//! so the free spring is conservative like the law it wraps, and its wrench is the law's at the relative pose
//! (envelope theorem). A tilt is a vector `s` in the plane of the seat: the base turned by `|s|` over the rim
//! point in the direction of `s`, which does not slip, its centre at `R ((1 - cos|s|) s/|s| + sin|s| z)`.
//! Lifting costs `R P |s|` to first order, an energy with a tip at `s = 0`: that is what keeps the plate
//! seated while `|M_base| <= P R`.
//!
//! The base slides where the force along the ground exceeds the friction of the axial force (Coulomb), until it does
//! not; it stays where it slid to. That costs energy, and is the one thing here that is not conservative.
//!
//! Derivation: the book, chapter "The spring"; the step with a tip is the proximal Newton step of Lee, Sun
//! and Saunders (2014).

use flotor_hal::glam::{DMat2, DQuat, DVec2, DVec3};
use flotor_hal::math;

use crate::centerline::Section;
use crate::held::HeldSpring;
use crate::pose::{Pose, quaternion};
use crate::response::{Demand, Response};
use crate::rigidity::Spring;
use crate::validity::Validity;

/// Evaluations of the law per tick at most.
const MOST_EVALUATIONS: u32 = 8;
/// Change of the tilt that counts as none (rad), of a law that leaves nothing open.
const TOLERANCE_RAD: f64 = 1e-11;
/// Largest change of the tilt between evaluations (rad).
const LONGEST_STEP_RAD: f64 = 0.05;
/// Largest tilt (rad): beyond it the plate would stand on edge.
const LARGEST_TILT_RAD: f64 = 1.2;
/// Newton steps on the secular equation; it is nearly straight, three give all digits.
const SECULAR_STEPS: u32 = 8;
/// Share of the friction by which the force along the ground may exceed it: no coefficient is known as well.
const FRICTION_TOLERANCE: f64 = 1e-6;
/// A sliding base is moved by what the stiffness along the ground makes of the excess; as observed, but within this
/// factor of that at rest.
const STIFFNESS_RANGE: f64 = 8.0;
/// Least surprise of the slope, in what the law leaves open of it, that says something about the curvature: the quotient
/// of noise and a short step is any number.
const LEAST_SURPRISE: f64 = 3.0;
/// Longest slide between evaluations, in free lengths.
const LONGEST_SLIDE: f64 = 0.05;
/// Least curvature assumed, of that of the spring at rest: a flatter model would take wild steps.
const LEAST_CURVATURE: f64 = 1e-3;

/// Friction between the base and the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction {
    /// Force along the ground per force onto it at which the base slides.
    pub coefficient: f64,
}

impl Friction {
    /// As good as none slides: no spring pulls its base that hard sideways while it stands.
    pub const STICKING: Self = Self { coefficient: 10.0 };
}

/// The base of one spring, free to tip, slide and lift.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seat {
    rim_radius_m: f64,
    free_length_m: f64,
    /// Curvature of the energy by the tilt at rest (N·m/rad).
    stiffness_nm_per_rad: f64,
    tilt_rad: DVec2,
    /// Curvature by the tilt as observed, without the tip (N·m/rad).
    curvature: DMat2,
    lifted: bool,
    /// Coefficient of friction on the ground.
    friction: f64,
    /// Where the base has slid to (m).
    slide_m: DVec2,
    /// Stiffness along the ground at rest, and as observed (N/m).
    lateral_n_per_m: f64,
    sliding_n_per_m: f64,
}

/// The base at a tilt.
struct Base {
    direction: DVec2,
    angle_rad: f64,
    rotation: DQuat,
    /// Relative to its seat.
    center_m: DVec3,
}

impl Seat {
    /// Seated. Real-time: bounded, no allocation.
    #[must_use]
    pub fn new(spring: &Spring, friction: Friction) -> Self {
        let free_length_m = spring.geometry().free_length_m;
        let stiffness_nm_per_rad = 4.0 * spring.rigidities().alpha_n_m2 / free_length_m;
        Self {
            rim_radius_m: 0.5 * spring.geometry().coil_diameter_m,
            free_length_m,
            stiffness_nm_per_rad,
            tilt_rad: DVec2::ZERO,
            curvature: DMat2::from_diagonal(DVec2::splat(stiffness_nm_per_rad)),
            lifted: false,
            friction: friction.coefficient,
            slide_m: DVec2::ZERO,
            lateral_n_per_m: spring.lateral_stiffness_n_per_m(),
            sliding_n_per_m: spring.lateral_stiffness_n_per_m(),
        }
    }

    /// Takes other parameters at a tick boundary and keeps the tilt. Real-time: bounded, no allocation.
    pub fn set_spring(&mut self, spring: &Spring, friction: Friction) {
        let fresh = Self::new(spring, friction);
        *self = Self { tilt_rad: self.tilt_rad, slide_m: self.slide_m, lifted: self.lifted, ..fresh };
    }

    /// Seated again, where it was at first. Real-time: bounded, no allocation.
    pub fn reset(&mut self) {
        self.sit_down();
        self.slide_m = DVec2::ZERO;
        self.sliding_n_per_m = self.lateral_n_per_m;
    }

    fn sit_down(&mut self) {
        self.tilt_rad = DVec2::ZERO;
        self.curvature = DMat2::from_diagonal(DVec2::splat(self.stiffness_nm_per_rad));
        self.lifted = false;
    }

    /// Tilt of the base (rad), a vector towards the rim point it stands on; zero while seated.
    #[must_use]
    pub fn tilt_rad(&self) -> DVec2 {
        self.tilt_rad
    }

    /// Where the base has slid to (m).
    #[must_use]
    pub fn slide_m(&self) -> DVec2 {
        self.slide_m
    }

    /// Whether the spring hangs in the air, without load.
    #[must_use]
    pub fn is_lifted(&self) -> bool {
        self.lifted
    }

    /// Wrench on the hand of the spring on its seat, at the pose of this tick.
    ///
    /// Total where the law is; [`Validity::NotConverged`] while the base is on its way, by a bounded tilt per
    /// tick. Real-time: bounded, no allocation; two to three evaluations of the law while the base moves, one
    /// while seated.
    pub fn step<S: HeldSpring>(&mut self, spring: &mut S, pose: &Pose, demand: Demand) -> Response {
        let wanted = demand.max(Demand::Wrench);
        let noise_rad = spring.noise_rad();
        self.lifted = false;
        let mut slid: Option<(f64, f64)> = None;
        let mut previous: Option<(DVec2, DVec2)> = None;
        let mut tip_nm = None;
        let mut response = Response::none(Validity::NotConverged);
        for _ in 0..MOST_EVALUATIONS {
            let base = self.base();
            response = self.held(spring, pose, &base, wanted);
            if !matches!(response.validity, Validity::Ok | Validity::Clamped) {
                return response;
            }
            if response.force_n.z <= 0.0 {
                return self.lift(&response);
            }
            // What lifting costs to first order; the rest of the energy has no tip. Off the tip any other number would
            // do, as long as it stays the same: the rest is then a smooth function, and its curvature can be observed.
            if base.angle_rad == 0.0 || tip_nm.is_none() {
                (tip_nm, previous) = (Some(self.rim_radius_m * response.force_n.z), None);
            }
            let tip_nm = tip_nm.unwrap_or_default();
            let slope = self.slope(pose, &base, &response) - tip_nm * base.direction;
            if let Some((tilt, old_slope)) = previous {
                self.observe(self.tilt_rad - tilt, slope - old_slope, noise_rad);
            }
            previous = Some((self.tilt_rad, slope));
            let goal = tipped_minimum(self.curvature, self.curvature * self.tilt_rad - slope, tip_nm);
            let step = (goal - self.tilt_rad).clamp_length_max(LONGEST_STEP_RAD);
            let excess_n = self.excess_n(&response);
            if let Some((distance_m, before_n)) = slid {
                self.observe_sliding((before_n - excess_n) / distance_m);
            }
            slid = None;
            if excess_n > FRICTION_TOLERANCE * self.friction * response.force_n.z {
                slid = Some((self.slide(&response, excess_n), excess_n));
                previous = None;
            } else if step.length() <= noise_rad.max(TOLERANCE_RAD) {
                return only(response, demand);
            }
            self.tilt_rad = (self.tilt_rad + step).clamp_length_max(LARGEST_TILT_RAD);
        }
        only(Response { validity: Validity::NotConverged, ..response }, demand)
    }

    /// The sections of the spring where its base is now: `draw` gives those of the held spring at a pose. Not
    /// real-time.
    pub(crate) fn draw(
        &self,
        pose: &Pose,
        sections: &mut [Section],
        draw: impl FnOnce(&Pose, &mut [Section]) -> bool,
    ) -> bool {
        let rise = DVec3::new(0.0, 0.0, self.free_length_m);
        let (rotation, origin_m, relative) = if self.lifted {
            // It hangs from the upper plate, unloaded.
            (pose.orientation, pose.position_m, Pose::HOME)
        } else {
            let base = self.base();
            (base.rotation, base.rotation * rise + base.center_m - rise, self.relative(pose, &base))
        };
        if !draw(&relative, sections) {
            return false;
        }
        for section in sections {
            section.center_m = rotation * section.center_m + origin_m;
            section.orientation = rotation * section.orientation;
        }
        true
    }

    /// By how much the force along the ground exceeds the friction (N).
    fn excess_n(&self, response: &Response) -> f64 {
        response.force_n.truncate().length() - self.friction * response.force_n.z
    }

    /// Slides the base the way it is pulled; returns how far (m).
    fn slide(&mut self, response: &Response, excess_n: f64) -> f64 {
        let along = response.force_n.truncate();
        let distance_m = (excess_n / self.sliding_n_per_m).min(LONGEST_SLIDE * self.free_length_m);
        // The spring pulls its base the other way than the hand.
        self.slide_m -= along * (distance_m / along.length());
        distance_m
    }

    fn observe_sliding(&mut self, stiffness_n_per_m: f64) {
        let (least, most) = (self.lateral_n_per_m / STIFFNESS_RANGE, self.lateral_n_per_m * STIFFNESS_RANGE);
        if stiffness_n_per_m.is_finite() {
            self.sliding_n_per_m = stiffness_n_per_m.clamp(least, most);
        }
    }

    /// The base as it is now.
    fn base(&self) -> Base {
        let base = Base::new(self.tilt_rad, self.rim_radius_m);
        Base { center_m: base.center_m + self.slide_m.extend(0.0), ..base }
    }

    /// A pose as the base sees it.
    fn relative(&self, pose: &Pose, base: &Base) -> Pose {
        let rise = DVec3::new(0.0, 0.0, self.free_length_m);
        let back = base.rotation.conjugate();
        Pose {
            position_m: back * (pose.position_m + rise - base.center_m) - rise,
            orientation: back * pose.orientation,
        }
    }

    /// The law's answer with the base at a tilt, in the model frame.
    fn held<S: HeldSpring>(&self, spring: &mut S, pose: &Pose, base: &Base, demand: Demand) -> Response {
        if base.angle_rad == 0.0 && base.center_m == DVec3::ZERO {
            return spring.respond(pose, demand);
        }
        let response = spring.respond(&self.relative(pose, base), demand);
        Response {
            force_n: base.rotation * response.force_n,
            torque_nm: base.rotation * response.torque_nm,
            ..response
        }
    }

    /// Derivative of the stored energy by the tilt: minus the work of the spring on the moving base.
    fn slope(&self, pose: &Pose, base: &Base, response: &Response) -> DVec2 {
        let rise = DVec3::new(0.0, 0.0, self.free_length_m);
        let arm_m = pose.position_m + rise - base.center_m;
        let force_n = response.force_n;
        let moment_nm = -(response.torque_nm + arm_m.cross(force_n));
        if base.angle_rad == 0.0 {
            // Along u the base turns about z x u and rises by R; the second part is the tip's.
            return DVec2::new(-moment_nm.y, moment_nm.x);
        }
        let along = base.direction.extend(0.0);
        let across = DVec3::new(-along.y, along.x, 0.0);
        let (sine, cosine) = math::sin_cos(base.angle_rad);
        let (chord, versine) = (sine / base.angle_rad, (1.0 - cosine) / base.angle_rad);
        let by_angle =
            self.rim_radius_m * (sine * force_n.dot(along) + cosine * force_n.z) - moment_nm.dot(across);
        // Turning the rim point: the base turns about -u, and about z where it is tilted.
        let by_side = self.rim_radius_m * versine * force_n.dot(across) + chord * moment_nm.dot(along)
            - versine * moment_nm.z;
        by_angle * base.direction + by_side * base.direction.perp()
    }

    /// Symmetric rank-one correction of the curvature (Nocedal and Wright, *Numerical Optimization*, 6.2).
    fn observe(&mut self, step: DVec2, change: DVec2, noise_rad: f64) {
        let surprise = change - self.curvature * step;
        if surprise.length() < LEAST_SURPRISE * noise_rad * self.stiffness_nm_per_rad {
            return;
        }
        let along = surprise.dot(step);
        if along.abs() > 1e-8 * surprise.length() * step.length() {
            let update = DMat2::from_cols(surprise * surprise.x, surprise * surprise.y);
            self.curvature += update * (1.0 / along);
        }
    }

    /// A spring that would be pulled leaves its seat and carries nothing.
    fn lift(&mut self, response: &Response) -> Response {
        self.sit_down();
        self.lifted = true;
        Response {
            force_n: DVec3::ZERO,
            torque_nm: DVec3::ZERO,
            energy_j: response.energy_j.map(|_| 0.0),
            validity: response.validity,
        }
    }
}

impl Base {
    fn new(tilt_rad: DVec2, rim_radius_m: f64) -> Self {
        let angle_rad = tilt_rad.length();
        let direction = if angle_rad > 0.0 { tilt_rad / angle_rad } else { DVec2::ZERO };
        let (sine, cosine) = math::sin_cos(angle_rad);
        Self {
            direction,
            angle_rad,
            rotation: quaternion(tilt_rad.perp().extend(0.0)),
            center_m: rim_radius_m * (direction * (1.0 - cosine)).extend(sine),
        }
    }
}

/// Minimum of `s.H s/2 - b.s + c |s|`: zero while `|b| <= c`, else `s = t (t H + c)⁻¹ b` with its own length
/// `t`.
fn tipped_minimum(curvature: DMat2, pull: DVec2, tip: f64) -> DVec2 {
    if pull.length() <= tip {
        return DVec2::ZERO;
    }
    let mut length = 0.0;
    let mut direction = pull / pull.length();
    for _ in 0..SECULAR_STEPS {
        // One Newton step on 1 - 1 / |(t H + c)⁻¹ b| = 0 for the length `t`.
        let matrix = curvature * length + DMat2::from_diagonal(DVec2::splat(tip));
        let inverse = matrix.inverse();
        let scaled = inverse * pull;
        let size = scaled.length();
        let falling = scaled.dot(inverse * (curvature * scaled)) / (size * size * size);
        let least = LEAST_CURVATURE / tip.max(f64::MIN_POSITIVE);
        direction = scaled / size;
        length = (length + (1.0 - 1.0 / size) / falling.max(least)).clamp(0.0, LARGEST_TILT_RAD);
    }
    let tilt = length * direction;
    if tilt.is_finite() { tilt } else { DVec2::ZERO }
}

/// What was demanded of a complete response.
fn only(response: Response, demand: Demand) -> Response {
    match demand {
        Demand::Force => Response { torque_nm: DVec3::ZERO, ..response },
        Demand::Wrench | Demand::WrenchAndEnergy => response,
    }
}
