//! The loop: tick after tick until the duration is over, somebody stops it, or a device faults.

use crate::{
    Cause, EmergencySource, Heartbeat, PaceLost, Place, RunState, Schedule, Servo, StopSwitch, Stuck,
};
use flotor_core::trace::TickRecord;
use flotor_hal::{Fault, SampleWait};

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunEnd {
    /// The duration is over.
    Finished,
    /// Somebody asked it to stop.
    Stopped,
    /// The device faulted.
    DeviceFault(Fault),
    /// The emergency stop was pressed.
    EmergencyStop(EmergencySource),
    /// The device sets the pace, and it is a faster one than the scene says: this many samples a second.
    TooFast(u32),
    /// The scene asks the device to set the pace, and with its settings it sets none.
    NotPaced,
    /// A tick took so long that the watchdog stopped the device; then it came back.
    Watchdog(Stuck),
    /// The force of a device swung between its limits, and went on when it was damped.
    Oscillation,
    /// The watchdog process was gone, without which the scene does not run: it ended in order.
    Unguarded,
}

impl RunEnd {
    /// Whether the run ended as it should: its time was over, or somebody stopped it. Real-time: bounded, no allocation.
    #[must_use]
    pub const fn is_in_order(self) -> bool {
        matches!(self, Self::Finished | Self::Stopped)
    }

    /// What it means that a device does not set the pace it should.
    fn without_pace(lost: PaceLost) -> Self {
        match lost {
            PaceLost::NotPaced => Self::NotPaced,
            PaceLost::TooFast { samples, elapsed_ns } => {
                let per_s = samples.saturating_mul(1_000_000_000) / elapsed_ns.max(1);
                Self::TooFast(u32::try_from(per_s).unwrap_or(u32::MAX))
            }
        }
    }

    /// What the last state of a run means for those who asked for it.
    fn of(run: RunState, heart: &Heartbeat) -> Self {
        match (run, heart.bitten()) {
            (RunState::Faulted(Cause::Device(fault)), _) => Self::DeviceFault(fault),
            // One that was stopped with the whole process has not bitten.
            (RunState::Faulted(Cause::Watchdog), stuck) => Self::Watchdog(stuck.unwrap_or(heart.now())),
            (RunState::Faulted(Cause::Oscillation), _) => Self::Oscillation,
            (RunState::EmergencyStopped(source), _) => Self::EmergencyStop(source),
            _ => Self::Stopped,
        }
    }
}

/// The loop proper, the same for both clocks.
pub struct Loop {
    servo: Servo,
    schedule: Schedule,
    duration_ns: u64,
    /// From when on force fades out because the duration will be over.
    release_ns: u64,
    end: Option<RunEnd>,
}

impl Loop {
    /// A loop before its first tick. Not real-time.
    #[must_use]
    pub fn new(servo: Servo, schedule: Schedule, duration_ns: u64) -> Self {
        Self { servo, schedule, duration_ns, release_ns: u64::MAX, end: None }
    }

    /// The same with an end that a hand can bear: force is gone when the duration is over, and does not drop then. On the
    /// virtual clock there is no hand.
    #[must_use]
    pub fn releasing(self) -> Self {
        Self { release_ns: self.duration_ns.saturating_sub(self.servo.ramp_ns()), ..self }
    }

    /// Waits for and runs the next tick, or sets `end`; `leave` gets what it leaves behind. Real-time: bounded, no allocation.
    #[inline]
    pub fn advance(&mut self, stop: &StopSwitch, leave: impl FnMut(&TickRecord)) {
        if self.schedule.next_time_ns() >= self.duration_ns {
            self.end = Some(RunEnd::Finished);
            return;
        }
        let Self { servo, schedule, release_ns, .. } = self;
        // The first device sets the pace, if one does.
        let next = schedule.next_index();
        let wait_for_sample = |timeout_ns| {
            servo.heart().enter(next, Place::DeviceWait(0));
            servo
                .devices()
                .next()
                .map_or(SampleWait::NotPaced, |(device, _)| device.wait_for_sample(timeout_ns))
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
        servo.tick(&due, stop, leave);
        if servo.run().is_over() {
            let end = RunEnd::of(servo.run(), servo.heart());
            // Lost samples end a release early; nobody has asked for one then.
            let is_time_up = end == RunEnd::Stopped && !stop.is_stop_asked();
            self.end = Some(if is_time_up { RunEnd::Finished } else { end });
        }
    }

    /// How the loop ended, once it has.
    #[must_use]
    pub fn end(&self) -> Option<RunEnd> {
        self.end
    }

    /// The tick, its devices and models.
    pub fn servo(&mut self) -> &mut Servo {
        &mut self.servo
    }

    /// Waits for the end of the last tick's period: what is left of the servo, how it ended, and how long it ran, ns. Not real-time.
    #[must_use]
    pub fn finish(self) -> (Servo, RunEnd, u64) {
        (self.servo, self.end.unwrap_or(RunEnd::Stopped), self.schedule.finish())
    }
}
