//! Servo: runs the ticks, each `changes -> device -> mapping -> models -> envelope -> device`.
//!
//! A scene may have several devices: each device has its own models and envelope; all devices share the tick and the run state.
//!
//! Nothing in a tick allocates, locks, formats or waits on another thread. A tick produces a [`TickRecord`] for each device;
//! clients get the records through a queue, off the loop.
#![deny(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros)] // see clippy.toml
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use crate::saved::{SavedServo, Unsaved};
use crate::stage_timer::{Moment, StageTimer};
use crate::timing::STAGE_SAMPLING;
use crate::{
    Cause, Due, EmergencySource, Forces, Heartbeat, LastStop, LoopSwaps, ParameterQueue, Place, Port,
    Reported, RunEvent, RunState, Stage, Station, StopSwitch, Timing, Unwound, WEIGHT,
};
use flotor_core::PluginIndex;
use flotor_core::demand::ObserverDemand;
use flotor_core::trace::{Events, TickRecord};
use flotor_hal::abi::CallStatus;
use flotor_hal::{Tick, Wrench};
use flotor_loader::ActiveDevice;

/// Settings of the loop for one run.
#[derive(Clone, Copy, Debug)]
pub struct RunConfig {
    /// Nominal time between ticks, ns.
    pub period_ns: u64,
    /// Time over which the force fades in and out, ns.
    pub ramp_ns: u64,
    /// Longest gap between two ticks, ns. After a longer gap the run ends: the process was suspended while the hand moved.
    pub longest_gap_ns: u64,
    /// Bit mask of the buttons that are emergency stops.
    pub emergency_buttons: u32,
}

/// Parts of a servo that exist before its devices are energised.
pub(crate) struct Parts {
    pub(crate) forces: Forces,
    pub(crate) observers: ObserverDemand,
    pub(crate) parameters: ParameterQueue,
    pub(crate) swaps: LoopSwaps,
    pub(crate) config: RunConfig,
    pub(crate) heartbeat: Heartbeat,
}

/// State of the loop: devices with their envelopes, models and couplings.
pub struct Servo {
    /// Dropped first: if a plugin unwinds the loop, the devices stop before anything else is dropped.
    _unwound: Option<Unwound>,
    stations: Box<[Station]>,
    /// Ports of the devices, in the order of `stations`.
    ports: Box<[Port]>,
    parts: Parts,
    run: RunState,
    timing: Timing,
    stage_timer: StageTimer,
    /// Dropped last: plugin code that closes devices or destroys models may end the process.
    _last_stop: Option<LastStop>,
}

impl Servo {
    /// Creates a servo with its [`LastStop`], the emergency stop on process death. Not real-time.
    pub(crate) fn new(stations: Vec<Station>, parts: Parts, last_stop: Option<(Unwound, LastStop)>) -> Self {
        let (unwound, last_stop) = last_stop.unzip();
        Self {
            _unwound: unwound,
            _last_stop: last_stop,
            ports: stations.iter().map(Station::port).collect(),
            stations: stations.into(),
            parts,
            run: RunState::START,
            timing: Timing::default(),
            stage_timer: StageTimer::new(),
        }
    }

    /// Registers the calling thread as the loop thread, in place of the thread that energised the devices. Not real-time.
    pub fn register_loop_thread(&self) {
        self._last_stop.iter().for_each(LastStop::register_loop_thread);
    }

    /// Runs one tick and passes a record for each device to `on_record`. Real-time: bounded by devices and models, no allocation.
    #[inline]
    #[cfg_attr(rtsan, sanitize(realtime = "nonblocking"))]
    pub fn tick(&mut self, due: &Due, stop: &StopSwitch, on_record: impl FnMut(&TickRecord)) {
        let (events, compute_ns) = self.advance(due, stop);
        self.emit_records(due, events, compute_ns, on_record);
    }

