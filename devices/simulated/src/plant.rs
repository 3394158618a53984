//! The flotor as a rigid body with six degrees of freedom.
//!
//! The moving part of the device is a bowl with a handle that floats in a magnetic field: one rigid body, no friction,
//! no transmission. Four loads act on it: the coils' wrench and eddy-current drag, both at the origin of the flotor
//! frame (the centre of the bowl); gravity and its compensation, at the centre of mass; and the hand, at the origin,
//! the place of the handle. Let `y` be the position of the centre of mass, `c` its position in the flotor frame,
//! `x = y - R c` the position of the origin, `q` the orientation (as a matrix: `R`), `w` the angular velocity in the
//! flotor frame, `b` and `d` the drag coefficients and `f` the compensation force; `h` marks the hand:
//!
//! ```text
//! m y'' = F_coils - b x' + F_hand + (f - m g) z          F_hand = F_h + K (x_h - x) + B (x_h' - x')
//! I w' + w x I w = R^T T_coils - c x R^T (F_coils - b x' + F_hand) - d w + T_hand
//! q' = q w / 2
//! ```
//!
//! **Time.** A coil wrench is constant from one tick to the next, so during a step the translation is a linear
//! oscillator under a constant or linearly growing force, and `plant::translation` solves it exactly. The rotation is
//! nonlinear and integrated by a Runge-Kutta method of order six. With the centre of mass off the origin, translation
//! and rotation are coupled, and `plant::step` integrates the coupling with the Runge-Kutta method and the oscillator
//! exactly (an integrating factor): the translation is of order six in general, and exact to rounding if nothing
//! rotates or the centre of mass is at the origin.
//!
//! **A hand with mass** moves rigidly with the handle: the plant then integrates flotor and hand as one body, with the hand
//! a point mass at the origin whose weight the person carries. The reported state is always that of the flotor.

mod body;
mod flotor;
mod grid;
mod motion;
mod rotation;
mod scheme;
mod state;
mod step;
mod tableau;
mod translation;

pub use flotor::{Drag, FeedForward, FlotorParameters, STANDARD_GRAVITY_M_PER_S2};
pub use scheme::MAX_PIECE_NS;
pub use state::{State, Wrench};

use crate::hand::{Impedance, Intention, Pose};
use crate::ledger::{MechanicalEnergy, Work};
use crate::validation::InvalidParameter;
use body::Body;
use flotor_hal::glam::BVec3;
use flotor_hal::restorable;
use motion::Motion;
use scheme::Scheme;

/// Placeholder for the intention if there is no hand (its impedance is zero then).
const NO_INTENTION: Intention = Intention::resting(Pose::HOME);

/// Result of [`Plant::advance`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// The flotor moved, and this work was done on it.
    Moved(Work),
    /// The motion exceeded the physical limits (for example with a wrench of 1e30 N): the flotor was stopped at its last
    /// pose.
    Stopped,
}

/// Integrator of the flotor, free or held by a hand, with its state of motion.
#[derive(Clone, Debug)]
pub struct Plant {
    motion: Motion,
    free: Scheme,
    /// One entry per set of axes along which the hand may yield.
    held: Vec<Held>,
}

restorable!(Plant { motion } without { free, held });

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

    /// Creates a flotor as [`Self::new`] does, for a hand that may have no stiffness along one of the sets of axes
    /// `yieldings`. Not real-time.
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
    #[inline]
    pub fn energy(&self) -> MechanicalEnergy {
        self.free.body().energy(&self.motion)
    }

    /// Advances by `piece_ns` (clamped to [`MAX_PIECE_NS`]) under a constant finite `coils` wrench; `hand` is the
    /// intention at the start, whose position moves at its velocity; `None`: the flotor is free. The hand has no
    /// impedance if its set of yielding axes was not given at creation.
    ///
    /// Splitting a piece into smaller ones gives the same motion: to rounding in translation, to the error of the
    /// Runge-Kutta method (order 6) in rotation.
    ///
    /// Real-time: bounded, no allocation. A piece length other than the nominal and the previous one costs a new set of
    /// response functions.
    #[inline(always)] // in the middle of a tick
    pub fn advance(&mut self, piece_ns: u64, coils: &Wrench, hand: Option<&Intention>) -> Outcome {
        let Some(hand) = hand else { return self.advance_free(piece_ns, coils) };
        let scheme = match self.held.as_mut_slice() {
            [held, ..] if held.yielding == hand.yielding => &mut held.scheme,
            others => yielding_scheme(others, hand.yielding).unwrap_or(&mut self.free),
        };
        advance_piece(&mut self.motion, scheme, piece_ns, coils, hand)
    }

    /// Advances a flotor without a hand. Real-time: bounded, no allocation.
    #[inline(never)] // inlined, the numbers of a hand would be kept in memory for both cases
    fn advance_free(&mut self, piece_ns: u64, coils: &Wrench) -> Outcome {
        advance_piece(&mut self.motion, &mut self.free, piece_ns, coils, &NO_INTENTION)
    }
}

/// Returns the scheme of the hand that yields along these axes. Real-time: bounded, no allocation.
#[inline(never)] // most hands never yield
fn yielding_scheme(held: &mut [Held], yielding: BVec3) -> Option<&mut Scheme> {
    held.iter_mut().find(|held| held.yielding == yielding).map(|held| &mut held.scheme)
}

/// Advances a piece, clamped to [`MAX_PIECE_NS`]. Real-time: bounded, no allocation.
#[inline(always)] // in the middle of a tick
fn advance_piece(
    motion: &mut Motion,
    scheme: &mut Scheme,
    piece_ns: u64,
    coils: &Wrench,
    intention: &Intention,
) -> Outcome {
    if piece_ns == 0 {
        return Outcome::Moved(Work::default());
    }
    let piece_ns = piece_ns.min(MAX_PIECE_NS);
    match scheme.step(motion, piece_ns, coils, intention) {
        Some((next, work)) => {
            let next = next.moving_settled();
            let is_sound = next.moves_physically() && work.is_finite();
            go_on(motion, is_sound.then_some((next, work)))
        }
        None => advance_by_steps(motion, scheme, piece_ns, coils, intention),
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
    intention: &Intention,
) -> Outcome {
    let (next, work) = scheme.advance(motion, piece_ns, coils, intention);
    let is_sound = next.is_physical() && work.is_finite();
    go_on(motion, is_sound.then_some((next, work)))
}

#[cfg(test)]
mod tests;
