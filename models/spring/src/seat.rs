//! Free seat of a spring: the lower plate rolls up on its rim, slides, and lifts off.
//!
//! The laws clamp the lower plate. A real spring stands freely: a pull lifts it, and its base tips over the rim as
//! soon as the moment at the base exceeds the axial force times the radius of the seat. The base takes the tilt of
//! least stored energy,
//!
//! ```text
//! W_free(pose) = min over tilts of W(pose relative to the tilted base),
//! ```
//!
//! and the wrench is the law's at the relative pose (envelope theorem). So a free spring that rolls, but does not slide or
//! fall over, is as conservative as the law. A tilt is a vector `s` in the plane of the seat: the base turned by `|s|` over the rim
//! point in the direction of `s`, which does not slip; its centre is at `R ((1 - cos|s|) s/|s| + sin|s| z)`.
//! To first order, lifting costs the energy `R P |s|`. This term has a kink at `s = 0`, called *tip* here; it keeps the plate
//! seated while `|M_base| <= P R`.
//!
//! The rim is subject to friction. If the force along the ground and the torque about the base's normal, divided by the radius,
//! together exceed the friction limit, the base slides and spins until they are at the limit. That dissipates energy.
//!
//! A spring that would be pulled hangs from the upper plate, without load. It touches down where its rim meets the ground, and
//! leaves the ground where a hanging rim would: the part of the coefficient of friction beyond `D/L0` acts by the depth of the hanging
//! rim, so that lift-off is continuous.
//!
//! If a spring is pressed past buckling, its base may lose contact with the ground or roll on without end. If the
//! spring would need more energy to stand straight than it has, it falls over: wrench and energy fade together, by an
//! equal part in each step, and the spring has no load until it is lifted. The lost energy is dissipated.
//!
//! A tick in which the base slides ends where rolling and sliding agree: the tilt of least energy at a pull equal to the friction
//! limit, found by rolling and sliding in turns. If a tick begins with the base pulled off the ground, the base gives way along
//! the straight line to its hanging place, only as far as it needs to stand again; so the force has no step there.
//!
//! `base` has the pose of the base and the load on it; [`flotor_lanes::tipped`] finds the tilt of least energy; `friction` has the
//! friction limit.
//!
//! Derivation: the book, chapter "The spring"; the step with a tip is the proximal Newton step of Lee, Sun
//! and Saunders (2014); one bound for force and torque of friction: Howe and Cutkosky (1996), a limit surface.

use std::ops::ControlFlow::{self, Break, Continue};

use flotor_hal::glam::{DVec2, DVec3};

use crate::centerline::Section;
use crate::held::HeldSpring;
use crate::pose::Pose;
use crate::response::{Demand, Response};
use crate::rigidity::Spring;
use crate::validity::Validity;
use base::{Base, Lengths, Standing};
use flotor_lanes::tipped::Quadratic;
pub use friction::Friction;
use friction::FrictionLimit;

mod base;
mod friction;

/// Maximum cost of a tick, in evaluations of an energy, if each evaluation costs no more than the one before.
const MOST_COST: u32 = 60;
/// Maximum number of evaluations of the law per tick.
const MOST_EVALUATIONS: u32 = 24;
/// Convergence tolerance of the tilt (rad), for a law without a tolerance of its own.
const TOLERANCE_RAD: f64 = 1e-11;
/// Tolerance of the stored energy, relative to the stiffness by the tilt.
const ENERGY_TOLERANCE: f64 = 1e-13;
/// Backtracking factor.
const SHORTER: f64 = 0.25;
/// Largest change of the tilt between evaluations (rad).
const LONGEST_STEP_RAD: f64 = 0.05;
/// Lower limit of this change after repeated backtracking (rad).
const LEAST_STRIDE_RAD: f64 = 1e-5;
/// Largest change of the tilt in a tick that reaches no equilibrium (rad).
const LONGEST_WAY_RAD: f64 = 0.1;
/// Largest tilt (rad) of a standing base: slender springs roll as far as 0.78 and stay there, and beyond 1.1 no law
/// describes a coil. A base that tilts further falls over.
const LARGEST_TILT_RAD: f64 = 0.9;
/// Fraction of the wrench that a falling spring loses in a step.
const FALL_PER_STEP: f64 = 1.0 / 32.0;
/// Tilt change below which rolling counts as converged, enabling series extrapolation (rad).
const SETTLED_RAD: f64 = 3e-7;
/// Largest ratio of successive excesses of the pull for a series extrapolation.
const MOST_RATIO: f64 = 0.9;
/// Tilt change (rad) below which sliding is decided: a base that has not rolled far enough is pulled harder.
const ROLLED_RAD: f64 = 3e-4;

