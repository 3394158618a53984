//! Entry points of regulation and motion: hold the handle, move it along a line, track targets without a planned motion.

use crate::basic::{angles, put6, read, read_live, turning};
use crate::device::{FRAME, Open, Switch, live, open};
use crate::error::{Code, DONE, failed, result};
use crate::gripper::Gripper;
use crate::kept::{POSITION_MOVE, ROTATION_MOVE};
use crate::regulation::{Motion, Progress, Regulation};
use crate::regulator::{follow, sampled, start};
use flotor_compat::export;
use flotor_compat::pointer::{In, Out};
use flotor_hal::{DQuat, DVec3, rotation_vector};
use std::ffi::c_int;
use std::time::Duration;

fn begin(id: i8) -> c_int {
    result(live(id).and_then(|open| start(&open)).map(|()| DONE))
}

/// Converts angles about x, then y, then z, to a rotation vector in Flotor's axes.
fn turned(angles_rad: DVec3) -> DVec3 {
    let DVec3 { x, y, z } = angles_rad;
    let turn = DQuat::from_rotation_x(x) * DQuat::from_rotation_y(y) * DQuat::from_rotation_z(z);
    FRAME.to_flotor(rotation_vector(turn))
}

/// Goal of a motion.
#[derive(Clone, Copy)]
struct Goal {
    position_m: Option<DVec3>,
    angles_rad: Option<DVec3>,
}

impl Goal {
    const NONE: Self = Self { position_m: None, angles_rad: None };
}

/// Kind of motion to a goal.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Way {
    /// Along a line; the call waits until the handle has arrived.
    Blocking,
    /// Along a line.
    Line,
    /// At once, without a plan.
    Follow,
}

fn way(block: bool) -> Way {
    if block { Way::Blocking } else { Way::Line }
}

fn go(id: i8, goal: Goal, way: Way) -> c_int {
    let vectors = [goal.position_m, goal.angles_rad];
    if vectors.into_iter().flatten().any(|vector| !vector.is_finite()) {
        return failed(Code::Invalid);
    }
    let open = match live(id) {
        Ok(open) => open,
        Err(code) => return failed(code),
    };
    {
        let mut device = open.device();
        if !device.regulation.is_running {
            return failed(Code::NoRegulation);
        }
        // A plan that started during the fade-in would end before the handle moves.
        let since_ns = open.host.now_ns().max(device.faded_in_ns);
        let fastest = [POSITION_MOVE, ROTATION_MOVE]
            .map(|index| device.parameters.get(index).map_or(0.1, |[_, speed, _]| *speed));
        let Regulation { position, rotation, .. } = &mut device.regulation;
        let goals =
            [goal.position_m.map(|position_m| FRAME.to_flotor(position_m)), goal.angles_rad.map(turned)];
        for ((motion, to), fastest) in [position, rotation].into_iter().zip(goals).zip(fastest) {
            match (to, way) {
                (None, _) => {}
                (Some(to), Way::Follow) => *motion = Motion::at(to),
                (Some(to), Way::Blocking | Way::Line) => motion.go_to(to, fastest, since_ns),
            }
        }
        open.send_again(&mut device);
    }
    match way {
        Way::Blocking => result(wait_for_arrival(&open, goal)),
        Way::Line | Way::Follow => DONE,
    }
}

/// Waits until the handle has arrived at a goal.
///
/// # Errors
/// [`Code::Timeout`] if the handle does not arrive, [`Code::Com`] if the run ends before.
fn wait_for_arrival(open: &Open, goal: Goal) -> Result<c_int, Code> {
    let is_awaited = [goal.position_m.is_some(), goal.angles_rad.is_some()];
    loop {
        let awaited = progress(open).into_iter().zip(is_awaited).filter(|(_, is_awaited)| *is_awaited);
        match awaited.map(|(progress, _)| progress).max() {
            None | Some(Progress::Arrived) => return Ok(DONE),
            Some(Progress::TimedOut) => return Err(Code::Timeout),
            Some(Progress::Moving) if !open.host.is_running() => return Err(Code::Com),
            Some(Progress::Moving) => {}
        }
        follow(open);
        open.host.sleep(Duration::from_nanos(open.host.period_ns()));
    }
}

