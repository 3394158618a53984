//! Knob on a serial port that moves up and down and exerts a force. Its board sets the pace of the loop.

#[cfg(test)]
mod board;
mod frame;
mod reader;

use flotor_hal::extension::independent_stop::{IndependentStop, StoppedState};
use flotor_hal::{
    ActiveDevice, Axes, Capabilities, Cycle, DQuat, DVec3, Device, DeviceInfo, DeviceState, Fault,
    IndependentStopDevice, LoopConfig, PacingDevice, Parameter, Pose, Refusal, SafeStop, SampleWait,
    Settings, Tick, Twist, Wrench,
};
use reader::{Newest, Reader};
use serialport::TTYPort;
use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

const BAUD: u32 = 1_000_000;
/// Timeout of a read or a write, after which the reader checks for its end.
const TIMEOUT: Duration = Duration::from_millis(20);
/// Watchdog timeout of the board, ns: without frames the board removes its force.
const BOARD_WATCHDOG_NS: u64 = 20_000_000;

/// Open knob, not energised.
struct Knob {
    port: TTYPort,
    is_stopped: Arc<AtomicBool>,
}

impl Device for Knob {
    const INFO: DeviceInfo = DeviceInfo::new("knob", "Knob", "One axis behind a serial cable");
    const PARAMETERS: &'static [Parameter] = &[Parameter::text("port", "Path of the serial port")];
    type Active = ActiveKnob;
    type Stop = Stop;

    fn open(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let path = settings.text("port").unwrap_or("/dev/ttyACM0");
        let port = TTYPort::open(&serialport::new(path, BAUD).timeout(TIMEOUT)).map_err(|error| {
            Refusal::resource(format!(
                "{path}: {error}; check that the board is connected and that this user may use its port"
            ))
        })?;
        Ok(Self::on(port))
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities {
            sensed: Axes::Z,
            actuated: Axes::Z,
            range_m: [0.0, 0.0, 0.012],
            range_rad: [0.0; 3],
            resolution_m: 1.0e-6,
            max_force_n: [0.0, 0.0, 5.0],
            max_torque_nm: [0.0; 3],
            max_force_slew_n_per_s: 10.0e3,
            max_torque_slew_nm_per_s: f64::INFINITY, // it drives no rotation
            max_stiffness_n_per_m: 2.0e3,
            rate_hz: [500.0, 1000.0],
            latency_s: 0.001,
        }
    }

    fn stopper(&self) -> Stop {
        Stop(Arc::clone(&self.is_stopped))
    }

    fn activate(self, _config: &LoopConfig) -> Result<ActiveKnob, (Self, Refusal)> {
        self.is_stopped.store(false, Ordering::Release);
        match self.port.try_clone_native().map_err(std::io::Error::from).and_then(Reader::start) {
            Ok(reader) => {
                Ok(ActiveKnob { knob: self, reader, seen: 0, reported: 0, z_m: None, force_n: 0.0 })
            }
            Err(error) => Err((self, Refusal::resource(format!("no thread reads the port: {error}")))),
        }
    }
}

impl Knob {
    fn on(port: TTYPort) -> Self {
        Self { port, is_stopped: Arc::default() }
    }
}

/// Independent stop if the host's process is killed: the watchdog of the board.
impl IndependentStopDevice for Knob {
    fn independent_stop(&self) -> IndependentStop {
        IndependentStop::by_itself(StoppedState::Zero, BOARD_WATCHDOG_NS)
    }
}

/// Energised knob.
struct ActiveKnob {
    knob: Knob,
    reader: Reader,
    /// Number of the last sample returned by `read`, and of the last sample reported by a wait.
    seen: u64,
    reported: u64,
    z_m: Option<f64>,
    force_n: f64,
}

impl ActiveDevice for ActiveKnob {
    type Opened = Knob;

    fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle {
        let Newest::Sample { number, position_um } = self.reader.newest() else {
            return Cycle::Fault(Fault::Disconnected);
        };
        if number == self.seen {
            return Cycle::Stale;
        }
        let z_m = f64::from(position_um) * 1.0e-6;
        let speed_m_per_s =
            self.z_m.map_or(0.0, |before_m| (z_m - before_m) / (1.0e-9 * tick.dt_ns.max(1) as f64));
        (self.seen, self.z_m) = (number, Some(z_m));
        state.pose = Pose::new(DVec3::Z * z_m, DQuat::IDENTITY);
        state.twist = Twist::new(DVec3::Z * speed_m_per_s, DVec3::ZERO);
        state.delivered = Wrench::from_force(DVec3::Z * self.force_n);
        state.sampled_ns = tick.time_ns;
        Cycle::Fresh
    }