    /// Passes a record of the tick for each device to `on_record`.
    #[inline(always)] // in the middle of a tick
    fn emit_records(
        &self,
        due: &Due,
        run_events: Events,
        compute_ns: u64,
        mut on_record: impl FnMut(&TickRecord),
    ) {
        for (device, (station, port)) in (0..).zip(self.stations.iter().zip(&self.ports)) {
            let Port { state, commanded, .. } = port;
            let mut events = run_events;
            events.insert(port.events);
            on_record(&TickRecord {
                tick: due.tick.index,
                device,
                time_ns: due.tick.time_ns,
                dt_ns: due.tick.dt_ns,
                pose: state.pose,
                twist: state.twist,
                model: port.outputs(),
                commanded: *commanded,
                delivered: state.delivered,
                port_energy_j: station.envelope.port_energy_j(),
                grip: port.grip,
                events,
                buttons: state.buttons,
                lateness_ns: due.lateness_ns.unwrap_or_default(),
                compute_ns,
            });
        }
    }

    /// Runs the tick without its records; returns the events of the run and the compute time, ns.
    fn advance(&mut self, due: &Due, stop: &StopSwitch) -> (Events, u64) {
        let Due { tick, lateness_ns, missed, .. } = due;
        let started = self.stage_timer.now();
        let mut watch = StageWatch::start(tick.index, started);
        let mut events = if *missed > 0 { Events::MISSED } else { Events::NONE };

        if self.parts.parameters.is_due(tick)
            || self.parts.swaps.is_due(tick)
            || self.parts.forces.is_fading()
        {
            self.apply_changes(tick, &mut events);
        }
        let (sample, buttons) = self.read(tick);
        self.follow(sample, buttons, tick, stop, &mut events);
        watch.lap(&self.stage_timer, &mut self.timing, Stage::Read);

        self.parts.forces.step(tick, &mut self.ports, self.parts.observers.now(), &self.parts.heartbeat);
        watch.lap(&self.stage_timer, &mut self.timing, Stage::Models);

        let gate = self.run.gate(tick.time_ns, self.parts.config.ramp_ns);
        for (station, port) in self.stations.iter_mut().zip(&mut self.ports) {
            station.limit(tick, gate, port);
            if station.envelope.is_unstable() {
                let failed = RunEvent::Failed(Cause::Oscillation);
                self.run = self.run.after(failed, tick.time_ns, self.parts.config.ramp_ns);
            }
        }
        watch.lap(&self.stage_timer, &mut self.timing, Stage::Envelope);

        self.write(tick);
        self.parts.heartbeat.enter(tick.index, Place::Waiting);
        watch.lap(&self.stage_timer, &mut self.timing, Stage::Write);

        let compute_ns = self.stage_timer.between_ns(started, self.stage_timer.now());
        self.record_timing(*lateness_ns, compute_ns, *missed);
        (events, compute_ns)
    }

    /// Fades the force out from this tick on and then ends the run; does nothing while samples are lost and there is no force.
    /// Real-time: bounded, no allocation.
    pub fn release(&mut self, tick: &Tick) {
        // While holding there is no force: the run ends without a fade.
        if self.run != RunState::Holding {
            self.change_state(RunEvent::StopRequested, tick);
        }
    }

    /// Saves the state before tick `next`. Not real-time.
    pub(crate) fn save(&mut self, next: u64) -> Result<SavedServo, Unsaved> {
        let Self { stations, ports, parts: Parts { forces, parameters, .. }, run, .. } = self;
        let devices = stations.len();
        let station = |(device, station): (usize, &mut Station)| {
            station.save().ok_or(Unsaved::Plugin(PluginIndex::at(device)))
        };
        Ok(SavedServo {
            stations: stations.iter_mut().enumerate().map(station).collect::<Result<_, _>>()?,
            forces: forces.save(devices, next)?,
            ports: ports.clone(),
            changes: parameters.save(),
            run: *run,
        })
    }

