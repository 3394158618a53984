//! Implementation of the device contract for the Touch and Phantom family, with their parameters.

use crate::hd::{Facts, Hd};
use crate::scheduler::Driver;
use flotor_hal::{
    ActiveDevice, Axes, Capabilities, ConnectionDevice, Cycle, Device, DeviceInfo, DeviceState, LoopConfig,
    PacingDevice, Parameter, Refusal, SampleWait, Settings, Tick, UsbAccess, UsbKind, Wrench, choices,
    export_device,
};
use flotor_vendor_sdk::parameters::{PACE, STAND_IN, TIMEOUT, max_force, max_torque};
use flotor_vendor_sdk::{DropInPolicy, Exchange, LoopEnd, Pace, StopSwitch};
use std::f64::consts::PI;
use std::sync::Arc;
use std::time::Duration;

/// Rate of the scheduler, Hz.
const RATE_HZ: f64 = 1000.0;
/// Resolution of the encoders at the handle, m (450 dpi, the coarsest of the family).
const RESOLUTION_M: f64 = 5.5e-5;

const SCHEMA: &[Parameter] = &[
    Parameter::file(
        "library",
        choices![],
        "Library of OpenHaptics: libHD.so, on Windows hd.dll (default: searched in $OH_SDK_BASE, $3DTOUCH_BASE, $LD_LIBRARY_PATH (on Windows $PATH) and the library folders of user and system)",
    ),
    STAND_IN,
    Parameter::text(
        "name",
        "Name of the device in the maker's setup program (default: the default device of that program)",
    ),
    max_force(40.0),
    max_torque(1.0),
    TIMEOUT,
    PACE,
];

/// Opened Touch or Phantom: identified and calibrated, without force.
pub struct TouchDevice {
    hd: Arc<Hd>,
    exchange: Arc<Exchange>,
    /// Limits of force, N, and torque, N·m.
    most: [f64; 2],
    timeout: Duration,
    values: Vec<f64>,
}

/// Active Touch or Phantom, called by the scheduler of the SDK.
pub struct ScheduledDevice {
    opened: TouchDevice,
    driver: Driver,
    end: LoopEnd,
}

impl Device for TouchDevice {
    const INFO: DeviceInfo = DeviceInfo::new(
        "openhaptics",
        "3D Systems Touch, Geomagic Touch, Phantom",
        "An arm with a stylus, over the OpenHaptics that the user has installed; its scheduler sets the pace",
    );
    const PARAMETERS: &'static [Parameter] = SCHEMA;
    type Active = ScheduledDevice;
    type Stop = StopSwitch;

    fn open(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let policy = settings.one_of(STAND_IN.id(), [DropInPolicy::Refuse, DropInPolicy::Accept]);
        let hd = Hd::open(settings.text("library"), policy, settings.text("name"))?;
        hd.calibrate()?;
        let Facts { force_n, torque_nm, gives_torque, .. } = hd.facts;
        let told = |id: &str, own: f64| match settings.number_or_default(id) {
            0.0 => own,
            told => told.min(own),
        };
        let most =
            [told("max_force_n", force_n), if gives_torque { told("max_torque_nm", torque_nm) } else { 0.0 }];
        let pace = settings.one_of(PACE.id(), [Pace::Real, Pace::Lockstep]);
        Ok(Self {
            hd: Arc::new(hd),
            exchange: Arc::new(Exchange::new(pace)),
            most,
            timeout: Duration::from_secs_f64(settings.number_or_default(TIMEOUT.id()) * 1.0e-3),
            values: settings.values(),
        })
    }

    fn capabilities(&self) -> Capabilities {
        let Facts { range_m, is_turned, gives_torque, stiffness_n_per_m, .. } = self.hd.facts;
        let [force_n, torque_nm] = self.most;
        Capabilities {
            sensed: if is_turned { Axes::ALL } else { Axes::TRANSLATION },
            actuated: if gives_torque { Axes::ALL } else { Axes::TRANSLATION },
            range_m: range_m.to_array(),
            // The SDK reports no range of the stylus: declare the largest rotation.
            range_rad: [if is_turned { PI } else { 0.0 }; 3],
            resolution_m: RESOLUTION_M,
            max_force_n: [force_n; 3],
            max_torque_nm: [torque_nm; 3],
            // Slew: from zero to the maximum in a tick of the scheduler; the SDK limits it further.
            max_force_slew_n_per_s: force_n * RATE_HZ,
            max_torque_slew_nm_per_s: if torque_nm > 0.0 { torque_nm * RATE_HZ } else { f64::INFINITY },
            max_stiffness_n_per_m: stiffness_n_per_m,
            rate_hz: [100.0, RATE_HZ],
            // A wrench waits for the next call of the scheduler.
            latency_s: 1.0 / RATE_HZ,
        }
    }

    fn stopper(&self) -> StopSwitch {
        StopSwitch(Arc::clone(&self.exchange))
    }

    fn activate(self, _config: &LoopConfig) -> Result<ScheduledDevice, (Self, Refusal)> {
        if let Err(refusal) = self.hd.calibrate() {
            return Err((self, refusal));
        }
        match Driver::start(&self.hd, &self.exchange) {
            Ok(driver) => {
                let end = LoopEnd::new(Arc::clone(&self.exchange), self.most, self.timeout);
                Ok(ScheduledDevice { opened: self, driver, end })
            }
            Err(failed) => Err((self, failed.refusal())),
        }
    }

    fn parameter(&self, index: usize) -> f64 {
        self.values.get(index).copied().unwrap_or(f64::NAN)
    }
}

impl ActiveDevice for ScheduledDevice {
    type Opened = TouchDevice;

    fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle {
        self.end.read(tick, state)
    }

    fn write(&mut self, _tick: &Tick, wrench: &Wrench) -> Cycle {
        self.end.write(wrench)
    }

    fn deactivate(self) -> TouchDevice {
        let Self { opened, driver, .. } = self;
        drop(driver);
        opened
    }
}

impl PacingDevice for ScheduledDevice {
    fn wait_for_sample(&mut self, timeout_ns: u64) -> SampleWait {
        self.end.wait_for_sample(timeout_ns)
    }
}

impl ConnectionDevice for TouchDevice {
    /// Devices of 3D Systems: a serial port for the older ones, raw HID for the newer.
    const USB: &'static [UsbKind] =
        &[UsbKind::new(0x2988, 0x0302, UsbAccess::Serial), UsbKind::of_vendor(0x2988, UsbAccess::Hid)];
}

export_device!(TouchDevice, connection, pacing);
