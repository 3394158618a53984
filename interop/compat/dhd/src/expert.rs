//! Entry points of expert mode: watchdog, thresholds, inertia.

use crate::basic::read_expert;
use crate::device::expert;
use crate::error::{Code, DONE, failed, result};
use flotor_compat::export;
use flotor_compat::pointer::{In, Out};
use std::ffi::{c_int, c_uchar, c_uint};

/// Nominal effective mass and moment of inertia at the handle, kg and kg·m².
const INERTIA: [f64; 6] = [0.6, 0.6, 0.6, 0.004, 0.004, 0.004];
/// Unit of the watchdog, ns.
const WATCHDOG_NS: u64 = 125_000;

export! {
    /// Returns the nominal mass matrix at the handle: diagonal, 6 by 6, kg and kg·m².
    fn dhdJointAnglesToInertiaMatrix(_joints: In<f64>, inertia: Out<f64>, id: i8) -> c_int [-1] {
        read_expert(id, |_| {
            let mut matrix = [0.0; 36];
            matrix.iter_mut().step_by(7).zip(INERTIA).for_each(|(place, value)| *place = value);
            inertia.put_all(&matrix);
        })
    }
    /// Returns 8 zeros: gravity loads no joint of a device that compensates it.
    fn dhdJointAnglesToGravityJointTorques(_joints: In<f64>, torques: Out<f64>, _mask: c_uchar, id: i8) -> c_int [-1] {
        read_expert(id, |_| torques.put_all(&[0.0; 8]))
    }
    /// Sets the time after which a force without a newer one expires, in units of 125 µs; 0: as in the scene.
    fn dhdSetWatchdog(units: c_uchar, id: i8) -> c_int [-1] {
        read_expert(id, |open| {
            open.station.set_validity(u64::from(units) * WATCHDOG_NS);
            open.device().watchdog = units;
        })
    }
    /// Returns the setting of [`dhdSetWatchdog`].
    fn dhdGetWatchdog(units: Out<c_uchar>, id: i8) -> c_int [-1] { read_expert(id, |open| units.put(open.device().watchdog)) }
    /// Stores the threshold without effect: the envelope limits velocity.
    fn dhdSetVelocityThreshold(threshold: c_uint, id: i8) -> c_int [-1] {
        read_expert(id, |open| open.device().velocity_threshold = threshold)
    }
    /// Returns the stored threshold.
    fn dhdGetVelocityThreshold(threshold: Out<c_uint>, id: i8) -> c_int [-1] {
        read_expert(id, |open| threshold.put(open.device().velocity_threshold))
    }
    /// Checks the argument without effect: samples are always those of the last tick.
    fn dhdSetTimeGuard(microseconds: c_int, id: i8) -> c_int [-1] {
        if microseconds < -1 {
            return failed(Code::Invalid);
        }
        result(expert(id).map(|_| DONE))
    }
}
