//! What is set, kept and given back, and changes nothing here.

use crate::basic::read;
use crate::error::{Code, failed};
use crate::force::keep;
use flotor_compat::pointer::Out;
use std::ffi::c_int;

const DEGREES: f64 = 180.0 / std::f64::consts::PI;

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
    /// The loop has an estimate of its own.
    fn dhdConfigLinearVelocity(_window_ms: c_int, _mode: c_int, id: i8) -> c_int [-1] { read(id, |_| ()) }
    /// The loop has an estimate of its own.
    fn dhdConfigAngularVelocity(_window_ms: c_int, _mode: c_int, id: i8) -> c_int [-1] { read(id, |_| ()) }
    /// There is no gripper.
    fn dhdConfigGripperVelocity(_window_ms: c_int, _mode: c_int, id: i8) -> c_int [-1] { read(id, |_| ()) }
    /// Kept, rad.
    fn dhdSetBaseAngleXRad(angle_rad: f64, id: i8) -> c_int [-1] { set_angle(id, 0, angle_rad) }
    /// Kept, degrees.
    fn dhdSetBaseAngleXDeg(angle_deg: f64, id: i8) -> c_int [-1] { set_angle(id, 0, angle_deg / DEGREES) }
    /// What was set, rad.
    fn dhdGetBaseAngleXRad(angle_rad: Out<f64>, id: i8) -> c_int [-1] { angle(id, 0, 1.0, angle_rad) }
    /// What was set, degrees.
    fn dhdGetBaseAngleXDeg(angle_deg: Out<f64>, id: i8) -> c_int [-1] { angle(id, 0, DEGREES, angle_deg) }
    /// Kept, rad.
    fn dhdSetBaseAngleZRad(angle_rad: f64, id: i8) -> c_int [-1] { set_angle(id, 1, angle_rad) }
    /// Kept, degrees.
    fn dhdSetBaseAngleZDeg(angle_deg: f64, id: i8) -> c_int [-1] { set_angle(id, 1, angle_deg / DEGREES) }
    /// What was set, rad.
    fn dhdGetBaseAngleZRad(angle_rad: Out<f64>, id: i8) -> c_int [-1] { angle(id, 1, 1.0, angle_rad) }
    /// What was set, degrees.
    fn dhdGetBaseAngleZDeg(angle_deg: Out<f64>, id: i8) -> c_int [-1] { angle(id, 1, DEGREES, angle_deg) }
    /// Kept, rad.
    fn dhdSetDeviceAngleRad(angle_rad: f64, id: i8) -> c_int [-1] { set_angle(id, 2, angle_rad) }
    /// Kept, degrees.
    fn dhdSetDeviceAngleDeg(angle_deg: f64, id: i8) -> c_int [-1] { set_angle(id, 2, angle_deg / DEGREES) }
    /// What was set, rad.
    fn dhdGetDeviceAngleRad(angle_rad: Out<f64>, id: i8) -> c_int [-1] { angle(id, 2, 1.0, angle_rad) }
    /// What was set, degrees.
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

/// Where the speed of a motion of the position and of the rotation is kept: acceleration, speed, jerk.
pub(crate) const POSITION_MOVE: usize = 2;
pub(crate) const ROTATION_MOVE: usize = 4;

