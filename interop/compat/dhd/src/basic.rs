//! Opening, identity, pose, velocity, buttons: what is read of a device.

use crate::device::{
    FRAME, Open, any, close, count, default, expert, kind, open, open_first, open_number, sampled,
    set_default,
};
use crate::error::{Code, DONE, failed, result};
use crate::force;
use flotor_compat::pointer::Out;
use flotor_compat::{Pace, Station, host};
use flotor_hal::{DVec3, math};
use std::ffi::{CStr, CString, c_char, c_int, c_uint};
use std::sync::OnceLock;
use std::time::Duration;

/// Version of the interface: major, minor, release, revision.
const VERSION: [c_int; 4] = [3, 17, 6, 0];
/// Digits of an angle in degrees.
const DEGREES: f64 = 180.0 / std::f64::consts::PI;

fn number(index: i8) -> Result<usize, Code> {
    usize::try_from(index).map_err(|_| Code::InvalidIndex)
}

fn opened(index: i8) -> c_int {
    // -1 is the default device, or the first one if there is none.
    if index < 0 && default().is_err() {
        return result(open_first(|_| true));
    }
    let index = if index < 0 {
        default().and_then(|id| usize::try_from(id).map_err(|_| Code::NoDevice))
    } else {
        number(index)
    };
    result(index.and_then(open_number))
}

fn whole(count: usize) -> c_int {
    c_int::try_from(count).unwrap_or(c_int::MAX)
}

