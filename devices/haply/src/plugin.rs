//! Implementation of the device contract for the pantograph: poses from angles, torques from wrenches, on one plane.

use crate::board::{Board, LinkLost, NoAnswer};
use crate::pantograph::{Pantograph, Posture};
use crate::protocol::{Arm, Direction, torques};
use flotor_hal::glam::DVec2;
use flotor_hal::{
    ActiveDevice, Axes, Capabilities, Choices, Conditions, Cycle, DQuat, DVec3, Device, DeviceInfo,
    DeviceState, Fault, IndependentStop, IndependentStopDevice, LoopConfig, Parameter, Pose, Refusal,
    SafeStop, Settings, StoppedState, Tick, Twist, Wrench, choices, export_device, math,
};
use flotor_serial::{PORT_EXAMPLE, PORT_HELP, Port};
use std::f64::consts::TAU;
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Timeout of the first reply: a board that resets when its port opens is back within a second or two.
const PATIENCE: Duration = Duration::from_secs(3);
/// Time from a request to the torque, ns: the slowest board (4 ms at 57 600 baud), and a frame of USB.
const STOP_NS: u64 = 5_000_000;
/// Lengths of the arms of both hardware versions, m (hAPI, `Pantograph`).
const INNER_M: f64 = 0.07;
const OUTER_M: f64 = 0.09;
/// Distance between the motors of the second and the third hardware version, m (hAPI, `Pantograph`).
const BASE_M: [f64; 2] = [0.0, 0.038];
/// Distance of the host's centre from the line of the motors, towards the user, m: the whole of [`RANGE_M`] is within reach
/// on either version without stretched arms.
const CENTRE_M: f64 = 0.1;
/// Half the range along x and y, m; no motion along z.
const RANGE_M: [f64; 3] = [0.05, 0.04, 0.0];
/// Stiffness of the wall in the maker's first example, N/m.
const MAX_STIFFNESS_N_PER_M: f64 = 450.0;

const VERSIONS: Choices = choices!["v2", "v3"];

const SCHEMA: &[Parameter] = &[
    Parameter::text("port", PORT_HELP),
    Parameter::choice("hardware", VERSIONS, 1, "Version of the device: v2 (metal) or v3 (plastic, 3.1)"),
    Parameter::real("max_force_n", "N", 0.0, 10.0, 3.0, "Largest force on the hand"),
    Parameter::real(
        "velocity_cutoff_hz",
        "Hz",
        1.0,
        500.0,
        30.0,
        "Cutoff frequency of the low-pass filter of the velocity, which is the difference of positions",
    ),
    Parameter::real("timeout_ms", "ms", 5.0, 10_000.0, 200.0, "Timeout for messages of the board"),
];

/// Hardware version, as described by the maker's examples.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Hardware {
    linkage: Pantograph,
    /// Configuration sent to the board; the handle must rest at the examples' start position while the board starts.
    arms: [Arm; 2],
}

/// Hardware by version, in the order of [`VERSIONS`] (hAPI, examples: `add_actuator`, `add_encoder`).
const HARDWARE: [Hardware; 2] = {
    use Direction::{Clockwise, Counterclockwise};
    const fn arm(direction: Direction, start_deg: f32, counts_per_turn: f32) -> Arm {
        Arm { motor: direction, encoder: direction, start_deg, counts_per_turn }
    }
    const fn linkage(base_m: f64) -> Pantograph {
        Pantograph { inner_m: INNER_M, outer_m: OUTER_M, base_m }
    }
    [
        Hardware {
            linkage: linkage(BASE_M[0]),
            arms: [arm(Counterclockwise, 241.0, 10752.0), arm(Clockwise, -61.0, 10752.0)],
        },
        Hardware {
            linkage: linkage(BASE_M[1]),
            arms: [arm(Counterclockwise, 168.0, 4880.0), arm(Counterclockwise, 12.0, 4880.0)],
        },
    ]
};

impl Hardware {
    /// Transforms a position, m, from the board's frame (x to the left, y towards the user) to the host's.
    fn to_host_m(self, handle_m: DVec2) -> DVec2 {
        DVec2::new(0.5 * self.linkage.base_m, CENTRE_M) - handle_m
    }
}

/// Opened pantograph: its port is open, its motors are not driven.
pub struct HaplyDevice {
    board: Board,
    hardware: Hardware,
    max_force_n: f64,
    cutoff_hz: f64,
    timeout: Duration,
    parameters: [f64; SCHEMA.len()],
    /// Descriptor of the port of `stop`.
    descriptor: i32,
    stop: Arc<Stop>,
}

