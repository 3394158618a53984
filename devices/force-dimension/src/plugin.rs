//! Implementation of the device contract for Force Dimension's devices, with their parameters.

use crate::dhd::{Dhd, Gripper, Setup, Which, Wrist};
use crate::driver::Driver;
use crate::kind::{Kind, grip_axis, gripper_n};
use flotor_hal::{
    ActiveDevice, ActiveGrip, Axes, Capabilities, Choices, ConnectionDevice, Cycle, Device, DeviceInfo,
    DeviceState, GripAxis, GripDevice, GripState, IndependentStop, IndependentStopDevice, LoopConfig,
    PacingDevice, Parameter, Refusal, SampleWait, Settings, StoppedState, Tick, UsbAccess, UsbKind, Wrench,
    choices, export_device,
};
use flotor_vendor_sdk::parameters::{PACE, STAND_IN, TIMEOUT, max_force, max_torque};
use flotor_vendor_sdk::{DropInPolicy, Exchange, LoopEnd, Pace, StopSwitch};
use std::sync::Arc;
use std::time::Duration;

const INITIALISE: Choices = choices!["never", "automatic"];

/// Highest exchange rate of the devices, Hz.
const FASTEST_HZ: f64 = 4000.0;
/// Unit of the watchdog timeout, ms; the timeout has eight bits.
const WATCHDOG_UNIT_MS: f64 = 0.125;
/// Resolution of the encoders at the handle, m: the coarsest of the family.
const RESOLUTION_M: f64 = 3.0e-5;

const SCHEMA: &[Parameter] = &[
    Parameter::file(
        "library",
        choices![],
        "Library of the SDK: libdrd.so.3, on Windows drdms64.dll (default: searched in $FDSDK, $FORCEDIM_SDK, $FD_SDK_DIR, $ForceDimensionSDK_DIR, $LD_LIBRARY_PATH (on Windows $PATH) and the library folders of user and system)",
    ),
    STAND_IN,
    Parameter::real(
        "serial",
        "1",
        0.0,
        65_535.0,
        0.0,
        "Serial number of the device; 0: the first device of the SDK",
    ),
    Parameter::choice(
        "initialise",
        INITIALISE,
        0,
        "Initialisation of a device without a reference position: never (the device is refused), or \
         automatic (its arm moves to find the reference when energised)",
    ),
    max_force(100.0),
    max_torque(10.0),
    Parameter::real("velocity_window_ms", "ms", 1.0, 100.0, 20.0, "Window of the SDK's velocity estimate"),
    Parameter::real(
        "watchdog_ms",
        "ms",
        1.0,
        31.875,
        20.0,
        "Time without a command after which the watchdog of the device removes the force",
    ),
    TIMEOUT,
    PACE,
];

/// Opened Force Dimension device: identified, without force.
pub struct ForceDimensionDevice {
    /// `None` after a panic of the thread that owned the device.
    dhd: Option<Dhd>,
    exchange: Arc<Exchange>,
    kind: Kind,
    wrist: Wrist,
    gripper: Gripper,
    initialises: bool,
    setup: Setup,
    timeout: Duration,
    values: Vec<f64>,
}

/// Force Dimension device with force enabled: opened device, driver thread, and the loop's side of the exchange.
pub struct EnergizedDevice {
    opened: ForceDimensionDevice,
    driver: Driver,
    end: LoopEnd,
}

impl Device for ForceDimensionDevice {
    const INFO: DeviceInfo = DeviceInfo::new(
        "force-dimension",
        "Force Dimension omega, delta, sigma, lambda",
        "A parallel arm with three to six driven axes, over the SDK that the user has installed",
    );
    const PARAMETERS: &'static [Parameter] = SCHEMA;
    type Active = EnergizedDevice;
    type Stop = StopSwitch;

    fn open(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let policy = settings.one_of(STAND_IN.id(), [DropInPolicy::Refuse, DropInPolicy::Accept]);
        let dhd = Dhd::open(settings.text("library"), policy, which(settings.number_or_default("serial"))?)?;
        let initialises = settings.choice_or_default("initialise") == 1;
        if !initialises && !dhd.is_initialized() {
            return Err(Refusal::resource(format!(
                "the {} has no reference position: initialise the device with the maker's program, or keep your \
                 hands off and set `initialise = \"automatic\"`, which moves the arm",
                dhd.name()
            )));
        }
        let (wrist, gripper) = (dhd.wrist, dhd.gripper);
        let of_kind = Kind::of_number(dhd.kind());
        let told = |id: &str, own: f64| match settings.number_or_default(id) {
            0.0 => own,
            told => told,
        };
        let kind = Kind {
            force_n: told("max_force_n", of_kind.force_n),
            torque_nm: if wrist == Wrist::Driven { told("max_torque_nm", of_kind.torque_nm) } else { 0.0 },
            ..of_kind
        };
        if wrist == Wrist::Driven && kind.torque_nm == 0.0 {
            return Err(Refusal::parameter(format!(
                "the {} has a driven wrist of unknown largest torque: set `max_torque_nm` to the torque in the maker's data sheet",
                dhd.name()
            )));
        }
        let pace = settings.one_of(PACE.id(), [Pace::Real, Pace::Lockstep]);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // in the ranges of the schema
        let setup = Setup {
            most: [kind.force_n, kind.torque_nm],
            window_ms: settings.number_or_default("velocity_window_ms").round() as i32,
            watchdog_units: (settings.number_or_default("watchdog_ms") / WATCHDOG_UNIT_MS).round() as u8,
        };
        Ok(Self {
            dhd: Some(dhd),
            exchange: Arc::new(Exchange::new(pace)),
            kind,
            wrist,
            gripper,
            initialises,
            setup,
            timeout: Duration::from_secs_f64(settings.number_or_default(TIMEOUT.id()) * 1.0e-3),
            values: settings.values(),
        })
    }

