//! The flotor as a rigid body with six degrees of freedom.
//!
//! The moving part of the device is a bowl with a handle that hangs in a magnetic field: one rigid body, no friction, no
//! transmission. Four loads act on it: the coils' wrench and eddy-current drag, both at the origin of the flotor frame (the
//! centre of the bowl); gravity and its compensation, at the centre of mass; and the hand, at the origin, the place of the
//! handle. With `y` the position of the centre of mass,
//! `x = y - R c` that of the origin and `w` the angular velocity in the flotor frame:
//!
//! ```text
//! m y'' = F_coils - b x' + F_hand + (f - m g) z          F_hand = F_h + K (x_h - x) + B (x_h' - x')
//! I w' + w x I w = R^T T_coils - c x R^T (F_coils - b x' + F_hand) - d w + T_hand
//! q' = q w / 2
//! ```
//!
//! **Time.** A coil wrench is constant from one tick to the next, so during a step the translation is a linear oscillator
//! under constant or linearly growing force, and `plant::translation` solves it exactly. The rotation is nonlinear and
//! integrated by a Runge-Kutta method of order six. With the centre of mass off the origin the two are coupled, and
//! `plant::step` integrates the coupling in the Runge-Kutta method and the oscillator exactly (an integrating factor):
//! sixth order in general, exact to rounding when nothing rotates or the centre of mass is at the origin.
//!
//! **A hand with mass** moves rigidly with the handle: the plant then integrates flotor and hand as one body, with the hand
//! a point mass at the origin whose weight the person carries. The reported state is always that of the flotor.

mod body;
mod motion;
mod rotation;
mod scheme;
mod step;
mod tableau;
mod translation;

use crate::hand::{Impedance, Intention, Pose};
use crate::ledger::{MechanicalEnergy, Work};
use crate::validation::{Domain, InvalidParameter, number, vector};
use body::Body;
use flotor_hal::glam::{BVec3, DQuat, DVec3};
use motion::{Contact, Motion};
use scheme::Scheme;

/// Longest piece of one call of [`Plant::advance`], ns. Callers split longer intervals.
pub const MAX_PIECE_NS: u64 = 1_000_000;

/// Standard gravity, m/s² (ISO 80000-3).
pub const STANDARD_GRAVITY_M_PER_S2: f64 = 9.806_65;

/// Weight of the flotor as the thesis measured it, N (Varadharajan 2007, section 3.4; its 580 g would weigh
/// 5.69 N).
pub const THESIS_MEASURED_WEIGHT_N: f64 = 6.9;

/// Feed-forward of the thesis's program, N (Varadharajan 2007, section 3.2 and appendix A).
pub const THESIS_FEED_FORWARD_N: f64 = 7.7;

/// Force and torque of the coils on the flotor, at the origin of the flotor frame, device frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    /// Force, N.
    pub force_n: DVec3,
    /// Torque about the origin of the flotor frame, N·m.
    pub torque_nm: DVec3,
}

impl Wrench {
    /// Zero force and torque.
    pub const ZERO: Self = Self { force_n: DVec3::ZERO, torque_nm: DVec3::ZERO };

    /// Returns true if every number is finite. Real-time: bounded, no allocation.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.force_n.is_finite() && self.torque_nm.is_finite()
    }
}

/// Upward force that compensates gravity, acting at the centre of mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FeedForward {
    /// Exactly the weight: the flotor floats.
    Weight,
    /// A set force, N; the difference to the weight acts on the flotor.
    Force(f64),
}

/// Eddy-current drag, acting at the origin of the flotor frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drag {
    /// Drag coefficient of translation, N s/m.
    pub translational_ns_per_m: f64,
    /// Drag coefficient of rotation, N·m s/rad.
    pub rotational_nms_per_rad: f64,
}

/// Physical parameters of the flotor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlotorParameters {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Principal moments of inertia about the centre of mass, along the axes of the flotor frame, kg m².
    pub inertia_kg_m2: DVec3,
    /// Centre of mass in the flotor frame, m.
    pub centre_of_mass_m: DVec3,
    /// Gravity, m/s², pointing down.
    pub gravity_m_per_s2: f64,
    /// Feed-forward that compensates gravity.
    pub feed_forward: FeedForward,
    /// Eddy-current drag.
    pub drag: Drag,
}

