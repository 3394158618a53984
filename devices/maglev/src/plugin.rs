//! The device plugin over either of the two protocols.

use crate::ml_client::stop::LandSwitch;
use crate::ml_device::{MlActive, MlDevice};
use crate::own_device::{OwnActive, OwnDevice};
use crate::parameters::{Options, Protocol, SCHEMA, Values};
use crate::protocol::Rejections;
use crate::shaping::Shaping;
use flotor_hal::{
    ActiveDevice, CalibrationDevice, Capabilities, Cycle, Device, DeviceInfo, DeviceState, IndependentStop,
    IndependentStopDevice, LoopConfig, PacingDevice, Parameter, Refusal, SafeStop, SampleWait, SampledLoop,
    SetParameterError, Settings, StopFlag, Tick, VerticalCalibration, Wrench, export_device,
};
use std::sync::Arc;

/// The magnetic-levitation device, opened: the controller has identified itself and is not commanded yet.
pub struct MaglevDevice {
    options: Options,
    values: Values,
    opened: Opened,
}

/// The opened device, by protocol.
enum Opened {
    Own(Box<OwnDevice>),
    MlApi(Box<MlDevice>),
}

/// The magnetic-levitation device, active: the flotor levitates under the commands of the host.
pub struct LevitatingDevice {
    options: Options,
    values: Values,
    active: Active,
    period_s: f64,
}

enum Active {
    Own(Box<OwnActive>),
    MlApi(Box<MlActive>),
}

/// Stop handle of the device, usable from any thread.
pub enum Switch {
    /// Switch-off of the coils at the next tick (Flotor's protocol).
    Coils(StopFlag),
    /// Land frame, sent at once (ML API).
    Land(LandSwitch),
}

impl SafeStop for Switch {
    fn safe_stop(&self) {
        match self {
            Self::Coils(switch) => switch.safe_stop(),
            Self::Land(switch) => switch.safe_stop(),
        }
    }
}

impl Device for MaglevDevice {
    const INFO: DeviceInfo = DeviceInfo::new(
        "maglev",
        "Magnetic-levitation haptic device",
        "A levitated handle behind a controller on USB, HID, a serial port or TCP",
    );
    const PARAMETERS: &'static [Parameter] = SCHEMA;
    type Active = LevitatingDevice;
    type Stop = Switch;

    fn open(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let values = Values::new(settings)?;
        let options = Options::new(settings, &values)?;
        let opened = match options.protocol {
            Protocol::Flotor => Opened::Own(Box::new(OwnDevice::open(&options)?)),
            Protocol::MlApi => Opened::MlApi(Box::new(MlDevice::open(&options)?)),
        };
        Ok(Self { options, values, opened })
    }

    fn capabilities(&self) -> Capabilities {
        match &self.opened {
            Opened::Own(device) => device.capabilities(),
            Opened::MlApi(device) => device.capabilities(self.options.lockstep),
        }
    }

    fn stopper(&self) -> Switch {
        match &self.opened {
            Opened::Own(device) => Switch::Coils(device.stopper()),
            Opened::MlApi(device) => Switch::Land(LandSwitch(Arc::clone(&device.stop))),
        }
    }

    fn activate(self, config: &LoopConfig) -> Result<LevitatingDevice, (Self, Refusal)> {
        let Self { options, values, opened } = self;
        let active = match opened {
            Opened::Own(device) => device
                .activate(config)
                .map(Active::Own)
                .map_err(|(device, refusal)| (Opened::Own(device), refusal)),
            Opened::MlApi(device) => device
                .activate(&options, &values, config)
                .map(Active::MlApi)
                .map_err(|(device, refusal)| (Opened::MlApi(device), refusal)),
        };
        match active {
            Ok(active) => {
                let period_s = config.period_ns as f64 * 1.0e-9;
                let mut active = LevitatingDevice { options, values, active, period_s };
                active.build_walls();
                Ok(active)
            }
            Err((opened, refusal)) => Err((Self { options, values, opened }, refusal)),
        }
    }

    fn parameter(&self, index: usize) -> f64 {
        self.values.get(index)
    }
}

impl CalibrationDevice for MaglevDevice {
    fn serial(&self) -> String {
        match &self.opened {
            Opened::Own(device) => device.serial(),
            Opened::MlApi(device) => device.serial(),
        }
    }

    fn calibrate_vertical(&mut self, calibration: &VerticalCalibration) -> Result<(), Refusal> {
        match &mut self.opened {
            Opened::Own(device) => device.calibration = *calibration,
            Opened::MlApi(device) => device.calibration = *calibration,
        }
        Ok(())
    }
}

impl IndependentStopDevice for MaglevDevice {
    fn independent_stop(&self) -> IndependentStop {
        match &self.opened {
            Opened::Own(device) => device.independent_stop(),
            Opened::MlApi(device) => device.stop.independent(),
        }
    }
}

impl ActiveDevice for LevitatingDevice {
    type Opened = MaglevDevice;

    fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle {
        match &mut self.active {
            Active::Own(device) => device.read(tick, state),
            Active::MlApi(device) => device.read(tick, state),
        }
    }

    fn write(&mut self, tick: &Tick, wrench: &Wrench) -> Cycle {
        match &mut self.active {
            Active::Own(device) => device.write(tick, wrench),
            Active::MlApi(device) => device.write(wrench),
        }
    }

    fn set_parameter(&mut self, index: usize, value: f64) -> Result<(), SetParameterError> {
        self.values.set(index, value);
        self.build_walls();
        Ok(())
    }

    fn deactivate(self) -> MaglevDevice {
        let opened = match self.active {
            Active::Own(device) => Opened::Own(device.deactivate()),
            Active::MlApi(device) => Opened::MlApi(device.deactivate()),
        };
        MaglevDevice { options: self.options, values: self.values, opened }
    }
}

impl PacingDevice for LevitatingDevice {
    /// Waits for a tick of the ML API; the other protocol has no pace, as its controller only replies to commands.
    fn wait_for_sample(&mut self, timeout_ns: u64) -> SampleWait {
        match &mut self.active {
            Active::Own(_) => SampleWait::NotPaced,
            Active::MlApi(device) => device.wait_for_sample(timeout_ns),
        }
    }
}

impl LevitatingDevice {
    /// Returns the numbers of rejected replies of the controller, by reason; `None` with the ML API, which counts none.
    #[must_use]
    pub fn rejections(&self) -> Option<&Rejections> {
        match &self.active {
            Active::Own(device) => Some(device.rejections()),
            Active::MlApi(_) => None,
        }
    }

    /// Returns the number of ticks superseded by a newer tick before use; `None` with Flotor's protocol, which has no
    /// ticks.
    #[must_use]
    pub fn dropped_ticks(&self) -> Option<u64> {
        match &self.active {
            Active::Own(_) => None,
            Active::MlApi(device) => Some(device.dropped_ticks()),
        }
    }

    fn shaping(&mut self) -> &mut Shaping {
        match &mut self.active {
            Active::Own(device) => &mut device.shaping,
            Active::MlApi(device) => &mut device.shaping,
        }
    }

    fn build_walls(&mut self) {
        let latency_s = match &self.active {
            Active::Own(device) => device.latency_s(),
            Active::MlApi(_) => MlDevice::latency_s(self.options.lockstep),
        };
        let sampled = SampledLoop { period_s: self.period_s, latency_s };
        let walls = self.values.walls().map(|walls| walls.stabilised(&sampled));
        self.shaping().walls = walls;
    }
}

export_device!(MaglevDevice, calibration, pacing, independent_stop);
