//! The servo: one tick after the other, `changes -> device -> mapping -> models -> envelope -> device`.
//!
//! Nothing in a tick allocates, locks, formats or waits on another thread. What a tick leaves behind is a
//! [`TickRecord`]; whoever watches gets it through a ring, off the loop.

mod budget;
mod clock;
mod engine;
mod envelope;
mod exchange;
mod models;
mod parameters;
mod passivity;
mod realtime;
mod state;
mod stop;
mod timing;
mod watchdog;

pub use budget::Overrun;
pub(crate) use budget::TimeBudget;
pub use clock::{Clock, SpinWindow};
pub(crate) use clock::{Due, Schedule, monotonic_ns, sleep_until};
pub(crate) use engine::Engine;
pub use envelope::Envelope;
pub(crate) use exchange::{Exchange, Workshop, exchange};
pub use models::ModelHealth;
pub(crate) use models::{Layer, ModelStack, Replacement};
pub(crate) use parameters::{
    ChangeReport, ChangeSender, PLUGIN, ParameterChange, ParameterQueue, ReportReceiver, ScheduledChange,
    WEIGHT,
};
pub use realtime::{Privilege, RealTimeReport};
pub(crate) use realtime::{enter_real_time, enter_worker_priority, probe_real_time};
pub use state::{Cause, EmergencySource, Gate, RunEvent, RunState};
pub use stop::StopSwitch;
pub use timing::{Durations, Percentiles, Stage, Timing};
pub(crate) use watchdog::{Heartbeat, start as start_watchdog};
pub use watchdog::{Place, Stuck};

use crate::trace::{Events, TickRecord};
use flotor_hal::abi::CallStatus;
use flotor_hal::abi::loader::ActiveDevice;
use flotor_hal::{Conditions, Cycle, DeviceState, Tick};
use timing::STAGE_SAMPLING;

/// Ticks without a new sample after which the force fades to zero: what is older than this is not where the
/// hand is. At 1 kHz, 10 ms of a 10 Hz movement of 5 mm are 3 mm.
const STALE_TICKS_LIMIT: u32 = 10;

/// What the run itself is told, beside device, models and envelope.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RunConfig {
    /// Nominal time between ticks, ns.
    pub(crate) period_ns: u64,
    /// Time over which force fades in and out, ns.
    pub(crate) ramp_ns: u64,
    /// Buttons of the device that are emergency stops, one bit each.
    pub(crate) emergency_buttons: u32,
}

/// The loop's state: a device, its models, the envelope.
pub(crate) struct Servo {
    device: ActiveDevice,
    models: ModelStack,
    parameters: ParameterQueue,
    exchange: Exchange,
    envelope: Envelope,
    config: RunConfig,
    heart: Heartbeat,
    run: RunState,
    state: DeviceState,
    stale_ticks: u32,
    timing: Timing,
}

impl Servo {
    /// Not real-time.
    pub(crate) fn new(
        device: ActiveDevice,
        models: ModelStack,
        parameters: ParameterQueue,
        exchange: Exchange,
        envelope: Envelope,
        config: RunConfig,
    ) -> Self {
        Self {
            device,
            models,
            parameters,
            exchange,
            envelope,
            config,
            heart: Heartbeat::default(),
            run: RunState::START,
            state: DeviceState::HOME,
            stale_ticks: 0,
            timing: Timing::default(),
        }
    }

    /// One tick. Real-time: bounded by device and models, no allocation.
    pub(crate) fn tick(&mut self, due: &Due, stop: &StopSwitch) -> TickRecord {
        let Due { tick, lateness_ns, missed } = due;
        let started = monotonic_ns();
        let mut watch = StageWatch::start(tick.index, started);
        let mut events = if *missed > 0 { Events::MISSED } else { Events::NONE };

        self.change_parameters(tick, &mut events);
        self.heart.enter(tick.index, Place::DeviceRead);
        let sample = self.read(tick, &mut events);
        self.follow(sample, tick, stop, &mut events);
        watch.lap(&mut self.timing, Stage::Read);

        let (model, energy_j) = self.models.step(tick, &self.state, &self.heart, &mut events);
        watch.lap(&mut self.timing, Stage::Models);

        let gate = self.run.gate(tick.time_ns, self.config.ramp_ns);
        let commanded = self.envelope.apply(&model, gate, &self.state, tick, &mut events);
        watch.lap(&mut self.timing, Stage::Envelope);

        self.heart.enter(tick.index, Place::DeviceWrite);
        if let Cycle::Fault(fault) = self.device.write(tick, &commanded) {
            events.insert(Events::DEVICE_FAULT);
            self.happen(RunEvent::Failed(Cause::Device(fault)), tick);
        }
        self.heart.enter(tick.index, Place::Waiting);
        watch.lap(&mut self.timing, Stage::Write);

        let compute_ns = monotonic_ns() - started;
        self.account(*lateness_ns, compute_ns, *missed);
        TickRecord {
            tick: tick.index,
            time_ns: tick.time_ns,
            dt_ns: tick.dt_ns,
            pose: self.state.pose,
            twist: self.state.twist,
            model,
            commanded,
            delivered: self.state.delivered,
            energy_j,
            port_energy_j: self.envelope.port_energy_j(),
            events,
            buttons: self.state.buttons,
            lateness_ns: *lateness_ns,
            compute_ns,
        }
    }