export! {
    /// Devices there are, open or not.
    fn dhdGetDeviceCount() -> c_int [0] { whole(count()) }
    /// Devices that no other program has.
    fn dhdGetAvailableCount() -> c_int [0] { whole(count()) }
    /// Opens the first device that is free; its id.
    fn dhdOpen() -> c_int [-1] { result(open_first(|_| true)) }
    /// The same.
    fn drdOpen() -> c_int [-1] { result(open_first(|_| true)) }
    /// Opens a device; one that is open stays so.
    fn dhdOpenID(index: i8) -> c_int [-1] { opened(index) }
    /// The same.
    fn drdOpenID(index: i8) -> c_int [-1] { opened(index) }
    /// Opens the device of a serial number.
    fn dhdOpenSerial(serial: c_int) -> c_int [-1] { result(open_first(|open| whole(open.number) + 1 == serial)) }
    /// Opens the first device of a type.
    fn dhdOpenType(wanted: c_int) -> c_int [-1] { result(open_first(|open| kind(open.station) == wanted)) }
    /// Closes a device: no force from the next tick on.
    fn dhdClose(id: i8) -> c_int [-1] { result(close(id)) }
    /// The same.
    fn drdClose(id: i8) -> c_int [-1] { result(close(id)) }
    /// Makes a device the one that an id of -1 means.
    fn dhdSetDevice(id: i8) -> c_int [-1] { result(set_default(id)) }
    /// The same.
    fn drdSetDevice(id: i8) -> c_int [-1] { result(set_default(id)) }
    /// The device that an id of -1 means.
    fn dhdGetDeviceID() -> c_int [-1] { result(default()) }
    /// The same.
    fn drdGetDeviceID() -> c_int [-1] { result(default()) }

    /// Version of the interface.
    fn dhdGetSDKVersion(major: Out<c_int>, minor: Out<c_int>, release: Out<c_int>, revision: Out<c_int>) -> () [()] {
        [major, minor, release, revision].into_iter().zip(VERSION).for_each(|(place, value)| place.put(value));
    }
    /// The same as text, never null.
    fn dhdGetSDKVersionStr() -> *const c_char [c"".as_ptr()] { c"3.17.6".as_ptr() }
    /// Version of the controller as text, never null.
    fn dhdGetVersionStr(_id: i8) -> *const c_char [c"".as_ptr()] { c"3.17".as_ptr() }
    /// Version of a part as text, never null.
    fn dhdGetComponentVersionStr(_component: c_uint, _id: i8) -> *const c_char [c"".as_ptr()] { c"3.17".as_ptr() }
    /// Version of the controller.
    fn dhdGetVersion(version: Out<f64>, id: i8) -> c_int [-1] { read(id, |_| version.put(3.17)) }
    /// Revision of the device.
    fn dhdGetSystemRev(id: i8) -> c_int [-1] { result(open(id).map(|_| 1)) }
    /// Type of the device; 0 for none.
    fn dhdGetSystemType(id: i8) -> c_int [0] { any(id).map_or(0, |open| kind(open.station)) }
    /// Name of the device, never null.
    fn dhdGetSystemName(id: i8) -> *const c_char [c"".as_ptr()] { name(any(id).ok().as_ref()).as_ptr() }
    /// Serial number.
    fn dhdGetSerialNumber(serial: Out<u16>, id: i8) -> c_int [-1] {
        read(id, |open| serial.put(u16::try_from(open.number + 1).unwrap_or(1)))
    }
    /// 3: simulated; 1: asynchronous.
    fn dhdGetComMode(id: i8) -> c_int [-1] {
        result(open(id).map(|open| if open.station.plugin() == "simulated" { 3 } else { 1 }))
    }
    /// Nothing is wrong with memory.
    fn dhdCheckControllerMemory(id: i8) -> c_int [-1] { read(id, |_| ()) }
    /// Whether it has translations.
    fn dhdHasBase(id: i8) -> bool [false] { any(id).is_ok() }
    /// Whether its rotations are sensed.
    fn dhdHasWrist(id: i8) -> bool [false] { any(id).is_ok_and(|open| open.has_wrist()) }
    /// Whether they are driven.
    fn dhdHasActiveWrist(id: i8) -> bool [false] { any(id).is_ok_and(|open| open.has_active_wrist()) }
    /// No device of Flotor has a gripper.
    fn dhdHasGripper(_id: i8) -> bool [false] { false }
    /// The same.
    fn dhdHasActiveGripper(_id: i8) -> bool [false] { false }
    /// Whether it is for the left hand: by its type.
    fn dhdIsLeftHanded(id: i8) -> bool [false] {
        any(id).is_ok_and(|open| [36, 37, 105, 109, 132].contains(&kind(open.station)))
    }

    /// Position, m.
    fn dhdGetPosition(x: Out<f64>, y: Out<f64>, z: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| put3([x, y, z], open.pose().0))
    }
    /// Rows of the rotation matrix; the identity without a wrist.
    fn dhdGetOrientationFrame(matrix: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| matrix.put_all(open.pose().1.as_flattened()))
    }
    /// Position, m, and rows of the rotation matrix.
    fn dhdGetPositionAndOrientationFrame(x: Out<f64>, y: Out<f64>, z: Out<f64>, matrix: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| {
            let (position_m, rows) = open.pose();
            put3([x, y, z], position_m);
            matrix.put_all(rows.as_flattened());
        })
    }
    /// Angles about x, then y, then z, rad.
    fn dhdGetOrientationRad(a: Out<f64>, b: Out<f64>, g: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| put3([a, b, g], angles(&open.pose().1)))
    }
    /// The same in degrees.
    fn dhdGetOrientationDeg(a: Out<f64>, b: Out<f64>, g: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| put3([a, b, g], angles(&open.pose().1) * DEGREES))
    }
    /// Position, m, and angles, rad.
    fn dhdGetPositionAndOrientationRad(x: Out<f64>, y: Out<f64>, z: Out<f64>, a: Out<f64>, b: Out<f64>, g: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| {
            let (position_m, rows) = open.pose();
            put3([x, y, z], position_m);
            put3([a, b, g], angles(&rows));
        })
    }
    /// Position, m, and angles, degrees.
    fn dhdGetPositionAndOrientationDeg(x: Out<f64>, y: Out<f64>, z: Out<f64>, a: Out<f64>, b: Out<f64>, g: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| {
            let (position_m, rows) = open.pose();
            put3([x, y, z], position_m);
            put3([a, b, g], angles(&rows) * DEGREES);
        })
    }
    /// Velocity, m/s.
    fn dhdGetLinearVelocity(x: Out<f64>, y: Out<f64>, z: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| put3([x, y, z], FRAME.of_flotor(open.station.state().velocity_m_per_s)))
    }
    /// Angular velocity about the axes of the base, rad/s.
    fn dhdGetAngularVelocityRad(x: Out<f64>, y: Out<f64>, z: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| put3([x, y, z], turning(open)))
    }
    /// The same in degrees.
    fn dhdGetAngularVelocityDeg(x: Out<f64>, y: Out<f64>, z: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| put3([x, y, z], turning(open) * DEGREES))
    }
    /// 1 if a button is pressed.
    fn dhdGetButton(index: c_int, id: i8) -> c_int [-1] {
        let bit = u32::try_from(index).ok().filter(|index| *index < 32).ok_or(Code::InvalidIndex);
        result(bit.and_then(|bit| sampled(id).map(|open| c_int::from(open.station.state().buttons >> bit & 1 == 1))))
    }
    /// Buttons, one bit each; 0 on error.
    fn dhdGetButtonMask(id: i8) -> c_uint [0] { sampled(id).map_or(0, |open| open.station.state().buttons) }

    /// There is no gripper.
    fn dhdGetGripperAngleRad(angle: Out<f64>, _id: i8) -> c_int [-1] { no_gripper([angle]) }
    /// There is no gripper.
    fn dhdGetGripperAngleDeg(angle: Out<f64>, _id: i8) -> c_int [-1] { no_gripper([angle]) }
    /// There is no gripper.
    fn dhdGetGripperGap(gap: Out<f64>, _id: i8) -> c_int [-1] { no_gripper([gap]) }
    /// There is no gripper.
    fn dhdGetGripperAngularVelocityRad(velocity: Out<f64>, _id: i8) -> c_int [-1] { no_gripper([velocity]) }
    /// There is no gripper.
    fn dhdGetGripperAngularVelocityDeg(velocity: Out<f64>, _id: i8) -> c_int [-1] { no_gripper([velocity]) }
    /// There is no gripper.
    fn dhdGetGripperLinearVelocity(velocity: Out<f64>, _id: i8) -> c_int [-1] { no_gripper([velocity]) }
    /// There is no gripper.
    fn dhdGetGripperThumbPos(x: Out<f64>, y: Out<f64>, z: Out<f64>, _id: i8) -> c_int [-1] { no_gripper([x, y, z]) }
    /// There is no gripper.
    fn dhdGetGripperFingerPos(x: Out<f64>, y: Out<f64>, z: Out<f64>, _id: i8) -> c_int [-1] { no_gripper([x, y, z]) }

    /// Seconds of a clock that never goes back; in lockstep those of the run.
    fn dhdGetTime() -> f64 [0.0] { now_s() }
    /// The same.
    fn drdGetTime() -> f64 [0.0] { now_s() }
    /// Waits for so many seconds; in lockstep the run goes on for as long.
    fn dhdSleep(seconds: f64) -> () [()] { sleep(seconds) }
    /// The same.
    fn drdSleep(seconds: f64) -> () [()] { sleep(seconds) }
    /// Microseconds of the same clock.
    fn dhdGetSystemCounter() -> std::ffi::c_ulong [0] {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a time since the machine started
        let microseconds = (now_s() * 1.0e6) as u64;
        microseconds
    }
    /// The scene decides what is simulated.
    fn dhdEnableSimulator(_on: bool) -> () [()] {}
    /// Allows calls for experts, in the whole process.
    fn dhdEnableExpertMode() -> c_int [-1] { crate::device::set_expert(true); DONE }
    /// Forbids them.
    fn dhdDisableExpertMode() -> c_int [-1] { crate::device::set_expert(false); DONE }
}

