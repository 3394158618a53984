//! Entry points of force: switch, commands, limits, and status.

use crate::basic::{put3, put6, read, read_live};
use crate::device::{Device, FRAME, Open, Switch, live, open};
use crate::error::{Code, DONE, SATURATED, failed, result};
use crate::gripper::Gripper;
use flotor_compat::export;
use flotor_compat::pointer::Out;
use flotor_hal::DVec3;
use std::ffi::{c_int, c_uchar, c_uint};

/// Number of elements of a status.
const STATUS: usize = 17;

/// Sends force, N, torque, N·m, and force of the gripper, N; with `waits`, waits for the next tick.
fn command(id: i8, wrench: [DVec3; 2], gripper_n: f64, waits: bool) -> c_int {
    result(live(id).and_then(|open| {
        let sent = open.send(&mut open.device(), wrench, gripper_n);
        // A rejected command waits too: a program that retries must not loop faster for it.
        if waits {
            open.host.wait(open.station);
        }
        sent.map(|is_scaled| if is_scaled { SATURATED } else { DONE })
    }))
}

/// Returns the applied force and torque, after all limits: N and N·m.
fn applied(open: &Open) -> [DVec3; 2] {
    let applied = open.station.state().applied;
    [applied.force(), applied.torque()].map(|part| FRAME.of_flotor(part))
}

/// Changes the stored settings of an open device.
pub(crate) fn keep(id: i8, change: impl FnOnce(&mut Device)) -> c_int {
    read(id, |open| change(&mut open.device()))
}

fn set_most(id: i8, axis: usize, most: f64) -> c_int {
    if most.is_nan() {
        return failed(Code::Invalid);
    }
    keep(id, |device| {
        device.most.get_mut(axis).into_iter().for_each(|place| *place = if most < 0.0 { -1.0 } else { most });
    })
}

fn most(id: i8, axis: usize) -> f64 {
    match open(id) {
        Ok(open) => open.device().most.get(axis).copied().unwrap_or(-1.0),
        Err(code) => f64::from(failed(code)),
    }
}

