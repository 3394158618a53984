//! Limits of the rendered stiffness and wrench.

use flotor_hal::Wrench;
use std::fmt;

/// Stiffness of the virtual coupling between handle and tool: the largest stiffness felt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling {
    stiffness_n_per_m: f64,
    stiffness_nm_per_rad: f64,
}

impl Coupling {
    /// Rigid coupling: no stiffness is reduced.
    pub const RIGID: Self = Self { stiffness_n_per_m: f64::INFINITY, stiffness_nm_per_rad: f64::INFINITY };

    /// Creates a coupling; an infinite stiffness is rigid (rotation of a device without torques). Not real-time.
    ///
    /// # Errors
    /// If a stiffness is not above 0.
    pub fn new(stiffness_n_per_m: f64, stiffness_nm_per_rad: f64) -> Result<Self, NotPositive> {
        check("stiffness_n_per_m", stiffness_n_per_m)?;
        check("stiffness_nm_per_rad", stiffness_nm_per_rad)?;
        Ok(Self { stiffness_n_per_m, stiffness_nm_per_rad })
    }

    pub(crate) fn stiffness_n_per_m(&self) -> f64 {
        self.stiffness_n_per_m
    }

    /// Returns the square roots of the compliances of translation and rotation.
    pub(crate) fn root_compliances(&self) -> [f64; 2] {
        [self.stiffness_n_per_m, self.stiffness_nm_per_rad].map(|stiffness| (1.0 / stiffness).sqrt())
    }
}

/// Largest force and torque that a solve returns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    force_n: f64,
    torque_nm: f64,
}

impl Limits {
    /// Creates limits of the magnitudes of force and torque; the torque's is 0 for a device without torques. Not real-time.
    ///
    /// # Errors
    /// If the limit of the force is not above 0, or that of the torque below 0.
    pub fn new(force_n: f64, torque_nm: f64) -> Result<Self, NotPositive> {
        check("force_n", force_n)?;
        check("torque_nm", if torque_nm == 0.0 { 1.0 } else { torque_nm })?;
        Ok(Self { force_n, torque_nm })
    }

    /// Returns the wrench with force and torque scaled down to the limits, and true if one of them exceeded its limit; torque on
    /// a device without torques does not count. Real-time: bounded, no allocation.
    pub(crate) fn limit(&self, wrench: &Wrench) -> (Wrench, bool) {
        let [(force, is_weaker), (torque, is_looser)] =
            [(wrench.force(), self.force_n), (wrench.torque(), self.torque_nm)].map(|(vector, longest)| {
                let length = vector.length();
                // The division may round up: subtract some units in the last place, so that the result never exceeds the limit.
                let share = (longest / length) * (1.0 - 4.0 * f64::EPSILON);
                if length <= longest { (vector, false) } else { (vector * share, longest > 0.0) }
            });
        (Wrench::new(force, torque), is_weaker || is_looser)
    }
}

/// Error of a setting that has to be above 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotPositive {
    /// Name of the setting.
    pub field: &'static str,
}

impl fmt::Display for NotPositive {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}` is not above 0", self.field)
    }
}

impl std::error::Error for NotPositive {}

/// Accepts numbers above 0; rejects NaN.
pub(crate) fn check(field: &'static str, number: f64) -> Result<(), NotPositive> {
    if number > 0.0 { Ok(()) } else { Err(NotPositive { field }) }
}
