//! Model computed in the tick of the loop at multiples of the model's period, with delayed answers.

use super::source::Source;
use crate::{Engine, Stepped};
use flotor_hal::abi::CallStatus;
use flotor_hal::{ContactSet, Input};

/// Model on the virtual clock.
pub(super) struct Inline {
    pub(super) source: Source,
    period_ns: u64,
    latency_ns: u64,
    /// Time of the next computation, ns.
    next_ns: u64,
    /// Release time of the computed answers, ns. A latency is at most a period, so no answer replaces one that is held back.
    ready_ns: Option<u64>,
    /// Computed answer of each port, and those that are released in this tick.
    held_back: Box<[ContactSet]>,
    released: Box<[ContactSet]>,
    is_released: bool,
}

impl Inline {
    /// Creates the model before its first answer, with this number of ports. Not real-time.
    pub(super) fn new(model: Engine, ports: usize, [period_ns, latency_ns]: [u64; 2]) -> Self {
        let sets: Box<[ContactSet]> = vec![ContactSet::NONE; ports].into();
        Self {
            source: Source::new(model),
            period_ns,
            latency_ns,
            next_ns: 0,
            ready_ns: None,
            held_back: sets.clone(),
            released: sets,
            is_released: false,
        }
    }

    /// Releases the answers whose latency is over, and computes the next ones if they are due; returns [`Stepped::Broken`] if that
    /// fails, otherwise late.
    pub(super) fn begin(&mut self, inputs: &[Input]) -> Stepped {
        let now_ns = inputs.first().map_or(0, |input| input.time_ns);
        self.is_released = self.ready_ns.take_if(|ready_ns| now_ns >= *ready_ns).is_some();
        if self.is_released {
            std::mem::swap(&mut self.held_back, &mut self.released);
        }
        if now_ns >= self.next_ns {
            self.next_ns = (now_ns / self.period_ns + 1) * self.period_ns;
            match self.source.compute(inputs, &mut self.held_back) {
                Stepped::Answered => self.ready_ns = Some(now_ns + self.latency_ns),
                Stepped::Broken | Stepped::Gone => return Stepped::Broken,
                // The next computation may yield an answer.
                _ => {}
            }
        }
        Stepped::Late
    }

    /// Copies the answer of a port that is released in this tick to `set`; returns late if there is none.
    pub(super) fn newest(&self, port: usize, set: &mut ContactSet) -> Stepped {
        let Some(released) = self.released.get(port).filter(|_| self.is_released) else {
            return Stepped::Late;
        };
        *set = *released;
        Stepped::Answered
    }

    /// Clears the history of the model and its answers.
    pub(super) fn reset(&mut self) -> CallStatus {
        self.ready_ns = None;
        self.source.reset()
    }
}
