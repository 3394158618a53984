//! Rig: a levitated handle that pushes against a force sensor from below.
//!
//! The controller locks all axes but the vertical. Vertically it commands a constant force, larger than the weight, so
//! that the handle follows the sensor. The sensor reads the delivered force less the weight of the moving part.

mod device;
mod holder;
mod simulated;

pub use device::{DeviceRig, RigOptions, Waiting};
pub use simulated::{RIG_WEIGHT_N, SENSOR_NOISE_N, SimulatedRig};

use super::CalibrationError;
use flotor_hal::{DVec3, DeviceState, Wrench, rotation_vector};

/// Handle at rest against the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rest {
    /// Height as measured by the device, m.
    pub height_m: f64,
    /// Delivered vertical force as reported by the device, N.
    pub delivered_n: f64,
}

/// Device with a force sensor above it.
pub trait Rig {
    /// Moves the sensor, or waits until a person has moved it, so that the handle rests at `target_m` under the command
    /// `command_n` (N, for a height in m).
    ///
    /// # Errors
    /// [`CalibrationError`] if the device faults, is saturated or too weak, if the handle does not come to rest at the target,
    /// or if the user aborts.
    fn rest_at(&mut self, target_m: f64, command_n: &dyn Fn(f64) -> f64) -> Result<Rest, CalibrationError>;

    /// Returns a reading of the force sensor while the handle is at `rest`, N: delivered force less the weight of the
    /// moving part.
    ///
    /// # Errors
    /// [`CalibrationError`] if the sensor does not answer or faults, or if the device faults.
    fn read_force_n(&mut self, rest: &Rest) -> Result<f64, CalibrationError>;

    /// Returns true if the handle has stayed at `rest` during all readings so far; always true in a simulation.
    ///
    /// # Errors
    /// [`CalibrationError`] if the device faults.
    fn still_rests(&mut self, rest: &Rest) -> Result<bool, CalibrationError> {
        let _ = rest;
        Ok(true)
    }
}

/// Servo period, ns.
const PERIOD_NS: u64 = 1_000_000;
/// Number of ticks averaged for a measured height: the noise of a micrometre falls to a tenth.
const AVERAGED_TICKS: u64 = 100;
/// Gains of a locked axis (from the client of the device's maker: 4800 N/m, 15 N s/m; 50 N·m/rad, 0.15 N·m s/rad).
const LOCK_N_PER_M: f64 = 4800.0;
const LOCK_NS_PER_M: f64 = 15.0;
const LOCK_NM_PER_RAD: f64 = 50.0;
const LOCK_NMS_PER_RAD: f64 = 0.15;

/// Returns the wrench that holds every axis but the vertical at home, with the vertical force as commanded.
fn locked(state: &DeviceState, vertical_n: f64) -> Wrench {
    let (position_m, rotation_rad) = (state.pose.position(), rotation_vector(state.pose.orientation()));
    let force_n = position_m * -LOCK_N_PER_M - state.twist.linear() * LOCK_NS_PER_M;
    let torque_nm: DVec3 = rotation_rad * -LOCK_NM_PER_RAD - state.twist.angular() * LOCK_NMS_PER_RAD;
    Wrench::new(force_n.with_z(vertical_n), torque_nm)
}

/// Running mean.
#[derive(Default)]
struct Mean {
    sum: f64,
    count: f64,
}

impl Mean {
    fn add(&mut self, value: f64) {
        self.sum += value;
        self.count += 1.0;
    }

    fn value(&self) -> f64 {
        self.sum / self.count
    }
}
