//! Entry points of settings that are stored and returned, mostly without effect.

use crate::basic::{DEGREES, read};
use crate::error::{Code, failed};
use crate::force::keep;
use flotor_compat::export;
use flotor_compat::pointer::Out;
use std::ffi::c_int;

fn set_angle(id: i8, index: usize, angle_rad: f64) -> c_int {
    if !angle_rad.is_finite() {
        return failed(Code::Invalid);
    }
    keep(id, |device| device.angles_rad.get_mut(index).into_iter().for_each(|kept| *kept = angle_rad))
}

fn angle(id: i8, index: usize, factor: f64, place: Out<f64>) -> c_int {
    read(id, |open| place.put(open.device().angles_rad.get(index).map_or(0.0, |kept| kept * factor)))
}

export! {
    /// Does nothing: the loop has its own velocity estimate.
    fn dhdConfigLinearVelocity(_window_ms: c_int, _mode: c_int, id: i8) -> c_int [-1] { read(id, |_| ()) }
    /// Does nothing: the loop has its own velocity estimate.
    fn dhdConfigAngularVelocity(_window_ms: c_int, _mode: c_int, id: i8) -> c_int [-1] { read(id, |_| ()) }
    /// Does nothing: the device estimates the velocity of a gripper itself.
    fn dhdConfigGripperVelocity(_window_ms: c_int, _mode: c_int, id: i8) -> c_int [-1] { read(id, |_| ()) }
    /// Stores the angle of the base about x, rad, without effect.
    fn dhdSetBaseAngleXRad(angle_rad: f64, id: i8) -> c_int [-1] { set_angle(id, 0, angle_rad) }
    /// Stores the angle of the base about x, degrees, without effect.
    fn dhdSetBaseAngleXDeg(angle_deg: f64, id: i8) -> c_int [-1] { set_angle(id, 0, angle_deg / DEGREES) }
    /// Reads the stored angle of the base about x, rad.
    fn dhdGetBaseAngleXRad(angle_rad: Out<f64>, id: i8) -> c_int [-1] { angle(id, 0, 1.0, angle_rad) }
    /// Reads the stored angle of the base about x, degrees.
    fn dhdGetBaseAngleXDeg(angle_deg: Out<f64>, id: i8) -> c_int [-1] { angle(id, 0, DEGREES, angle_deg) }
    /// Stores the angle of the base about z, rad, without effect.
    fn dhdSetBaseAngleZRad(angle_rad: f64, id: i8) -> c_int [-1] { set_angle(id, 1, angle_rad) }
    /// Stores the angle of the base about z, degrees, without effect.
    fn dhdSetBaseAngleZDeg(angle_deg: f64, id: i8) -> c_int [-1] { set_angle(id, 1, angle_deg / DEGREES) }
    /// Reads the stored angle of the base about z, rad.
    fn dhdGetBaseAngleZRad(angle_rad: Out<f64>, id: i8) -> c_int [-1] { angle(id, 1, 1.0, angle_rad) }
    /// Reads the stored angle of the base about z, degrees.
    fn dhdGetBaseAngleZDeg(angle_deg: Out<f64>, id: i8) -> c_int [-1] { angle(id, 1, DEGREES, angle_deg) }
    /// Stores the angle of the device, rad, without effect.
    fn dhdSetDeviceAngleRad(angle_rad: f64, id: i8) -> c_int [-1] { set_angle(id, 2, angle_rad) }
    /// Stores the angle of the device, degrees, without effect.
    fn dhdSetDeviceAngleDeg(angle_deg: f64, id: i8) -> c_int [-1] { set_angle(id, 2, angle_deg / DEGREES) }
    /// Reads the stored angle of the device, rad.
    fn dhdGetDeviceAngleRad(angle_rad: Out<f64>, id: i8) -> c_int [-1] { angle(id, 2, 1.0, angle_rad) }
    /// Reads the stored angle of the device, degrees.
    fn dhdGetDeviceAngleDeg(angle_deg: Out<f64>, id: i8) -> c_int [-1] { angle(id, 2, DEGREES, angle_deg) }
}

