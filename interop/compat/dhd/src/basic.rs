//! Entry points to open, identify and read a device: pose, velocity, buttons.

use crate::device::{
    FRAME, Open, any, close, count, default, expert, kind, open, open_first, open_number, set_default,
};
use crate::error::{Code, DONE, failed, result};
use crate::gripper::{Gripper, is_driven};
use crate::regulator::{follow_all, sampled};
use flotor_compat::pointer::Out;
use flotor_compat::{Pace, export, host, interned};
use flotor_hal::{DVec3, math};
use std::ffi::{CStr, c_char, c_int, c_uint};
use std::time::Duration;

/// Version of the interface: major, minor, release, revision.
const VERSION: [c_int; 4] = [3, 17, 6, 0];
/// Degrees per radian.
pub(crate) const DEGREES: f64 = 180.0 / std::f64::consts::PI;

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
    /// Returns the number of devices, open or not.
    fn dhdGetDeviceCount() -> c_int [0] { whole(count()) }
    /// Returns the number of devices, as [`dhdGetDeviceCount`]: no other program uses a device of the scene.
    fn dhdGetAvailableCount() -> c_int [0] { whole(count()) }
    /// Opens the first free device; returns its id.
    fn dhdOpen() -> c_int [-1] { result(open_first(|_| true)) }
    /// Opens the first free device, as [`dhdOpen`].
    fn drdOpen() -> c_int [-1] { result(open_first(|_| true)) }
    /// Opens a device by number (-1: the default device), and makes it the default; an open device stays open.
    fn dhdOpenID(index: i8) -> c_int [-1] { opened(index) }
    /// Opens a device by number, as [`dhdOpenID`].
    fn drdOpenID(index: i8) -> c_int [-1] { opened(index) }
    /// Opens the device with this serial number, which is its number plus one; an error if it is open.
    fn dhdOpenSerial(serial: c_int) -> c_int [-1] { result(open_first(|open| whole(open.number) + 1 == serial)) }
    /// Opens the first device of a type.
    fn dhdOpenType(wanted: c_int) -> c_int [-1] { result(open_first(|open| kind(open.station) == wanted)) }
    /// Closes a device, whose force ends with the next tick.
    fn dhdClose(id: i8) -> c_int [-1] { result(close(id)) }
    /// Closes a device, as [`dhdClose`].
    fn drdClose(id: i8) -> c_int [-1] { result(close(id)) }
    /// Makes an open device the default device, which id -1 selects.
    fn dhdSetDevice(id: i8) -> c_int [-1] { result(set_default(id)) }
    /// Sets the default device, as [`dhdSetDevice`].
    fn drdSetDevice(id: i8) -> c_int [-1] { result(set_default(id)) }
    /// Returns the id of the default device.
    fn dhdGetDeviceID() -> c_int [-1] { result(default()) }
    /// Returns the id of the default device, as [`dhdGetDeviceID`].
    fn drdGetDeviceID() -> c_int [-1] { result(default()) }

    /// Reads the version of the interface.
    fn dhdGetSDKVersion(major: Out<c_int>, minor: Out<c_int>, release: Out<c_int>, revision: Out<c_int>) -> () [()] {
        [major, minor, release, revision].into_iter().zip(VERSION).for_each(|(place, value)| place.put(value));
    }
    /// Returns the version of the interface as text, never null.
    fn dhdGetSDKVersionStr() -> *const c_char [c"".as_ptr()] { c"3.17.6".as_ptr() }
    /// Returns the version of the controller as text, never null.
    fn dhdGetVersionStr(_id: i8) -> *const c_char [c"".as_ptr()] { c"3.17".as_ptr() }
    /// Returns the version of a component as text, never null.
    fn dhdGetComponentVersionStr(_component: c_uint, _id: i8) -> *const c_char [c"".as_ptr()] { c"3.17".as_ptr() }
    /// Reads the version of the controller.
    fn dhdGetVersion(version: Out<f64>, id: i8) -> c_int [-1] { read(id, |_| version.put(3.17)) }
    /// Returns the revision of the device.
    fn dhdGetSystemRev(id: i8) -> c_int [-1] { result(open(id).map(|_| 1)) }
    /// Returns the type of the device; 0 without one.
    fn dhdGetSystemType(id: i8) -> c_int [0] { any(id).map_or(0, |open| kind(open.station)) }
    /// Returns the name of the device, never null.
    fn dhdGetSystemName(id: i8) -> *const c_char [c"".as_ptr()] { name(any(id).ok().as_ref()).as_ptr() }
    /// Reads the serial number.
    fn dhdGetSerialNumber(serial: Out<u16>, id: i8) -> c_int [-1] {
        read(id, |open| serial.put(u16::try_from(open.number + 1).unwrap_or(1)))
    }
    /// Returns the communication mode, 3: simulated; 1: asynchronous.
    fn dhdGetComMode(id: i8) -> c_int [-1] {
        result(open(id).map(|open| if open.station.plugin() == "simulated" { 3 } else { 1 }))
    }
    /// Reports an intact memory of the controller.
    fn dhdCheckControllerMemory(id: i8) -> c_int [-1] { read(id, |_| ()) }
    /// Returns true if the device exists: every device has translations.
    fn dhdHasBase(id: i8) -> bool [false] { any(id).is_ok() }
    /// Returns true if the device senses rotations.
    fn dhdHasWrist(id: i8) -> bool [false] { any(id).is_ok_and(|open| open.has_wrist()) }
    /// Returns true if the device drives its rotations.
    fn dhdHasActiveWrist(id: i8) -> bool [false] { any(id).is_ok_and(|open| open.has_active_wrist()) }
    /// Returns whether the device has a gripper.
    fn dhdHasGripper(id: i8) -> bool [false] { any(id).is_ok_and(|open| open.station.grip().is_some()) }
    /// Returns whether the device has a gripper with a motor.
    fn dhdHasActiveGripper(id: i8) -> bool [false] { any(id).is_ok_and(|open| is_driven(open.station)) }
    /// Returns true if the device is for the left hand, by its type.
    fn dhdIsLeftHanded(id: i8) -> bool [false] {
        any(id).is_ok_and(|open| [36, 37, 105, 109, 132].contains(&kind(open.station)))
    }

    /// Reads the position, m.
    fn dhdGetPosition(x: Out<f64>, y: Out<f64>, z: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| put3([x, y, z], open.pose().0))
    }
    /// Reads the rotation matrix, row-major; the identity without a wrist.
    fn dhdGetOrientationFrame(matrix: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| matrix.put_all(open.pose().1.as_flattened()))
    }
    /// Reads the position, m, and the rotation matrix, row-major.
    fn dhdGetPositionAndOrientationFrame(x: Out<f64>, y: Out<f64>, z: Out<f64>, matrix: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| {
            let (position_m, rows) = open.pose();
            put3([x, y, z], position_m);
            matrix.put_all(rows.as_flattened());
        })
    }
    /// Reads the angles about x, then y, then z, rad.
    fn dhdGetOrientationRad(a: Out<f64>, b: Out<f64>, g: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| put3([a, b, g], angles(&open.pose().1)))
    }
    /// Reads the angles about x, then y, then z, degrees.
    fn dhdGetOrientationDeg(a: Out<f64>, b: Out<f64>, g: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| put3([a, b, g], angles(&open.pose().1) * DEGREES))
    }
    /// Reads the position, m, and the angles, rad.
    fn dhdGetPositionAndOrientationRad(x: Out<f64>, y: Out<f64>, z: Out<f64>, a: Out<f64>, b: Out<f64>, g: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| {
            let (position_m, rows) = open.pose();
            put6([x, y, z, a, b, g], [position_m, angles(&rows)]);
        })
    }
    /// Reads the position, m, and the angles, degrees.
    fn dhdGetPositionAndOrientationDeg(x: Out<f64>, y: Out<f64>, z: Out<f64>, a: Out<f64>, b: Out<f64>, g: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| {
            let (position_m, rows) = open.pose();
            put6([x, y, z, a, b, g], [position_m, angles(&rows) * DEGREES]);
        })
    }
    /// Reads the velocity, m/s.
    fn dhdGetLinearVelocity(x: Out<f64>, y: Out<f64>, z: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| put3([x, y, z], FRAME.of_flotor(open.station.state().velocity_m_per_s)))
    }
    /// Reads the angular velocity about the axes of the base, rad/s.
    fn dhdGetAngularVelocityRad(x: Out<f64>, y: Out<f64>, z: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| put3([x, y, z], turning(open)))
    }
    /// Reads the angular velocity about the axes of the base, degrees/s.
    fn dhdGetAngularVelocityDeg(x: Out<f64>, y: Out<f64>, z: Out<f64>, id: i8) -> c_int [-1] {
        read_live(id, |open| put3([x, y, z], turning(open) * DEGREES))
    }
    /// Returns 1 if a button is pressed, 0 if not.
    fn dhdGetButton(index: c_int, id: i8) -> c_int [-1] {
        let bit = u32::try_from(index).ok().filter(|index| *index < 32).ok_or(Code::InvalidIndex);
        result(bit.and_then(|bit| sampled(id).map(|open| c_int::from(open.station.state().buttons >> bit & 1 == 1))))
    }
    /// Returns the buttons, one bit each; 0 on error.
    fn dhdGetButtonMask(id: i8) -> c_uint [0] { sampled(id).map_or(0, |open| open.station.state().buttons) }

    /// Reads the angle of the gripper, rad; 0 and an error without one.
    fn dhdGetGripperAngleRad(angle: Out<f64>, id: i8) -> c_int [-1] { gripper(id, angle, |gripper| gripper.angle_rad()) }
    /// Reads the angle of the gripper, degrees; 0 and an error without one.
    fn dhdGetGripperAngleDeg(angle: Out<f64>, id: i8) -> c_int [-1] { gripper(id, angle, |gripper| gripper.angle_rad() * DEGREES) }
    /// Reads the gap of the gripper, m; 0 and an error without one.
    fn dhdGetGripperGap(gap: Out<f64>, id: i8) -> c_int [-1] { gripper(id, gap, |gripper| gripper.gap_m) }
    /// Reads the angular velocity of the gripper, rad/s; 0 and an error without one.
    fn dhdGetGripperAngularVelocityRad(velocity: Out<f64>, id: i8) -> c_int [-1] { gripper(id, velocity, |gripper| gripper.velocity_rad_per_s()) }
    /// Reads the angular velocity of the gripper, degrees/s; 0 and an error without one.
    fn dhdGetGripperAngularVelocityDeg(velocity: Out<f64>, id: i8) -> c_int [-1] { gripper(id, velocity, |gripper| gripper.velocity_rad_per_s() * DEGREES) }
    /// Reads the velocity of the gap, m/s; 0 and an error without a gripper.
    fn dhdGetGripperLinearVelocity(velocity: Out<f64>, id: i8) -> c_int [-1] { gripper(id, velocity, |gripper| gripper.velocity_m_per_s) }
    /// Reads 0 and returns an error: the positions of the fingers are unknown.
    fn dhdGetGripperThumbPos(x: Out<f64>, y: Out<f64>, z: Out<f64>, _id: i8) -> c_int [-1] { no_finger([x, y, z]) }
    /// Reads 0 and returns an error: the positions of the fingers are unknown.
    fn dhdGetGripperFingerPos(x: Out<f64>, y: Out<f64>, z: Out<f64>, _id: i8) -> c_int [-1] { no_finger([x, y, z]) }

    /// Returns the time of a monotonic clock, s; in lockstep that of the run.
    fn dhdGetTime() -> f64 [0.0] { now_s() }
    /// Returns the time, as [`dhdGetTime`].
    fn drdGetTime() -> f64 [0.0] { now_s() }
    /// Sleeps for a time, s; in lockstep advances the run by the same time.
    fn dhdSleep(seconds: f64) -> () [()] { sleep(seconds) }
    /// Sleeps for a time, as [`dhdSleep`].
    fn drdSleep(seconds: f64) -> () [()] { sleep(seconds) }
    /// Returns the time of [`dhdGetTime`] in microseconds.
    fn dhdGetSystemCounter() -> std::ffi::c_ulong [0] {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a time since the machine started
        let microseconds = (now_s() * 1.0e6) as u64;
        microseconds
    }
    /// Does nothing: the scene decides whether devices are simulated.
    fn dhdEnableSimulator(_on: bool) -> () [()] {}
    /// Permits expert calls in the whole process.
    fn dhdEnableExpertMode() -> c_int [-1] { crate::device::set_expert(true); DONE }
    /// Forbids expert calls in the whole process.
    fn dhdDisableExpertMode() -> c_int [-1] { crate::device::set_expert(false); DONE }
}

