//! Calibration of the vertical force: ratio of delivered to commanded force over the height of the handle.
//!
//! The coils of a levitation device are in an uneven field, so the force of one current depends on the height. The
//! thesis (Varadharajan 2007, section 3.4) measured 10.87 % over 14 mm and corrected for it; this module does the same,
//! with improvements where the thesis is incomplete:
//!
//! | | thesis | here |
//! |---|---|---|
//! | what is corrected | the spring's force | the total command, gravity compensation included |
//! | error per newton | an offset in N, divided by the feed-forward | a ratio, fitted over two commanded forces |
//! | weight of the moving part | weighed separately | fitted together, and reported |
//! | degree of the polynomial | two | chosen by cross-validation, with the scores reported |
//! | quality | not reported | residual, 95 % band, and the error measured again afterwards |
//!
//! Data flows one way: [`rig`] (device and force [`sensor`]) -> [`procedure`] (readings) -> [`fit`] (polynomial) ->
//! [`flotor_session::calibration_file`] (stored file) -> the device. [`verify`] measures the device again, [`picture`]
//! draws the result. [`thesis`] is the thesis's polynomial, as a baseline.
//!
//! Not real-time, apart from the thread that holds the handle in the rig.

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

use flotor_hal::{Fault, InvalidCalibration, Refusal};
use flotor_loader::{LoadError, SettingError};
use flotor_session::{RunError, THREAD_ADVICE};

/// Failure of a calibration.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// The plugin cannot be loaded, or rejects a call.
    #[error(transparent)]
    Plugin(#[from] LoadError),
    /// The plugin lacks the parameters of the simulated flotor.
    #[error("the plugin `simulated` is not that of this version (`flotor plugins` shows its file): {0}")]
    Setting(#[from] SettingError),
    /// The handle lost contact with the sensor.
    #[error(
        "the handle lost contact with the force sensor at {height_mm:.1} mm and was braked; check that the sensor \
         is above the handle and firmly mounted"
    )]
    LostContact {
        /// Height of the handle, mm.
        height_mm: f64,
    },
    /// The force of a locked axis alternated between its limits, and the envelope removed it.
    #[error(
        "the force of a locked axis alternated between its limits, so the host removed the force; check that the \
         handle moves freely and that the calibration file belongs to this device"
    )]
    Oscillated,
    /// The handle did not come to rest at the requested height in time.
    #[error(
        "the handle did not come to rest at {target_mm:.2} mm within the time limit, but is at {height_mm:.2} mm; move the \
         sensor there and hold it still, or raise the limit (--patience)"
    )]
    NotReached {
        /// Requested height, mm.
        target_mm: f64,
        /// Actual height, mm.
        height_mm: f64,
    },
    /// The plan needs more force than the device exerts; the missing part would be fitted as a loss.
    #[error(
        "the plan needs {command_n} N; device and host exert at most {most_n} N in a calibration: plan smaller forces (--force)"
    )]
    TooStrong {
        /// Force that the plan needs, N.
        command_n: f64,
        /// Lower of the device's declared limit and the host's limit, N.
        most_n: f64,
    },
    /// The device limited the commanded force.
    #[error(
        "the device exerts only {delivered_n:.2} N of the planned {command_n} N at {height_mm:.1} mm, because it is saturated; \
         plan smaller forces (--force)"
    )]
    Saturated {
        /// Commanded force, N.
        command_n: f64,
        /// Delivered force, N.
        delivered_n: f64,
        /// Height of the handle, mm.
        height_mm: f64,
    },
    /// The user stopped the calibration.
    #[error("the calibration was aborted; the handle was lowered, and no file was written")]
    Aborted,
    /// The thread that holds the handle cannot be started.
    #[error("cannot start the thread of the holding controller: {0}; {THREAD_ADVICE}")]
    NoThread(std::io::Error),
    /// The emergency-stop latch is pressed, or the watchdog process cannot be started as required.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The device rejects a parameter, activation or calibration.
    #[error("the device rejected the request: {0}")]
    Refused(Refusal),
    /// The force sensor has no parameter `port`, or rejects activation.
    #[error("the force sensor rejected the request: {0}")]
    SensorRefused(Refusal),
    /// The device was lost at a deactivation.
    #[error(
        "the device could not be deactivated between two measurements; check its connection and start again"
    )]
    Disconnected,
    /// The device faulted.
    #[error("device fault: {}", .0.advice())]
    Fault(Fault),
    /// The simulated handle did not come to rest.
    #[error(
        "at {height_mm:.1} mm the simulated handle does not come to rest: it moves by {moved_um:.0} µm; plan smaller forces \
         (--force), or correct the calibration file"
    )]
    NotAtRest {
        /// Height of the handle, mm.
        height_mm: f64,
        /// Residual motion, µm.
        moved_um: f64,
    },
    /// The force sensor faulted.
    #[error("fault of the force sensor: {}", .0.advice())]
    Sensor(Fault),
    /// The readings do not determine a curve.
    #[error(
        "the readings do not determine the curve (readings: {readings}, heights: {heights}, forces: {forces}): {needed}"
    )]
    TooFew {
        /// Number of readings.
        readings: usize,
        /// Number of different heights.
        heights: usize,
        /// Number of different commanded forces.
        forces: usize,
        /// Requirement in words.
        needed: String,
    },
    /// The fitted curve is not a valid calibration.
    #[error("invalid calibration: {0}")]
    Implausible(#[from] InvalidCalibration),
}