    /// What was to change before this tick does so now.
    #[inline]
    fn change_parameters(&mut self, tick: &Tick, events: &mut Events) {
        let Self { device, models, parameters, exchange, .. } = self;
        // Looked at before the replacements: whoever sent one of these after a replacement has sent that too.
        let waiting = parameters.waiting();
        let mut replaced = false;
        exchange.apply_due(tick, models, |model, generation| {
            replaced = true;
            let plugin = u16::try_from(model + 1).unwrap_or(u16::MAX); // a run has fewer plugins
            parameters.report_replaced(tick, plugin, generation);
        });
        let changed = parameters.apply_due(tick, waiting, |change| {
            let parameter = change.parameter as usize;
            match usize::from(change.plugin).checked_sub(1) {
                None => device.set_parameter(parameter, change.value),
                Some(model) if change.parameter == WEIGHT => models.set_weight(model, tick, change.value),
                Some(model) if models.generation(model) != Some(change.generation) => CallStatus::WrongPhase,
                Some(model) => models.set_parameter(model, tick, parameter, change.value),
            }
        });
        if changed || replaced {
            events.insert(Events::PARAMETER_CHANGED);
        }
    }

    /// Newest sample into `self.state`; an old one stays, a senseless one is never used. What it means for the run.
    #[inline]
    fn read(&mut self, tick: &Tick, events: &mut Events) -> RunEvent {
        let last = self.state;
        match self.device.read(tick, &mut self.state) {
            Cycle::Fresh if self.state.is_finite() => {
                self.stale_ticks = 0;
                if self.state.conditions.contains(Conditions::SATURATED) {
                    events.insert(Events::SATURATED);
                }
                if self.state.conditions.contains(Conditions::EXCESS_FORCE) {
                    events.insert(Events::EXCESS_FORCE);
                }
                return RunEvent::SamplesBack;
            }
            Cycle::Fresh => events.insert(Events::NOT_FINITE),
            Cycle::Stale => events.insert(Events::STALE_SAMPLE),
            Cycle::Fault(fault) => {
                self.state = if self.state.is_finite() { self.state } else { last };
                events.insert(Events::DEVICE_FAULT);
                return RunEvent::Failed(Cause::Device(fault));
            }
        }
        self.state = last;
        self.stale_ticks = self.stale_ticks.saturating_add(1);
        if self.stale_ticks > STALE_TICKS_LIMIT { RunEvent::SamplesLost } else { RunEvent::Time }
    }

    /// Takes the run where the sample, the clock and everybody who may stop it lead.
    #[inline]
    fn follow(&mut self, sample: RunEvent, tick: &Tick, stop: &StopSwitch, events: &mut Events) {
        self.happen(RunEvent::Time, tick);
        self.happen(sample, tick);
        if stop.is_stop_asked() {
            self.happen(RunEvent::StopAsked, tick);
        }
        if self.heart.bitten().is_some() {
            self.happen(RunEvent::Failed(Cause::Watchdog), tick);
        }
        let pressed = self.state.buttons & self.config.emergency_buttons != 0;
        if let Some(source) = stop.emergency().or(pressed.then_some(EmergencySource::Button)) {
            self.happen(RunEvent::Emergency(source), tick);
        }
        events.insert(self.run.events());
    }

    #[inline]
    fn happen(&mut self, event: RunEvent, tick: &Tick) {
        self.run = self.run.after(event, tick.time_ns, self.config.ramp_ns);
    }

    #[inline]
    fn account(&mut self, lateness_ns: u64, compute_ns: u64, missed: u64) {
        self.timing.lateness.record(lateness_ns);
        self.timing.compute.record(compute_ns);
        self.timing.ticks += 1;
        self.timing.missed += missed;
        if lateness_ns > self.config.period_ns / 10 {
            self.timing.late += 1;
        }
    }

    /// Ends the loop: the device is deactivated, what was measured remains. Not real-time.
    pub(crate) fn into_timing(self) -> Timing {
        drop(self.device);
        self.timing
    }

    /// What nothing gets past.
    pub(crate) fn envelope(&self) -> &Envelope {
        &self.envelope
    }

    /// Where the run stands after the last tick.
    pub(crate) fn run(&self) -> RunState {
        self.run
    }

    /// What the watchdog listens to.
    pub(crate) fn heart(&self) -> &Heartbeat {
        &self.heart
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
