//! Largest stiffness that a hand feels, and the largest wrench.

use flotor_hal::Wrench;
use std::fmt;

/// Stiffness of the virtual coupling between handle and tool: the largest stiffness felt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling {
    stiffness_n_per_m: f64,
    stiffness_nm_per_rad: f64,
}

impl Coupling {
    /// A coupling that does not yield: no stiffness is reduced.
    pub const RIGID: Self = Self { stiffness_n_per_m: f64::INFINITY, stiffness_nm_per_rad: f64::INFINITY };

    /// Creates a coupling; an infinite stiffness does not yield (rotation of a device without torques). Not real-time.
    ///
    /// # Errors
    /// If a stiffness is not above 0.
    pub fn new(stiffness_n_per_m: f64, stiffness_nm_per_rad: f64) -> Result<Self, NotPositive> {
        check("stiffness_n_per_m", stiffness_n_per_m)?;
        check("stiffness_nm_per_rad", stiffness_nm_per_rad)?;
        Ok(Self { stiffness_n_per_m, stiffness_nm_per_rad })
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
    /// Creates limits of the magnitudes of force and torque. Not real-time.
    ///
    /// # Errors
    /// If a limit is not above 0.
    pub fn new(force_n: f64, torque_nm: f64) -> Result<Self, NotPositive> {
        check("force_n", force_n)?;
        check("torque_nm", torque_nm)?;
        Ok(Self { force_n, torque_nm })
    }

    /// Returns the wrench with force and torque shortened to the limits. Real-time: bounded, no allocation.
    pub(crate) fn limit(&self, wrench: Wrench) -> Wrench {
        // The division may round up: one unit in the last place less is never above the limit.
        let shortened = |vector: flotor_hal::DVec3, longest: f64| {
            let length = vector.length();
            if length <= longest {
                vector
            } else {
                vector * ((longest / length) * (1.0 - 4.0 * f64::EPSILON))
            }
        };
        Wrench::new(shortened(wrench.force(), self.force_n), shortened(wrench.torque(), self.torque_nm))
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

/// Accepts numbers above 0, and no NaN.
pub(crate) fn check(field: &'static str, number: f64) -> Result<(), NotPositive> {
    if number > 0.0 { Ok(()) } else { Err(NotPositive { field }) }
}
