//! Implementation of the device contract for the sensor: a device without axes, whose state contains a measured force.

use crate::line::{Heard, LineLost, SensorLine};
use flotor_hal::{
    ActiveDevice, Capabilities, Cycle, DVec3, Device, DeviceInfo, DeviceState, Fault, LoopConfig,
    NothingToStop, Parameter, Refusal, Settings, Tick, Wrench, export_device,
};
use flotor_serial::{PORT_EXAMPLE, PORT_HELP};
use std::time::Duration;

const SCHEMA: &[Parameter] = &[
    Parameter::text("port", PORT_HELP),
    Parameter::real(
        "timeout_ms",
        "ms",
        10.0,
        60_000.0,
        2000.0,
        "Silence of the sensor that is a fault; a slow one averages for a tenth of a second",
    ),
];

/// Poll interval for the first reading.
const LOOK_AGAIN: Duration = Duration::from_millis(1);

/// Opened force sensor that has replied once.
pub struct ForceSensor {
    line: SensorLine,
    timeout: Duration,
}

/// Active force sensor, polled in each tick.
pub struct AskedSensor {
    opened: ForceSensor,
    /// Newest reading.
    state: DeviceState,
}

impl ForceSensor {
    /// Waits for the first reading, so that a faulty sensor is reported at open.
    fn prove(&mut self, port: &str) -> Result<(), String> {
        let gone =
            |LineLost| format!("the force sensor at {port} is disconnected; plug it in and measure again");
        loop {
            self.line.ask().map_err(gone)?;
            match self.line.hear().map_err(gone)? {
                Heard::Force(_) => return Ok(()),
                Heard::Nonsense => {
                    let answer = self.line.last();
                    return Err(format!(
                        "the force sensor at {port} answers `{answer}` instead of a force like `F 1.234`"
                    ));
                }
                Heard::Nothing if self.line.silence() > self.timeout => {
                    return Err(format!(
                        "the force sensor at {port} does not answer within {} ms; is it one that answers `R`, at \
                         115200 baud?",
                        self.timeout.as_millis()
                    ));
                }
                Heard::Nothing => std::thread::sleep(LOOK_AGAIN),
            }
        }
    }
}

impl Device for ForceSensor {
    const INFO: DeviceInfo = DeviceInfo::new(
        "force-sensor",
        "Force sensor",
        "A force sensor on a serial port: measures a vertical force, exerts none",
    );
    const PARAMETERS: &'static [Parameter] = SCHEMA;
    type Active = AskedSensor;
    type Stop = NothingToStop;

    fn open(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let port = settings.text("port").ok_or_else(|| {
            Refusal::resource(format!("no `port` for the force sensor; set it, as in {PORT_EXAMPLE}"))
        })?;
        let timeout = Duration::from_secs_f64(settings.number_or_default("timeout_ms") * 1.0e-3);
        let mut sensor = Self { line: SensorLine::open(port).map_err(Refusal::resource)?, timeout };
        sensor.prove(port).map_err(Refusal::resource)?;
        Ok(sensor)
    }

    fn capabilities(&self) -> Capabilities {
        // A request and its reply over USB, a frame each.
        Capabilities { latency_s: 2.0e-3, ..Capabilities::UNDRIVEN }
    }

    fn stopper(&self) -> NothingToStop {
        NothingToStop
    }

    fn activate(self, _config: &LoopConfig) -> Result<AskedSensor, (Self, Refusal)> {
        Ok(AskedSensor { opened: self, state: DeviceState::HOME })
    }

    fn parameter(&self, index: usize) -> f64 {
        match index {
            0 => 0.0,
            1 => self.timeout.as_secs_f64() * 1.0e3,
            _ => f64::NAN,
        }
    }
}

impl ActiveDevice for AskedSensor {
    type Opened = ForceSensor;

    /// Reads the force on the sensor, N; fresh with each reading.
    fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle {
        let heard = self.opened.line.hear().and_then(|heard| self.opened.line.ask().map(|()| heard));
        let cycle = match heard {
            Err(LineLost) => Cycle::Fault(Fault::Disconnected),
            Ok(Heard::Nonsense) => Cycle::Fault(Fault::Protocol),
            Ok(Heard::Nothing) if self.opened.line.silence() > self.opened.timeout => {
                Cycle::Fault(Fault::Timeout)
            }
            Ok(Heard::Nothing) => Cycle::Stale,
            Ok(Heard::Force(force_n)) => {
                self.state.delivered = Wrench::from_force(DVec3::Z * force_n);
                self.state.sampled_ns = tick.time_ns;
                Cycle::Fresh
            }
        };
        *state = self.state;
        cycle
    }

    fn write(&mut self, _tick: &Tick, _wrench: &Wrench) -> Cycle {
        Cycle::Fresh
    }

    fn deactivate(self) -> ForceSensor {
        self.opened
    }
}

export_device!(ForceSensor);
