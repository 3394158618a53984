//! Session: loads the plugins of a scene, opens devices and creates models, runs the loop, and connects observers and controls.

mod ceiling;
mod controls;
mod error;
mod fit;
mod latch;
mod lockstep;
mod observer;
mod outcome;
mod plugin_report;
mod prepare;
mod prepared_loop;
mod real_clock;
mod schedule;
mod steps;
mod stop_time;
mod stop_without_host;
mod unfreed_plugins;
mod unguarded;
mod virtual_loop;

pub use ceiling::{Strength, StrongDevice};
pub use controls::{ControlError, Controls, FaultyPlugin, LiveNumbers, NewValue};
pub use error::RunError;
pub use latch::{LatchGuard, LatchWatch, StopReach};
pub use lockstep::{Lockstep, SavedRun};
pub use observer::{Observer, Tap};
pub use outcome::{DeviceOutcome, Outcome};
pub use plugin_report::PluginReport;
pub use prepare::{check_plugins, prepare_model};
pub use steps::Steps;
pub use stop_time::StopTime;
pub use stop_without_host::{StopWithoutHost, WatchdogStart, start_watchdog_process};
pub use unfreed_plugins::UnfreedPlugins;
pub use unguarded::Guardian;

use crate::calls::EndReserve;
use crate::registry::Registry;
use crate::scene::Scene;
use ceiling::Guards;
use controls::{ChangeLog, PluginTable};
use fit::check_fit;
use flotor_core::demand::ObserverDemand;
use flotor_core::{period_ns, to_ns};
use flotor_coupling::{Line, LinkTimeouts, Reach};
use flotor_hal::{Capabilities, GripAxis, LoopConfig};
use flotor_live::{Directory, WrenchLimits};
use flotor_loader::Stopper;
use flotor_servo::{
    Clock, Core, Coupled, Envelope, Forces, ParameterQueue, RunConfig, Servo, Standby, StopSwitch,
    swap_queues,
};
use observer::Taps;
use outcome::Epilogue;
use plugin_report::PluginNames;
use prepare::{open_devices, prepare_models, settled};
use prepared_loop::{PreparedLoop, activate};
use real_clock::RealClock;
use schedule::{Scheduled, schedule};
use std::sync::Arc;
use std::time::Instant;

/// Options of a run that are not in its scene.
#[derive(Clone, Debug)]
pub struct RunOptions {
    /// Clock of the loop, real or virtual.
    pub clock: Clock,
    /// Seed of all random numbers of the run, and of the choice among alternatives in the scene.
    pub seed: u64,
}

/// Scene that is ready to run: plugins loaded, devices open, models created, no device energised.
#[must_use]
pub struct Session {
    prepared: PreparedLoop,
    clock: Clock,
    real_clock: RealClock,
    controls: Controls,
    changes: ChangeLog,
    lines: Vec<(String, Line)>,
    strength: Strength,
    strong_devices: Vec<StrongDevice>,
    /// Envelopes of the devices, in order, without the host's ceiling.
    strong_envelopes: Vec<Envelope>,
    limit_notices: Vec<String>,
    warnings: Vec<String>,
    capabilities: Vec<Capabilities>,
    grips: Vec<Option<GripAxis>>,
}

