//! Hot swap of models: boxed layers, created and dropped outside the loop, move into the running loop and back through wait-free queues.
//!
//! The loop takes a model out of a queue and puts it in place between two ticks; the replaced model fades out and returns through
//! another queue. Nothing in the loop allocates or frees.

use super::forces::Forces;
use super::models::{Layer, Replacement};
use flotor_hal::Tick;
use rtrb::{Consumer, Producer, RingBuffer};

/// Layer that is no longer needed, with its model number.
pub(crate) type Retired = (usize, Layer);

/// Loop side of the hot swap: scheduled replacements, and both queues.
pub struct LoopSwaps {
    /// Scheduled replacements in order of their run time, ns; `None` once a replacement has been applied.
    schedule: Box<[(u64, Option<Replacement>)]>,
    next: usize,
    arriving: Consumer<Replacement>,
    retired: Producer<Retired>,
}

/// Host side of the hot swap.
pub struct HostSwaps {
    /// Sender of replacements to the loop.
    pub leaving_for_the_loop: Producer<Replacement>,
    /// Receiver of layers that the loop no longer needs, to be dropped by the host.
    pub retired: Consumer<Retired>,
}

/// Creates both sides for `models` models; `schedule` has replacements, each with the run time from which it is due, ns. Not real-time.
pub fn swap_queues(models: usize, mut schedule: Vec<(u64, Replacement)>) -> (LoopSwaps, HostSwaps) {
    schedule.sort_by_key(|(time_ns, _)| *time_ns); // stable: equal times keep the scene's order
    // One replacement of each model may be pending. The return queue has room for two layers of each model and for the scheduled ones.
    let (leaving_for_the_loop, arriving) = RingBuffer::new(models.max(1));
    let (retired, taken_back) = RingBuffer::new(2 * models + schedule.len() + 1);
    let schedule = schedule.into_iter().map(|(time_ns, replacement)| (time_ns, Some(replacement))).collect();
    let swaps = LoopSwaps { schedule, next: 0, arriving, retired };
    (swaps, HostSwaps { leaving_for_the_loop, retired: taken_back })
}

impl LoopSwaps {
    /// Returns true if a replacement is due at this tick. Real-time: bounded, no allocation.
    pub fn is_due(&self, tick: &Tick) -> bool {
        self.is_scheduled(tick) || !self.arriving.is_empty()
    }

    /// Returns true if the next scheduled replacement is due.
    fn is_scheduled(&self, tick: &Tick) -> bool {
        self.schedule.get(self.next).is_some_and(|(time_ns, _)| *time_ns <= tick.time_ns)
    }

    /// Returns faded layers to the host and applies the replacements that are due; calls `report` with model number and generation
    /// of each. A replacement waits while the return queue is full.
    ///
    /// Real-time: bounded by the models and the schedule, no allocation.
    #[inline]
    pub fn apply_due(&mut self, tick: &Tick, models: &mut Forces, mut report: impl FnMut(usize, u16)) {
        while !self.retired.is_full()
            && let Some(faded) = models.take_faded(tick)
        {
            let _ = self.retired.push(faded); // there is room
        }
        // Each replacement may displace a layer: it is only taken if the queue has room for that layer.
        while !self.retired.is_full()
            && let Some(replacement) = self.due(tick)
        {
            let (model, generation) = (replacement.model, replacement.generation);
            if let Some(pushed_out) = models.replace(replacement, tick) {
                let _ = self.retired.push((model, pushed_out)); // there is room
            }
            report(model, generation);
        }
    }

    /// Returns the layers of the replacements that were not applied, each with its model number. Not real-time.
    pub fn into_layers(mut self) -> Vec<(usize, Layer)> {
        let scheduled = self.schedule.into_iter().filter_map(|(_, replacement)| replacement);
        let arriving = std::iter::from_fn(|| self.arriving.pop().ok());
        scheduled.chain(arriving).map(|replacement| (replacement.model, replacement.layer)).collect()
    }

    /// Takes the next replacement that is due.
    #[inline]
    fn due(&mut self, tick: &Tick) -> Option<Replacement> {
        if !self.is_scheduled(tick) {
            return self.arriving.pop().ok();
        }
        let (_, replacement) = self.schedule.get_mut(self.next)?;
        self.next += 1;
        replacement.take()
    }
}
