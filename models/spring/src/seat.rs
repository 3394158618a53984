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
//! The rim rubs on the ground. Where the force along the ground and the torque about the base's normal, over the radius,
//! together exceed the friction of the axial force, the base slides and spins until they do not, and stays there. That
//! costs energy, and is the one thing here that is not conservative.
//!
//! A spring that would be pulled hangs from the upper plate, without load: its base goes, tilts and turns with it. It
//! touches down where its rim meets the ground, with no stored energy, and stands there as it hung. It leaves the ground
//! where a hanging rim would. Coulomb's law alone lets a bent spring jam in its friction where the coefficient is above `D/L0`, and
//! snap as it is lifted. What such a coefficient holds beyond `D/L0` is therefore a share of what a straight spring shortened as
//! far would press down: as the hanging rim comes free, friction fades and with it all that it holds, so lifting off is continuous.
//!
//! Pressed past buckling a base may lose the ground under a bent spring, or roll on without end. Where it cannot stand up as it
//! would hang with the energy that it has, it falls over: wrench and energy fade together, a share a tick, and it carries nothing
//! until it is lifted.
//!
//! Derivation: the book, chapter "The spring"; the step with a tip is the proximal Newton step of Lee, Sun
//! and Saunders (2014); one bound for force and torque of friction: Howe and Cutkosky (1996), a limit surface.

use flotor_hal::glam::{DMat2, DQuat, DVec2, DVec3};
use flotor_hal::math;

use crate::centerline::Section;
use crate::held::HeldSpring;
use crate::pose::{Pose, quaternion};
use crate::response::{Demand, Response};
use crate::rigidity::Spring;
use crate::validity::Validity;

/// Evaluations of the law per tick at most.
const MOST_EVALUATIONS: u32 = 16;
/// Change of the tilt that counts as none (rad), of a law that leaves nothing open.
const TOLERANCE_RAD: f64 = 1e-11;
/// Change of the stored energy that counts as none, of the stiffness by the tilt.
const ENERGY_TOLERANCE: f64 = 1e-13;
/// Part of a step that is left of one that went too far.
const SHORTER: f64 = 0.25;
/// Largest change of the tilt between evaluations (rad).
const LONGEST_STEP_RAD: f64 = 0.05;
/// Longest way of the tilt in a tick that ends in no equilibrium (rad).
const LONGEST_WAY_RAD: f64 = 0.1;
/// Largest tilt (rad) of a base that stands: slender springs roll as far as 0.78 and stay there, and beyond 1.1 no law knows
/// a coil. A base that goes on falls over.
const LARGEST_TILT_RAD: f64 = 0.9;
/// Share of its wrench that a spring which falls over loses in a tick.
const FALL_PER_TICK: f64 = 1.0 / 32.0;
/// Newton steps on the secular equation; it is nearly straight, three give all digits.
const SECULAR_STEPS: u32 = 8;
/// Share of the friction by which the force along the ground may exceed it: no coefficient is known as well.
const FRICTION_TOLERANCE: f64 = 1e-6;
/// Friction by the height over that by the force, at most. Tables of a base that sticks ask for half of both together; from
/// 0.9 on slender springs jam.
const BY_HEIGHT: f64 = 0.8;
/// A sliding base is moved by what the stiffness along the ground makes of the excess; as observed, but within this
/// factor of that at rest.
const STIFFNESS_RANGE: f64 = 8.0;
/// Least surprise of the slope, in what the law leaves open of it, that says something about the curvature: the quotient
/// of noise and a short step is any number.
const LEAST_SURPRISE: f64 = 3.0;
/// Change of the tilt (rad) below which it is clear whether the base slides: one that has not rolled as far as it will is
/// pulled harder.
const ROLLED_RAD: f64 = 3e-4;
/// Longest slide between evaluations, in free lengths.
const LONGEST_SLIDE: f64 = 0.05;
/// Least curvature assumed, of that of the spring at rest: a flatter model would take wild steps.
const LEAST_CURVATURE: f64 = 1e-3;

/// Friction between the base and the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction {
    /// Force along the ground per force onto it at which the base slides; of more than `D/L0`, see the module's documentation.
    pub coefficient: f64,
}

impl Friction {
    /// As much as any holds.
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
    /// Share of its wrench that is left as it falls over: 1 while it stands, 0 where it lies.
    hold: f64,
    /// Stiffness along the axis at rest (N/m).
    axial_n_per_m: f64,
    /// Coefficient of friction on the ground.
    friction: f64,
    /// Where the base has slid to (m), and how far it has turned about its normal (rad).
    slide_m: DVec2,
    turn_rad: f64,
    /// Stiffness along the ground at rest, and as observed (N/m).
    lateral_n_per_m: f64,
    sliding_n_per_m: f64,
}

