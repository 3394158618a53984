//! Implementation of the device contract for the Falcon: positions from encoder counts, motor words from wrenches, buttons.

use crate::boot;
use crate::chip::{Chip, PRODUCT, VENDOR};
use crate::device_error::DeviceError;
use crate::exchange::{Exchange, ForceSwitch};
use crate::firmware;
use crate::kinematics::{CENTRE_M, Posture, RANGE_M, angles_rad, posture, resolution_m};
use crate::protocol::{ALL_HOMED, Command, Homing, Lamp, Report, clipped_words};
use crate::remote::RemoteChip;
use crate::usb;
use flotor_hal::{
    ActiveDevice, Axes, CalibrationDevice, Capabilities, Conditions, ConnectionDevice, Cycle, DQuat, DVec3,
    Device, DeviceInfo, DeviceState, IndependentStop, IndependentStopDevice, LoopConfig, Parameter, Pose,
    Refusal, Settings, Tick, Twist, UsbAccess, UsbKind, VelocityFilter, VerticalCalibration, Wrench, choices,
    export_device,
};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Prefixes of an address.
const USB: &str = "usb";
const TCP: &str = "tcp:";
/// Maximum slew rate of the force, N/s: from zero to the default limit in a millisecond.
const SLEW_N_PER_S: f64 = 8000.0;
/// Latency, s: a command and its report over full-speed USB, a frame of 1 ms each.
const LATENCY_S: f64 = 2.0e-3;
/// Error without homing, with the remedy.
const NOT_HOMED: &str = "the Falcon has not found its home position: start with `homing_s` of 10 or more, and while \
its lamp is red, push the handle in as far as possible and pull the handle out as far as possible";
/// Interval between two commands during homing.
const HOMING_NAP: Duration = Duration::from_millis(2);

const SCHEMA: &[Parameter] = &[
    Parameter::text(
        "address",
        "Address: usb (the default: the first Falcon that can be opened), usb:SERIAL, or tcp:HOST:PORT of an emulator",
    ),
    Parameter::file(
        "firmware",
        choices![],
        "Firmware file of your own, which the device needs once after power-off (default: none)",
    ),
    Parameter::text(
        "firmware_sha256",
        "First 16 or more hex digits of the SHA-256 of `firmware` (default: `firmware` must be in the built-in list)",
    ),
    Parameter::real("max_force_n", "N", 0.0, 20.0, 8.0, "Largest force on the hand"),
    Parameter::real(
        "words_per_nm",
        "1/(N·m)",
        100.0,
        100_000.0,
        10_000.0,
        "Motor command per torque of an arm; measure this value with a force sensor",
    ),
    Parameter::real(
        "homing_s",
        "s",
        0.0,
        600.0,
        30.0,
        "Time limit for homing by hand (push the handle in, and pull it out); 0: the device must be homed \
         already",
    ),
    Parameter::real(
        "velocity_cutoff_hz",
        "Hz",
        1.0,
        500.0,
        30.0,
        "Cutoff frequency of the low-pass filter of the velocity, which is estimated by finite differences \
         of the position",
    ),
    Parameter::real("timeout_ms", "ms", 5.0, 10_000.0, 100.0, "Timeout for messages of the device"),
];

/// Transforms a vector from the maker's frame (x right, y up, z towards the user) to the host's (x right, y away, z up).
fn to_host(maker: DVec3) -> DVec3 {
    DVec3::new(maker.x, -maker.z, maker.y)
}

/// Transforms a vector from the host's frame to the maker's.
fn to_maker(host: DVec3) -> DVec3 {
    DVec3::new(host.x, host.z, -host.y)
}

/// Parsed parameters.
#[derive(Clone, Debug)]
struct Options {
    address: String,
    firmware: Option<Vec<u8>>,
    max_force_n: f64,
    words_per_nm: f64,
    homing: Duration,
    cutoff_hz: f64,
    timeout: Duration,
    values: Vec<f64>,
}

/// Opened Falcon: its firmware runs, the motors exert no torque.
pub struct FalconDevice {
    options: Options,
    /// `None` after a fault: the next activation opens the chip again.
    chip: Option<Arc<dyn Chip>>,
    calibration: VerticalCalibration,
    switch: ForceSwitch,
}

/// Active Falcon: its motors exert the commanded force.
pub struct DrivenDevice {
    opened: FalconDevice,
    exchange: Exchange,
    posture: Posture,
    /// First report, for the first read.
    first: Option<Report>,
    state: DeviceState,
    velocity: VelocityFilter,
    /// Last motor command as a force on the hand, N, and whether the words were clipped.
    force_n: DVec3,
    is_clipped: bool,
    /// Fault that removed the force.
    error: Option<DeviceError>,
}