export! {
    /// Largest acceleration, speed and jerk of a motion.
    fn drdSetEncMoveParam(amax: f64, vmax: f64, jerk: f64, id: i8) -> c_int [-1] { set_parameters(id, 0, [amax, vmax, jerk]) }
    /// The same while following.
    fn drdSetEncTrackParam(amax: f64, vmax: f64, jerk: f64, id: i8) -> c_int [-1] { set_parameters(id, 1, [amax, vmax, jerk]) }
    /// Of the position: m and s.
    fn drdSetPosMoveParam(amax: f64, vmax: f64, jerk: f64, id: i8) -> c_int [-1] { set_parameters(id, POSITION_MOVE, [amax, vmax, jerk]) }
    /// The same while following.
    fn drdSetPosTrackParam(amax: f64, vmax: f64, jerk: f64, id: i8) -> c_int [-1] { set_parameters(id, 3, [amax, vmax, jerk]) }
    /// Of the rotation: rad and s.
    fn drdSetRotMoveParam(amax: f64, vmax: f64, jerk: f64, id: i8) -> c_int [-1] { set_parameters(id, ROTATION_MOVE, [amax, vmax, jerk]) }
    /// The same while following.
    fn drdSetRotTrackParam(amax: f64, vmax: f64, jerk: f64, id: i8) -> c_int [-1] { set_parameters(id, 5, [amax, vmax, jerk]) }
    /// Of a gripper.
    fn drdSetGripMoveParam(amax: f64, vmax: f64, jerk: f64, id: i8) -> c_int [-1] { set_parameters(id, 6, [amax, vmax, jerk]) }
    /// The same while following.
    fn drdSetGripTrackParam(amax: f64, vmax: f64, jerk: f64, id: i8) -> c_int [-1] { set_parameters(id, 7, [amax, vmax, jerk]) }
    /// What was set.
    fn drdGetEncMoveParam(amax: Out<f64>, vmax: Out<f64>, jerk: Out<f64>, id: i8) -> c_int [-1] { parameters(id, 0, [amax, vmax, jerk]) }
    /// What was set.
    fn drdGetEncTrackParam(amax: Out<f64>, vmax: Out<f64>, jerk: Out<f64>, id: i8) -> c_int [-1] { parameters(id, 1, [amax, vmax, jerk]) }
    /// What was set.
    fn drdGetPosMoveParam(amax: Out<f64>, vmax: Out<f64>, jerk: Out<f64>, id: i8) -> c_int [-1] { parameters(id, POSITION_MOVE, [amax, vmax, jerk]) }
    /// What was set.
    fn drdGetPosTrackParam(amax: Out<f64>, vmax: Out<f64>, jerk: Out<f64>, id: i8) -> c_int [-1] { parameters(id, 3, [amax, vmax, jerk]) }
    /// What was set.
    fn drdGetRotMoveParam(amax: Out<f64>, vmax: Out<f64>, jerk: Out<f64>, id: i8) -> c_int [-1] { parameters(id, ROTATION_MOVE, [amax, vmax, jerk]) }
    /// What was set.
    fn drdGetRotTrackParam(amax: Out<f64>, vmax: Out<f64>, jerk: Out<f64>, id: i8) -> c_int [-1] { parameters(id, 5, [amax, vmax, jerk]) }
    /// What was set.
    fn drdGetGripMoveParam(amax: Out<f64>, vmax: Out<f64>, jerk: Out<f64>, id: i8) -> c_int [-1] { parameters(id, 6, [amax, vmax, jerk]) }
    /// What was set.
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
    /// Kept: the spring here has gains of its own.
    fn drdSetEncPGain(value: f64, id: i8) -> c_int [-1] { set_gain(id, 0, value) }
    /// Kept.
    fn drdSetEncIGain(value: f64, id: i8) -> c_int [-1] { set_gain(id, 1, value) }
    /// Kept.
    fn drdSetEncDGain(value: f64, id: i8) -> c_int [-1] { set_gain(id, 2, value) }
    /// Kept: the envelope limits.
    fn drdSetMotRatioMax(value: f64, id: i8) -> c_int [-1] { set_gain(id, 3, value) }
    /// What was set.
    fn drdGetEncPGain(id: i8) -> f64 [-1.0] { gain(id, 0) }
    /// What was set.
    fn drdGetEncIGain(id: i8) -> f64 [-1.0] { gain(id, 1) }
    /// What was set.
    fn drdGetEncDGain(id: i8) -> f64 [-1.0] { gain(id, 2) }
    /// What was set.
    fn drdGetMotRatioMax(id: i8) -> f64 [-1.0] { gain(id, 3) }
    /// Kept: the loop has a priority of its own.
    fn drdSetPriorities(program: c_int, control: c_int, id: i8) -> c_int [-1] {
        keep(id, |device| device.priorities = [program, control])
    }
    /// What was set.
    fn drdGetPriorities(program: Out<c_int>, control: Out<c_int>, id: i8) -> c_int [-1] {
        read(id, |open| [program, control].into_iter().zip(open.device().priorities).for_each(|(place, value)| place.put(value)))
    }
    /// Kept.
    fn drdEnableFilter(on: bool, id: i8) -> c_int [-1] { keep(id, |device| device.filters = on) }
    /// What was set.
    fn drdIsFiltering(id: i8) -> bool [false] { crate::device::open(id).is_ok_and(|open| open.device().filters) }
    /// There are no locks.
    fn drdLock(_mask: std::ffi::c_uchar, _init: bool, id: i8) -> c_int [-1] { read(id, |_| ()) }
}
