//! Loop of a run: ticks until the duration is over, a stop is requested, or a fault occurs.

use crate::{Place, RunEnd, SavedLoop, Schedule, Servo, StopSwitch, Unsaved};
use flotor_core::trace::TickRecord;
use flotor_hal::SampleWait;

/// Loop of a servo with its schedule, the same on the real and the virtual clock.
#[must_use]
pub struct Loop {
    servo: Servo,
    schedule: Schedule,
    duration_ns: u64,
    /// Time from which the force fades out before the end of the duration, ns.
    release_ns: u64,
    end: Option<RunEnd>,
}

impl Loop {
    /// Creates a loop before its first tick, for a run of at most `duration_ns`. Not real-time.
    pub fn new(servo: Servo, schedule: Schedule, duration_ns: u64) -> Self {
        Self { servo, schedule, duration_ns, release_ns: u64::MAX, end: None }
    }

    /// Makes the loop fade the force out over the ramp time before the end of the duration, so that the force does not drop
    /// abruptly. Unnecessary on the virtual clock, which has no hand.
    pub fn releasing(self) -> Self {
        Self { release_ns: self.duration_ns.saturating_sub(self.servo.ramp_ns()), ..self }
    }

    /// Waits for the next tick, runs the tick and passes its records to `on_record`; or ends the run ([`Self::end`]). Real-time
    /// after the wait: bounded, no allocation.
    #[inline]
    pub fn advance(&mut self, stop: &StopSwitch, on_record: impl FnMut(&TickRecord)) {
        if self.schedule.next_time_ns() >= self.duration_ns {
            self.end = Some(RunEnd::Finished);
            return;
        }
        let Self { servo, schedule, release_ns, .. } = self;
        // Only the first device can set the pace.
        let next = schedule.next_index();
        let wait_for_sample = |timeout_ns| {
            servo.heartbeat().enter(next, Place::DeviceWait(0));
            let first = servo.devices().next();
            first.map_or(SampleWait::NotPaced, |(device, _)| device.wait_for_sample(timeout_ns))
        };
        let due = match schedule.wait(wait_for_sample) {
            Ok(due) => due,
            Err(lost) => {
                self.end = Some(RunEnd::without_pace(lost));
                return;
            }
        };
        if due.tick.time_ns >= *release_ns {
            servo.release(&due.tick);
        }
        servo.tick(&due, stop, on_record);
        if servo.run().is_over() {
            let end = RunEnd::of(servo.run(), servo.heartbeat());
            // Lost samples end a fade-out early: without a stop request the run has finished.
            let is_time_up = end == RunEnd::Stopped && !stop.is_stop_requested();
            self.end = Some(if is_time_up { RunEnd::Finished } else { end });
        }
    }

    /// Returns the end of the run; `None` while the loop runs.
    #[must_use]
    pub fn end(&self) -> Option<RunEnd> {
        self.end
    }

    /// Saves the state before the next tick. Resets a path-dependent model that was inactive in the last tick, as before its next step.
    /// Not real-time.
    ///
    /// # Errors
    /// [`Unsaved`].
    pub fn save(&mut self) -> Result<SavedLoop, Unsaved> {
        self.check_saved()?;
        let servo = self.servo.save(self.schedule.next_index())?;
        Ok(SavedLoop { schedule: self.schedule, servo })
    }

    /// Restores a state that this loop has saved; later ticks have the same bits as after the state was saved. Not real-time.
    ///
    /// # Errors
    /// [`Unsaved`]; unless it is [`Unsaved::RealClock`] or [`Unsaved::Ended`], the loop has to be dropped.
    pub fn restore(&mut self, saved: &SavedLoop) -> Result<(), Unsaved> {
        self.check_saved()?;
        self.servo.restore(&saved.servo, saved.schedule.next_index())?;
        (self.schedule, self.end) = (saved.schedule, None);
        Ok(())
    }

    fn check_saved(&self) -> Result<(), Unsaved> {
        match self.end {
            _ if !self.schedule.is_virtual() => Err(Unsaved::RealClock),
            None | Some(RunEnd::Finished) => Ok(()),
            Some(_) => Err(Unsaved::Ended),
        }
    }

    /// Returns the servo, with its devices and models.
    pub fn servo(&mut self) -> &mut Servo {
        &mut self.servo
    }

    /// Returns the servo, the end of the run ([`RunEnd::Stopped`] if the loop was still running) and the duration, ns. On the real
    /// clock first waits for the end of the last tick's period. Not real-time.
    #[must_use]
    pub fn finish(self) -> (Servo, RunEnd, u64) {
        (self.servo, self.end.unwrap_or(RunEnd::Stopped), self.schedule.finish())
    }
}
