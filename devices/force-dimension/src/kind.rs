//! Ranges and limits of the devices, by the type number of the SDK.
//!
//! Checked against CHAI3D (`CDeltaDevices.cpp`, BSD): type numbers 31 to 37, 60 to 64 and 104 to 107, 12 N of an omega.3 and 20 N
//! of a delta.3. Deviations: CHAI3D treats type 31 as an early delta and allows 0.2 N·m for a delta.6 (61, 62, 64); the limits
//! here are lower for these types. All other figures (workspace, continuous force and torque) are assumed to be the
//! manufacturer's, but were not compared with data sheets; a scene's `[limits]` can lower the limits.

use crate::dhd::Gripper;
use flotor_hal::{GripAxis, GripKind};
use std::f64::consts::PI;

/// Largest gap of a gripper, m, and largest force, N: the maker's figures of an omega.7 and a sigma.7, not verified.
const GAP_M: f64 = 0.025;
const GRIPPER_N: f64 = 8.0;

/// Returns the grip of a device, with its largest force, N; 0: sensed only.
pub(crate) const fn grip_axis(force_n: f64) -> GripAxis {
    // From zero to the maximum in a millisecond, as the other motors.
    GripAxis::new(GripKind::Linear, [0.0, GAP_M], force_n).with_slew(GRIPPER_N * 1.0e3)
}

/// Returns the largest force of a gripper, N.
pub(crate) const fn gripper_n(gripper: Gripper) -> f64 {
    match gripper {
        Gripper::Driven => GRIPPER_N,
        Gripper::None | Gripper::Sensed => 0.0,
    }
}

/// Range and limits of a device type.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Kind {
    /// Half-extents of the workspace to the right, away from the user, and up, m.
    pub(crate) range_m: [f64; 3],
    /// Largest rotation about any axis, rad.
    pub(crate) range_rad: f64,
    /// Largest force in any direction, N.
    pub(crate) force_n: f64,
    /// Largest torque about any axis, N·m; 0: no driven wrist, or unknown.
    pub(crate) torque_nm: f64,
}

const OMEGA: Kind = Kind { range_m: [0.08, 0.055, 0.08], range_rad: PI, force_n: 12.0, torque_nm: 0.0 };
const DELTA: Kind = Kind { range_m: [0.2, 0.13, 0.2], range_rad: PI, force_n: 20.0, torque_nm: 0.0 };
const SIGMA: Kind = Kind { range_m: [0.095, 0.065, 0.095], range_rad: 1.2, force_n: 20.0, torque_nm: 0.4 };
const LAMBDA: Kind = Kind { range_m: [0.12, 0.085, 0.12], range_rad: 1.2, force_n: 20.0, torque_nm: 0.2 };
const FALCON: Kind = Kind { range_m: [0.05, 0.05, 0.05], range_rad: PI, force_n: 8.0, torque_nm: 0.0 };

impl Kind {
    /// Returns the entry of a type number; an unknown type gets the range of an omega, and the lowest limits of force and torque.
    pub(crate) fn of_number(number: i32) -> Self {
        match number {
            60 => FALCON,
            61..=64 => DELTA,
            104..=107 => SIGMA,
            206 => Self { torque_nm: 0.0, ..SIGMA },
            108 | 109 | 131 | 132 => LAMBDA,
            203 => Self { torque_nm: 0.0, ..LAMBDA },
            31..=37 => OMEGA,
            _ => Self { force_n: FALCON.force_n, ..OMEGA },
        }
    }
}