/// Active pantograph whose motors follow the host.
pub struct DrivenDevice {
    opened: HaplyDevice,
    posture: Posture,
    /// True for a posture that was not read yet.
    is_fresh: bool,
    state: DeviceState,
    /// Time of the last sample, ns.
    sampled_ns: Option<u64>,
    force_n: DVec2,
}

/// State shared by the loop and the threads that stop it.
struct Stop {
    is_stopped: AtomicBool,
    /// Second handle of the port: the board holds the last torque indefinitely, so that zero must be sent even if the loop has
    /// stopped.
    port: Mutex<Port>,
}

impl Stop {
    /// Sends zero torque, also while a request is pending. Never waits: the holder of the lock is sending zero as well.
    fn let_go(&self) {
        if let Ok(mut port) = self.port.try_lock() {
            let _ = port.write_all(&torques([0.0; 2]));
        }
    }
}

/// Stop of the torques, usable from any thread.
pub struct TorqueSwitch(Arc<Stop>);

impl SafeStop for TorqueSwitch {
    fn safe_stop(&self) {
        self.0.is_stopped.store(true, Ordering::Release);
        self.0.let_go();
    }
}

impl Device for HaplyDevice {
    const INFO: DeviceInfo = DeviceInfo::new(
        "haply",
        "Haply 2DIY",
        "A planar pantograph with two motors, over its maker's open serial protocol",
    );
    const PARAMETERS: &'static [Parameter] = SCHEMA;
    type Active = DrivenDevice;
    type Stop = TorqueSwitch;

    fn open(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let path = settings.text("port").ok_or_else(|| {
            Refusal::resource(format!(
                "no `port` for the board; set the port, as in {PORT_EXAMPLE}; without hardware start the emulator \
                 with `cargo run -p flotor-haply --example emulated_board`, which prints its port"
            ))
        })?;
        let board = Board::open(path).map_err(Refusal::resource)?;
        let port = board.second_port().map_err(Refusal::resource)?;
        let mut parameters = [0.0; SCHEMA.len()];
        for (value, parameter) in parameters.iter_mut().zip(SCHEMA) {
            *value = settings.number_or_default(parameter.id());
        }
        let version = settings.choice_or_default("hardware");
        Ok(Self {
            board,
            hardware: HARDWARE.get(version).copied().unwrap_or(HARDWARE[1]),
            max_force_n: settings.number_or_default("max_force_n"),
            cutoff_hz: settings.number_or_default("velocity_cutoff_hz"),
            timeout: Duration::from_secs_f64(settings.number_or_default("timeout_ms") * 1.0e-3),
            parameters,
            descriptor: port.descriptor(),
            stop: Arc::new(Stop { is_stopped: AtomicBool::new(false), port: Mutex::new(port) }),
        })
    }

    fn capabilities(&self) -> Capabilities {
        let counts_per_turn = f64::from(self.hardware.arms[0].counts_per_turn);
        let max_force_n = self.max_force_n;
        Capabilities {
            sensed: Axes::PLANE,
            actuated: Axes::PLANE,
            range_m: RANGE_M,
            range_rad: [0.0; 3],
            // An encoder count at the end of a stretched arm.
            resolution_m: TAU / counts_per_turn * (INNER_M + OUTER_M),
            max_force_n: [max_force_n, max_force_n, 0.0],
            max_torque_nm: [0.0; 3],
            // Slew: from zero to the default limit in a millisecond, as the motors are driven directly.
            max_force_slew_n_per_s: 3000.0,
            max_torque_slew_nm_per_s: f64::INFINITY, // of nothing
            max_stiffness_n_per_m: MAX_STIFFNESS_N_PER_M,
            rate_hz: [100.0, 1000.0],
            // A request and its reply over USB, a frame each.
            latency_s: 2.0e-3,
        }
    }

    fn stopper(&self) -> TorqueSwitch {
        TorqueSwitch(Arc::clone(&self.stop))
    }

    fn activate(mut self, _config: &LoopConfig) -> Result<DrivenDevice, (Self, Refusal)> {
        match self.start() {
            Ok(posture) => {
                self.stop.is_stopped.store(false, Ordering::Release);
                Ok(DrivenDevice {
                    opened: self,
                    posture,
                    is_fresh: true,
                    state: DeviceState::HOME,
                    sampled_ns: None,
                    force_n: DVec2::ZERO,
                })
            }
            Err(refusal) => Err((self, refusal)),
        }
    }