    /// Restores a state before tick `next`. Not real-time.
    pub(crate) fn restore(&mut self, saved: &SavedServo, next: u64) -> Result<(), Unsaved> {
        let Self { stations, ports, parts: Parts { forces, parameters, .. }, run, .. } = self;
        if (stations.len(), ports.len()) != (saved.stations.len(), saved.ports.len()) {
            return Err(Unsaved::OtherLoop);
        }
        forces.restore(&saved.forces, stations.len(), next)?;
        for (device, (station, saved)) in stations.iter_mut().zip(&saved.stations).enumerate() {
            station.restore(saved).ok_or(Unsaved::Plugin(PluginIndex::at(device)))?;
        }
        ports.copy_from_slice(&saved.ports);
        parameters.restore(&saved.changes);
        *run = saved.run;
        Ok(())
    }

    /// Returns the time over which the force fades in and out, ns.
    pub fn ramp_ns(&self) -> u64 {
        self.parts.config.ramp_ns
    }

    /// Applies the parameter changes and model replacements that are due.
    #[inline(never)] // seldom called; its instructions are counted: tests/instructions
    fn apply_changes(&mut self, tick: &Tick, events: &mut Events) {
        let Self { stations, parts: Parts { forces, parameters, swaps, .. }, .. } = self;
        let devices = stations.len();
        // Counted before the replacements: a change sent after a replacement must not overtake it.
        let waiting = parameters.waiting();
        let mut replaced = false;
        swaps.apply_due(tick, forces, |model, generation| {
            replaced = true;
            parameters.report_replaced(tick, PluginIndex::of_model(devices, model), generation);
        });
        let changed = parameters.apply_due(tick, waiting, |change| {
            let parameter = change.parameter as usize;
            if let Some(station) = stations.get_mut(change.plugin.position()) {
                return station.device.set_parameter(parameter, change.value);
            }
            let Some(model) = change.plugin.among_models(devices) else { return CallStatus::Unsupported };
            if change.parameter == WEIGHT {
                forces.set_weight(model, tick, change.value)
            } else if forces.generation(model) == Some(change.generation) {
                forces.set_parameter(model, tick, parameter, change.value)
            } else {
                CallStatus::WrongPhase
            }
        });
        if changed || replaced {
            events.insert(Events::PARAMETER_CHANGED);
        }
    }

    /// Reads the newest samples of all devices. Returns the worst event (a hand must not feel one device while another is lost) and
    /// the buttons of all devices.
    fn read(&mut self, tick: &Tick) -> (RunEvent, u32) {
        let (mut worst, mut buttons) = (RunEvent::SamplesBack, 0);
        for (device, (station, port)) in (0..).zip(self.stations.iter_mut().zip(&mut self.ports)) {
            self.parts.heartbeat.enter(tick.index, Place::DeviceRead(device));
            port.events = Events::NONE;
            let sample = station.read(tick, port);
            buttons |= port.state.buttons;
            if severity(sample) > severity(worst) {
                worst = sample;
            }
        }
        (worst, buttons)
    }

    /// Sends the commands to all devices.
    fn write(&mut self, tick: &Tick) {
        let Self { stations, ports, parts: Parts { heartbeat, config, .. }, run, .. } = self;
        for (device, (station, port)) in (0..).zip(stations.iter_mut().zip(ports)) {
            heartbeat.enter(tick.index, Place::DeviceWrite(device));
            if heartbeat.is_silenced() {
                port.commanded = Wrench::ZERO; // zeroed by the safe stop
                port.grip.iter_mut().for_each(|grip| grip.commanded = 0.0);
                continue;
            }
            if let Some(failed) = station.write(tick, port) {
                *run = run.after(failed, tick.time_ns, config.ramp_ns);
            }
            if station.device.has_changed_floats() {
                port.events.insert(Events::FLOAT_ENVIRONMENT);
            }
        }
    }