/// Base of one spring, free to tip, slide and lift.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seat {
    lengths: Lengths,
    at: Standing,
    quadratic: Quadratic,
    grip: FrictionLimit,
    lifted: bool,
    /// Remaining fraction of the wrench in a fall: 1 for a standing spring, 0 for a fallen one.
    hold: f64,
    /// Largest change of the tilt between evaluations (rad): reduced after a tick of failed steps.
    stride_rad: f64,
}

flotor_hal::restorable!(Seat { at, quadratic, grip, lifted, hold, stride_rad } without { lengths });

/// Call of a tick, with the hanging place of the base and its height above the ground.
struct Tick<'a> {
    spring: &'a mut dyn HeldSpring,
    pose: &'a Pose,
    demand: Demand,
    hanging: Standing,
    height_m: f64,
    /// Uncertainty of the slope, as a tilt.
    noise_rad: f64,
    /// Tilt at the start of the tick.
    started_rad: DVec2,
    cost: Cost,
}

/// Response of the spring on its base at the present place.
struct Probe {
    base: Base,
    response: Response,
    stored_j: f64,
    has_settled: bool,
}

/// Phase of the search in a tick.
enum Phase {
    /// No place was probed.
    Start,
    /// The base has lost contact with the ground, and has not stood since.
    Lost(Lost),
    /// The base has stood: it rolls and slides in turns.
    Standing(Descent),
}

/// Base that lost contact with the ground. It may stand at its hanging place, or between both places, with less energy.
struct Lost {
    at: Standing,
    stored_j: f64,
    missing_n: [f64; 2],
    trial: Trial,
}

/// Place tried next for a base that lost contact.
#[derive(Clone, Copy)]
enum Trial {
    Hanging,
    OnTheWay,
    /// Hanging place, with any response.
    Last,
}

/// Descent of a standing base to the tilt of least energy, at a pull within the friction limit.
struct Descent {
    last: Stood,
    /// Cost of lifting to first order. The rest of the energy has no tip. Off the tip any other constant would do: the
    /// rest is then a smooth function, and its curvature can be observed.
    tip_nm: f64,
    slide: Option<Slide>,
    /// Place of the last slide if rolling had converged there, with the excess of the pull (N).
    settled: Option<(Standing, f64)>,
    has_rolled: bool,
    failures: u32,
}

/// Place of a base that stood in a tick, with its response, and the slope of the energy without its tip.
struct Stood {
    at: Standing,
    response: Response,
    stored_j: f64,
    slope: Option<DVec2>,
}

/// Trial slide, with the excess of the pull over the friction limit at its start (N), direction and distance (m); no
/// direction for the extrapolation of rolling and sliding in turns.
struct Slide {
    excess_n: f64,
    along: Option<(DVec3, f64)>,
}

/// Response of the tick, or phase of the next probe.
type Next = ControlFlow<Response, Phase>;

/// Cost of the evaluations of a tick so far, in evaluations of an energy.
#[derive(Default)]
struct Cost {
    whole: u32,
    last: u32,
}

impl Cost {
    fn add(&mut self, last: u32) {
        self.whole += last;
        self.last = last;
    }

    /// Returns true if one more evaluation like the last would cost too much.
    fn is_spent(&self) -> bool {
        self.whole + self.last > MOST_COST
    }
}

/// Returns the fraction of a distance at which no force is missing, from the missing forces at both ends.
fn part_of_the_way(here_n: [f64; 2], there_n: [f64; 2]) -> f64 {
    let part =
        |here_n: f64, there_n: f64| if here_n > 0.0 { here_n / (here_n - there_n).max(here_n) } else { 0.0 };
    part(here_n[0], there_n[0]).max(part(here_n[1], there_n[1]))
}