impl Options {
    fn new(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let expected = settings.text("firmware_sha256");
        let firmware = settings.text("firmware").map(|path| firmware::read(path, expected));
        let seconds = |key| Duration::from_secs_f64(settings.number_or_default(key));
        Ok(Self {
            address: settings.text("address").unwrap_or(USB).to_owned(),
            firmware: firmware.transpose().map_err(Refusal::parameter)?,
            max_force_n: settings.number_or_default("max_force_n"),
            words_per_nm: settings.number_or_default("words_per_nm"),
            homing: seconds("homing_s"),
            cutoff_hz: settings.number_or_default("velocity_cutoff_hz"),
            timeout: seconds("timeout_ms") / 1000,
            values: settings.values(),
        })
    }

    fn open(&self) -> Result<Arc<dyn Chip>, Refusal> {
        if let Some(address) = self.address.strip_prefix(TCP) {
            let connected = RemoteChip::connect(address);
            return connected.map(|chip| Arc::new(chip) as Arc<dyn Chip>).map_err(|error| {
                Refusal::resource(format!(
                    "no emulated Falcon at {address} ({error}); start one with `flotor emulate falcon` (on Linux), which prints its address"
                ))
            });
        }
        let serial = match self.address.strip_prefix(USB) {
            Some("") => None,
            Some(rest) if rest.starts_with(':') && rest.len() > 1 => rest.get(1..),
            _ => {
                return Err(Refusal::parameter(format!(
                    "`address` = `{}` is not valid; write usb, usb:SERIAL or tcp:HOST:PORT",
                    self.address
                )));
            }
        };
        usb::open(serial).map(|chip| Arc::new(chip) as Arc<dyn Chip>).map_err(Refusal::resource)
    }
}

impl Device for FalconDevice {
    const INFO: DeviceInfo = DeviceInfo::new(
        "falcon",
        "Novint Falcon",
        "A desktop delta with three driven axes and four buttons, over raw USB",
    );
    const PARAMETERS: &'static [Parameter] = SCHEMA;
    type Active = DrivenDevice;
    type Stop = ForceSwitch;

    fn open(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let options = Options::new(settings)?;
        let mut device = Self {
            options,
            chip: None,
            calibration: VerticalCalibration::NONE,
            switch: ForceSwitch::default(),
        };
        device.connect()?;
        Ok(device)
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities {
            resolution_m: resolution_m(),
            rate_hz: [100.0, 1000.0],
            ..Capabilities::driving(Axes::TRANSLATION)
                .with_range(RANGE_M, 0.0)
                .with_limits(self.options.max_force_n, 0.0)
                .with_slew(SLEW_N_PER_S, f64::INFINITY) // no torque to limit
                .with_latency(LATENCY_S)
        }
    }

    fn stopper(&self) -> ForceSwitch {
        self.switch.clone()
    }

    fn activate(mut self, _config: &LoopConfig) -> Result<DrivenDevice, (Self, Refusal)> {
        match self.start() {
            Ok((exchange, report, posture)) => Ok(DrivenDevice {
                velocity: VelocityFilter::new(self.options.cutoff_hz),
                opened: self,
                exchange,
                posture,
                first: Some(report),
                state: DeviceState::HOME,
                force_n: DVec3::ZERO,
                is_clipped: false,
                error: None,
            }),
            Err(refusal) => Err((self, refusal)),
        }
    }

    fn parameter(&self, index: usize) -> f64 {
        self.options.values.get(index).copied().unwrap_or(f64::NAN)
    }
}

impl FalconDevice {
    /// Opens the chip and starts the device up to its first report.
    fn connect(&mut self) -> Result<Arc<dyn Chip>, Refusal> {
        let chip = self.options.open()?;
        let firmware = self.options.firmware.as_deref();
        let report = boot::start(&*chip, firmware)
            .map_err(|failure| Refusal::resource(format!("the Falcon: {failure}")))?;
        if self.options.homing.is_zero() && report.homed != ALL_HOMED {
            return Err(Refusal::resource(NOT_HOMED));
        }
        self.chip = Some(Arc::clone(&chip));
        Ok(chip)
    }

    fn start(&mut self) -> Result<(Exchange, Report, Posture), Refusal> {
        let chip = match self.chip.take() {
            Some(chip) => chip,
            None => self.connect()?,
        };
        self.switch.rearm();
        let mut exchange =
            Exchange::start(&chip, &self.switch, self.options.timeout).map_err(Refusal::resource)?;
        let report = match self.home(&exchange) {
            Ok(report) => report,
            Err(refusal) => {
                if exchange.end().is_none() {
                    self.chip = Some(chip);
                }
                return Err(refusal);
            }
        };
        self.chip = Some(chip);
        let posture = posture(angles_rad(report.encoders), CENTRE_M).ok_or_else(|| {
            Refusal::resource(format!(
                "the encoder counts {} of the Falcon match no position of its arms: switch the Falcon off \
                 and on, and start again",
                report.encoders.map(|count| count.to_string()).join(", ")
            ))
        })?;
        Ok((exchange, report, posture))
    }