/// Where a base stood in a tick, what was felt there, and the slope of the energy without its tip.
struct Stood {
    at: Standing,
    response: Response,
    stored_j: f64,
    slope: Option<DVec2>,
}

/// Where a base stands.
#[derive(Clone, Copy)]
struct Standing {
    tilt_rad: DVec2,
    slide_m: DVec2,
    turn_rad: f64,
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
            hold: 1.0,
            axial_n_per_m: spring.axial_stiffness_n_per_m(),
            friction: friction.coefficient,
            slide_m: DVec2::ZERO,
            turn_rad: 0.0,
            lateral_n_per_m: spring.lateral_stiffness_n_per_m(),
            sliding_n_per_m: spring.lateral_stiffness_n_per_m(),
        }
    }

    /// Takes other parameters at a tick boundary and keeps the tilt. Real-time: bounded, no allocation.
    pub fn set_spring(&mut self, spring: &Spring, friction: Friction) {
        let fresh = Self::new(spring, friction);
        let Self { tilt_rad, slide_m, turn_rad, lifted, hold, .. } = *self;
        *self = Self { tilt_rad, slide_m, turn_rad, lifted, hold, ..fresh };
    }

    /// Seated again, where it was at first. Real-time: bounded, no allocation.
    pub fn reset(&mut self) {
        self.stand(&Standing { tilt_rad: DVec2::ZERO, slide_m: DVec2::ZERO, turn_rad: 0.0 });
        (self.lifted, self.hold) = (false, 1.0);
    }

    /// Stands at a place, with nothing known of the spring there.
    fn stand(&mut self, at: &Standing) {
        (self.tilt_rad, self.slide_m, self.turn_rad) = (at.tilt_rad, at.slide_m, at.turn_rad);
        self.curvature = DMat2::from_diagonal(DVec2::splat(self.stiffness_nm_per_rad));
        self.sliding_n_per_m = self.lateral_n_per_m;
    }

    /// The base of a spring that hangs from the upper plate, and how high its rim is above the ground (m).
    fn hanging(&self, pose: &Pose) -> (Standing, f64) {
        let normal = pose.orientation * DVec3::Z;
        let center_m = pose.position_m + DVec3::Z * self.free_length_m - normal * self.free_length_m;
        let sine = normal.truncate().length();
        let lean = if sine > 0.0 { normal.truncate() / sine } else { DVec2::ZERO };
        let standing = Standing {
            tilt_rad: lean * math::atan2(sine, normal.z).min(LARGEST_TILT_RAD),
            // The rim point it would stand on is where a base that had rolled there would have it.
            slide_m: center_m.truncate() - lean * (self.rim_radius_m * (1.0 - normal.z)),
            turn_rad: 2.0 * math::atan2(pose.orientation.z, pose.orientation.w),
        };
        (standing, center_m.z - self.rim_radius_m * sine)
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

    /// Whether the spring has fallen over, or falls.
    #[must_use]
    pub fn has_fallen(&self) -> bool {
        self.hold < 1.0
    }

    /// Wrench on the hand of the spring on its seat, at the pose of this tick.
    ///
    /// Total where the law is; [`Validity::NotConverged`] while the base is on its way, by a bounded tilt per
    /// tick. Real-time: bounded, no allocation; two to three evaluations of the law while the base moves, one
    /// while seated.
    pub fn step<S: HeldSpring>(&mut self, spring: &mut S, pose: &Pose, demand: Demand) -> Response {
        if !pose.is_valid() {
            return Response::none(Validity::InvalidInput);
        }
        let (standing, height_m) = self.hanging(pose);
        let was_lifted = std::mem::replace(&mut self.lifted, height_m > 0.0);
        if self.lifted {
            self.hold = 1.0;
            spring.unload();
            return without_load(demand);
        }
        if was_lifted {
            self.stand(&standing);
        }
        if self.hold < 1.0 {
            return self.fall(spring, pose, demand);
        }
        let (noise_rad, started_rad) = (spring.noise_rad(), self.tilt_rad);
        // The last place of the base in this tick at which it stood, and what was felt there.
        let mut last: Option<Stood> = None;
        let mut slid: Option<(f64, f64)> = None;
        let mut tip_nm = None;
        // Where it lost the ground, and the energy it may have at most where it stands up.
        let mut lost: Option<(Standing, f64)> = None;
        let (mut failures, mut has_rolled) = (0, false);
        for _ in 0..MOST_EVALUATIONS {
            let base = self.base();
            let response = self.held(spring, pose, &base, Demand::WrenchAndEnergy);
            let has_settled = matches!(response.validity, Validity::Ok | Validity::Clamped);
            if !has_settled && last.is_none() && lost.is_none() {
                // It snaps between its plates: the base waits for it.
                return only(response, demand);
            }
            let stored_j = response.energy_j.unwrap_or_default();
            if let Some(stood) = &last {
                // Too far: it would snap, lose the ground, or gain energy.
                let most_j = stood.stored_j + ENERGY_TOLERANCE * self.stiffness_nm_per_rad;
                if !has_settled || response.force_n.z <= 0.0 || stored_j > most_j {
                    if let (true, Some(before), Some(tip_nm)) = (has_settled, stood.slope, tip_nm) {
                        let slope = self.slope(pose, &base, &response) - tip_nm * base.direction;
                        self.observe(self.tilt_rad - stood.at.tilt_rad, slope - before, noise_rad);
                    }
                    failures += 1;
                    // Shorter; where that was no help, the other way as well: near where the base tips over no model of
                    // the energy says which way is down.
                    let part = match (slid.take(), failures) {
                        (Some(_), _) | (None, 1) => SHORTER,
                        (None, even) if even % 2 == 0 => -1.0,
                        _ => -SHORTER,
                    };
                    self.go_back_to(&stood.at, part);
                    spring.go_back();
                    continue;
                }
            } else if let Some((at, most_j)) = lost {
                if !has_settled || stored_j > most_j {
                    self.go_back_to(&at, 0.0);
                    spring.go_back();
                    return self.fall(spring, pose, demand);
                }
                if response.force_n.z <= 0.0 {
                    // It merely touches the ground.
                    return without_load(demand);
                }
            } else if response.force_n.z <= 0.0 {
                // Nothing holds it there any more: it stands as it would have hung, where that costs nothing.
                lost = Some((self.standing(), stored_j));
                spring.mark();
                spring.unload();
                self.stand(&standing);
                continue;
            }
            // What lifting costs to first order; the rest of the energy has no tip. Off the tip any other number would
            // do, as long as it stays the same: the rest is then a smooth function, and its curvature can be observed.
            if base.angle_rad == 0.0 || tip_nm.is_none() {
                tip_nm = Some(self.rim_radius_m * response.force_n.z);
                last = last.map(|stood| Stood { slope: None, ..stood });
            }
            let tip_nm = tip_nm.unwrap_or_default();
            let slope = self.slope(pose, &base, &response) - tip_nm * base.direction;
            if let Some(Stood { slope: Some(before), at, .. }) = &last {
                self.observe(self.tilt_rad - at.tilt_rad, slope - *before, noise_rad);
            }
            let goal = tipped_minimum(self.curvature, self.curvature * self.tilt_rad - slope, tip_nm);
            let mut step = (goal - self.tilt_rad).clamp_length_max(LONGEST_STEP_RAD);
            let whole_slope = slope + tip_nm * base.direction;
            if base.angle_rad > 0.0 && step.dot(whole_slope) > 0.0 {
                // Where the curvature is no cup the model's best is not downhill.
                step = (whole_slope / -self.stiffness_nm_per_rad).clamp_length_max(LONGEST_STEP_RAD);
            }
            let pull_n = self.pull_n(pose, &base, &response);
            let straight_n = -height_m * self.axial_n_per_m;
            let (by_force, by_height) = self.friction_shares();
            let friction_n = by_force * response.force_n.z + by_height * straight_n;
            let excess_n = pull_n.length() - friction_n;
            let tolerance_n = FRICTION_TOLERANCE * friction_n;
            if let (Some((distance_m, before_n)), Some(stood)) = (slid.take(), &last) {
                self.observe_sliding((before_n - excess_n) / distance_m);
                if excess_n < -tolerance_n {
                    // Friction holds it short of here: by the straight line between the two.
                    let part = before_n / (before_n - excess_n);
                    self.go_back_to(&stood.at, part);
                    spring.go_back();
                    slid = Some((distance_m * part, before_n));
                    continue;
                }
            }
            let at = self.standing();
            has_rolled |= step.length() <= ROLLED_RAD;
            let slides = has_rolled && excess_n > tolerance_n;
            // After a slide the slope is another one at the same tilt: nothing to observe.
            last = Some(Stood { at, response, stored_j, slope: (!slides).then_some(slope) });
            spring.mark();
            if slides {
                slid = Some((self.slide(pull_n, excess_n), excess_n));
                continue;
            }
            if step.length() <= noise_rad.max(TOLERANCE_RAD) {
                return only(response, demand);
            }
            if (self.tilt_rad + step).length() >= LARGEST_TILT_RAD {
                return self.fall(spring, pose, demand);
            }
            if (self.tilt_rad + step).distance(started_rad) > LONGEST_WAY_RAD {
                break;
            }
            failures = 0;
            self.tilt_rad += step;
        }
        // On its way: it stays where it last stood.
        let Some(Stood { at, response, .. }) = last else { return Response::none(Validity::NotConverged) };
        spring.go_back();
        (self.tilt_rad, self.slide_m, self.turn_rad) = (at.tilt_rad, at.slide_m, at.turn_rad);
        only(Response { validity: Validity::NotConverged, ..response }, demand)
    }

    /// Gives way where it stood, a share a tick: its energy and its wrench are that share of the law's, so what it loses
    /// nobody gets.
    #[cold]
    fn fall<S: HeldSpring>(&mut self, spring: &mut S, pose: &Pose, demand: Demand) -> Response {
        self.hold = (self.hold - FALL_PER_TICK).max(0.0);
        let response = self.held(spring, pose, &self.base(), Demand::WrenchAndEnergy);
        let stored_j = response.energy_j.unwrap_or_default();
        if self.hold == 0.0 || !response.validity.has_answer() || stored_j <= 0.0 {
            self.hold = 0.0;
            spring.unload();
            return without_load(demand);
        }
        let response = Response {
            force_n: response.force_n * self.hold,
            torque_nm: response.torque_nm * self.hold,
            energy_j: Some(stored_j * self.hold),
            validity: Validity::NotConverged,
        };
        only(response, demand)
    }

    fn standing(&self) -> Standing {
        Standing { tilt_rad: self.tilt_rad, slide_m: self.slide_m, turn_rad: self.turn_rad }
    }

    /// Back to where it stood, but for a part of the way.
    fn go_back_to(&mut self, at: &Standing, part: f64) {
        self.tilt_rad = at.tilt_rad.lerp(self.tilt_rad, part);
        self.slide_m = at.slide_m.lerp(self.slide_m, part);
        self.turn_rad = at.turn_rad + part * (self.turn_rad - at.turn_rad);
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
            // One that has fallen lies there, unloaded.
            let relative = if self.hold > 0.0 { self.relative(pose, &base) } else { Pose::HOME };
            (base.rotation, base.rotation * rise + base.center_m - rise, relative)
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

    /// What friction holds, of the force onto the ground and of the force of a straight spring that is shortened as far.
    /// Coulomb's law up to `D/L0`. Beyond that a bent spring whose rim slides loses force onto the ground faster than it is
    /// relieved: what such a coefficient holds beyond is taken by the height.
    fn friction_shares(&self) -> (f64, f64) {
        let gentle = 2.0 * self.rim_radius_m / self.free_length_m;
        let by_force = self.friction.min(gentle);
        (by_force, (self.friction - by_force).min(BY_HEIGHT * gentle))
    }

    /// What the spring pulls its base with along the ground, and turns it with about its normal, over the radius (N).
    fn pull_n(&self, pose: &Pose, base: &Base, response: &Response) -> DVec3 {
        let turning_nm = self.moment_nm(pose, base, response).dot(base.rotation * DVec3::Z);
        (-response.force_n.truncate()).extend(turning_nm / self.rim_radius_m)
    }

    /// Slides and turns the base the way it is pulled; returns how far (m).
    fn slide(&mut self, pull_n: DVec3, excess_n: f64) -> f64 {
        let distance_m = (excess_n / self.sliding_n_per_m).min(LONGEST_SLIDE * self.free_length_m);
        let way_m = pull_n * (distance_m / pull_n.length());
        self.slide_m += way_m.truncate();
        self.turn_rad += way_m.z / self.rim_radius_m;
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
        let rotation = base.rotation * DQuat::from_rotation_z(self.turn_rad);
        Base { rotation, center_m: base.center_m + self.slide_m.extend(0.0), ..base }
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
        if base.angle_rad == 0.0 && base.center_m == DVec3::ZERO && self.turn_rad == 0.0 {
            return spring.respond(pose, demand);
        }
        let response = spring.respond(&self.relative(pose, base), demand);
        Response {
            force_n: base.rotation * response.force_n,
            torque_nm: base.rotation * response.torque_nm,
            ..response
        }
    }

    /// Moment of the spring on its base, about the base's centre.
    fn moment_nm(&self, pose: &Pose, base: &Base, response: &Response) -> DVec3 {
        let arm_m = pose.position_m + DVec3::Z * self.free_length_m - base.center_m;
        -(response.torque_nm + arm_m.cross(response.force_n))
    }

    /// Derivative of the stored energy by the tilt: minus the work of the spring on the moving base.
    fn slope(&self, pose: &Pose, base: &Base, response: &Response) -> DVec2 {
        let force_n = response.force_n;
        let moment_nm = self.moment_nm(pose, base, response);
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
}

/// The wrench of a spring that carries nothing.
fn without_load(demand: Demand) -> Response {
    let energy_j = (demand >= Demand::WrenchAndEnergy).then_some(0.0);
    Response { energy_j, ..Response::none(Validity::Ok) }
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
        Demand::Force => Response { torque_nm: DVec3::ZERO, energy_j: None, ..response },
        Demand::Wrench => Response { energy_j: None, ..response },
        Demand::WrenchAndEnergy => response,
    }
}