impl Seat {
    /// Builds a seated base. Real-time: bounded, no allocation.
    #[must_use]
    pub fn new(spring: &Spring, friction: Friction) -> Self {
        let free_length_m = spring.geometry().free_length_m;
        Self {
            lengths: Lengths::of(spring),
            at: Standing::SEATED,
            quadratic: Quadratic::at_rest(4.0 * spring.rigidities().alpha_n_m2 / free_length_m),
            grip: FrictionLimit::new(spring, friction),
            lifted: false,
            hold: 1.0,
            stride_rad: LONGEST_STEP_RAD,
        }
    }

    /// Sets the parameters at a tick boundary, with tilt, slide and fall unchanged. Real-time: bounded, no allocation.
    pub fn set_spring(&mut self, spring: &Spring, friction: Friction) {
        let Self { at, lifted, hold, .. } = *self;
        *self = Self { at, lifted, hold, ..Self::new(spring, friction) };
    }

    /// Resets the base to its initial seat. Real-time: bounded, no allocation.
    pub fn reset(&mut self) {
        self.stand(Standing::SEATED);
        (self.lifted, self.hold, self.stride_rad) = (false, 1.0, LONGEST_STEP_RAD);
    }

    /// Places the base, and clears the observed stiffnesses.
    fn stand(&mut self, at: Standing) {
        self.at = at;
        self.quadratic = Quadratic::at_rest(self.quadratic.stiffness_nm_per_rad);
        self.grip.restart();
    }

    /// Returns the tilt of the base (rad), a vector towards the rim point of contact; zero while seated.
    #[must_use]
    pub fn tilt_rad(&self) -> DVec2 {
        self.at.tilt_rad
    }

    /// Returns the slide of the base from its initial seat (m).
    #[must_use]
    pub fn slide_m(&self) -> DVec2 {
        self.at.slide_m
    }

    /// Returns true if the spring hangs in the air, without load.
    #[must_use]
    pub fn is_lifted(&self) -> bool {
        self.lifted
    }

    /// Returns true if the spring has fallen over, or is falling.
    #[must_use]
    pub fn has_fallen(&self) -> bool {
        self.hold < 1.0
    }

    /// Advances the base by one tick and returns the wrench of the spring on the hand at `pose`.
    ///
    /// Defined at every pose at which the law is defined. A lifted or fallen spring has zero wrench with [`Validity::Ok`].
    /// The validity is [`Validity::NotConverged`] while the base moves over several ticks, because its tilt per tick is bounded,
    /// and while the spring falls over. Real-time: bounded, no allocation; two to three evaluations of the law while the base
    /// moves, one while seated.
    pub fn step(&mut self, spring: &mut dyn HeldSpring, pose: &Pose, demand: Demand) -> Response {
        if !pose.is_valid() {
            return Response::none(Validity::InvalidInput);
        }
        let (hanging, height_m) = Standing::hanging(pose, &self.lengths, LARGEST_TILT_RAD);
        let was_lifted = std::mem::replace(&mut self.lifted, height_m > 0.0);
        if self.lifted {
            self.hold = 1.0;
            spring.unload();
            return without_load(demand);
        }
        if was_lifted {
            self.stand(hanging);
        }
        if self.hold < 1.0 {
            return self.fall(spring, pose, demand);
        }
        let (noise_rad, started_rad) = (spring.noise_rad(), self.at.tilt_rad);
        let cost = Cost::default();
        let mut tick = Tick { spring, pose, demand, hanging, height_m, noise_rad, started_rad, cost };
        let mut phase = Phase::Start;
        for _ in 0..MOST_EVALUATIONS {
            if let Phase::Standing(descent) = &phase
                && tick.cost.is_spent()
            {
                let shorter =
                    (0..descent.failures).fold(self.stride_rad, |stride_rad, _| stride_rad * SHORTER);
                self.stride_rad = shorter.max(LEAST_STRIDE_RAD);
                break;
            }
            let probe = self.probe(&mut tick);
            let next = match phase {
                // The spring snaps between its plates: the base waits.
                Phase::Start if !probe.has_settled => Break(probe.response),
                Phase::Start if probe.response.force_n.z <= 0.0 => self.lose_contact(&mut tick, &probe),
                Phase::Start => self.stand_on(&mut tick, &probe, self.begin(&probe)),
                Phase::Lost(lost) => self.give_way(&mut tick, &probe, lost),
                Phase::Standing(descent) if self.is_too_far(&probe, &descent.last) => {
                    self.back_off(&mut tick, &probe, descent)
                }
                Phase::Standing(descent) => self.stand_on(&mut tick, &probe, descent),
            };
            phase = match next {
                Continue(phase) => phase,
                Break(response) => return response.limited_to(demand),
            };
        }
        let Phase::Standing(descent) = phase else { return Response::none(Validity::NotConverged) };
        self.not_converged(&mut tick, &descent.last).limited_to(demand)
    }

