//! Implementation of the device contract for the sensor: a device without axes, whose state contains a measured force.

use crate::line::{LineLost, PollResult, SensorLine};
use crate::protocol::PLAUSIBLE_N;
use flotor_hal::{
    Capabilities, Cycle, DVec3, DeviceInfo, DeviceState, Fault, NothingToStop, Opened, Parameter, Refusal,
    Settings, Simple, SimpleDevice, Tick, Wrench, export_device,
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
        "Timeout for a reading of the sensor; a slow sensor needs 100 ms for each reading",
    ),
];

/// Poll interval for the first reading.
const LOOK_AGAIN: Duration = Duration::from_millis(1);

/// Force sensor, polled in each tick.
pub struct ForceSensor {
    line: SensorLine,
    timeout: Duration,
    /// Newest reading.
    state: DeviceState,
}

impl ForceSensor {
    /// Waits for the first reading, so that a faulty sensor is reported at open.
    fn prove(&mut self, port: &str) -> Result<(), String> {
        let gone = |LineLost| {
            format!("the force sensor at {port} is disconnected; connect the sensor and try again")
        };
        loop {
            self.line.request().map_err(gone)?;
            match self.line.poll().map_err(gone)? {
                PollResult::Force(_) => return Ok(()),
                PollResult::Malformed => {
                    let answer = self.line.last();
                    return Err(format!(
                        "the force sensor at {port} answers `{answer}` instead of a force like `F 1.234`, at most {PLAUSIBLE_N} N; remove the cause of a reported error, or set `port` to the port of the force sensor"
                    ));
                }
                PollResult::Nothing if self.line.silence() > self.timeout => {
                    return Err(format!(
                        "the force sensor at {port} does not answer within {} ms; check its power and `port`, \
                         and use a sensor that answers `R` at 115200 baud",
                        self.timeout.as_millis()
                    ));
                }
                PollResult::Nothing => std::thread::sleep(LOOK_AGAIN),
            }
        }
    }
}

impl SimpleDevice for ForceSensor {
    const INFO: DeviceInfo = DeviceInfo::new(
        "force-sensor",
        "Force sensor",
        "A force sensor on a serial port: measures a vertical force, exerts none",
    );
    const PARAMETERS: &'static [Parameter] = SCHEMA;
    type Stop = NothingToStop;

    fn open(settings: &Settings<'_>) -> Result<Opened<Self>, Refusal> {
        let port = settings.text("port").ok_or_else(|| {
            Refusal::resource(format!("no `port` for the force sensor; set the port, such as {PORT_EXAMPLE}"))
        })?;
        let timeout = Duration::from_secs_f64(settings.number_or_default("timeout_ms") * 1.0e-3);
        let line = SensorLine::open(port).map_err(Refusal::resource)?;
        let mut device = Self { line, timeout, state: DeviceState::HOME };
        device.prove(port).map_err(Refusal::resource)?;
        // A request and its reply over USB, a frame each.
        let capabilities = Capabilities::UNDRIVEN.with_latency(2.0e-3);
        Ok(Opened { device, capabilities, stop: NothingToStop })
    }

    /// Reads the vertical force on the sensor, N: fresh with each new reading, a fault for a malformed line or after
    /// the timeout.
    fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle {
        let polled = self.line.poll().and_then(|polled| self.line.request().map(|()| polled));
        let cycle = match polled {
            Err(LineLost) => Cycle::Fault(Fault::Disconnected),
            Ok(PollResult::Malformed) => Cycle::Fault(Fault::Protocol),
            Ok(PollResult::Nothing) if self.line.silence() > self.timeout => Cycle::Fault(Fault::Timeout),
            Ok(PollResult::Nothing) => Cycle::Stale,
            Ok(PollResult::Force(force_n)) => {
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
}

export_device!(Simple<ForceSensor>);
