//! Force: switching, commanding, limits, and what the status says of it.

use crate::basic::{put3, read, read_live};
use crate::device::{self, Device, FRAME, Open, Switch, live, open};
use crate::error::{Code, DONE, SATURATED, failed, result};
use crate::regulation;
use flotor_compat::pointer::Out;
use flotor_hal::DVec3;
use std::ffi::{c_int, c_uchar, c_uint};

/// How many numbers a status has.
const STATUS: usize = 17;

/// Sends a command, and waits for the tick that sees it if it is to.
fn command(id: i8, force_n: DVec3, torque_nm: Option<DVec3>, waits: bool) -> c_int {
    let open = match live(id) {
        Ok(open) => open,
        Err(code) => return failed(code),
    };
    let sent = {
        let mut device = open.device();
        open.send(&mut device, force_n, torque_nm.unwrap_or(DVec3::ZERO))
    };
    // One that is refused waits too: a program that goes on asking is not to go round faster for it.
    if waits {
        open.host.wait(open.station);
    }
    result(sent.map(|is_scaled| if is_scaled { SATURATED } else { DONE }))
}

/// In lockstep, what regulation adds to the next tick.
pub(crate) fn follow_all() {
    for id in (0..).take(device::count()) {
        if let Ok(open) = live(id) {
            regulation::follow(&open);
        }
    }
}

/// What is applied, after all limits: N and N·m.
fn applied(open: &Open) -> [DVec3; 2] {
    let applied = open.station.state().applied;
    [applied.force(), applied.torque()].map(|part| FRAME.of_flotor(part))
}

fn switched(id: i8, on: bool) -> c_int {
    result(open(id).map(|open| {
        open.set_switch(&mut open.device(), if on { Switch::On } else { Switch::Off });
        DONE
    }))
}

/// Changes what is kept of an open device.
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