    /// Evaluates the law on the base at its present place.
    fn probe(&self, tick: &mut Tick<'_>) -> Probe {
        let base = self.base();
        let response = base.respond(tick.spring, tick.pose, Demand::WrenchAndEnergy);
        tick.cost.add(tick.spring.cost());
        let has_settled = matches!(response.validity, Validity::Ok | Validity::Clamped);
        Probe { base, response, stored_j: response.energy_j.unwrap_or_default(), has_settled }
    }

    /// Moves the base back to the last place at which it stood.
    fn not_converged(&mut self, tick: &mut Tick<'_>, stood: &Stood) -> Response {
        tick.spring.go_back();
        self.at = stood.at;
        Response { validity: Validity::NotConverged, ..stood.response }
    }

    /// Moves a base that lost contact to its hanging place.
    fn lose_contact(&mut self, tick: &mut Tick<'_>, probe: &Probe) -> Next {
        let missing_n = self.missing_n(tick, probe);
        let lost = Lost { at: self.at, stored_j: probe.stored_j, missing_n, trial: Trial::Hanging };
        tick.spring.mark();
        tick.spring.unload();
        self.stand(tick.hanging);
        Continue(Phase::Lost(lost))
    }

    /// Moves a base that lost contact along the straight line to its hanging place, only as far as it needs to stand.
    fn give_way(&mut self, tick: &mut Tick<'_>, probe: &Probe, lost: Lost) -> Next {
        let Probe { response, stored_j, has_settled, .. } = *probe;
        let may_stand = has_settled && stored_j <= lost.stored_j && response.force_n.z > 0.0;
        match lost.trial {
            Trial::Hanging if !has_settled || stored_j > lost.stored_j => {
                self.at = lost.at;
                tick.spring.go_back();
                Break(self.fall(tick.spring, tick.pose, tick.demand))
            }
            // The base touches the ground without load.
            Trial::Hanging if !may_stand => Break(without_load(tick.demand)),
            Trial::Hanging if !tick.cost.is_spent() => {
                let there_n = self.missing_n(tick, probe);
                self.at = lost.at.toward(&tick.hanging, part_of_the_way(lost.missing_n, there_n));
                Continue(Phase::Lost(Lost { trial: Trial::OnTheWay, ..lost }))
            }
            Trial::OnTheWay if !may_stand => {
                self.at = tick.hanging;
                Continue(Phase::Lost(Lost { trial: Trial::Last, ..lost }))
            }
            Trial::Hanging | Trial::OnTheWay | Trial::Last => self.stand_on(tick, probe, self.begin(probe)),
        }
    }

    /// Returns true if the spring would snap, lose contact, or gain energy at the present place.
    fn is_too_far(&self, probe: &Probe, last: &Stood) -> bool {
        let most_j = last.stored_j + ENERGY_TOLERANCE * self.quadratic.stiffness_nm_per_rad;
        !probe.has_settled || probe.response.force_n.z <= 0.0 || probe.stored_j > most_j
    }

    /// Shortens the last step. Every second failure tries the opposite direction: near where the base tips over no
    /// model of the energy gives the downhill direction.
    fn back_off(&mut self, tick: &mut Tick<'_>, probe: &Probe, mut descent: Descent) -> Next {
        let last = &descent.last;
        if let (true, Some(before)) = (probe.has_settled, last.slope) {
            let slope = probe.base.slope(tick.pose, &probe.response) - descent.tip_nm * probe.base.direction;
            self.quadratic.observe(self.at.tilt_rad - last.at.tilt_rad, slope - before, tick.noise_rad);
        }
        descent.failures += 1;
        let part = match (descent.slide.take(), descent.failures) {
            (Some(_), _) | (None, 1) => SHORTER,
            (None, even) if even % 2 == 0 => -1.0,
            _ => -SHORTER,
        };
        self.at = last.at.toward(&self.at, part);
        tick.spring.go_back();
        Continue(Phase::Standing(descent))
    }

