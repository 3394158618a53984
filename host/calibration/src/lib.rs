//! Calibration of the vertical force: how much of a commanded force arrives, over the height of the handle.
//!
//! The coils of a levitation device sit in an uneven field, so the same current pushes differently at every
//! height. The report this framework follows measured 10.87 % over 14 mm (Varadharajan 2007, section 3.4) and
//! corrected for it; this module does the same, and better where the report left something open:
//!
//! | | report | here |
//! |---|---|---|
//! | what is corrected | the spring's force | the total command, gravity compensation included |
//! | error per newton | an offset in N, divided by the feed-forward | a share, fitted over two commanded forces |
//! | weight of the moving part | weighed apart | fitted along, and shown |
//! | degree of the polynomial | two | chosen by cross-validation, with the scores shown |
//! | how good it is | not said | residual, 95 % band, and the error measured again afterwards |
//!
//! Data flows one way: [`rig`] (device and force [`sensor`]) -> [`procedure`] (readings) -> [`fit`] (polynomial) ->
//! [`flotor_session::calibration_file`] (what is kept) -> the device; [`verify`] asks the device again, [`picture`] draws it. [`thesis`] is
//! the report's polynomial, as a baseline.
//!
//! Not real-time, but for the thread that holds the handle in the rig.

pub mod cli;
pub mod fit;
mod least_squares;
pub mod picture;
pub mod procedure;
pub mod rig;
pub mod sensor;
pub mod thesis;
pub mod verify;

#[cfg(test)]
mod tests;

use flotor_hal::abi::loader::{LoadError, SettingError};
use flotor_hal::{Fault, InvalidCalibration, Refusal};

/// Why a calibration did not come about.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// The plugin was refused or refuses.
    #[error(transparent)]
    Plugin(#[from] LoadError),
    /// The plugin does not understand what the rig asks of a simulated flotor.
    #[error("the plugin is no simulated flotor: {0}")]
    Setting(#[from] SettingError),
    /// Nothing held the handle.
    #[error(
        "at {height_mm:.1} mm the handle flew off and was braked; is the force sensor above it, and held firmly?"
    )]
    RanAway {
        /// Where, mm.
        height_mm: f64,
    },
    /// The sensor was not brought where it should be.
    #[error(
        "the handle rests at {height_mm:.2} mm and not at {target_mm:.2} mm; move the sensor, or wait longer (--patience)"
    )]
    NotReached {
        /// Where it should rest, mm.
        target_mm: f64,
        /// Where it does, mm.
        height_mm: f64,
    },
    /// The plan asks for more than the device gives: what is cut off would be fitted as a loss.
    #[error("the plan pushes with {command_n} N, the device gives {most_n} N at most; plan smaller forces")]
    TooStrong {
        /// What the plan asks for, N.
        command_n: f64,
        /// What the device declares, N.
        most_n: f64,
    },
    /// Somebody stopped it.
    #[error("stopped before it was done: the handle was let down, nothing was written")]
    BrokenOff,
    /// There is no thread to hold the handle.
    #[error("cannot hold the handle beside measuring: {0}")]
    NoThread(std::io::Error),
    /// The device refuses to run or to be calibrated.
    #[error("the device refuses: {0}")]
    Refused(Refusal),
    /// The device faulted.
    #[error("the device faulted: {}", .0.advice())]
    Fault(Fault),
    /// The handle did not come to rest.
    #[error("at {height_mm:.1} mm the handle still moves by {moved_um:.0} µm; is the sensor's stand firm?")]
    Restless {
        /// Where, mm.
        height_mm: f64,
        /// How much, µm.
        moved_um: f64,
    },
    /// The force sensor does not say how large the force is.
    #[error("the force sensor faulted: {}", .0.advice())]
    Sensor(Fault),
    /// The readings do not determine a curve.
    #[error("{readings} readings at {heights} heights and {forces} forces are too few: {needed}")]
    TooFew {
        /// Number of readings.
        readings: usize,
        /// Number of different heights.
        heights: usize,
        /// Number of different commanded forces.
        forces: usize,
        /// What is needed.
        needed: &'static str,
    },
    /// The fitted curve is no calibration.
    #[error("the fit is no calibration: {0}")]
    Implausible(#[from] InvalidCalibration),
}
