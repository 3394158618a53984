//! Division of a time interval into equal steps, with the responses of the oscillator.

use super::body::Body;
use super::motion::Motion;
use super::tableau::{END, NODES};
use super::translation::{Gramian, Oscillator, Response};
use crate::hand::Intention;
use crate::ledger::Work;
use crate::units::seconds;

/// Maximum number of steps of an interval.
pub(super) const MAX_STEPS: u32 = 128;

/// Grid of equal steps, with the response of the oscillator in a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    pub(super) steps: u32,
    /// Length of a step, s.
    pub(super) step_s: f64,
    /// Evaluation times of the Runge-Kutta method.
    nodes: [Node; NODES.len()],
    /// Integral of velocity squared over a step.
    pub(super) gramian: Gramian,
}

/// A time during a step, with the response of the oscillator from the start of the step to this time and back.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    /// Time since the start of the step, s.
    pub(super) time_s: f64,
    /// Response after `time_s`.
    pub(super) later: Response,
    /// Response after `-time_s`.
    pub(super) earlier: Response,
}

impl Grid {
    /// Divides an interval into at least `at_least` steps, at most [`MAX_STEPS`].
    pub(super) fn new(body: &Body, piece_ns: u64, at_least: f64) -> Self {
        let mut steps = 1;
        while f64::from(steps) < at_least && steps < MAX_STEPS {
            steps += 1;
        }
        let step_s = seconds(piece_ns) / f64::from(steps);
        Self {
            steps,
            step_s,
            nodes: NODES.map(|share| Node::new(&body.oscillator, share * step_s)),
            gramian: body.oscillator.gramian(step_s),
        }
    }

    /// Returns the node at `index`, clamped to the end of the step.
    #[inline]
    pub(super) fn node(&self, index: usize) -> &Node {
        &self.nodes[index.min(END)]
    }

    /// Returns the node at the end of the step.
    #[inline]
    pub(super) fn end(&self) -> &Node {
        &self.nodes[END]
    }

    /// Takes all steps of the grid; `None` as soon as `step` returns `None`. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn march(
        &self,
        from: &Motion,
        intention: &Intention,
        step: impl Fn(&Intention, &Motion) -> Option<(Motion, Work)>,
    ) -> Option<(Motion, Work)> {
        let (mut motion, mut work, mut intention) = (*from, Work::default(), *intention);
        // A single call site of `step`, so that it is inlined.
        for left in (0..self.steps).rev() {
            let (next, done) = step(&intention, &motion)?;
            motion = next;
            work += done;
            if left > 0 {
                intention = intention.later(self.step_s);
            }
        }
        Some((motion, work))
    }
}

impl Node {
    fn new(oscillator: &Oscillator, time_s: f64) -> Self {
        Self { time_s, later: oscillator.response(time_s), earlier: oscillator.response(-time_s) }
    }
}
