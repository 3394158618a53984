//! The loop's side of an exchange: the calls of the device contract.

use crate::exchange::{Command, Exchange};
use flotor_hal::{Cycle, DVec3, DeviceState, Fault, GripKind, GripState, SafeStop, SampleWait, Tick, Wrench};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Stop handle that removes the force of an exchange, usable from any thread.
#[derive(Clone, Debug)]
pub struct StopSwitch(pub Arc<Exchange>);

impl SafeStop for StopSwitch {
    fn safe_stop(&self) {
        self.0.stop();
    }
}

/// Implementation of `read`, `write` and `wait_for_sample` for a device that a thread of an SDK drives.
#[derive(Debug)]
pub struct LoopEnd {
    exchange: Arc<Exchange>,
    /// Limits of force, N, and torque, N·m, in any direction.
    most: [f64; 2],
    /// Largest effort at the grip, N; 0 for a device without one.
    most_effort: f64,
    timeout: Duration,
    seen: u64,
    /// Number of samples counted by earlier waits.
    awaited: u64,
    fresh: Instant,
    state: DeviceState,
    grip: GripState,
    /// Effort of the next command, N.
    effort: f64,
}

impl LoopEnd {
    /// Creates the loop's side of an exchange that has begun. `most` limits the magnitude of force, N, and torque, N·m;
    /// `timeout` without a sample is a fault. Not real-time.
    #[must_use]
    pub fn new(exchange: Arc<Exchange>, most: [f64; 2], timeout: Duration) -> Self {
        let seen = exchange.begun_at();
        Self {
            exchange,
            most,
            most_effort: 0.0,
            timeout,
            seen,
            awaited: seen,
            fresh: Instant::now(),
            state: DeviceState::HOME,
            grip: GripState::new(GripKind::Linear, 0.0, 0.0),
            effort: 0.0,
        }
    }

    /// Sets the largest effort at a grip, N. Not real-time.
    #[must_use]
    pub fn with_grip(self, most_effort: f64) -> Self {
        Self { most_effort, ..self }
    }

    /// Writes the newest sample to `state`; without a new sample, the last one, as [`Cycle::Stale`] or, after the timeout,
    /// [`Fault::Timeout`]. A fault of the exchange takes precedence, with the last sample. Real-time: bounded, no allocation; in
    /// lockstep it waits, a second at most.
    pub fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle {
        if let Some(patience) = self.exchange.lockstep_patience() {
            self.exchange.wait_for_sample(self.seen, patience);
        }
        let newest = self.exchange.newest().filter(|(count, ..)| *count > self.seen);
        let cycle = match (self.exchange.fault(), newest) {
            (Some(fault), _) => Cycle::Fault(fault),
            (None, Some((count, sample, grip))) => {
                (self.seen, self.fresh, self.grip) = (count, Instant::now(), grip);
                self.state = DeviceState { sampled_ns: tick.time_ns, ..sample };
                Cycle::Fresh
            }
            (None, None) if self.fresh.elapsed() > self.timeout => Cycle::Fault(Fault::Timeout),
            (None, None) => Cycle::Stale,
        };
        *state = self.state;
        cycle
    }

    /// Writes the grip of the last sample that [`Self::read`] took. Real-time: bounded, no allocation.
    pub fn read_grip(&self, state: &mut GripState) {
        *state = self.grip;
    }

    /// Sets the effort of the next command, limited in magnitude; an effort that is not finite counts as zero. Real-time:
    /// bounded, no allocation.
    pub fn write_grip(&mut self, effort: f64) {
        self.effort =
            if effort.is_finite() { effort.clamp(-self.most_effort, self.most_effort) } else { 0.0 };
    }

    /// Publishes the wrench with the effort, limited in magnitude; a force or torque that is not finite counts as zero. Returns the
    /// fault of the exchange, if any. Real-time: bounded, no allocation.
    pub fn write(&mut self, wrench: &Wrench) -> Cycle {
        let [force_n, torque_nm] = [wrench.force(), wrench.torque()];
        let within = |vector: DVec3, most: f64| {
            if vector.is_finite() { vector.clamp_length_max(most) } else { DVec3::ZERO }
        };
        let [most_n, most_nm] = self.most;
        let wrench = Wrench::new(within(force_n, most_n), within(torque_nm, most_nm));
        self.exchange.command(&Command { wrench, effort: self.effort });
        self.exchange.fault().map_or(Cycle::Fresh, Cycle::Fault)
    }

    /// Waits until the exchange has a sample that no earlier call has counted, or until the timeout; returns the number
    /// of new samples, and 1 after a fault, which the next read returns. Apart from the wait real-time: no allocation.
    pub fn wait_for_sample(&mut self, timeout_ns: u64) -> SampleWait {
        self.exchange.wait_for_sample(self.awaited, Duration::from_nanos(timeout_ns));
        let samples = self.exchange.samples();
        let new = samples.saturating_sub(self.awaited);
        self.awaited = samples;
        match (new, self.exchange.fault()) {
            // The next read returns the fault.
            (0, Some(_)) => SampleWait::Arrived { samples: 1 },
            (0, None) => SampleWait::TimedOut,
            (samples, _) => SampleWait::Arrived { samples },
        }
    }
}