    fn capabilities(&self) -> Capabilities {
        let Kind { range_m, range_rad, force_n, torque_nm } = self.kind;
        let (sensed, actuated) = match self.wrist {
            Wrist::None => (Axes::TRANSLATION, Axes::TRANSLATION),
            Wrist::Sensed => (Axes::ALL, Axes::TRANSLATION),
            Wrist::Driven => (Axes::ALL, Axes::ALL),
        };
        let turns = self.wrist != Wrist::None;
        Capabilities {
            sensed,
            actuated,
            range_m,
            range_rad: [if turns { range_rad } else { 0.0 }; 3],
            resolution_m: RESOLUTION_M,
            max_force_n: [force_n; 3],
            max_torque_nm: [torque_nm; 3],
            // Slew: from zero to the maximum in a millisecond, as the motors are driven directly.
            max_force_slew_n_per_s: force_n * 1.0e3,
            max_torque_slew_nm_per_s: if torque_nm > 0.0 { torque_nm * 1.0e3 } else { f64::INFINITY },
            // The maker's figure holds for a control loop at 4 kHz, not for this loop.
            max_stiffness_n_per_m: 0.0,
            rate_hz: [100.0, FASTEST_HZ],
            // A wrench is sent with the next exchange, which also reads the next sample: one period at 1 kHz.
            latency_s: 1.0 / 1000.0,
        }
    }

    fn stopper(&self) -> StopSwitch {
        StopSwitch(Arc::clone(&self.exchange))
    }

    fn activate(mut self, _config: &LoopConfig) -> Result<EnergizedDevice, (Self, Refusal)> {
        let Some(dhd) = self.dhd.take() else {
            return Err((
                self,
                Refusal::resource(
                    "the thread of the device has ended and closed the device; start the program again",
                ),
            ));
        };
        if self.initialises
            && !dhd.is_initialized()
            && let Err(refusal) = dhd.initialize()
        {
            self.dhd = Some(dhd);
            return Err((self, refusal));
        }
        match Driver::start(dhd, &self.setup, &self.exchange) {
            Ok(driver) => {
                let end = LoopEnd::new(Arc::clone(&self.exchange), self.setup.most, self.timeout)
                    .with_grip(gripper_n(self.gripper));
                Ok(EnergizedDevice { opened: self, driver, end })
            }
            Err((dhd, refusal)) => {
                self.dhd = dhd;
                Err((self, refusal))
            }
        }
    }

    fn parameter(&self, index: usize) -> f64 {
        self.values.get(index).copied().unwrap_or(f64::NAN)
    }
}

/// Converts the parameter `serial` to a device selection.
fn which(serial: f64) -> Result<Which, Refusal> {
    if serial == 0.0 {
        return Ok(Which::First);
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // in the range of the schema
    let number = serial as u16;
    match f64::from(number) == serial {
        true => Ok(Which::Serial(number)),
        false => Err(Refusal::parameter(format!("`serial` is {serial}, but must be a whole number"))),
    }
}

impl ActiveDevice for EnergizedDevice {
    type Opened = ForceDimensionDevice;

    fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle {
        self.end.read(tick, state)
    }

    fn write(&mut self, _tick: &Tick, wrench: &Wrench) -> Cycle {
        self.end.write(wrench)
    }

    fn deactivate(self) -> ForceDimensionDevice {
        let Self { mut opened, mut driver, .. } = self;
        opened.dhd = driver.end();
        opened
    }
}

impl PacingDevice for EnergizedDevice {
    fn wait_for_sample(&mut self, timeout_ns: u64) -> SampleWait {
        self.end.wait_for_sample(timeout_ns)
    }
}

impl GripDevice for ForceDimensionDevice {
    fn grip_axis(&self) -> Option<GripAxis> {
        (self.gripper != Gripper::None).then(|| grip_axis(gripper_n(self.gripper)))
    }
}

impl ActiveGrip for EnergizedDevice {
    fn read_grip(&mut self, state: &mut GripState) {
        self.end.read_grip(state);
    }

    fn write_grip(&mut self, effort: f64) {
        self.end.write_grip(effort);
    }
}

impl IndependentStopDevice for ForceDimensionDevice {
    /// Declares the device's own watchdog, which removes the force.
    fn independent_stop(&self) -> IndependentStop {
        let within_ns = u64::from(self.setup.watchdog_units) * 125_000;
        IndependentStop::by_itself(StoppedState::Zero, within_ns)
    }
}

impl ConnectionDevice for ForceDimensionDevice {
    const USB: &'static [UsbKind] = &[UsbKind::of_vendor(0x1451, UsbAccess::Raw)];
}

export_device!(ForceDimensionDevice, connection, pacing, independent_stop, grip);
