//! Calibration of the vertical force: how much of a commanded force arrives, over the height of the handle.
//!
//! The coils of a levitation device sit in an uneven field, so the same current pushes differently at every
//! height. The thesis (Varadharajan 2007, section 3.4) measured 10.87 % over 14 mm and
//! corrected for it; this module does the same, and better where the thesis leaves something open:
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
//! the thesis's polynomial, as a baseline.
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
use flotor_session::RunError;

/// Why a calibration did not come about.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// The plugin was refused or refuses.
    #[error(transparent)]
    Plugin(#[from] LoadError),
    /// The plugin lacks the parameters of the simulated flotor.
    #[error("the plugin is not the simulated flotor: {0}")]
    Setting(#[from] SettingError),
    /// The handle lost contact with the sensor.
    #[error(
        "the handle lost contact with the force sensor at {height_mm:.1} mm and was braked; check that the sensor is above it and \
         held firmly"
    )]
    RanAway {
        /// Where, mm.
        height_mm: f64,
    },
    /// The force of a locked axis alternated between its limits, and the envelope took it away.
    #[error(
        "the force of a locked axis alternated between its limits, so it was taken away; check that the handle moves freely and that \
         the device is the one of the calibration"
    )]
    Oscillated,
    /// The sensor was not brought where it should be.
    #[error(
        "the handle rests at {height_mm:.2} mm instead of {target_mm:.2} mm; move the sensor, or raise the time limit \
         (--patience)"
    )]
    NotReached {
        /// Where it should rest, mm.
        target_mm: f64,
        /// Where it does, mm.
        height_mm: f64,
    },
    /// The plan asks for more than the device gives: what is cut off would be fitted as a loss.
    #[error(
        "the plan needs {command_n} N; device and host exert at most {most_n} N in a calibration: plan smaller forces (--force)"
    )]
    TooStrong {
        /// What the plan asks for, N.
        command_n: f64,
        /// The less of what the device declares and the host's ceiling, N.
        most_n: f64,
    },
    /// The device cut off what was commanded.
    #[error(
        "the device exerts less than the {command_n} N of the plan at {height_mm:.1} mm (it is saturated): plan smaller forces \
         (--force)"
    )]
    Saturated {
        /// What was commanded, N.
        command_n: f64,
        /// Where, mm.
        height_mm: f64,
    },
    /// Somebody stopped it.
    #[error("calibration aborted; handle lowered, no file written")]
    BrokenOff,
    /// There is no thread to hold the handle.
    #[error("cannot start the holding controller thread: {0}")]
    NoThread(std::io::Error),
    /// A rule that holds for every program that drives a device.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The device refuses to run or to be calibrated.
    #[error("device refused: {0}")]
    Refused(Refusal),
    /// The device faulted.
    #[error("device fault: {}", .0.advice())]
    Fault(Fault),
    /// The handle did not come to rest.
    #[error("at {height_mm:.1} mm the handle still moves by {moved_um:.0} µm; check the sensor's stand")]
    Restless {
        /// Where, mm.
        height_mm: f64,
        /// How much, µm.
        moved_um: f64,
    },
    /// The force sensor does not say how large the force is.
    #[error("fault of the force sensor: {}", .0.advice())]
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
    #[error("invalid calibration: {0}")]
    Implausible(#[from] InvalidCalibration),
}
