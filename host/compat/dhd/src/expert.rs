//! Calls for experts: joints of a device that has none, watchdog, thresholds.

use crate::basic::read_expert;
use crate::device::expert;
use crate::error::{Code, DONE, failed, result};
use flotor_compat::pointer::{In, Out};
use flotor_hal::DVec3;
use std::ffi::{c_int, c_uchar, c_uint};

/// A nominal arm, m: its joint angles are displacements over its length.
const ARM_M: f64 = 0.2;
/// Effective mass and moment of inertia at the handle that a program may reckon with, kg and kg·m².
const INERTIA: [f64; 6] = [0.6, 0.6, 0.6, 0.004, 0.004, 0.004];
/// A unit of the watchdog, ns.
const WATCHDOG_NS: u64 = 125_000;

fn identity() -> [f64; 9] {
    [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
}

export! {
    /// Joint angles of a nominal arm, 8 numbers, rad.
    fn dhdGetJointAngles(joints: Out<f64>, id: i8) -> c_int [-1] {
        read_expert(id, |open| {
            let (position_m, rows) = open.pose();
            let DVec3 { x, y, z } = position_m / ARM_M;
            let DVec3 { x: a, y: b, z: g } = crate::basic::angles(&rows);
            joints.put_all(&[x, y, z, a, b, g, 0.0, 0.0]);
        })
    }
    /// 8 velocities of the same joints, rad/s.
    fn dhdGetJointVelocities(joints: Out<f64>, id: i8) -> c_int [-1] {
        read_expert(id, |open| {
            let state = open.station.state();
            let DVec3 { x, y, z } = crate::device::FRAME.of_flotor(state.velocity_m_per_s) / ARM_M;
            let DVec3 { x: a, y: b, z: g } = crate::basic::turning(open);
            joints.put_all(&[x, y, z, a, b, g, 0.0, 0.0]);
        })
    }
    /// 8 smallest and 8 largest angles of those joints, rad.
    fn dhdGetJointAngleRange(least: Out<f64>, most: Out<f64>, id: i8) -> c_int [-1] {
        read_expert(id, |open| {
            let DVec3 { x, y, z } = crate::device::FRAME.of_flotor(open.station.range_m()).abs() / ARM_M;
            let range = [x, y, z, 0.2, 0.2, 0.2, 0.0, 0.0];
            least.put_all(&range.map(|joint| -joint));
            most.put_all(&range);
        })
    }
    /// Effective mass at the handle: a diagonal matrix of 6 by 6, kg and kg·m².
    fn dhdJointAnglesToInertiaMatrix(_joints: In<f64>, inertia: Out<f64>, id: i8) -> c_int [-1] {
        read_expert(id, |_| {
            let mut matrix = [0.0; 36];
            matrix.iter_mut().step_by(7).zip(INERTIA).for_each(|(place, value)| *place = value);
            inertia.put_all(&matrix);
        })
    }
    /// Gravity loads no joint of a device that compensates it: 8 zeros.
    fn dhdJointAnglesToGravityJointTorques(_joints: In<f64>, torques: Out<f64>, _mask: c_uchar, id: i8) -> c_int [-1] {
        read_expert(id, |_| torques.put_all(&[0.0; 8]))
    }
    /// There are no joints to drive.
    fn dhdSetJointTorques(_torques: In<f64>, id: i8) -> c_int [-1] { result(expert(id).and(Err(Code::NotAvailable))) }
    /// The identity: the handle is its own joint.
    fn dhdGetDeltaJacobian(jacobian: Out<f64>, id: i8) -> c_int [-1] { read_expert(id, |_| jacobian.put_all(&identity())) }
    /// The same.
    fn dhdGetWristJacobian(jacobian: Out<f64>, id: i8) -> c_int [-1] { read_expert(id, |_| jacobian.put_all(&identity())) }
    /// How long a force is valid, in 125 µs; 0: as long as the scene says.
    fn dhdSetWatchdog(units: c_uchar, id: i8) -> c_int [-1] {
        read_expert(id, |open| {
            open.station.keep_valid_for(u64::from(units) * WATCHDOG_NS);
            open.device().watchdog = units;
        })
    }
    /// What was set.
    fn dhdGetWatchdog(units: Out<c_uchar>, id: i8) -> c_int [-1] { read_expert(id, |open| units.put(open.device().watchdog)) }
    /// Kept: the envelope limits velocity.
    fn dhdSetVelocityThreshold(threshold: c_uint, id: i8) -> c_int [-1] {
        read_expert(id, |open| open.device().velocity_threshold = threshold)
    }
    /// What was set.
    fn dhdGetVelocityThreshold(threshold: Out<c_uint>, id: i8) -> c_int [-1] {
        read_expert(id, |open| threshold.put(open.device().velocity_threshold))
    }
    /// What is read is always that of the last tick.
    fn dhdSetTimeGuard(microseconds: c_int, id: i8) -> c_int [-1] {
        if microseconds < -1 {
            return failed(Code::Invalid);
        }
        result(expert(id).map(|_| DONE))
    }
}