fn vector(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

export! {
    /// Force, N; waits for the next tick.
    fn dhdSetForce(x: f64, y: f64, z: f64, id: i8) -> c_int [-1] { command(id, vector(x, y, z), None, true) }
    /// Force, N, and torque, N·m; waits for the next tick.
    fn dhdSetForceAndTorque(x: f64, y: f64, z: f64, tx: f64, ty: f64, tz: f64, id: i8) -> c_int [-1] {
        command(id, vector(x, y, z), Some(vector(tx, ty, tz)), true)
    }
    /// Force, N; there is no gripper.
    fn dhdSetForceAndGripperForce(x: f64, y: f64, z: f64, _gripper: f64, id: i8) -> c_int [-1] {
        command(id, vector(x, y, z), None, true)
    }
    /// Force, N, and torque, N·m; there is no gripper.
    fn dhdSetForceAndTorqueAndGripperForce(x: f64, y: f64, z: f64, tx: f64, ty: f64, tz: f64, _gripper: f64, id: i8) -> c_int [-1] {
        command(id, vector(x, y, z), Some(vector(tx, ty, tz)), true)
    }
    /// Force, N, and torque, N·m, on top of the regulation; returns at once.
    fn drdSetForceAndTorqueAndGripperForce(x: f64, y: f64, z: f64, tx: f64, ty: f64, tz: f64, _gripper: f64, id: i8) -> c_int [-1] {
        command(id, vector(x, y, z), Some(vector(tx, ty, tz)), false)
    }
    /// Force that is applied, after all limits, N.
    fn dhdGetForce(x: Out<f64>, y: Out<f64>, z: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| put3([x, y, z], applied(open)[0]))
    }
    /// Force, N, and torque, N·m, that are applied.
    fn dhdGetForceAndTorque(x: Out<f64>, y: Out<f64>, z: Out<f64>, tx: Out<f64>, ty: Out<f64>, tz: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| {
            let [force_n, torque_nm] = applied(open);
            put3([x, y, z], force_n);
            put3([tx, ty, tz], torque_nm);
        })
    }
    /// Force, N, and torque, N·m, that are applied, and 0 of a gripper.
    fn dhdGetForceAndTorqueAndGripperForce(x: Out<f64>, y: Out<f64>, z: Out<f64>, tx: Out<f64>, ty: Out<f64>, tz: Out<f64>, gripper: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| {
            let [force_n, torque_nm] = applied(open);
            put3([x, y, z], force_n);
            put3([tx, ty, tz], torque_nm);
            gripper.put(0.0);
        })
    }
    /// Lets force through, or not.
    fn dhdEnableForce(on: c_uchar, id: i8) -> c_int [-1] { switched(id, on != 0) }
    /// There is no gripper.
    fn dhdEnableGripperForce(_on: c_uchar, id: i8) -> c_int [-1] { read(id, |_| ()) }
    /// No force. 0 also where nothing is open: programs call it until it is.
    fn dhdStop(id: i8) -> c_int [0] {
        if let Ok(open) = open(id) {
            let mut device = open.device();
            open.set_switch(&mut device, Switch::Off);
            device.has_been_stopped = true;
        }
        DONE
    }
    /// Damping where there is no force: kept.
    fn dhdSetBrakes(on: c_int, id: i8) -> c_int [-1] { keep(id, |device| device.brakes = on != 0) }
    /// The device\'s own: kept.
    fn dhdSetGravityCompensation(on: c_int, id: i8) -> c_int [-1] { keep(id, |device| device.gravity = on != 0) }
    /// Kept.
    fn dhdSetEffectorMass(mass_kg: f64, id: i8) -> c_int [-1] { keep(id, |device| device.mass_kg = mass_kg) }
    /// What was set, kg.
    fn dhdGetEffectorMass(mass_kg: Out<f64>, id: i8) -> c_int [-1] { read(id, |open| mass_kg.put(open.device().mass_kg)) }
    /// Kept nowhere: the device knows where it stands.
    fn dhdSetStandardGravity(_gravity: f64, id: i8) -> c_int [-1] { read(id, |_| ()) }
    /// Largest force, N, within the envelope; negative: no limit of the program\'s own.
    fn dhdSetMaxForce(force_n: f64, id: i8) -> c_int [-1] { set_most(id, 0, force_n) }
    /// The same of torque, N·m.
    fn dhdSetMaxTorque(torque_nm: f64, id: i8) -> c_int [-1] { set_most(id, 1, torque_nm) }
    /// The same of a gripper, N.
    fn dhdSetMaxGripperForce(force_n: f64, id: i8) -> c_int [-1] { set_most(id, 2, force_n) }
    /// What was set; -1: nothing.
    fn dhdGetMaxForce(id: i8) -> f64 [-1.0] { most(id, 0) }
    /// What was set; -1: nothing.
    fn dhdGetMaxTorque(id: i8) -> f64 [-1.0] { most(id, 1) }
    /// What was set; -1: nothing.
    fn dhdGetMaxGripperForce(id: i8) -> f64 [-1.0] { most(id, 2) }
    /// Status, 17 numbers.
    fn dhdGetStatus(status: Out<c_int>, id: i8) -> c_int [-1] { read(id, |open| status.put_all(&status_of(open))) }
    /// Commands of force, kHz.
    fn dhdGetComFreq(id: i8) -> f64 [0.0] { open(id).map_or(0.0, |open| open.station.command_rate_hz() * 1.0e-3) }
    /// A vibration along z that is added to the force: Hz and N.
    fn dhdSetVibration(frequency_hz: f64, amplitude_n: f64, _profile: c_int, id: i8) -> c_int [-1] {
        if !(frequency_hz.is_finite() && amplitude_n.is_finite()) {
            return failed(Code::Invalid);
        }
        keep(id, |device| device.vibration = [frequency_hz, amplitude_n])
    }
    /// There is no gripper whose closing could be a button.
    fn dhdEmulateButton(_on: c_uchar, _id: i8) -> c_int [-1] { failed(Code::NotAvailable) }
    /// There is nothing to calibrate.
    fn dhdReset(id: i8) -> c_int [-1] { read(id, |_| ()) }
    /// It is calibrated.
    fn dhdWaitForReset(_timeout_ms: c_int, id: i8) -> c_int [-1] { read(id, |_| ()) }
    /// Outputs of the device: there are none.
    fn dhdSetOutput(_outputs: c_uint, id: i8) -> c_int [-1] { read(id, |_| ()) }
}

/// Power, connected, started, calibrated, idle, force, brake, torque, wrist, error, gravity, time guard, wrist calibrated,
/// redundancy, why force is off, locks, axes checked.
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
