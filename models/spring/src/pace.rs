//! The pace of a spring that moves by itself: per second, not per tick.
//!
//! A rod that snaps and a base that rolls or falls over are on their way for several steps of their law
//! ([`Validity::NotConverged`]). A step goes a bounded way, so it needs a duration: a millisecond. A faster loop holds the
//! wrench of a step until the next is due, a slower one makes several steps in a tick, at most [`MOST_STEPS`]. So a motion
//! takes the same time at every rate, and at 1 kHz each tick is one step. A tick without a duration (`dt_ns = 0`: the first of
//! a loop, poses of a table) is one step.

use flotor_hal::Input;

use crate::contract;
use crate::response::{Demand, Response};
use crate::validity::Validity;

/// Duration of a step, ns.
const STEP_NS: u64 = 1_000_000;
/// Steps in a tick at most: those of the slowest loop, 100 Hz. What a longer pause leaves out is not caught up.
const MOST_STEPS: u64 = 10;

/// The time of a motion, and the wrench that is felt in it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Pace {
    moving: Option<Motion>,
}

/// A law on its way.
#[derive(Clone, Copy, Debug)]
struct Motion {
    response: Response,
    /// Time since its last step was due, ns; negative where that was made up to half a tick early.
    since_ns: i64,
}

impl Pace {
    /// Returns the answer of a tick by as many steps of a law as are due. Real-time: bounded by the law, no allocation.
    #[inline]
    pub(crate) fn respond(
        &mut self,
        input: &Input,
        mut step: impl FnMut(&crate::pose::Pose, Demand) -> Response,
    ) -> Response {
        let (pose, demand) = (contract::pose(input), contract::demand(input));
        match self.moving {
            Some(motion) if pose.is_valid() => self.go_on(motion, input.dt_ns, || step(&pose, demand)),
            _ => {
                let response = step(&pose, demand);
                self.keep(Motion { response, since_ns: 0 })
            }
        }
    }

    /// The law is at an equilibrium.
    pub(crate) fn end(&mut self) {
        self.moving = None;
    }

    #[cold]
    fn go_on(&mut self, mut motion: Motion, dt_ns: u64, mut step: impl FnMut() -> Response) -> Response {
        let dt_ns = if dt_ns == 0 { STEP_NS } else { dt_ns.min(MOST_STEPS * STEP_NS) };
        motion.since_ns = motion.since_ns.saturating_add_unsigned(dt_ns);
        // To the nearest tick: the period of a loop need not divide a millisecond.
        let early_ns = (dt_ns.min(STEP_NS) / 2).cast_signed();
        while motion.since_ns + early_ns >= STEP_NS.cast_signed() {
            motion.since_ns -= STEP_NS.cast_signed();
            motion.response = step();
            if motion.response.validity != Validity::NotConverged {
                break;
            }
        }
        self.keep(motion)
    }

    #[inline]
    fn keep(&mut self, motion: Motion) -> Response {
        self.moving = (motion.response.validity == Validity::NotConverged).then_some(motion);
        motion.response
    }
}
