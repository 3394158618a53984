//! Timing of a spring in motion to its equilibrium: steps per second, independent of the tick rate.
//!
//! A rod that snaps and a base that rolls or falls over move for several steps of their law
//! ([`Validity::NotConverged`]). The distance of a step is bounded, so a step needs a duration: a millisecond. Until
//! the next step is due, a faster loop renders the shape of the last step, which is conservative; a slower loop makes
//! several steps in a tick, at most [`MOST_STEPS`]. So a motion takes the same time at every rate, and at 1 kHz each
//! tick is one step. A tick without a duration (`dt_ns = 0`: the first of a loop, poses of a table) is one step.

use flotor_hal::Input;

use crate::contract;
use crate::pose::Pose;
use crate::response::{Demand, Response};
use crate::validity::Validity;

/// Request to a law that may be in motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Advance {
    /// One step of the motion.
    Step,
    /// Unchanged shape.
    Stay,
}

/// Duration of a step, ns.
const STEP_NS: u64 = 1_000_000;
/// Maximum number of steps in a tick: those of the slowest loop, 100 Hz. Steps missed in a longer pause are dropped.
const MOST_STEPS: u64 = 10;

/// Timing of a motion.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Pace {
    /// Time since the last step was due, ns; negative if that step was made up to half a tick early; `None` at rest.
    since_ns: Option<i64>,
}

flotor_hal::restorable!(Pace { since_ns });

impl Pace {
    /// Returns the response of a tick, after as many steps of the law as are due. Real-time: bounded by the law, no
    /// allocation.
    #[inline]
    pub(crate) fn respond(
        &mut self,
        input: &Input,
        mut law: impl FnMut(Advance, &Pose, Demand) -> Response,
    ) -> Response {
        let (pose, demand) = (contract::pose(input), contract::demand(input));
        match self.since_ns {
            Some(since_ns) if pose.is_valid() => {
                self.go_on(since_ns, input.dt_ns, |advance| law(advance, &pose, demand))
            }
            _ => {
                let response = law(Advance::Step, &pose, demand);
                self.keep(response, 0)
            }
        }
    }

    #[cold]
    fn go_on(&mut self, since_ns: i64, dt_ns: u64, mut law: impl FnMut(Advance) -> Response) -> Response {
        let dt_ns = if dt_ns == 0 { STEP_NS } else { dt_ns.min(MOST_STEPS * STEP_NS) };
        let mut since_ns = since_ns.saturating_add_unsigned(dt_ns);
        // Round to the nearest tick: the period of a loop need not divide a millisecond.
        let early_ns = (dt_ns.min(STEP_NS) / 2).cast_signed();
        let mut response = None;
        while since_ns + early_ns >= STEP_NS.cast_signed() {
            since_ns -= STEP_NS.cast_signed();
            let stepped = law(Advance::Step);
            response = Some(stepped);
            if stepped.validity != Validity::NotConverged {
                break;
            }
        }
        let response = response.unwrap_or_else(|| law(Advance::Stay));
        self.keep(response, since_ns)
    }

    #[inline]
    fn keep(&mut self, response: Response, since_ns: i64) -> Response {
        self.since_ns = (response.validity == Validity::NotConverged).then_some(since_ns);
        response
    }
}