/// Returns the progress of the position and of the rotation of a device.
fn progress(open: &Open) -> [Progress; 2] {
    let (state, now_ns) = (open.station.state(), open.host.now_ns());
    open.device().regulation.update(&state, open.station.axes(), now_ns)
}

fn regulate(id: i8, axis: usize, on: bool) -> c_int {
    read(id, |open| {
        let state = open.station.state();
        let mut device = open.device();
        device.regulation.axes.get_mut(axis).into_iter().for_each(|kept| *kept = on);
        // Regulated axes hold their current position.
        device.regulation.hold(&state);
    })
}

fn eight(place: In<f64>) -> Option<Goal> {
    let [x, y, z, a, b, g, _, _] = place.get_all()?;
    Some(Goal { position_m: Some(DVec3::new(x, y, z)), angles_rad: Some(DVec3::new(a, b, g)) })
}

fn position(x: f64, y: f64, z: f64) -> Goal {
    Goal { position_m: Some(DVec3::new(x, y, z)), ..Goal::NONE }
}

fn rotation(a: f64, b: f64, g: f64) -> Goal {
    Goal { angles_rad: Some(DVec3::new(a, b, g)), ..Goal::NONE }
}

export! {
    /// Returns true for an open device: no program then moves the device to initialise it.
    fn drdIsInitialized(id: i8) -> bool [false] { open(id).is_ok() }
    /// Returns true for an open device: every device can be regulated.
    fn drdIsSupported(id: i8) -> bool [false] { open(id).is_ok() }
    /// Returns true if the device is regulated.
    fn drdIsRunning(id: i8) -> bool [false] { open(id).is_ok_and(|open| open.device().regulation.is_running) }
    /// Returns true if a motion is in progress: until the handle has arrived, at most until 2 s after the planned end.
    fn drdIsMoving(id: i8) -> bool [false] {
        sampled(id).is_ok_and(|open| progress(&open).contains(&Progress::Moving))
    }
    /// Starts the regulation as [`drdStart`]: the device needs no initialisation.
    fn drdAutoInit(id: i8) -> c_int [-1] { begin(id) }
    /// Starts the regulation as [`drdStart`]: the device needs no initialisation.
    fn drdCheckInit(id: i8) -> c_int [-1] { begin(id) }
    /// Starts the regulation as [`drdStart`]: the device needs no initialisation.
    fn drdPrecisionInit(id: i8) -> c_int [-1] { begin(id) }
    /// Enables force and starts the regulation, which holds the handle at its current pose.
    fn drdStart(id: i8) -> c_int [-1] { begin(id) }
    /// Ends the regulation and clears the program's command; disables force unless `keeps_force`.
    fn drdStop(keeps_force: bool, id: i8) -> c_int [-1] {
        read(id, |open| {
            let mut device = open.device();
            device.regulation = Regulation::OFF;
            (device.force_n, device.torque_nm, device.gripper_n) = (DVec3::ZERO, DVec3::ZERO, 0.0);
            if keeps_force {
                open.send_again(&mut device);
            } else {
                open.set_switch(&mut device, Switch::Off);
            }
        })
    }
    /// Holds the handle at its current pose; an error if the device is not regulated.
    fn drdHold(id: i8) -> c_int [-1] {
        result(live(id).and_then(|open| {
            let state = open.station.state();
            let mut device = open.device();
            if !device.regulation.is_running {
                return Err(Code::NoRegulation);
            }
            device.regulation.hold(&state);
            Ok(DONE)
        }))
    }
    /// Enables or disables the regulation of the position; holds the handle at its current pose.
    fn drdRegulatePos(on: bool, id: i8) -> c_int [-1] { regulate(id, 0, on) }
    /// Enables or disables the regulation of the orientation; holds the handle at its current pose.
    fn drdRegulateRot(on: bool, id: i8) -> c_int [-1] { regulate(id, 1, on) }
    /// Stores the switch for a gripper without effect.
    fn drdRegulateGrip(on: bool, id: i8) -> c_int [-1] { regulate(id, 2, on) }
    /// Moves the handle to a position, m; with `block`, waits for the arrival.
    fn drdMoveToPos(x: f64, y: f64, z: f64, block: bool, id: i8) -> c_int [-1] { go(id, position(x, y, z), way(block)) }
    /// Turns the handle to angles, rad; with `block`, waits for the arrival.
    fn drdMoveToRot(a: f64, b: f64, g: f64, block: bool, id: i8) -> c_int [-1] { go(id, rotation(a, b, g), way(block)) }
    /// Checks the regulation and moves nothing: a gripper is not regulated.
    fn drdMoveToGrip(_gap: f64, _block: bool, id: i8) -> c_int [-1] { go(id, Goal::NONE, Way::Follow) }
    /// Moves the handle to a position, m, and turns it to angles, rad; with `block`, waits for the arrival.
    fn drdMoveTo(place: In<f64>, block: bool, id: i8) -> c_int [-1] {
        eight(place).map_or_else(|| failed(Code::NullArgument), |goal| go(id, goal, way(block)))
    }
    /// Sets the target position, m, without a planned motion.
    fn drdTrackPos(x: f64, y: f64, z: f64, id: i8) -> c_int [-1] { go(id, position(x, y, z), Way::Follow) }
    /// Sets the target angles, rad, without a planned motion.
    fn drdTrackRot(a: f64, b: f64, g: f64, id: i8) -> c_int [-1] { go(id, rotation(a, b, g), Way::Follow) }
    /// Checks the regulation and moves nothing: a gripper is not regulated.
    fn drdTrackGrip(_gap: f64, id: i8) -> c_int [-1] { go(id, Goal::NONE, Way::Follow) }
    /// Reads position, m, angles, rad, gap of the gripper, m (0 without one), and rotation matrix, row-major.
    fn drdGetPositionAndOrientation(x: Out<f64>, y: Out<f64>, z: Out<f64>, a: Out<f64>, b: Out<f64>, g: Out<f64>, gap: Out<f64>, matrix: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| {
            let (position_m, rows) = open.pose();
            put6([x, y, z, a, b, g], [position_m, angles(&rows)]);
            gap.put(Gripper::of(open.station).map_or(0.0, |gripper| gripper.gap_m));
            matrix.put_all(rows.as_flattened());
        })
    }
    /// Reads velocity, m/s, angular velocity, rad/s, and velocity of the gap, m/s (0 without a gripper).
    fn drdGetVelocity(x: Out<f64>, y: Out<f64>, z: Out<f64>, a: Out<f64>, b: Out<f64>, g: Out<f64>, gap: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| {
            let velocity_m_per_s = FRAME.of_flotor(open.station.state().velocity_m_per_s);
            put6([x, y, z, a, b, g], [velocity_m_per_s, turning(open)]);
            gap.put(Gripper::of(open.station).map_or(0.0, |gripper| gripper.velocity_m_per_s));
        })
    }
    /// Returns the rate of the loop, kHz.
    fn drdGetCtrlFreq(id: i8) -> f64 [0.0] {
        open(id).map_or(0.0, |open| 1.0e6 / open.host.period_ns().max(1) as f64)
    }
    /// Waits for the next tick.
    fn drdWaitForTick(id: i8) -> () [()] {
        match live(id) {
            Ok(open) => {
                follow(&open);
                open.host.wait(open.station);
            }
            // Throttles a loop without a device.
            Err(_) => std::thread::sleep(Duration::from_millis(1)),
        }
    }
}