impl Session {
    /// Loads the plugins of a scene, opens its devices, creates its models and checks that scene and devices fit; energises no
    /// device. On the real clock also starts the watchdog process. Not real-time; runs plugin code.
    ///
    /// # Errors
    /// [`RunError`] if a plugin is unknown or refuses, a call does not return, the scene does not fit a device or a plugin, or the
    /// required watchdog process cannot be started.
    pub fn prepare(scene: &Scene, registry: &Registry, options: &RunOptions) -> Result<Self, RunError> {
        let RunOptions { clock, seed } = *options;
        let config = LoopConfig { period_ns: period_ns(scene.rate_hz), seed };
        let latch = (clock == Clock::Real).then(LatchGuard::of_this_user);

        let (opened, mut plugins) = open_devices(registry, scene)?;
        let scene = &settled(scene, &opened, clock);
        let (models, reports) = prepare_models(registry, scene, &config, clock)?;
        plugins.extend(reports);
        check_fit(scene, &opened)?;
        let mut warnings: Vec<String> = plugins.iter().filter_map(PluginReport::warning).collect();
        warnings.extend(fit::warnings(scene, &opened));
        warnings.extend(latch.as_ref().and_then(LatchGuard::warning));
        let WatchdogStart { process, warnings: unguarded } = match clock {
            Clock::Real => {
                let stops: Vec<_> = opened.iter().map(|opened| &opened.stop).collect();
                start_watchdog_process(&stops, &scene.limits)?
            }
            Clock::Virtual => WatchdogStart::default(),
        };
        warnings.extend(unguarded);

        let table = PluginTable::new(&plugins);
        let Scheduled { changes, replacements } = schedule(scene, &table, registry, &config, clock)?;
        let (parameters, sender, reports) = ParameterQueue::new(changes, models.len() + replacements.len());
        let (swaps, host_swaps) = swap_queues(models.len(), replacements);
        let controls = Controls::new(table.clone(), sender, &scene.models, (config, clock), host_swaps);

        let [ramp_ns, watchdog_ns] = [scene.limits.ramp_s, scene.limits.watchdog_s].map(to_ns);
        let (capabilities, grips): (Vec<_>, Vec<_>) =
            opened.iter().map(|opened| (opened.capabilities, opened.grip)).unzip();
        // A partner on another host has the same timeout as the loop.
        let timeouts = LinkTimeouts { silence_ns: watchdog_ns, fade_ns: ramp_ns };
        let (couplings, lines) = couple(scene, &capabilities, config.period_ns, timeouts);
        let Guards { devices, strong_envelopes, strong_devices, notices } =
            Guards::of(scene, opened, config.period_ns);
        let forces = Forces::new(devices.len(), models, couplings);
        let run = RunConfig {
            period_ns: config.period_ns,
            ramp_ns,
            longest_gap_ns: watchdog_ns,
            emergency_buttons: scene.limits.emergency_buttons,
        };
        let session = Self {
            prepared: PreparedLoop {
                standby: Standby::new(devices, forces, parameters, swaps, config, run),
                plugins,
                taps: Taps::default(),
                period_ns: config.period_ns,
                duration_ns: to_ns(scene.duration_s),
            },
            clock,
            real_clock: RealClock {
                pacing: scene.pacing,
                core: None,
                watchdog_ns,
                watchdog_process: process.map(Arc::new),
                requires_independent_stop: scene.limits.require_independent_stop,
                latch,
            },
            controls,
            changes: ChangeLog::new(table, reports),
            lines,
            strength: Strength::UnderCeiling,
            strong_devices,
            strong_envelopes,
            limit_notices: notices,
            warnings,
            capabilities,
            grips,
        };
        Ok(session.with_strength(Strength::of_the_environment()))
    }

    /// Lifts the host's ceiling on force and torque if the strength is [`Strength::Strong`]: only the limits of scene and device
    /// apply. [`Strength::UnderCeiling`] changes nothing. Only a user who knows the device should decide this; a scene cannot. Not
    /// real-time.
    pub fn with_strength(mut self, strength: Strength) -> Self {
        if strength == Strength::Strong && self.strength == Strength::UnderCeiling {
            self.prepared.standby.guard_with(std::mem::take(&mut self.strong_envelopes));
            self.strength = Strength::Strong;
        }
        self
    }

    /// Returns the devices whose force or torque the host's ceiling limits, in the scene's order; empty once the ceiling is
    /// [lifted](Self::with_strength).
    #[must_use]
    pub fn held_back(&self) -> &[StrongDevice] {
        match self.strength {
            Strength::UnderCeiling => &self.strong_devices,
            Strength::Strong => &[],
        }
    }

    /// Returns notices about the limits, to be shown before the run, a line each. Not real-time.
    #[must_use]
    pub fn notices(&self) -> Vec<String> {
        let strong = self.strong_devices.iter().map(|device| device.notice(self.strength));
        self.limit_notices.iter().cloned().chain(strong).collect()
    }

    /// Returns the warnings of the preparation, a sentence each.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Sets the core to which the loop's thread is pinned on the real clock; `None` pins it to no core.
    pub fn on_core(mut self, core: Option<Core>) -> Self {
        self.real_clock.core = core;
        self
    }

    /// Uses the latch in `directory` in place of the latch of this user; presses count from this call on. No effect on the virtual
    /// clock.
    pub fn latched_in(mut self, directory: &Directory) -> Self {
        self.real_clock.latch = self.real_clock.latch.map(|_| LatchGuard::of(directory));
        self
    }

    /// Returns the emergency-stop latch of this run: a press of the latch stops this run, and an emergency stop of this run presses
    /// the latch. `None` on the virtual clock, where no hand is on a device.
    #[must_use]
    pub fn latch(&self) -> Option<&LatchGuard> {
        self.real_clock.latch.as_ref()
    }

    /// Energises the devices and returns the servo and the stoppers of its devices, for a caller that paces the loop itself; the
    /// caller must stop the devices before dropping the servo. Not real-time.
    ///
    /// # Errors
    /// [`RunError::Latched`] if the emergency stop of the machine is pressed, [`RunError::Plugin`] if a device refuses; then no
    /// device is energised.
    pub fn into_loop(self) -> Result<(Servo, Vec<Stopper>), RunError> {
        self.latch().map_or(Ok(()), LatchGuard::check)?;
        let PreparedLoop { standby, plugins, .. } = self.prepared;
        let stoppers = standby.stoppers();
        Ok((activate(standby, &plugins)?, stoppers))
    }

