//! Encoders and joints of a nominal base. A Flotor device has other joints or none; programs receive the joints of a Cartesian
//! base: one joint along each axis, whose angle is the displacement divided by the length of an arm. Encoders, joints, positions
//! and the Jacobian agree with each other to one count.
//!
//! Lengths in m, angles in rad.

use crate::basic::{angles, put3, read_expert, turning};
use crate::device::{FRAME, expert};
use crate::error::{Code, failed, result};
use flotor_compat::export;
use flotor_compat::pointer::{In, Out};
use flotor_hal::DVec3;
use std::ffi::c_int;

/// Length of a nominal arm, m.
const ARM_M: f64 = 0.2;
/// Displacement per count of an encoder, m.
const COUNT_M: f64 = 1.0e-7;

/// Returns the position of encoder counts, m.
fn position(counts: [c_int; 3]) -> DVec3 {
    DVec3::from_array(counts.map(f64::from)) * COUNT_M
}

/// Returns the encoder counts of a position, m.
///
/// # Errors
/// [`Code::Geometry`] outside the range of an encoder, 215 m.
fn counts(position_m: DVec3) -> Result<[c_int; 3], Code> {
    let counts = (position_m / COUNT_M).round();
    let is_in_range = counts.is_finite() && counts.abs().max_element() < f64::from(c_int::MAX);
    if !is_in_range {
        return Err(Code::Geometry);
    }
    #[allow(clippy::cast_possible_truncation)] // within the range
    Ok(counts.to_array().map(|count| count as c_int))
}

/// Writes the counts of a position.
fn put_counts(id: i8, position_m: DVec3, places: [Out<c_int>; 3]) -> c_int {
    match counts(position_m) {
        Ok(counts) => read_expert(id, |_| {
            places.into_iter().zip(counts).for_each(|(place, count)| place.put(count));
        }),
        Err(code) => failed(code),
    }
}

/// Jacobian of the position with respect to the joint angles, row-major, m/rad.
const JACOBIAN: [f64; 9] = [ARM_M, 0.0, 0.0, 0.0, ARM_M, 0.0, 0.0, 0.0, ARM_M];
/// Jacobian of the orientation with respect to the joint angles of the wrist, row-major.
const WRIST_JACOBIAN: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];

export! {
    /// Reads the encoders of the base, counts.
    fn dhdGetDeltaEncoders(first: Out<c_int>, second: Out<c_int>, third: Out<c_int>, id: i8) -> c_int [-1] {
        match expert(id) {
            Ok(open) => put_counts(id, open.pose().0, [first, second, third]),
            Err(code) => failed(code),
        }
    }
    /// Converts encoder counts to a position, m.
    fn dhdDeltaEncoderToPosition(first: c_int, second: c_int, third: c_int, x: Out<f64>, y: Out<f64>, z: Out<f64>, id: i8) -> c_int [-1] {
        read_expert(id, |_| put3([x, y, z], position([first, second, third])))
    }
    /// Converts a position, m, to encoder counts.
    fn dhdDeltaPositionToEncoder(x: f64, y: f64, z: f64, first: Out<c_int>, second: Out<c_int>, third: Out<c_int>, id: i8) -> c_int [-1] {
        put_counts(id, DVec3::new(x, y, z), [first, second, third])
    }
    /// Converts encoder counts to joint angles, rad.
    fn dhdDeltaEncodersToJointAngles(first: c_int, second: c_int, third: c_int, a: Out<f64>, b: Out<f64>, c: Out<f64>, id: i8) -> c_int [-1] {
        read_expert(id, |_| put3([a, b, c], position([first, second, third]) / ARM_M))
    }
    /// Converts joint angles, rad, to encoder counts.
    fn dhdDeltaJointAnglesToEncoders(a: f64, b: f64, c: f64, first: Out<c_int>, second: Out<c_int>, third: Out<c_int>, id: i8) -> c_int [-1] {
        put_counts(id, DVec3::new(a, b, c) * ARM_M, [first, second, third])
    }
    /// Reads the joint angles of the base, rad.
    fn dhdGetDeltaJointAngles(a: Out<f64>, b: Out<f64>, c: Out<f64>, id: i8) -> c_int [-1] {
        read_expert(id, |open| put3([a, b, c], open.pose().0 / ARM_M))
    }
    /// Returns the Jacobian of the base, which is the same at all joint angles, m/rad.
    fn dhdDeltaJointAnglesToJacobian(_a: f64, _b: f64, _c: f64, jacobian: Out<f64>, id: i8) -> c_int [-1] {
        read_expert(id, |_| jacobian.put_all(&JACOBIAN))
    }
    /// Returns the Jacobian of the base, m/rad.
    fn dhdGetDeltaJacobian(jacobian: Out<f64>, id: i8) -> c_int [-1] { read_expert(id, |_| jacobian.put_all(&JACOBIAN)) }
    /// Returns the identity: the angles of the handle are the joints of the wrist.
    fn dhdGetWristJacobian(jacobian: Out<f64>, id: i8) -> c_int [-1] { read_expert(id, |_| jacobian.put_all(&WRIST_JACOBIAN)) }
    /// Returns an error: there are no joints to drive.
    fn dhdSetJointTorques(_torques: In<f64>, id: i8) -> c_int [-1] { result(expert(id).and(Err(Code::NotAvailable))) }
    /// Reads the joint angles of a nominal arm, 8 numbers, rad.
    fn dhdGetJointAngles(joints: Out<f64>, id: i8) -> c_int [-1] {
        read_expert(id, |open| {
            let (position_m, rows) = open.pose();
            let DVec3 { x, y, z } = position_m / ARM_M;
            let DVec3 { x: a, y: b, z: g } = angles(&rows);
            joints.put_all(&[x, y, z, a, b, g, 0.0, 0.0]);
        })
    }
    /// Reads the velocities of the nominal joints, 8 numbers, rad/s.
    fn dhdGetJointVelocities(joints: Out<f64>, id: i8) -> c_int [-1] {
        read_expert(id, |open| {
            let state = open.station.state();
            let DVec3 { x, y, z } = FRAME.of_flotor(state.velocity_m_per_s) / ARM_M;
            let DVec3 { x: a, y: b, z: g } = turning(open);
            joints.put_all(&[x, y, z, a, b, g, 0.0, 0.0]);
        })
    }
    /// Reads the smallest and the largest angles of the nominal joints, 8 numbers each, rad.
    fn dhdGetJointAngleRange(least: Out<f64>, most: Out<f64>, id: i8) -> c_int [-1] {
        read_expert(id, |open| {
            let DVec3 { x, y, z } = FRAME.of_flotor(open.station.range_m()).abs() / ARM_M;
            let range = [x, y, z, 0.2, 0.2, 0.2, 0.0, 0.0];
            least.put_all(&range.map(|joint| -joint));
            most.put_all(&range);
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_of_a_position_are_those_of_the_position_of_the_counts() {
        let position_m = DVec3::new(0.0123, -0.0456, 0.2);
        let [first, second, third] = counts(position_m).expect("in range");
        assert_eq!([first, second, third], [123_000, -456_000, 2_000_000]);
        assert!((position([first, second, third]) - position_m).length() < COUNT_M);
        assert_eq!(counts(DVec3::splat(300.0)), Err(Code::Geometry));
        assert_eq!(counts(DVec3::splat(f64::NAN)), Err(Code::Geometry));
    }
}