    /// Advances the state machine of the run from sample validity, timing and requests to stop.
    fn follow(
        &mut self,
        sample: RunEvent,
        buttons: u32,
        tick: &Tick,
        stop: &StopSwitch,
        events: &mut Events,
    ) {
        // An active run with a valid sample stays active.
        if (self.run, sample) != (RunState::Active, RunEvent::SamplesBack) {
            self.change_state(RunEvent::Time, tick);
            self.change_state(sample, tick);
        }
        if stop.is_stop_requested() {
            self.change_state(RunEvent::StopRequested, tick);
        }
        if self.parts.heartbeat.fired_at().is_some() || tick.dt_ns > self.parts.config.longest_gap_ns {
            self.change_state(RunEvent::Failed(Cause::Watchdog), tick);
        }
        let pressed = buttons & self.parts.config.emergency_buttons != 0;
        if let Some(source) = stop.emergency().or(pressed.then_some(EmergencySource::Button)) {
            self.change_state(RunEvent::Emergency(source), tick);
        }
        events.insert(self.run.events());
    }

    /// Updates the run state after an event.
    fn change_state(&mut self, event: RunEvent, tick: &Tick) {
        self.run = self.run.after(event, tick.time_ns, self.parts.config.ramp_ns);
    }

    fn record_timing(&mut self, lateness_ns: Option<u64>, compute_ns: u64, missed: u64) {
        self.timing.compute.record(compute_ns);
        self.timing.ticks += 1;
        self.timing.missed += missed;
        if let Some(lateness_ns) = lateness_ns {
            self.timing.lateness.record(lateness_ns);
            self.timing.late += u64::from(lateness_ns > self.parts.config.period_ns / 10);
        }
    }

    /// Takes the servo apart into its parts and measurements, without running plugin code. Not real-time.
    pub fn dismantle(self) -> Dismantled {
        let device = |station: Station| {
            let reported = station.reported();
            (station.device, reported)
        };
        Dismantled {
            devices: self.stations.into_iter().map(device).collect(),
            last_stop: self._last_stop,
            forces: self.parts.forces,
            swaps: self.parts.swaps,
            timing: self.timing,
        }
    }

    /// Returns the run state after the last tick.
    pub fn run(&self) -> RunState {
        self.run
    }

    /// Returns the heartbeat that the watchdog reads.
    pub fn heartbeat(&self) -> &Heartbeat {
        &self.parts.heartbeat
    }

    /// Iterates over the devices in the scene's order, each with its report.
    pub fn devices(&mut self) -> impl Iterator<Item = (&mut ActiveDevice, Reported)> {
        self.stations.iter_mut().map(|station| {
            let reported = station.reported();
            (&mut station.device, reported)
        })
    }

    /// Returns the models and couplings.
    pub fn forces(&mut self) -> &mut Forces {
        &mut self.parts.forces
    }
}

/// Parts of a stopped servo. Dropping the parts runs plugin code.
pub struct Dismantled {
    /// Devices in the scene's order, still energised, each with its report.
    pub devices: Vec<(ActiveDevice, Reported)>,
    /// [`LastStop`] to keep until devices are closed and models are freed: plugin code may end the process meanwhile.
    pub last_stop: Option<LastStop>,
    /// Models and couplings of the run.
    pub forces: Forces,
    /// Pending model replacements.
    pub swaps: LoopSwaps,
    /// Timing statistics of the ticks.
    pub timing: Timing,
}

/// Returns the rank of a sample event: the event of highest rank among the devices decides the run state.
const fn severity(sample: RunEvent) -> u8 {
    match sample {
        RunEvent::Failed(_) => 3,
        RunEvent::SamplesLost => 2,
        RunEvent::Time => 1,
        _ => 0,
    }
}

/// Stopwatch for the stages of every [`STAGE_SAMPLING`]th tick.
struct StageWatch {
    last: Option<Moment>,
}

impl StageWatch {
    fn start(tick: u64, now: Moment) -> Self {
        Self { last: tick.is_multiple_of(STAGE_SAMPLING).then_some(now) }
    }

    fn lap(&mut self, stage_timer: &StageTimer, timing: &mut Timing, stage: Stage) {
        if let Some(last) = self.last {
            let now = stage_timer.now();
            timing.stage(stage, stage_timer.between_ns(last, now));
            self.last = Some(now);
        }
    }
}