    fn parameter(&self, index: usize) -> f64 {
        self.parameters.get(index).copied().unwrap_or(f64::NAN)
    }
}

impl HaplyDevice {
    fn start(&mut self) -> Result<Posture, Refusal> {
        let angles_deg = self.board.start(&self.hardware.arms, PATIENCE).map_err(|no_answer| {
            Refusal::resource(match no_answer {
                NoAnswer::Lost => "the port of the board was closed; check that the board is plugged in",
                NoAnswer::Silent => {
                    "no board of this device replies at this port; check that the board is switched on"
                }
            })
        })?;
        self.posture(angles_deg).ok_or_else(|| {
            Refusal::resource(format!(
                "the arms cannot have the angles {:.1}° and {:.1}°: put the handle into its rest position, switch \
                 the board off and on, and start again",
                angles_deg[0], angles_deg[1]
            ))
        })
    }

    fn posture(&self, angles_deg: [f64; 2]) -> Option<Posture> {
        self.hardware.linkage.posture(angles_deg.map(f64::to_radians))
    }
}

impl ActiveDevice for DrivenDevice {
    type Opened = HaplyDevice;

    fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle {
        let polled = match self.opened.board.poll() {
            Ok(polled) => polled,
            Err(LinkLost) => return Cycle::Fault(Fault::Disconnected),
        };
        // Angles outside the linkage's geometry are malformed data: the next reply will be right.
        if let Some(posture) = polled.and_then(|angles_deg| self.opened.posture(angles_deg)) {
            (self.posture, self.is_fresh) = (posture, true);
        }
        let cycle = if std::mem::take(&mut self.is_fresh) {
            self.sample(tick.time_ns);
            Cycle::Fresh
        } else if self.opened.board.silence() > self.opened.timeout {
            Cycle::Fault(Fault::Timeout)
        } else {
            Cycle::Stale
        };
        *state = self.state;
        cycle
    }

    fn write(&mut self, _tick: &Tick, wrench: &Wrench) -> Cycle {
        let asked_n = DVec2::new(wrench.force_n[0], wrench.force_n[1]);
        let is_stopped = self.opened.stop.is_stopped.load(Ordering::Acquire);
        self.force_n = match asked_n.is_finite() && !is_stopped {
            true => asked_n.clamp_length_max(self.opened.max_force_n),
            false => DVec2::ZERO,
        };
        // The board's x and y are the host's, rotated by half a turn.
        let torques_nm = self.posture.torques_nm(-self.force_n);
        match self.opened.board.request(torques_nm) {
            Ok(()) => Cycle::Fresh,
            Err(LinkLost) => Cycle::Fault(Fault::Disconnected),
        }
    }

    fn deactivate(self) -> HaplyDevice {
        self.opened.stop.let_go();
        self.opened
    }
}

impl DrivenDevice {
    /// Updates the sample from the posture.
    fn sample(&mut self, time_ns: u64) {
        let position_m = self.opened.hardware.to_host_m(self.posture.handle_m()).extend(0.0);
        let before_m = self.state.pose.position();
        let velocity = match self.sampled_ns {
            Some(before_ns) if time_ns > before_ns => {
                let dt_s = (time_ns - before_ns) as f64 * 1.0e-9;
                // First-order low pass, exact for a difference that is constant over the interval.
                let share = 1.0 - math::exp(-TAU * self.opened.cutoff_hz * dt_s);
                self.state.twist.linear().lerp((position_m - before_m) / dt_s, share)
            }
            _ => DVec3::ZERO,
        };
        self.sampled_ns = Some(time_ns);
        self.state = DeviceState {
            pose: Pose::new(position_m, DQuat::IDENTITY),
            twist: Twist::new(velocity, DVec3::ZERO),
            // The commanded force: the board measures none.
            delivered: Wrench::from_force(self.force_n.extend(0.0)),
            sampled_ns: time_ns,
            buttons: 0,
            conditions: Conditions::NONE,
        };
    }
}

impl Drop for HaplyDevice {
    fn drop(&mut self) {
        self.stop.let_go();
    }
}

impl IndependentStopDevice for HaplyDevice {
    /// Declares a message of zero torque, as the board holds the last torque indefinitely. A partial request before the message
    /// resynchronises with the bytes that follow.
    fn independent_stop(&self) -> IndependentStop {
        IndependentStop::by_message(self.descriptor, &torques([0.0; 2]), StoppedState::Zero, STOP_NS)
    }
}

export_device!(HaplyDevice, independent_stop);