/// Reads something of an open device.
pub(crate) fn read(id: i8, body: impl FnOnce(&Open)) -> c_int {
    result(open(id).map(|open| {
        body(&open);
        DONE
    }))
}

/// Reads the sample of a device that is not lost.
pub(crate) fn read_live(id: i8, body: impl FnOnce(&Open)) -> c_int {
    result(sampled(id).map(|open| {
        body(&open);
        DONE
    }))
}

/// The same, in expert mode.
pub(crate) fn read_expert(id: i8, body: impl FnOnce(&Open)) -> c_int {
    result(expert(id).map(|open| {
        body(&open);
        DONE
    }))
}

pub(crate) fn put3(places: [Out<f64>; 3], values: DVec3) {
    places.into_iter().zip(values.to_array()).for_each(|(place, value)| place.put(value));
}

fn no_gripper<const N: usize>(places: [Out<f64>; N]) -> c_int {
    places.into_iter().for_each(|place| place.put(0.0));
    failed(Code::NotAvailable)
}

pub(crate) fn turning(open: &Open) -> DVec3 {
    FRAME.of_flotor(open.station.state().angular_velocity_rad_per_s)
}

/// Angles a, b, g with R = Rx(a) Ry(b) Rz(g), rad.
pub(crate) fn angles(rows: &[[f64; 3]; 3]) -> DVec3 {
    DVec3::new(
        math::atan2(-rows[1][2], rows[2][2]),
        math::asin(rows[0][2].clamp(-1.0, 1.0)),
        math::atan2(-rows[0][1], rows[0][0]),
    )
}

/// The name of a device, or that there is none: kept for as long as the process lives.
fn name(open: Option<&Open>) -> &'static CStr {
    static NAMES: [OnceLock<CString>; crate::device::MOST] = [const { OnceLock::new() }; crate::device::MOST];
    let none = c"no device";
    let Some((open, place)) = open.and_then(|open| Some((open, NAMES.get(open.number)?))) else {
        return none;
    };
    let named = |station: &Station| CString::new(format!("Flotor {}", station.plugin())).unwrap_or_default();
    place.get_or_init(|| named(open.station))
}

fn now_s() -> f64 {
    host().map_or(0.0, |host| host.now_ns() as f64 * 1.0e-9)
}

fn sleep(seconds: f64) {
    let Ok(time) = Duration::try_from_secs_f64(seconds.clamp(0.0, 3600.0)) else { return };
    match host().filter(|host| host.pace() == Pace::Lockstep) {
        Some(host) => {
            let period = Duration::from_nanos(host.period_ns().max(1));
            let ticks = time.as_nanos().div_ceil(period.as_nanos());
            for _ in 0..ticks {
                force::follow_all();
                host.sleep(period);
            }
        }
        None => std::thread::sleep(time),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::{DMat3, DQuat};

    #[test]
    fn angles_are_those_that_clients_put_together_again() {
        let wanted = DVec3::new(0.3, -0.4, 0.7);
        let turned = DQuat::from_rotation_x(wanted.x)
            * DQuat::from_rotation_y(wanted.y)
            * DQuat::from_rotation_z(wanted.z);
        let columns = DMat3::from_quat(turned).to_cols_array_2d();
        let rows = std::array::from_fn(|row| std::array::from_fn(|column| columns[column][row]));
        assert!((angles(&rows) - wanted).length() < 1.0e-15);
    }
}