export! {
    /// Sets the force, N, and zero torque; waits for the next tick.
    fn dhdSetForce(x: f64, y: f64, z: f64, id: i8) -> c_int [-1] { command(id, [DVec3::new(x, y, z), DVec3::ZERO], 0.0, true) }
    /// Sets force, N, and torque, N·m; waits for the next tick.
    fn dhdSetForceAndTorque(x: f64, y: f64, z: f64, tx: f64, ty: f64, tz: f64, id: i8) -> c_int [-1] {
        command(id, [DVec3::new(x, y, z), DVec3::new(tx, ty, tz)], 0.0, true)
    }
    /// Sets force and force of the gripper, N, and zero torque; waits for the next tick.
    fn dhdSetForceAndGripperForce(x: f64, y: f64, z: f64, gripper: f64, id: i8) -> c_int [-1] {
        command(id, [DVec3::new(x, y, z), DVec3::ZERO], gripper, true)
    }
    /// Sets force, N, torque, N·m, and force of the gripper, N; waits for the next tick.
    fn dhdSetForceAndTorqueAndGripperForce(x: f64, y: f64, z: f64, tx: f64, ty: f64, tz: f64, gripper: f64, id: i8) -> c_int [-1] {
        command(id, [DVec3::new(x, y, z), DVec3::new(tx, ty, tz)], gripper, true)
    }
    /// Sets force, N, torque, N·m, and force of the gripper, N, in addition to the regulation; returns at once.
    fn drdSetForceAndTorqueAndGripperForce(x: f64, y: f64, z: f64, tx: f64, ty: f64, tz: f64, gripper: f64, id: i8) -> c_int [-1] {
        command(id, [DVec3::new(x, y, z), DVec3::new(tx, ty, tz)], gripper, false)
    }
    /// Reads the applied force, after all limits, N.
    fn dhdGetForce(x: Out<f64>, y: Out<f64>, z: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| put3([x, y, z], applied(open)[0]))
    }
    /// Reads the applied force, N, and torque, N·m.
    fn dhdGetForceAndTorque(x: Out<f64>, y: Out<f64>, z: Out<f64>, tx: Out<f64>, ty: Out<f64>, tz: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| put6([x, y, z, tx, ty, tz], applied(open)))
    }
    /// Reads the applied force, N, torque, N·m, and force of the gripper, N; 0 without one.
    fn dhdGetForceAndTorqueAndGripperForce(x: Out<f64>, y: Out<f64>, z: Out<f64>, tx: Out<f64>, ty: Out<f64>, tz: Out<f64>, gripper: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| {
            put6([x, y, z, tx, ty, tz], applied(open));
            gripper.put(Gripper::of(open.station).map_or(0.0, |gripper| gripper.applied_n));
        })
    }
    /// Enables or disables force.
    fn dhdEnableForce(on: c_uchar, id: i8) -> c_int [-1] {
        read(id, |open| open.set_switch(&mut open.device(), if on == 0 { Switch::Off } else { Switch::On }))
    }
    /// Does nothing: the force of a gripper is enabled with all force.
    fn dhdEnableGripperForce(_on: c_uchar, id: i8) -> c_int [-1] { read(id, |_| ()) }
    /// Disables force. Returns 0 even without an open device: programs call it until it succeeds.
    fn dhdStop(id: i8) -> c_int [0] {
        if let Ok(open) = open(id) {
            let mut device = open.device();
            open.set_switch(&mut device, Switch::Off);
            device.has_been_stopped = true;
        }
        DONE
    }
    /// Stores the brake setting without effect.
    fn dhdSetBrakes(on: c_int, id: i8) -> c_int [-1] { keep(id, |device| device.brakes = on != 0) }
    /// Stores the setting without effect: the device compensates gravity itself.
    fn dhdSetGravityCompensation(on: c_int, id: i8) -> c_int [-1] { keep(id, |device| device.gravity = on != 0) }
    /// Stores the mass, kg, without effect.
    fn dhdSetEffectorMass(mass_kg: f64, id: i8) -> c_int [-1] { keep(id, |device| device.mass_kg = mass_kg) }
    /// Returns the stored mass, kg.
    fn dhdGetEffectorMass(mass_kg: Out<f64>, id: i8) -> c_int [-1] { read(id, |open| mass_kg.put(open.device().mass_kg)) }
    /// Does nothing: the device has its own value of gravity.
    fn dhdSetStandardGravity(_gravity: f64, id: i8) -> c_int [-1] { read(id, |_| ()) }
    /// Sets the limit of force, N, within the envelope; negative: none.
    fn dhdSetMaxForce(force_n: f64, id: i8) -> c_int [-1] { set_most(id, 0, force_n) }
    /// Sets the limit of torque, N·m, within the envelope; negative: none.
    fn dhdSetMaxTorque(torque_nm: f64, id: i8) -> c_int [-1] { set_most(id, 1, torque_nm) }
    /// Sets the limit of the force of the gripper, N, within the envelope; negative: none.
    fn dhdSetMaxGripperForce(force_n: f64, id: i8) -> c_int [-1] { set_most(id, 2, force_n) }
    /// Returns the limit of force, N; -1: none.
    fn dhdGetMaxForce(id: i8) -> f64 [-1.0] { most(id, 0) }
    /// Returns the limit of torque, N·m; -1: none.
    fn dhdGetMaxTorque(id: i8) -> f64 [-1.0] { most(id, 1) }
    /// Returns the limit of gripper force, N; -1: none.
    fn dhdGetMaxGripperForce(id: i8) -> f64 [-1.0] { most(id, 2) }
    /// Reads the status, 17 numbers.
    fn dhdGetStatus(status: Out<c_int>, id: i8) -> c_int [-1] { read(id, |open| status.put_all(&status_of(open))) }
    /// Returns the rate of force commands, kHz.
    fn dhdGetComFreq(id: i8) -> f64 [0.0] { open(id).map_or(0.0, |open| open.station.command_rate_hz() * 1.0e-3) }
    /// Sets a vibration along z, Hz and N, which is added to the force; ignores the profile.
    fn dhdSetVibration(frequency_hz: f64, amplitude_n: f64, _profile: c_int, id: i8) -> c_int [-1] {
        if !(frequency_hz.is_finite() && amplitude_n.is_finite()) {
            return failed(Code::Invalid);
        }
        keep(id, |device| device.vibration = [frequency_hz, amplitude_n])
    }
    /// Returns an error: a gripper is not a button.
    fn dhdEmulateButton(_on: c_uchar, _id: i8) -> c_int [-1] { failed(Code::NotAvailable) }
    /// Does nothing: the device needs no calibration.
    fn dhdReset(id: i8) -> c_int [-1] { read(id, |_| ()) }
    /// Returns at once: the device is calibrated.
    fn dhdWaitForReset(_timeout_ms: c_int, id: i8) -> c_int [-1] { read(id, |_| ()) }
    /// Does nothing: the device has no outputs.
    fn dhdSetOutput(_outputs: c_uint, id: i8) -> c_int [-1] { read(id, |_| ()) }
}

/// Returns the status: power, connected, started, calibrated, idle, force, brake, torque, wrist, error, gravity, time guard, wrist
/// calibrated, redundancy, cause of disabled force, locks, axes checked.
fn status_of(open: &Open) -> [c_int; STATUS] {
    let device = open.device();
    let is_alive = open.host.is_running();
    let has_lapsed = device.watchdog > 0 && open.station.counts().lapses > device.lapses;
    let has_force = open.station.is_enabled() && is_alive && !has_lapsed;
    let cause = match (is_alive, has_force, has_lapsed) {
        (false, ..) => 5,
        (_, true, _) => 0,
        (_, _, true) => 3,
        _ if device.switch == Switch::Off => 4,
        _ => 0,
    };
    let (wrist, torque) = (open.has_wrist(), open.has_active_wrist() && has_force);
    [
        c_int::from(is_alive),
        c_int::from(is_alive),
        c_int::from(is_alive),
        1,
        c_int::from(!has_force),
        c_int::from(has_force),
        c_int::from(!has_force && device.brakes),
        c_int::from(torque),
        c_int::from(wrist),
        c_int::from(!is_alive),
        c_int::from(device.gravity),
        0,
        c_int::from(wrist),
        0,
        cause,
        0,
        1,
    ]
}
