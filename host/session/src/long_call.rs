//! Limits of a call that may not return: processor time, waiting time, and time after a stop request.
//!
//! Time in which other threads have the processor does not count: ten times the limit of the processor time is allowed for waiting.

use crate::calls::STEP_LIMIT_VARIABLE;
use crate::platform::ThreadClock;
use flotor_servo::StopSwitch;
use std::time::{Duration, Instant};

/// Default limit of the processor time of a call.
const DEFAULT_LIMIT: Duration = Duration::from_secs(1);
/// Limit of the waiting time of a call, as a multiple of the limit of its processor time.
const WAITS: u32 = 10;
/// Grace period of a call after a stop request.
const STOP_PATIENCE: Duration = Duration::from_secs(1);
/// Longest time that counts between two polls: a longer one shows that the polling thread had no processor either.
const LONGEST_LOOK: Duration = Duration::from_millis(100);

/// Returns the limit on the processor time of a call in a loop on the virtual clock: the value of `FLOTOR_STEP_LIMIT_S`, or 1 s. Not
/// real-time.
#[must_use]
pub fn step_limit() -> Duration {
    crate::calls::limit_of(STEP_LIMIT_VARIABLE).unwrap_or(DEFAULT_LIMIT)
}

const REMEDY: &str = "set `FLOTOR_STEP_LIMIT_S` to raise the limit";

/// Limit that a call has exceeded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Exceeded {
    /// Watchdog timeout; the watchdog has stopped the devices.
    #[error(
        "; the watchdog stopped all devices after {} ms (`[limits] watchdog_ms` sets the limit)",
        .0.as_millis()
    )]
    Watchdog(Duration),
    /// Limit of processor time.
    #[error(" within {} s of processor time ({REMEDY})", .0.as_secs_f64())]
    Processor(Duration),
    /// Limit of the time in which the thread needed no processor.
    #[error(
        " within {} s, without measured use of a processor: the call may be blocked ({REMEDY})",
        .0.as_secs_f64()
    )]
    Waiting(Duration),
    /// Limit of the time after a stop request.
    #[error(" within {} s after the request to stop", .0.as_secs_f64())]
    Stop(Duration),
}

/// Timer of a call at a place of the loop, polled from another thread.
pub struct LongCall<P> {
    place: P,
    ran_before: Option<Duration>,
    waited: Duration,
    lasted: Duration,
    looked: Instant,
}

impl<P: PartialEq> LongCall<P> {
    /// Starts the timing of a call at `place` that has just begun.
    pub fn new(place: P) -> Self {
        let (waited, lasted) = (Duration::ZERO, Duration::ZERO);
        Self { place, ran_before: None, waited, lasted, looked: Instant::now() }
    }

    /// Returns the place of the call.
    pub fn place(&self) -> &P {
        &self.place
    }

    /// Polls the thread of `clock`, which is at `place` now, and returns the limit that the call has exceeded; at a new place the
    /// timing starts again. Call this function every few tens of milliseconds. Not real-time.
    pub fn check(
        &mut self,
        place: P,
        clock: &ThreadClock,
        limit: Duration,
        stop: Option<&StopSwitch>,
    ) -> Option<Exceeded> {
        let used = clock.used();
        let ran = used.map_or(Duration::ZERO, |used| used.ran);
        if place != self.place {
            *self = Self { ran_before: Some(ran), ..Self::new(place) };
            return None;
        }
        let since = self.looked.elapsed().min(LONGEST_LOOK);
        self.looked = Instant::now();
        self.lasted += since;
        if !used.is_some_and(|used| used.wants) {
            self.waited += since;
        }
        let before = *self.ran_before.get_or_insert(ran);
        let is_to_stop = stop.is_some_and(|stop| stop.is_stop_requested() || stop.emergency().is_some());
        if ran.saturating_sub(before) >= limit {
            Some(Exceeded::Processor(limit))
        } else if self.waited >= WAITS * limit {
            Some(Exceeded::Waiting(WAITS * limit))
        } else if is_to_stop && self.lasted >= STOP_PATIENCE {
            Some(Exceeded::Stop(STOP_PATIENCE))
        } else {
            None
        }
    }
}