    /// Returns the core to which the loop's thread is pinned; `None` if no core was set.
    pub fn core(&self) -> Option<Core> {
        self.real_clock.core
    }

    /// Returns the nominal period of the loop, ns.
    pub fn period_ns(&self) -> u64 {
        self.prepared.period_ns
    }

    /// Returns the plugins of this run with the values of all parameters: devices, then models, in the scene's order.
    #[must_use]
    pub fn plugins(&self) -> &[PluginReport] {
        &self.prepared.plugins
    }

    /// Returns the largest force, N, and torque, N·m, that may reach a hand at any device, along each axis and as a norm; `None`:
    /// unlimited.
    #[must_use]
    pub fn limits(&self) -> WrenchLimits {
        let finite = |limit: f64| limit.is_finite().then_some(limit);
        let most = self.prepared.standby.most();
        let [force_n, torque_nm] = most.map(|bound| bound.axes().map(finite));
        let [force_norm_n, torque_norm_nm] = most.map(|bound| finite(bound.norm()));
        WrenchLimits { force_n, torque_nm, force_norm_n, torque_norm_nm }
    }

    /// Removes and returns the lines of the couplings with a remote end, each with the name of its coupling; a line transports the
    /// peer state. Without a connected line the local end receives no peer state and requests no force.
    #[must_use]
    pub fn take_lines(&mut self) -> Vec<(String, Line)> {
        std::mem::take(&mut self.lines)
    }

    /// Creates a tap, through which another thread reads the newest record of the device without waiting. The loop publishes a
    /// record as soon as its tick is over. Not real-time.
    #[must_use]
    pub fn tap(&mut self, device: u16) -> Tap {
        self.prepared.taps.add(device)
    }

    /// Returns the handle with which observers other than the observer of the run request model outputs.
    #[must_use]
    pub fn observers(&self) -> ObserverDemand {
        self.prepared.standby.observers()
    }

    /// Returns the capabilities of the devices, in the scene's order.
    pub fn capabilities(&self) -> &[Capabilities] {
        &self.capabilities
    }

    /// Returns the grip of each device, in the scene's order; `None` without one.
    pub fn grips(&self) -> &[Option<GripAxis>] {
        &self.grips
    }

    /// Returns the handle with which other threads change the run.
    #[must_use]
    pub fn controls(&self) -> Controls {
        self.controls.clone()
    }

    /// Energises the devices, runs the loop until the duration is over, `stop` requests an end, or a device faults, then de-energises
    /// the devices and returns the outcome. The observer is called in the calling thread. Not real-time.
    ///
    /// # Errors
    /// [`RunError::Latched`] if the emergency stop of the machine is pressed, [`RunError::Plugin`] if a device refuses to be
    /// energised, [`RunError::NoThread`] if the system cannot start a thread for a part of the run, [`RunError::Calls`] or
    /// [`RunError::Hung`] if a plugin call does not return: its thread is abandoned then, and the process should end soon.
    pub fn run(self, observer: &mut dyn Observer, stop: &StopSwitch) -> Result<Outcome, RunError> {
        let reserve = EndReserve::take().map_err(|_| RunError::NoThread("the end of the run"))?;
        let epilogue = self.epilogue(reserve);
        let Self { prepared, clock, real_clock, controls, changes, .. } = self;
        let finished = match clock {
            Clock::Virtual => virtual_loop::run(prepared, changes, &controls, observer, stop)?,
            Clock::Real => real_clock::run(prepared, real_clock, changes, &controls, observer, stop)?,
        };
        Ok(epilogue.conclude(finished))
    }

    /// Collects the data from the start of this run that its end needs.
    fn epilogue(&self, reserve: EndReserve) -> Epilogue {
        Epilogue {
            reserve,
            started: Instant::now(),
            warnings: self.warnings.clone(),
            heartbeat: self.prepared.standby.heartbeat(),
            names: PluginNames::of(&self.prepared.plugins),
            controls: self.controls.clone(),
        }
    }
}

/// Creates the couplings of a scene; returns them, and the name and line of each coupling with a remote end.
fn couple(
    scene: &Scene,
    capabilities: &[Capabilities],
    period_ns: u64,
    timeouts: LinkTimeouts,
) -> (Vec<Coupled>, Vec<(String, Line)>) {
    let period_s = period_ns as f64 * 1.0e-9;
    let mut lines = Vec::new();
    let couplings = scene.couplings.iter().map(|coupling| {
        let here = coupling.ends.here().first().and_then(|end| capabilities.get(usize::from(end.device)));
        let reach = here.map(|device| Reach { range_m: device.range_m, range_rad: device.range_rad });
        let (coupled, line) = Coupled::new(coupling, period_s, timeouts, reach.unwrap_or_default());
        lines.extend(line.map(|line| (coupling.name.clone(), line)));
        coupled
    });
    (couplings.collect(), lines)
}