fn set_parameters(id: i8, index: usize, values: [f64; 3]) -> c_int {
    if values.iter().any(|value| !value.is_finite() || *value <= 0.0) {
        return failed(Code::Invalid);
    }
    keep(id, |device| device.parameters.get_mut(index).into_iter().for_each(|kept| *kept = values))
}

fn parameters(id: i8, index: usize, places: [Out<f64>; 3]) -> c_int {
    read(id, |open| {
        let kept = open.device().parameters.get(index).copied().unwrap_or_default();
        places.into_iter().zip(kept).for_each(|(place, value)| place.put(value));
    })
}

/// Indices of the motion limits of position and rotation: acceleration, speed, jerk. The regulation uses the speed.
pub(crate) const POSITION_MOVE: usize = 2;
pub(crate) const ROTATION_MOVE: usize = 4;

export! {
    /// Stores the limits of acceleration, speed and jerk for encoder motions, without effect.
    fn drdSetEncMoveParam(amax: f64, vmax: f64, jerk: f64, id: i8) -> c_int [-1] { set_parameters(id, 0, [amax, vmax, jerk]) }
    /// Stores the limits for tracking encoders, without effect.
    fn drdSetEncTrackParam(amax: f64, vmax: f64, jerk: f64, id: i8) -> c_int [-1] { set_parameters(id, 1, [amax, vmax, jerk]) }
    /// Sets the limits for motions of the position, m and s; only the speed has an effect.
    fn drdSetPosMoveParam(amax: f64, vmax: f64, jerk: f64, id: i8) -> c_int [-1] { set_parameters(id, POSITION_MOVE, [amax, vmax, jerk]) }
    /// Stores the limits for tracking a position, m and s, without effect.
    fn drdSetPosTrackParam(amax: f64, vmax: f64, jerk: f64, id: i8) -> c_int [-1] { set_parameters(id, 3, [amax, vmax, jerk]) }
    /// Sets the limits for motions of the rotation, rad and s; only the speed has an effect.
    fn drdSetRotMoveParam(amax: f64, vmax: f64, jerk: f64, id: i8) -> c_int [-1] { set_parameters(id, ROTATION_MOVE, [amax, vmax, jerk]) }
    /// Stores the limits for tracking a rotation, rad and s, without effect.
    fn drdSetRotTrackParam(amax: f64, vmax: f64, jerk: f64, id: i8) -> c_int [-1] { set_parameters(id, 5, [amax, vmax, jerk]) }
    /// Stores the limits for motions of a gripper, without effect.
    fn drdSetGripMoveParam(amax: f64, vmax: f64, jerk: f64, id: i8) -> c_int [-1] { set_parameters(id, 6, [amax, vmax, jerk]) }
    /// Stores the limits for tracking a gripper, without effect.
    fn drdSetGripTrackParam(amax: f64, vmax: f64, jerk: f64, id: i8) -> c_int [-1] { set_parameters(id, 7, [amax, vmax, jerk]) }
    /// Reads the limits for encoder motions.
    fn drdGetEncMoveParam(amax: Out<f64>, vmax: Out<f64>, jerk: Out<f64>, id: i8) -> c_int [-1] { parameters(id, 0, [amax, vmax, jerk]) }
    /// Reads the limits for tracking encoders.
    fn drdGetEncTrackParam(amax: Out<f64>, vmax: Out<f64>, jerk: Out<f64>, id: i8) -> c_int [-1] { parameters(id, 1, [amax, vmax, jerk]) }
    /// Reads the limits for motions of the position.
    fn drdGetPosMoveParam(amax: Out<f64>, vmax: Out<f64>, jerk: Out<f64>, id: i8) -> c_int [-1] { parameters(id, POSITION_MOVE, [amax, vmax, jerk]) }
    /// Reads the limits for tracking a position.
    fn drdGetPosTrackParam(amax: Out<f64>, vmax: Out<f64>, jerk: Out<f64>, id: i8) -> c_int [-1] { parameters(id, 3, [amax, vmax, jerk]) }
    /// Reads the limits for motions of the rotation.
    fn drdGetRotMoveParam(amax: Out<f64>, vmax: Out<f64>, jerk: Out<f64>, id: i8) -> c_int [-1] { parameters(id, ROTATION_MOVE, [amax, vmax, jerk]) }
    /// Reads the limits for tracking a rotation.
    fn drdGetRotTrackParam(amax: Out<f64>, vmax: Out<f64>, jerk: Out<f64>, id: i8) -> c_int [-1] { parameters(id, 5, [amax, vmax, jerk]) }
    /// Reads the limits for motions of a gripper.
    fn drdGetGripMoveParam(amax: Out<f64>, vmax: Out<f64>, jerk: Out<f64>, id: i8) -> c_int [-1] { parameters(id, 6, [amax, vmax, jerk]) }
    /// Reads the limits for tracking a gripper.
    fn drdGetGripTrackParam(amax: Out<f64>, vmax: Out<f64>, jerk: Out<f64>, id: i8) -> c_int [-1] { parameters(id, 7, [amax, vmax, jerk]) }
}

