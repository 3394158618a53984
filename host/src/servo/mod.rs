//! The servo: one tick after the other, `device -> mapping -> models -> envelope -> device`.
//!
//! Nothing in a tick allocates, locks, formats or waits on another thread. What a tick leaves behind is a
//! [`TickRecord`]; whoever watches gets it through a ring, off the loop.

mod clock;
mod envelope;
mod models;
mod realtime;
mod timing;

pub use clock::{Clock, SpinWindow};
pub(crate) use clock::{Schedule, monotonic_ns, sleep_until};
pub use envelope::Envelope;
pub use models::ModelHealth;
pub(crate) use models::{ModelSlot, ModelStack};
pub use realtime::{Privilege, RealTimeReport};
pub(crate) use realtime::{enter_real_time, probe_real_time};
pub use timing::{Durations, Percentiles, Stage, Timing};

use crate::trace::{Events, TickRecord};
use flotor_hal::abi::loader::ActiveDevice;
use flotor_hal::{Conditions, Cycle, DeviceState, Fault, Tick, Wrench};
use timing::STAGE_SAMPLING;

/// Ticks without a new sample after which the force fades to zero: what is older than this is not where the
/// hand is. At 1 kHz, 10 ms of a 10 Hz movement of 5 mm are 3 mm.
const STALE_TICKS_LIMIT: u32 = 10;

/// How a tick ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum TickEnd {
    /// Go on.
    Continue,
    /// The device faulted: stop.
    DeviceFault(Fault),
}

/// The loop's state: a device, its models, the envelope.
pub(crate) struct Servo {
    device: ActiveDevice,
    models: ModelStack,
    envelope: Envelope,
    state: DeviceState,
    stale_ticks: u32,
    timing: Timing,
    period_ns: u64,
}

impl Servo {
    /// Not real-time.
    pub(crate) fn new(device: ActiveDevice, models: ModelStack, envelope: Envelope, period_ns: u64) -> Self {
        Self {
            device,
            models,
            envelope,
            state: DeviceState::HOME,
            stale_ticks: 0,
            timing: Timing::default(),
            period_ns,
        }
    }

    /// One tick. Real-time: bounded by device and models, no allocation.
    pub(crate) fn tick(&mut self, tick: &Tick, lateness_ns: u64, missed: u64) -> (TickRecord, TickEnd) {
        let started = monotonic_ns();
        let mut watch = StageWatch::start(tick.index, started);
        let mut events = if missed > 0 { Events::MISSED } else { Events::NONE };

        let mut end = self.read(tick, &mut events);
        watch.lap(&mut self.timing, Stage::Read);

        let (model, energy_j) = self.models.step(tick, &self.state, &mut events);
        watch.lap(&mut self.timing, Stage::Models);

        let stale = self.stale_ticks > STALE_TICKS_LIMIT || end != TickEnd::Continue;
        let request = if stale { Wrench::ZERO } else { model };
        let commanded = self.envelope.apply(&request, &self.state, tick, &mut events);
        watch.lap(&mut self.timing, Stage::Envelope);

        if let Cycle::Fault(fault) = self.device.write(tick, &commanded) {
            events.insert(Events::DEVICE_FAULT);
            end = TickEnd::DeviceFault(fault);
        }
        watch.lap(&mut self.timing, Stage::Write);

        let compute_ns = monotonic_ns() - started;
        self.account(lateness_ns, compute_ns, missed);
        let record = TickRecord {
            tick: tick.index,
            time_ns: tick.time_ns,
            dt_ns: tick.dt_ns,
            pose: self.state.pose,
            twist: self.state.twist,
            model,
            commanded,
            delivered: self.state.delivered,
            energy_j,
            events,
            buttons: self.state.buttons,
            lateness_ns,
            compute_ns,
        };
        (record, end)
    }

    /// Newest sample into `self.state`; an old one stays, a senseless one is never used.
    #[inline]
    fn read(&mut self, tick: &Tick, events: &mut Events) -> TickEnd {
        let last = self.state;
        match self.device.read(tick, &mut self.state) {
            Cycle::Fresh if self.state.is_finite() => {
                self.stale_ticks = 0;
                if self.state.conditions.contains(Conditions::SATURATED) {
                    events.insert(Events::SATURATED);
                }
                return TickEnd::Continue;
            }
            Cycle::Fresh => events.insert(Events::NOT_FINITE),
            Cycle::Stale => events.insert(Events::STALE_SAMPLE),
            Cycle::Fault(fault) => {
                self.state = if self.state.is_finite() { self.state } else { last };
                events.insert(Events::DEVICE_FAULT);
                return TickEnd::DeviceFault(fault);
            }
        }
        self.state = last;
        self.stale_ticks = self.stale_ticks.saturating_add(1);
        TickEnd::Continue
    }

    #[inline]
    fn account(&mut self, lateness_ns: u64, compute_ns: u64, missed: u64) {
        self.timing.lateness.record(lateness_ns);
        self.timing.compute.record(compute_ns);
        self.timing.ticks += 1;
        self.timing.missed += missed;
        if lateness_ns > self.period_ns / 10 {
            self.timing.late += 1;
        }
    }

    /// Ends the loop: the device is deactivated, what was measured remains. Not real-time.
    pub(crate) fn into_timing(self) -> Timing {
        drop(self.device);
        self.timing
    }

    pub(crate) fn device(&mut self) -> &mut ActiveDevice {
        &mut self.device
    }

    pub(crate) fn models(&mut self) -> &mut ModelStack {
        &mut self.models
    }
}

/// Times the stages of every [`STAGE_SAMPLING`]th tick.
struct StageWatch {
    last_ns: Option<u64>,
}

impl StageWatch {
    #[inline]
    fn start(tick: u64, now_ns: u64) -> Self {
        Self { last_ns: tick.is_multiple_of(STAGE_SAMPLING).then_some(now_ns) }
    }

    #[inline]
    fn lap(&mut self, timing: &mut Timing, stage: Stage) {
        if let Some(last_ns) = self.last_ns {
            let now_ns = monotonic_ns();
            timing.stage(stage, now_ns - last_ns);
            self.last_ns = Some(now_ns);
        }
    }
}