    /// Returns the start of a descent from the present place.
    fn begin(&self, probe: &Probe) -> Descent {
        let Probe { response, stored_j, .. } = *probe;
        Descent {
            last: Stood { at: self.at, response, stored_j, slope: None },
            tip_nm: self.lengths.rim_radius_m * response.force_n.z,
            slide: None,
            settled: None,
            has_rolled: false,
            failures: 0,
        }
    }

    /// Rolls or slides the base on from a place at which it stands.
    fn stand_on(&mut self, tick: &mut Tick<'_>, probe: &Probe, mut descent: Descent) -> Next {
        let Probe { base, response, stored_j, .. } = probe;
        if base.angle_rad == 0.0 {
            descent.tip_nm = self.lengths.rim_radius_m * response.force_n.z;
            descent.last.slope = None;
        }
        let (at, tip_nm) = (self.at, descent.tip_nm);
        let slope = base.slope(tick.pose, response) - tip_nm * base.direction;
        if let Stood { slope: Some(before), at: from, .. } = &descent.last {
            self.quadratic.observe(at.tilt_rad - from.tilt_rad, slope - *before, tick.noise_rad);
        }
        let goal = self.quadratic.least(at.tilt_rad, slope, tip_nm, LARGEST_TILT_RAD);
        let mut step = (goal - at.tilt_rad).clamp_length_max(self.stride_rad);
        let whole_slope = slope + tip_nm * base.direction;
        if base.angle_rad > 0.0 && step.dot(whole_slope) > 0.0 {
            // With an indefinite curvature the model's minimum is not downhill.
            step = (whole_slope / -self.quadratic.stiffness_nm_per_rad).clamp_length_max(self.stride_rad);
        }
        let pull_n = base.pull_n(tick.pose, response);
        let friction_n = self.grip.holds_n(response.force_n.z, tick.height_m);
        let excess_n = pull_n.length() - friction_n;
        let tolerance_n = friction::TOLERANCE * friction_n;
        if let Some(Slide { excess_n: before_n, along }) = descent.slide.take() {
            if let Some((way, distance_m)) = along {
                self.grip.observe(before_n - excess_n, distance_m, way);
            }
            if excess_n < -tolerance_n {
                // Friction stops the base before this place: interpolate linearly.
                let part = before_n / (before_n - excess_n);
                self.at = descent.last.at.toward(&at, part);
                tick.spring.go_back();
                let along = along.map(|(way, distance_m)| (way, distance_m * part));
                descent.slide = Some(Slide { excess_n: before_n, along });
                return Continue(Phase::Standing(descent));
            }
        }
        descent.has_rolled |= step.length() <= ROLLED_RAD;
        let slides = descent.has_rolled && excess_n > tolerance_n;
        // A slide changes the slope at the same tilt: no curvature to observe.
        let slope = (!slides).then_some(slope);
        descent.last = Stood { at, response: *response, stored_j: *stored_j, slope };
        tick.spring.mark();
        if slides {
            let settled = (step.length() < SETTLED_RAD).then_some((at, excess_n));
            let before = std::mem::replace(&mut descent.settled, settled);
            descent.slide = Some(match (before, settled) {
                // Rolling raises the pull again, in the same ratio each time: extrapolate the series.
                (Some((from, before_n)), Some(_)) if excess_n < MOST_RATIO * before_n => {
                    self.at = from.toward(&at, before_n / (before_n - excess_n));
                    Slide { excess_n, along: None }
                }
                _ => self.slide(pull_n, excess_n),
            });
            return Continue(Phase::Standing(descent));
        }
        let tilt_rad = at.tilt_rad + step;
        if step.length() <= tick.noise_rad.max(TOLERANCE_RAD) {
            return Break(*response);
        }
        if tilt_rad.length() >= LARGEST_TILT_RAD {
            return Break(self.fall(tick.spring, tick.pose, tick.demand));
        }
        if tilt_rad.distance(tick.started_rad) > LONGEST_WAY_RAD {
            return Break(self.not_converged(tick, &descent.last));
        }
        if descent.failures == 0 {
            self.stride_rad = (2.0 * self.stride_rad).min(LONGEST_STEP_RAD);
        }
        descent.failures = 0;
        self.at.tilt_rad = tilt_rad;
        Continue(Phase::Standing(descent))
    }