fn set_gain(id: i8, index: usize, gain: f64) -> c_int {
    if !gain.is_finite() {
        return failed(Code::Invalid);
    }
    keep(id, |device| device.gains.get_mut(index).into_iter().for_each(|kept| *kept = gain))
}

fn gain(id: i8, index: usize) -> f64 {
    match crate::device::open(id) {
        Ok(open) => open.device().gains.get(index).copied().unwrap_or_default(),
        Err(code) => f64::from(failed(code)),
    }
}

export! {
    /// Stores the proportional gain without effect: the regulation has its own gains.
    fn drdSetEncPGain(value: f64, id: i8) -> c_int [-1] { set_gain(id, 0, value) }
    /// Stores the integral gain without effect.
    fn drdSetEncIGain(value: f64, id: i8) -> c_int [-1] { set_gain(id, 1, value) }
    /// Stores the derivative gain without effect.
    fn drdSetEncDGain(value: f64, id: i8) -> c_int [-1] { set_gain(id, 2, value) }
    /// Stores the motor limit without effect: the envelope limits the force.
    fn drdSetMotRatioMax(value: f64, id: i8) -> c_int [-1] { set_gain(id, 3, value) }
    /// Returns the stored proportional gain.
    fn drdGetEncPGain(id: i8) -> f64 [-1.0] { gain(id, 0) }
    /// Returns the stored integral gain.
    fn drdGetEncIGain(id: i8) -> f64 [-1.0] { gain(id, 1) }
    /// Returns the stored derivative gain.
    fn drdGetEncDGain(id: i8) -> f64 [-1.0] { gain(id, 2) }
    /// Returns the stored motor limit.
    fn drdGetMotRatioMax(id: i8) -> f64 [-1.0] { gain(id, 3) }
    /// Stores the thread priorities without effect: the loop has its own priority.
    fn drdSetPriorities(program: c_int, control: c_int, id: i8) -> c_int [-1] {
        keep(id, |device| device.priorities = [program, control])
    }
    /// Reads the stored priorities.
    fn drdGetPriorities(program: Out<c_int>, control: Out<c_int>, id: i8) -> c_int [-1] {
        read(id, |open| [program, control].into_iter().zip(open.device().priorities).for_each(|(place, value)| place.put(value)))
    }
    /// Stores the filter switch without effect.
    fn drdEnableFilter(on: bool, id: i8) -> c_int [-1] { keep(id, |device| device.filters = on) }
    /// Returns the stored filter switch.
    fn drdIsFiltering(id: i8) -> bool [false] { crate::device::open(id).is_ok_and(|open| open.device().filters) }
    /// Does nothing: there are no locks.
    fn drdLock(_mask: std::ffi::c_uchar, _init: bool, id: i8) -> c_int [-1] { read(id, |_| ()) }
}