    fn write(&mut self, _tick: &Tick, wrench: &Wrench) -> Cycle {
        let is_stopped = self.knob.is_stopped.load(Ordering::Acquire);
        let force_mn = if is_stopped { 0.0 } else { (wrench.force_n[2] * 1.0e3).round() };
        self.force_n = force_mn * 1.0e-3;
        match self.knob.port.write_all(&frame::encode(frame::FORCE, force_mn as i16)) {
            Ok(()) => Cycle::Fresh,
            Err(_) => Cycle::Fault(Fault::Disconnected),
        }
    }

    fn deactivate(mut self) -> Knob {
        // If this write fails, the board removes its force by itself.
        let _ = self.knob.port.write_all(&frame::encode(frame::FORCE, 0));
        self.knob
    }
}

impl PacingDevice for ActiveKnob {
    fn wait_for_sample(&mut self, timeout_ns: u64) -> SampleWait {
        match self.reader.wait_beyond(self.reported, Duration::from_nanos(timeout_ns)) {
            Some(number) => {
                let samples = number - self.reported;
                self.reported = number;
                SampleWait::Arrived { samples }
            }
            None => SampleWait::TimedOut,
        }
    }
}

/// Safe stop: every later frame has zero force, and a board without frames removes its force.
struct Stop(Arc<AtomicBool>);

impl SafeStop for Stop {
    fn safe_stop(&self) {
        self.0.store(true, Ordering::Release);
    }
}

flotor_hal::export_device!(Knob, pacing, independent_stop);

#[cfg(test)]
mod tests {
    use super::*;
    use board::Board;

    const PATIENCE_NS: u64 = 10_000_000_000;

    fn tick(index: u64) -> Tick {
        Tick { index, time_ns: index * 1_000_000, dt_ns: 1_000_000 }
    }

    #[test]
    fn the_board_sets_the_pace_takes_the_force_and_hears_of_a_stop() {
        let (board, port) = Board::start(2500);
        let opened = Knob::on(port);
        let stop = opened.stopper();
        let Ok(mut knob) = opened.activate(&LoopConfig { period_ns: 1_000_000, seed: 0 }) else {
            panic!("refused")
        };
        let mut state = DeviceState::HOME;
        assert!(matches!(knob.wait_for_sample(PATIENCE_NS), SampleWait::Arrived { samples: 1.. }));
        assert_eq!(knob.read(&tick(0), &mut state), Cycle::Fresh);
        assert_eq!(state.pose.position(), DVec3::Z * 0.0025);
        assert_eq!(knob.write(&tick(0), &Wrench::from_force(DVec3::Z * 1.25)), Cycle::Fresh);
        board.wait_for_force_mn(1250);
        stop.safe_stop();
        assert_eq!(knob.write(&tick(1), &Wrench::from_force(DVec3::Z * 1.25)), Cycle::Fresh);
        board.wait_for_force_mn(0);
        // Active again after a stop, over the same cable.
        let Ok(mut knob) = knob.deactivate().activate(&LoopConfig { period_ns: 1_000_000, seed: 0 }) else {
            panic!("refused")
        };
        assert_eq!(knob.write(&tick(2), &Wrench::from_force(DVec3::Z * -0.5)), Cycle::Fresh);
        board.wait_for_force_mn(-500);
    }

    #[test]
    fn a_cable_that_is_pulled_is_a_fault() {
        let (board, port) = Board::start(0);
        let Ok(mut knob) = Knob::on(port).activate(&LoopConfig { period_ns: 1_000_000, seed: 0 }) else {
            panic!("refused")
        };
        assert!(matches!(knob.wait_for_sample(PATIENCE_NS), SampleWait::Arrived { .. }));
        drop(board);
        while knob.wait_for_sample(PATIENCE_NS) != SampleWait::TimedOut {}
        assert_eq!(
            knob.read(&tick(0), &mut DeviceState { ..DeviceState::HOME }),
            Cycle::Fault(Fault::Disconnected)
        );
    }
}
