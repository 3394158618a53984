//! Implementation of the device contract for the pantograph: poses from angles, torques from wrenches, on one plane.

use crate::board::{Board, LinkLost, NoAnswer};
use crate::pantograph::{Pantograph, Posture};
use crate::protocol::{Arm, Direction, torques};
use flotor_hal::glam::DVec2;
use flotor_hal::{
    Axes, Capabilities, Choices, Conditions, Cycle, DQuat, DVec3, DeviceInfo, DeviceState, Fault,
    IndependentStop, IndependentStopDevice, LoopConfig, Opened, Parameter, Pose, Refusal, SafeStop, Settings,
    Simple, SimpleDevice, StoppedState, Tick, Twist, VelocityFilter, Wrench, choices, export_device,
};
use flotor_serial::{PORT_EXAMPLE, PORT_HELP, Port};
use std::f64::consts::TAU;
use std::io::Write;
use std::sync::Mutex;
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
    Parameter::choice("hardware", VERSIONS, 1, "Version of the device: v2 (metal) or v3 (plastic, also 3.1)"),
    Parameter::real("max_force_n", "N", 0.0, 10.0, 3.0, "Largest force on the hand"),
    Parameter::real(
        "velocity_cutoff_hz",
        "Hz",
        1.0,
        500.0,
        30.0,
        "Cutoff frequency of the low-pass filter of the velocity, which is estimated by finite differences \
         of the position",
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

/// Pantograph with its board; while the device is active, its motors exert the commanded force.
pub struct HaplyDevice {
    board: Board,
    hardware: Hardware,
    max_force_n: f64,
    cutoff_hz: f64,
    timeout: Duration,
    /// Descriptor of the port of the stop.
    descriptor: i32,
    /// Posture at the newest angles; `None` before the first activation.
    posture: Option<Posture>,
    /// True for a posture that was not read yet.
    is_fresh: bool,
    state: DeviceState,
    velocity: VelocityFilter,
    force_n: DVec2,
}

/// Stop handle: sends zero torque through a duplicate of the port, from any thread: the board holds the last torque
/// indefinitely, so that zero must be sent even if the loop has stopped.
pub struct TorqueStop(Mutex<Port>);

impl SafeStop for TorqueStop {
    /// Sends zero torque, also while a request is pending. Does not wait for the lock: its holder is sending zero
    /// torque as well.
    fn safe_stop(&self) {
        if let Ok(mut port) = self.0.try_lock() {
            let _ = port.write_all(&torques([0.0; 2]));
        }
    }
}

impl Drop for TorqueStop {
    /// Sends zero torque also for a board that was never activated: it may hold a torque of an earlier program.
    fn drop(&mut self) {
        self.safe_stop();
    }
}

impl SimpleDevice for HaplyDevice {
    const INFO: DeviceInfo = DeviceInfo::new(
        "haply",
        "Haply 2DIY",
        "A planar pantograph with two motors, over its maker's open serial protocol",
    );
    const PARAMETERS: &'static [Parameter] = SCHEMA;
    type Stop = TorqueStop;

    fn open(settings: &Settings<'_>) -> Result<Opened<Self>, Refusal> {
        let path = settings.text("port").ok_or_else(|| {
            Refusal::resource(format!(
                "no `port` for the board; set the port, such as {PORT_EXAMPLE}; without hardware start the emulator \
                 with `cargo run -p flotor-haply --example emulated_board` (on Linux), which prints its port"
            ))
        })?;
        let board = Board::open(path).map_err(Refusal::resource)?;
        let port = board.second_port().map_err(Refusal::resource)?;
        let hardware = settings.one_of("hardware", HARDWARE);
        let max_force_n = settings.number_or_default("max_force_n");
        let cutoff_hz = settings.number_or_default("velocity_cutoff_hz");
        let device = Self {
            board,
            hardware,
            max_force_n,
            cutoff_hz,
            timeout: Duration::from_secs_f64(settings.number_or_default("timeout_ms") * 1.0e-3),
            descriptor: port.descriptor(),
            posture: None,
            is_fresh: false,
            state: DeviceState::HOME,
            velocity: VelocityFilter::new(cutoff_hz),
            force_n: DVec2::ZERO,
        };
        let counts_per_turn = f64::from(hardware.arms[0].counts_per_turn);
        let capabilities = Capabilities {
            range_m: RANGE_M,
            // An encoder count at the end of a stretched arm.
            resolution_m: TAU / counts_per_turn * (INNER_M + OUTER_M),
            // Slew: from zero to the default limit in a millisecond, as the motors are driven directly.
            max_force_slew_n_per_s: 3000.0,
            max_torque_slew_nm_per_s: f64::INFINITY, // of nothing
            rate_hz: [100.0, 1000.0],
            ..Capabilities::driving(Axes::PLANE)
                .with_limits(max_force_n, 0.0)
                .with_stiffness(MAX_STIFFNESS_N_PER_M)
                // A request and its reply over USB, a frame each.
                .with_latency(2.0e-3)
        };
        Ok(Opened { device, capabilities, stop: TorqueStop(Mutex::new(port)) })
    }

    fn activate(&mut self, _config: &LoopConfig) -> Result<(), Refusal> {
        (self.posture, self.is_fresh) = (Some(self.start()?), true);
        (self.state, self.force_n) = (DeviceState::HOME, DVec2::ZERO);
        self.velocity = VelocityFilter::new(self.cutoff_hz);
        Ok(())
    }

    fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle {
        let Ok(polled) = self.board.poll() else { return Cycle::Fault(Fault::Disconnected) };
        // Angles outside the linkage's geometry are malformed data: the last posture stays, and the cycle is stale until a valid
        // reply.
        if let Some(posture) = polled.and_then(|angles_deg| self.posture(angles_deg)) {
            (self.posture, self.is_fresh) = (Some(posture), true);
        }
        let cycle = match self.posture {
            Some(posture) if std::mem::take(&mut self.is_fresh) => {
                self.sample(&posture, tick.time_ns);
                Cycle::Fresh
            }
            _ if self.board.silence() > self.timeout => Cycle::Fault(Fault::Timeout),
            _ => Cycle::Stale,
        };
        *state = self.state;
        cycle
    }

    fn write(&mut self, _tick: &Tick, wrench: &Wrench) -> Cycle {
        let asked_n = DVec2::new(wrench.force_n[0], wrench.force_n[1]);
        self.force_n = match asked_n.is_finite() {
            true => asked_n.clamp_length_max(self.max_force_n),
            false => DVec2::ZERO,
        };
        // The board's x and y are the host's, rotated by half a turn.
        let torques_nm = self.posture.map_or([0.0; 2], |posture| posture.torques_nm(-self.force_n));
        match self.board.request(torques_nm) {
            Ok(()) => Cycle::Fresh,
            Err(LinkLost) => Cycle::Fault(Fault::Disconnected),
        }
    }
}

impl HaplyDevice {
    fn start(&mut self) -> Result<Posture, Refusal> {
        let angles_deg = self.board.start(&self.hardware.arms, PATIENCE).map_err(|no_answer| {
            Refusal::resource(match no_answer {
                NoAnswer::Lost => "the port of the board was closed; check that the board is plugged in",
                NoAnswer::Silent => {
                    "no Haply board replies at `port`; check that the board is switched on, and that `port` is \
                     the port of the board"
                }
            })
        })?;
        self.posture(angles_deg).ok_or_else(|| {
            Refusal::resource(format!(
                "the reported angles {:.1}° and {:.1}° match no position of the arms: put the handle into \
                 its rest position, switch the board off and on, and start again",
                angles_deg[0], angles_deg[1]
            ))
        })
    }

    fn posture(&self, angles_deg: [f64; 2]) -> Option<Posture> {
        self.hardware.linkage.posture(angles_deg.map(f64::to_radians))
    }

    /// Updates the sample from the posture.
    fn sample(&mut self, posture: &Posture, time_ns: u64) {
        let position_m = self.hardware.to_host_m(posture.handle_m()).extend(0.0);
        let velocity = self.velocity.update(position_m - self.state.pose.position(), time_ns);
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

impl IndependentStopDevice for HaplyDevice {
    /// Declares a message of zero torque, as the board holds the last torque indefinitely. A partial request before the message
    /// resynchronises with the bytes that follow.
    fn independent_stop(&self) -> IndependentStop {
        IndependentStop::by_message(self.descriptor, &torques([0.0; 2]), StoppedState::Zero, STOP_NS)
    }
}

export_device!(Simple<HaplyDevice>, independent_stop);
