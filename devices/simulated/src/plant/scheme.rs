//! Division of time intervals into steps, with tables for each step length.
//!
//! A flotor without rotation and torque is integrated exactly; its steps are limited only by the series of the
//! oscillator. A rotating flotor is integrated in finer steps, limited by the fastest rate of its rotation and of the
//! forces off its centre of mass.

use super::body::Body;
use super::grid::{Grid, MAX_STEPS};
use super::motion::Motion;
use super::state::Wrench;
use super::step::Step;
use super::translation::MAX_STEP_TIMES_RATE;
use crate::hand::Intention;
use crate::ledger::Work;
use crate::units::seconds;
use crate::validation::InvalidParameter;
use flotor_hal::glam::DVec3;

/// Longest step of a rotating flotor times the fastest rate of its rotation and, where the two are coupled, of its
/// translation (pure number). The energy balance of a firm hand that grips the flotor askew then closes to 1e-11 of the
/// energy in the hand's springs.
const MAX_TURNING_STEP: f64 = 0.1;

/// Maximum interval of one call of [`Plant::advance`](super::Plant::advance), ns. Callers split longer intervals.
pub const MAX_PIECE_NS: u64 = 1_000_000;

/// Body with the tables of two intervals: the nominal interval and the last other one.
#[derive(Clone, Debug)]
pub(super) struct Scheme {
    body: Body,
    nominal: Table,
    other: Table,
}

/// The two divisions of an interval into steps.
#[derive(Clone, Copy, Debug)]
struct Table {
    piece_ns: u64,
    /// Grid for a flotor without rotation.
    straight: Grid,
    /// Grid for a rotating flotor.
    turning: Grid,
}

impl Scheme {
    /// Prepares the tables of a body. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// If the maximum interval would need more than [`MAX_STEPS`] steps.
    pub(super) fn new(body: Body, nominal_ns: u64) -> Result<Self, InvalidParameter> {
        let most_steps = f64::from(MAX_STEPS);
        let steps = straight_steps(&body, MAX_PIECE_NS).max(turning_steps(&body, MAX_PIECE_NS));
        // Parameters near the largest float can overflow to NaN.
        if steps.is_nan() || steps > most_steps {
            return Err(InvalidParameter::TooStiff { steps_per_ms: steps, limit: most_steps });
        }
        let nominal = Table::new(&body, nominal_ns.clamp(1, MAX_PIECE_NS));
        Ok(Self { body, nominal, other: nominal })
    }

    /// Returns the body. Real-time: bounded, no allocation.
    pub(super) fn body(&self) -> &Body {
        &self.body
    }

    /// Advances by `piece_ns` in one straight step; returns the new motion and the work done, or `None` if one straight step is not
    /// exact.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn step(
        &mut self,
        from: &Motion,
        piece_ns: u64,
        coils: &Wrench,
        intention: &Intention,
    ) -> Option<(Motion, Work)> {
        let (body, table) = self.prepared(piece_ns);
        if table.straight.steps > 1 {
            return None;
        }
        Step::new(body, &table.straight, coils, intention, from).straight()
    }

    /// Advances by `piece_ns` in the necessary number of steps, after [`Self::step`] returned `None`; returns the new
    /// motion and the work done.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn advance(
        &mut self,
        from: &Motion,
        piece_ns: u64,
        coils: &Wrench,
        intention: &Intention,
    ) -> (Motion, Work) {
        let (body, table) = self.prepared(piece_ns);
        let straight = || {
            table.straight.march(from, intention, |intention, motion| {
                Step::new(body, &table.straight, coils, intention, motion).straight()
            })
        };
        // A failed single step implies rotation.
        let (motion, work) = (table.straight.steps > 1)
            .then(straight)
            .flatten()
            .or_else(|| {
                table.turning.march(from, intention, |intention, motion| {
                    Some(Step::new(body, &table.turning, coils, intention, motion).turning())
                })
            })
            .unwrap_or((*from, Work::default()));
        (motion.settled(), work)
    }

    /// Returns the body and the table for an interval of `piece_ns`, computed unless stored.
    #[inline]
    fn prepared(&mut self, piece_ns: u64) -> (&Body, &Table) {
        if piece_ns == self.nominal.piece_ns {
            return (&self.body, &self.nominal);
        }
        if piece_ns != self.other.piece_ns {
            self.prepare(piece_ns);
        }
        (&self.body, &self.other)
    }

    #[cold] // pieces are of one or two lengths
    fn prepare(&mut self, piece_ns: u64) {
        self.other = Table::new(&self.body, piece_ns);
    }
}

impl Table {
    fn new(body: &Body, piece_ns: u64) -> Self {
        let straight = straight_steps(body, piece_ns);
        let turning = turning_steps(body, piece_ns).max(straight);
        let straight = Grid::new(body, piece_ns, straight);
        let turning =
            if turning <= f64::from(straight.steps) { straight } else { Grid::new(body, piece_ns, turning) };
        Self { piece_ns, straight, turning }
    }
}

/// Returns the number of steps of an interval needed for the series of the oscillator, not rounded up. Real-time: bounded, no
/// allocation.
fn straight_steps(body: &Body, piece_ns: u64) -> f64 {
    body.oscillator.rate_per_s() * seconds(piece_ns) / MAX_STEP_TIMES_RATE
}

/// Returns the number of steps of an interval needed for the accuracy of the rotation, not rounded up. Real-time: bounded, no
/// allocation.
fn turning_steps(body: &Body, piece_ns: u64) -> f64 {
    let coupled = body.centre_of_mass_m != DVec3::ZERO;
    let coupled_rate_per_s = if coupled { body.oscillator.rate_per_s() } else { 0.0 };
    body.rotation_rate_per_s.max(coupled_rate_per_s) * seconds(piece_ns) / MAX_TURNING_STEP
}
