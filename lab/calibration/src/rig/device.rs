//! Real device with a force sensor on a serial port; a person or a stage lowers the sensor.

use super::holder::{Guard, Holder, Holding, REST_M, STEADY_N};
use super::{PERIOD_NS, Rest, Rig};
use crate::CalibrationError;
use crate::procedure::Plan;
use crate::sensor::ForceSensor;
use flotor_core::limits::{Boundary, CEILING, Limits};
use flotor_core::plausibility::PlausibilityCheck;
use flotor_hal::{Embodiment, Fault, LoopConfig, VerticalCalibration};
use flotor_loader::{OpenedDevice, Plugin, Setting};
use flotor_servo::watchdog_process::WatchdogProcess;
use flotor_servo::{Envelope, StopSwitch};
use flotor_session::calibration_file::CalibratedDevice;
use flotor_session::{Guardian, StopWithoutHost, WatchdogStart, start_watchdog_process};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Poll interval while waiting for the handle to rest at its target.
const LOOK_AGAIN: Duration = Duration::from_millis(20);

/// State of the handle while the sensor is moved to its next height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waiting {
    /// Target height of the handle, m.
    pub target_m: f64,
    /// Actual height of the handle, m.
    pub height_m: f64,
    /// Commanded upward force, N.
    pub command_n: f64,
}

/// Tolerance, timeout and limits of a procedure with a real device.
#[derive(Clone, Copy, Debug)]
pub struct RigOptions {
    /// Largest distance of the handle at rest from its target, m.
    pub close_m: f64,
    /// Timeout for the handle to rest at its target.
    pub patience: Duration,
    /// Limits of force, torque and velocity, which the host's limit reduces further; requirements for an independent stop.
    pub limits: Limits,
}

/// Real device in the rig, with its force sensor.
pub struct DeviceRig<W> {
    /// Device while not held; `None` while held, and after the device was lost.
    opened: Option<OpenedDevice>,
    holder: Option<Holder>,
    /// Largest vertical force that the device accepts and the host sends, N.
    most_n: f64,
    stop: StopSwitch,
    sensor: ForceSensor,
    /// Value of `Report::restless` when the measured rest began.
    restless: u64,
    device: CalibratedDevice,
    options: RigOptions,
    waiting: W,
    /// Watchdog process, which stops the device if this process ends; dropped after the device.
    watchdog_process: Option<Arc<WatchdogProcess>>,
    guardian: Guardian,
    warnings: Vec<String>,
}

impl<W: FnMut(Option<Waiting>) -> ControlFlow<()>> DeviceRig<W> {
    /// Opens the device and starts its watchdog process. `waiting` is called repeatedly with the position of the handle
    /// until the handle rests at its target, then once with `None`. If `waiting` breaks, the calibration is aborted and
    /// the handle lowered. An emergency stop of `stop` stops the device. Not real-time.
    ///
    /// # Errors
    /// [`CalibrationError`] if the device rejects the call, if the watchdog process cannot be started as required, or if the
    /// user has to accept a control group shared with this process.
    pub fn open(
        plugin: &Plugin,
        settings: &[Setting],
        sensor: ForceSensor,
        options: RigOptions,
        stop: StopSwitch,
        waiting: W,
    ) -> Result<Self, CalibrationError> {
        let mut opened = plugin.open_device(settings)?;
        let device = CalibratedDevice { plugin: plugin.metadata().id.clone(), serial: opened.serial() };
        let capabilities = opened.capabilities().map_err(CalibrationError::Refused)?;
        let embodiment = plugin.device_info().map_or(Embodiment::Physical, |info| info.embodiment());
        let independent = StopWithoutHost::of(&device.plugin, embodiment, &capabilities, &mut opened);
        let independent = independent.map_err(CalibrationError::Refused)?;
        let WatchdogStart { process, warnings } = start_watchdog_process(&[&independent], &options.limits)?;
        let watchdog_process = process.map(Arc::new);
        let guardian = Guardian::of(watchdog_process.as_ref(), options.limits.require_independent_stop);
        let [_, _, most_n] = capabilities.max_force_n;
        Ok(Self {
            opened: Some(opened),
            holder: None,
            most_n: most_n.min(CEILING.force_n),
            stop,
            sensor,
            restless: 0,
            device,
            options,
            waiting,
            watchdog_process,
            guardian,
            warnings,
        })
    }

    /// Returns warnings about the device before activation, a sentence each.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Returns plugin and serial number of the device.
    #[must_use]
    pub fn device(&self) -> &CalibratedDevice {
        &self.device
    }

    /// Checks that no force of a plan is too strong, before the first measurement.
    ///
    /// # Errors
    /// [`CalibrationError::TooStrong`] with the first excessive force.
    pub fn check(&self, plan: &Plan) -> Result<(), CalibrationError> {
        let too_strong = plan.forces_n.iter().find(|command_n| **command_n > self.most_n);
        too_strong.map_or(Ok(()), |command_n| {
            Err(CalibrationError::TooStrong { command_n: *command_n, most_n: self.most_n })
        })
    }