    /// Waits until all arms are homed.
    fn home(&self, exchange: &Exchange) -> Result<Report, Refusal> {
        let started = Instant::now();
        let mut newest = None;
        loop {
            let report = exchange
                .take()
                .map_err(|error| Refusal::resource(format!("the Falcon: {}", error.fault().advice())))?;
            newest = report.or(newest);
            let patience = self.options.homing.max(self.options.timeout);
            match newest {
                Some(report) if report.homed == ALL_HOMED => return Ok(report),
                _ if started.elapsed() > patience => {
                    return Err(Refusal::resource(NOT_HOMED));
                }
                _ => {}
            }
            let command = Command { motors: [0; 3], lamp: Lamp::Red, homing: Homing::Wanted };
            exchange.post(command);
            std::thread::sleep(HOMING_NAP);
        }
    }
}

impl ActiveDevice for DrivenDevice {
    type Opened = FalconDevice;

    fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle {
        let report = match self.exchange.take() {
            Ok(report) => report.or(self.first.take()),
            Err(error) => return Cycle::Fault(error.fault()),
        };
        self.first = None;
        let Some(report) = report else {
            // The thread reports a device that is silent for too long.
            *state = self.state;
            return Cycle::Stale;
        };
        self.error = self.error.or((report.homed != ALL_HOMED).then_some(DeviceError::NotHomed));
        match posture(angles_rad(report.encoders), self.posture.position_m()) {
            Some(posture) => self.posture = posture,
            None => self.error = self.error.or(Some(DeviceError::NoPosture)),
        }
        if let Some(error) = self.error {
            self.exchange.post(Command::REST);
            return Cycle::Fault(error.fault());
        }
        self.sample(report.buttons, tick.time_ns);
        *state = self.state;
        Cycle::Fresh
    }

    fn write(&mut self, _tick: &Tick, wrench: &Wrench) -> Cycle {
        let asked_n = wrench.force();
        let Options { max_force_n, words_per_nm, .. } = self.opened.options;
        let may_push = self.error.is_none() && !self.opened.switch.is_stopped();
        let wanted_n = match asked_n.is_finite() && may_push {
            true => asked_n.clamp_length_max(max_force_n),
            false => DVec3::ZERO,
        };
        let height_m = self.state.pose.position().z;
        let share = self.opened.calibration.share(height_m);
        let command_n = wanted_n.with_z(self.opened.calibration.command_n(wanted_n.z, height_m));
        // The motors pull against the direction of the angles.
        let wanted = self.posture.torques_nm(to_maker(command_n)) * -words_per_nm;
        let clipped = clipped_words(wanted.to_array());
        let torques_nm = DVec3::from_array(clipped.words.map(f64::from)) / -words_per_nm;
        let given_n = to_host(self.posture.force_n(torques_nm));
        let command = Command { motors: clipped.words, lamp: Lamp::Green, homing: Homing::Done };
        if !self.exchange.post(command) {
            return Cycle::Stale;
        }
        self.force_n = if clipped.words == [0; 3] { DVec3::ZERO } else { given_n.with_z(given_n.z * share) };
        self.is_clipped = clipped.is_clipped;
        Cycle::Fresh
    }

    fn deactivate(mut self) -> FalconDevice {
        if self.exchange.end().is_some() {
            self.opened.chip = None;
        }
        self.opened
    }
}

impl DrivenDevice {
    /// Updates the sample from the posture.
    fn sample(&mut self, buttons: u32, time_ns: u64) {
        let position_m = to_host(self.posture.position_m() - CENTRE_M);
        let velocity = self.velocity.update(position_m - self.state.pose.position(), time_ns);
        self.state = DeviceState {
            pose: Pose::new(position_m, DQuat::IDENTITY),
            twist: Twist::new(velocity, DVec3::ZERO),
            // The commanded force: the device measures none.
            delivered: Wrench::from_force(self.force_n),
            sampled_ns: time_ns,
            buttons,
            conditions: if self.is_clipped { Conditions::SATURATED } else { Conditions::NONE },
        };
    }
}

impl CalibrationDevice for FalconDevice {
    /// Returns the address, because the firmware has no serial number.
    fn serial(&self) -> String {
        self.options.address.clone()
    }

    fn calibrate_vertical(&mut self, calibration: &VerticalCalibration) -> Result<(), Refusal> {
        self.calibration = *calibration;
        Ok(())
    }
}

impl ConnectionDevice for FalconDevice {
    const USB: &'static [UsbKind] = &[UsbKind::new(VENDOR, PRODUCT, UsbAccess::Raw)];
}

impl IndependentStopDevice for FalconDevice {
    /// Returns the independent stop of the open connection; a device on USB has none.
    fn independent_stop(&self) -> IndependentStop {
        let rest = Command::REST.bytes();
        self.chip.as_ref().map_or(IndependentStop::none(), |chip| chip.independent_stop(&rest))
    }
}

export_device!(FalconDevice, calibration, connection, independent_stop);