    /// Returns the wrench on the hand of a moving spring, with base and shape unchanged: the derivatives of one energy.
    /// Real-time: bounded, no allocation.
    pub(crate) fn stay(&mut self, spring: &mut dyn HeldSpring, pose: &Pose, demand: Demand) -> Response {
        let (_, height_m) = Standing::hanging(pose, &self.lengths, LARGEST_TILT_RAD);
        if height_m > 0.0 || self.lifted || self.hold == 0.0 {
            return self.step(spring, pose, demand);
        }
        let response = self.base().answer(pose, |relative| spring.stay(relative, Demand::WrenchAndEnergy));
        self.remaining(&response).limited_to(demand)
    }

    /// Fades wrench and energy of a falling spring in place, by an equal part per tick: both are a fraction of the
    /// law's, so the lost energy is dissipated.
    #[cold]
    fn fall(&mut self, spring: &mut dyn HeldSpring, pose: &Pose, demand: Demand) -> Response {
        self.hold = (self.hold - FALL_PER_STEP).max(0.0);
        let response = self.base().respond(spring, pose, Demand::WrenchAndEnergy);
        let stored_j = response.energy_j.unwrap_or_default();
        if self.hold == 0.0 || !response.validity.has_answer() || stored_j <= 0.0 {
            self.hold = 0.0;
            spring.unload();
            return without_load(demand);
        }
        self.remaining(&response).limited_to(demand)
    }

    /// Returns the remaining fraction of a response while the spring moves.
    fn remaining(&self, response: &Response) -> Response {
        Response {
            force_n: response.force_n * self.hold,
            torque_nm: response.torque_nm * self.hold,
            energy_j: response.energy_j.map(|stored_j| stored_j * self.hold),
            validity: Validity::NotConverged,
        }
    }

    /// Returns the forces that a base lacks to stand: onto the ground, and of friction (N); negative if sufficient.
    fn missing_n(&self, tick: &Tick<'_>, probe: &Probe) -> [f64; 2] {
        let pull_n = probe.base.pull_n(tick.pose, &probe.response).length();
        let pressed_n = probe.response.force_n.z;
        [-pressed_n, pull_n - self.grip.holds_n(pressed_n, tick.height_m)]
    }

    /// Returns the base at its present place.
    fn base(&self) -> Base {
        Base::new(&self.at, &self.lengths)
    }

    /// Slides and turns the base in the direction of the pull.
    fn slide(&mut self, pull_n: DVec3, excess_n: f64) -> Slide {
        let way = pull_n / pull_n.length();
        let distance_m = self.grip.slide_m(excess_n, way);
        self.at.slide_m += way.truncate() * distance_m;
        self.at.turn_rad += way.z * distance_m / self.lengths.rim_radius_m;
        Slide { excess_n, along: Some((way, distance_m)) }
    }

    /// Draws the sections of the spring on its present base; `draw` draws the sections of the clamped spring at a pose. Returns
    /// false if `draw` does. Not real-time.
    pub(crate) fn draw(
        &self,
        pose: &Pose,
        sections: &mut [Section],
        draw: impl FnOnce(&Pose, &mut [Section]) -> bool,
    ) -> bool {
        let rise_m = self.lengths.rise_m();
        let (rotation, origin_m, relative) = if self.lifted {
            // A lifted spring hangs from the upper plate, unloaded.
            (pose.orientation, pose.position_m, Pose::HOME)
        } else {
            let base = self.base();
            // A fallen spring lies on its base, unloaded.
            let relative = if self.hold > 0.0 { base.relative(pose) } else { Pose::HOME };
            (base.rotation, base.rotation * rise_m + base.center_m - rise_m, relative)
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
}

/// Returns the response of a spring without load.
fn without_load(demand: Demand) -> Response {
    let energy_j = (demand >= Demand::WrenchAndEnergy).then_some(0.0);
    Response { energy_j, ..Response::none(Validity::Ok) }
}