    /// Sets the calibration of the device; lowers the handle first.
    ///
    /// # Errors
    /// [`CalibrationError`] if the device does not support calibration, or was lost.
    pub fn calibrate(&mut self, calibration: &VerticalCalibration) -> Result<(), CalibrationError> {
        if let Some(mut holder) = self.holder.take() {
            self.opened = holder.stop();
        }
        let opened = self.opened.as_mut().ok_or(CalibrationError::Disconnected)?;
        opened.calibrate_vertical(calibration).map_err(CalibrationError::Refused)
    }

    fn tell(&mut self, waiting: Option<Waiting>) -> Result<(), CalibrationError> {
        self.guardian.check(&self.stop);
        match (self.waiting)(waiting) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(CalibrationError::Aborted),
        }
    }

    fn holder(&mut self) -> Result<&mut Holder, CalibrationError> {
        if let (None, Some(mut opened)) = (&self.holder, self.opened.take()) {
            let config = LoopConfig { period_ns: PERIOD_NS, seed: 0 };
            let capabilities = opened.capabilities().map_err(CalibrationError::Refused)?;
            let limits = self.options.limits.under(CEILING);
            let envelope = Envelope::new(&limits, &without_wall(), &capabilities, PERIOD_NS);
            let plausibility = PlausibilityCheck::new(&capabilities, PERIOD_NS);
            let (stopper, stop) = (opened.stopper(), self.stop.clone());
            let watchdog_process = self.watchdog_process.clone();
            let guard = Guard { envelope, plausibility, stopper, stop, watchdog_process };
            let active = opened.activate(&config).map_err(|(opened, refusal)| {
                self.opened = Some(opened);
                CalibrationError::Refused(refusal)
            })?;
            self.holder = Some(Holder::start(active, guard).map_err(CalibrationError::NoThread)?);
        }
        self.holder.as_mut().ok_or(CalibrationError::Disconnected)
    }
}

/// Returns a boundary without stiffness: the handle rests against the sensor, and a wall would push too.
fn without_wall() -> Boundary {
    Boundary {
        stiffness_n_per_m: 0.0,
        damping_ns_per_m: 0.0,
        stiffness_nm_per_rad: 0.0,
        damping_nms_per_rad: 0.0,
        ..Boundary::default()
    }
}

impl<W: FnMut(Option<Waiting>) -> ControlFlow<()>> Rig for DeviceRig<W> {
    fn rest_at(&mut self, target_m: f64, command_n: &dyn Fn(f64) -> f64) -> Result<Rest, CalibrationError> {
        let RigOptions { close_m, patience, .. } = self.options;
        let (until, command_n) = (Instant::now() + patience, command_n(target_m));
        if command_n > self.most_n {
            return Err(CalibrationError::TooStrong { command_n, most_n: self.most_n });
        }
        self.holder()?.push(command_n);
        loop {
            let report = self.holder()?.look()?;
            let is_close = (report.height_m - target_m).abs() <= close_m;
            if report.state == Holding::Steady(command_n) && is_close && report.moved_m <= REST_M {
                // The saturation flag alone proves nothing: for a tick, a coil may saturate that holds a locked axis.
                if report.saturated > 0 && report.delivered_n < command_n - STEADY_N {
                    let (height_mm, delivered_n) = (report.height_m * 1.0e3, report.delivered_n);
                    return Err(CalibrationError::Saturated { command_n, delivered_n, height_mm });
                }
                self.tell(None)?;
                self.restless = report.restless;
                return Ok(Rest { height_m: report.height_m, delivered_n: report.delivered_n });
            }
            if Instant::now() > until {
                let (target_mm, height_mm) = (target_m * 1.0e3, report.height_m * 1.0e3);
                return Err(CalibrationError::NotReached { target_mm, height_mm });
            }
            self.tell(Some(Waiting { target_m, height_m: report.height_m, command_n }))?;
            std::thread::sleep(LOOK_AGAIN);
        }
    }

    fn still_rests(&mut self, rest: &Rest) -> Result<bool, CalibrationError> {
        // The mean in progress at this point and the next one contain any motion during the last reading.
        let (from, until) = (self.holder()?.look()?.means, Instant::now() + self.options.patience);
        loop {
            let report = self.holder()?.look()?;
            if report.means >= from + 2 {
                let is_there = (report.height_m - rest.height_m).abs() <= REST_M;
                return Ok(is_there && report.restless == self.restless);
            }
            if Instant::now() > until {
                return Err(CalibrationError::Fault(Fault::Timeout));
            }
            std::thread::sleep(LOOK_AGAIN);
        }
    }

    fn read_force_n(&mut self, _: &Rest) -> Result<f64, CalibrationError> {
        // Check the handle first: a fault is more specific than an implausible force.
        self.holder()?.look()?;
        self.sensor.read_n()
    }
}