impl FlotorParameters {
    /// The thesis's flotor: 580 g (Varadharajan 2007, section 3.2), centre of mass on the axis.
    ///
    /// The centre of mass lies as deep as the one measured on a sister device ([`Self::UTAH`]). The inertia
    /// was never published: it is that of a thin hemisphere of 115 mm radius plus a handle that lifts the
    /// centre of mass to that depth, 3.0 to 3.7 and 3.4 to 3.9 g m² depending on the handle's mass; this is
    /// the middle. Drag is an estimate too: "damped oscillation" (thesis section 3.2) at 1 kHz needs more
    /// than half the stiffness times the period, 0.4 to 1.6 N s/m for the thesis's springs (Colgate and
    /// Schenkel 1997); the rotational one is the same drag spread evenly over the hemisphere, `2/3 b R^2`.
    pub const THESIS: Self = Self {
        mass_kg: 0.580,
        inertia_kg_m2: DVec3::new(3.35e-3, 3.35e-3, 3.65e-3),
        centre_of_mass_m: DVec3::new(0.0, 0.0, -31.7e-3),
        gravity_m_per_s2: STANDARD_GRAVITY_M_PER_S2,
        feed_forward: FeedForward::Weight,
        drag: Drag { translational_ns_per_m: 2.0, rotational_nms_per_rad: 0.0176 },
    };

    /// The flotor of the University of Utah's device: mass and centre of mass from its control program
    /// (repository n-fallahinia/UoU_Soft_V2.0), which compensates 5.674 N. The rest as [`Self::THESIS`].
    pub const UTAH: Self =
        Self { mass_kg: 0.555, centre_of_mass_m: DVec3::new(0.614e-3, 1.225e-3, -31.669e-3), ..Self::THESIS };

    /// Returns the upward compensation force, N. Real-time: bounded, no allocation.
    #[must_use]
    pub fn feed_forward_n(&self) -> f64 {
        match self.feed_forward {
            FeedForward::Weight => self.mass_kg * self.gravity_m_per_s2,
            FeedForward::Force(force_n) => force_n,
        }
    }

    /// Rejects unphysical numbers. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// If a parameter is not finite, not positive, or impossible; the error contains its name.
    pub fn check(&self) -> Result<(), InvalidParameter> {
        number("mass_kg", self.mass_kg, Domain::Positive)?;
        vector("inertia_kg_m2", self.inertia_kg_m2, Domain::Positive)?;
        // The moments of a flat body just meet the triangle inequality: allow for rounding.
        let sum_kg_m2 = self.inertia_kg_m2.element_sum();
        if 2.0 * self.inertia_kg_m2.max_element() > sum_kg_m2 * (1.0 + 1.0e-12) {
            return Err(InvalidParameter::ImpossibleInertia { principal_kg_m2: self.inertia_kg_m2 });
        }
        vector("centre_of_mass_m", self.centre_of_mass_m, Domain::Finite)?;
        number("gravity_m_per_s2", self.gravity_m_per_s2, Domain::Finite)?;
        number("feed_forward_n", self.feed_forward_n(), Domain::Finite)?;
        number("translational_ns_per_m", self.drag.translational_ns_per_m, Domain::NotNegative)?;
        number("rotational_nms_per_rad", self.drag.rotational_nms_per_rad, Domain::NotNegative)
    }
}

/// Pose and velocity of the flotor, device frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// Position of the flotor frame's origin, m.
    pub position_m: DVec3,
    /// Unit quaternion, flotor to device frame.
    pub orientation: DQuat,
    /// Velocity of the flotor frame's origin, m/s.
    pub velocity_m_per_s: DVec3,
    /// Angular velocity, rad/s.
    pub angular_velocity_rad_per_s: DVec3,
}

impl State {
    /// At rest at home.
    pub const HOME: Self = Self {
        position_m: DVec3::ZERO,
        orientation: DQuat::IDENTITY,
        velocity_m_per_s: DVec3::ZERO,
        angular_velocity_rad_per_s: DVec3::ZERO,
    };

    /// Rejects non-finite states and orientations that are no rotation. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// If a part is not finite or no rotation; the error contains its name.
    pub fn check(&self) -> Result<(), InvalidParameter> {
        Pose { position_m: self.position_m, orientation: self.orientation }.check()?;
        vector("velocity_m_per_s", self.velocity_m_per_s, Domain::Finite)?;
        vector("angular_velocity_rad_per_s", self.angular_velocity_rad_per_s, Domain::Finite)
    }
}

/// Result of a piece of motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// Regular motion, with the work done.
    Moved(Work),
    /// The motion exceeded the physical limits (for example with a wrench of 1e30 N): the flotor was stopped at its last
    /// pose.
    Stopped,
}

/// The flotor, free or held by a hand, in motion.
#[derive(Clone, Debug)]
pub struct Plant {
    motion: Motion,
    free: Scheme,
    /// One entry per set of axes along which the hand may yield.
    held: Vec<Held>,
}