/// Runs `body` on a device; returns [`DONE`], or reports the error.
pub(crate) fn with(device: Result<Open, Code>, body: impl FnOnce(&Open)) -> c_int {
    result(device.map(|open| {
        body(&open);
        DONE
    }))
}

/// Runs `body` on an open device.
pub(crate) fn read(id: i8, body: impl FnOnce(&Open)) -> c_int {
    with(open(id), body)
}

/// Runs `body` on an open device that is not lost, and counts a read of its sample.
pub(crate) fn read_live(id: i8, body: impl FnOnce(&Open)) -> c_int {
    with(sampled(id), body)
}

/// Runs `body` on an open device that is not lost, in expert mode.
pub(crate) fn read_expert(id: i8, body: impl FnOnce(&Open)) -> c_int {
    with(expert(id), body)
}

pub(crate) fn put3(places: [Out<f64>; 3], values: DVec3) {
    places.into_iter().zip(values.to_array()).for_each(|(place, value)| place.put(value));
}

pub(crate) fn put6(places: [Out<f64>; 6], values: [DVec3; 2]) {
    places
        .into_iter()
        .zip(values.iter().flat_map(DVec3::to_array))
        .for_each(|(place, value)| place.put(value));
}

/// Reads a number of a gripper; 0 and an error without one.
fn gripper(id: i8, place: Out<f64>, number: impl FnOnce(&Gripper) -> f64) -> c_int {
    result(sampled(id).and_then(|open| {
        let found = Gripper::of(open.station);
        place.put(found.as_ref().map_or(0.0, number));
        found.map(|_| DONE).ok_or(Code::NotAvailable)
    }))
}

fn no_finger(places: [Out<f64>; 3]) -> c_int {
    places.into_iter().for_each(|place| place.put(0.0));
    failed(Code::NotAvailable)
}

pub(crate) fn turning(open: &Open) -> DVec3 {
    FRAME.of_flotor(open.station.state().angular_velocity_rad_per_s)
}

/// Returns the angles a, b, g of R = Rx(a) Ry(b) Rz(g), rad.
pub(crate) fn angles(rows: &[[f64; 3]; 3]) -> DVec3 {
    DVec3::new(
        math::atan2(-rows[1][2], rows[2][2]),
        math::asin(rows[0][2].clamp(-1.0, 1.0)),
        math::atan2(-rows[0][1], rows[0][0]),
    )
}

/// Returns the name of a device, or "no device"; valid for the life of the process.
fn name(open: Option<&Open>) -> &'static CStr {
    open.map_or(c"no device", |open| interned(format!("Flotor {}", open.station.plugin())))
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
                follow_all();
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
