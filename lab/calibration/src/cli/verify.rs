//! `flotor calibrate verify`: error of the vertical force without and with a calibration file.

use super::rig::RigArguments;
use super::{FORCES_N, refused};
use crate::procedure::{Plan, measure};
use crate::verify::{ErrorCurve, PROBE_N};
use clap::Args;
use flotor_command::options::{JsonOption, number};
use flotor_command::{CommandError, print_result, progress_bar, style};
use flotor_hal::VerticalCalibration;
use flotor_session::calibration_file::{CalibratedDevice, CalibrationFile, CalibrationFileError};
use serde::Serialize;
use std::path::PathBuf;

/// Measure the error without and with a calibration file.
#[derive(Args)]
#[command(after_help = "Examples:\n  flotor calibrate verify calibration.toml --simulated\n  \
    flotor calibrate verify mine.toml --device maglev --set transport=usb --sensor /dev/ttyUSB0")]
pub(super) struct VerifyArguments {
    /// Calibration file to verify
    file: PathBuf,
    #[command(flatten)]
    rig: RigArguments,
    /// Commanded vertical force in N
    #[arg(long, value_name = "N", default_value_t = PROBE_N, conflicts_with = "simulated", value_parser = number("N", "force", FORCES_N), allow_hyphen_values = true)]
    force: f64,
    #[command(flatten)]
    json: JsonOption,
}

/// JSON output of `verify`.
#[derive(Serialize)]
struct VerifyReport {
    error_before_percent: f64,
    error_after_percent: f64,
}

pub(super) fn run(arguments: &VerifyArguments) -> Result<(), CommandError> {
    let (file, calibration) = CalibrationFile::load(&arguments.file).map_err(usage)?;
    let [before, after] = if arguments.rig.simulated {
        simulated(arguments, &file, calibration)?
    } else {
        device(arguments, &file, &calibration)?
    };
    let report = VerifyReport { error_before_percent: before, error_after_percent: after };
    let title = style::title("error of the vertical force over all heights, peak to peak");
    let text = || format!("{title}\n  without {before:>8.3} %\n  with    {after:>8.3} %");
    print_result(arguments.json.file(), &report, text)
}

fn usage(error: CalibrationFileError) -> CommandError {
    CommandError::Usage(error.to_string())
}

/// Checks that the file belongs to the device, before anything moves.
fn check(
    arguments: &VerifyArguments,
    file: &CalibrationFile,
    device: &CalibratedDevice,
) -> Result<(), CommandError> {
    let path = arguments.file.display().to_string();
    file.check_device(&path, &device.plugin, &device.serial).map_err(usage)
}

fn simulated(
    arguments: &VerifyArguments,
    file: &CalibrationFile,
    calibration: VerticalCalibration,
) -> Result<[f64; 2], CommandError> {
    let mut rig = arguments.rig.simulated_rig()?;
    check(arguments, file, &rig.device().map_err(refused)?)?;
    let progress = progress_bar(2 * ErrorCurve::HEIGHTS, "{percent:>3} %  {wide_bar}");
    let mut error = |calibration| {
        rig.calibrate(calibration);
        let curve = ErrorCurve::measure(&mut rig, &|_| PROBE_N, || progress.inc(1)).map_err(refused)?;
        Ok::<f64, CommandError>(curve.error_percent())
    };
    let errors = [error(None)?, error(Some(calibration))?];
    progress.finish_and_clear();
    Ok(errors)
}

fn device(
    arguments: &VerifyArguments,
    file: &CalibrationFile,
    calibration: &VerticalCalibration,
) -> Result<[f64; 2], CommandError> {
    let plan = Plan { forces_n: vec![arguments.force], runs: 1, ..Plan::thesis() };
    let (mut rig, progress) = arguments.rig.device_rig(2 * plan.stops())?;
    check(arguments, file, rig.device())?;
    rig.check(&plan).map_err(refused)?;
    let mut errors = [0.0; 2];
    for (error, calibration) in errors.iter_mut().zip([&VerticalCalibration::NONE, calibration]) {
        rig.calibrate(calibration).map_err(refused)?;
        let readings = measure(&mut rig, &plan, || progress.inc(1)).map_err(refused)?;
        // The weight of the moving part shifts all readings equally and cancels in the difference.
        *error = ErrorCurve::of_readings(&readings, 0.0).error_percent();
    }
    progress.finish_and_clear();
    Ok(errors)
}