/// The flotor in a hand without stiffness along some axes.
#[derive(Clone, Debug)]
struct Held {
    yielding: BVec3,
    scheme: Scheme,
}

impl Plant {
    /// Creates a flotor in `state`, for a hand of `impedance` that may grip it. `nominal_ns` is the most frequent piece
    /// length; its tables are computed once.
    ///
    /// Not real-time.
    ///
    /// # Errors
    /// If a parameter is not physical, or flotor and hand together are stiffer than the integrator resolves.
    pub fn new(
        flotor: &FlotorParameters,
        impedance: &Impedance,
        state: &State,
        nominal_ns: u64,
    ) -> Result<Self, InvalidParameter> {
        Self::yielding(flotor, impedance, &[BVec3::FALSE], state, nominal_ns)
    }

    /// Creates a flotor for a hand that at times yields along a set of axes, else like [`Self::new`]. Not real-time.
    ///
    /// # Errors
    /// Errors of [`Self::new`].
    pub fn yielding(
        flotor: &FlotorParameters,
        impedance: &Impedance,
        yieldings: &[BVec3],
        state: &State,
        nominal_ns: u64,
    ) -> Result<Self, InvalidParameter> {
        flotor.check()?;
        state.check()?;
        let held = yieldings.iter().map(|&yielding| {
            let body = Body::held(flotor, &impedance.yielding(yielding));
            Ok(Held { yielding, scheme: Scheme::new(body, nominal_ns)? })
        });
        Ok(Self {
            motion: Motion::of(state),
            free: Scheme::new(Body::free(flotor), nominal_ns)?,
            held: held.collect::<Result<_, _>>()?,
        })
    }

    /// Returns the present pose and velocity. Real-time: bounded, no allocation.
    #[must_use]
    #[inline]
    pub fn state(&self) -> State {
        self.motion.state()
    }

    /// Sets the state of the flotor; the caller has checked `state`. Real-time: bounded, no allocation.
    pub(crate) fn place(&mut self, state: &State) {
        self.motion = Motion::of(state);
    }

    /// Returns the present mechanical energy of the flotor. Real-time: bounded, no allocation.
    #[must_use]
    #[inline]
    pub fn energy(&self) -> MechanicalEnergy {
        self.free.body().energy(&self.motion)
    }

    /// Advances by `piece_ns` (clamped to [`MAX_PIECE_NS`]) under a constant finite `coils` wrench, held by a hand whose
    /// intention starts as given and moves at its velocity, or free.
    ///
    /// Splitting a piece into smaller ones gives the same motion: to rounding in translation, to the error of the
    /// Runge-Kutta method (order 6) in rotation.
    ///
    /// Real-time: bounded, no allocation. A piece length other than the nominal and the previous one costs a new set of
    /// response functions.
    #[inline]
    pub fn advance(&mut self, piece_ns: u64, coils: &Wrench, hand: Option<&Intention>) -> Outcome {
        if piece_ns == 0 {
            return Outcome::Moved(Work::default());
        }
        let piece_ns = piece_ns.min(MAX_PIECE_NS);
        let contact = hand.map_or(Contact::NONE, Contact::with);
        let scheme = match hand {
            Some(hand) => {
                let fits = |held: &&mut Held| held.yielding == hand.yielding;
                self.held.iter_mut().find(fits).map_or(&mut self.free, |held| &mut held.scheme)
            }
            None => &mut self.free,
        };
        match scheme.step(&self.motion, piece_ns, coils, &contact) {
            Some((motion, work)) => {
                let motion = motion.moving_settled();
                let is_sound = motion.moves_physically() && work.is_finite();
                go_on(&mut self.motion, is_sound.then_some((motion, work)))
            }
            None => advance_by_steps(&mut self.motion, scheme, piece_ns, coils, contact),
        }
    }
}

/// Applies a valid motion, else stops the flotor. Real-time: bounded, no allocation.
#[inline]
fn go_on(motion: &mut Motion, next: Option<(Motion, Work)>) -> Outcome {
    let Some((next, work)) = next else {
        *motion = motion.at_rest();
        return Outcome::Stopped;
    };
    *motion = next;
    Outcome::Moved(work)
}

/// Advances a piece that one straight step cannot cover. Real-time: bounded, no allocation.
#[inline(never)] // keeps the common single step small
fn advance_by_steps(
    motion: &mut Motion,
    scheme: &mut Scheme,
    piece_ns: u64,
    coils: &Wrench,
    contact: Contact,
) -> Outcome {
    let (next, work) = scheme.advance(motion, piece_ns, coils, contact);
    let is_sound = next.is_physical() && work.is_finite();
    go_on(motion, is_sound.then_some((next, work)))
}

#[cfg(test)]
mod tests;
