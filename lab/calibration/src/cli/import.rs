//! `flotor calibrate import`: calibration file from an existing polynomial.

use super::{FORCES_N, provenance, write_calibration};
use crate::thesis;
use clap::Args;
use flotor_command::CommandError;
use flotor_command::options::{new_file, number, real};
use flotor_command::say;
use flotor_hal::InvalidCalibration;
use flotor_session::calibration_file::{
    CalibratedDevice, CalibrationFile, FORMAT, Quality, Source, VerticalCurve,
};
use std::path::PathBuf;

/// Write a calibration file from the polynomial of the thesis, or from given coefficients.
#[derive(Args)]
#[command(
    after_help = "The excess p(z) = c0 + c1 z + c2 z² ... in N (z in mm) was measured at a commanded force F; \
    the file stores the ratio 1 + p / F. Without --excess, the command uses the polynomial of CMU-RI-TR-07-21.\n\n\
    Examples:\n  \
    flotor calibrate import --out thesis.toml\n  \
    flotor calibrate import --excess 0.19,-0.026,-0.0045 --at 10 --device maglev --out mine.toml"
)]
pub(super) struct ImportArguments {
    /// Polynomial of the excess force over the height z in mm: up to 8 coefficients, of 1, z, z² ... in N, N/mm, N/mm² ...
    /// (default: the polynomial of the thesis)
    #[arg(long, value_name = "C0,C1,...", value_delimiter = ',', value_parser = real, allow_hyphen_values = true)]
    excess: Vec<f64>,
    /// Commanded force at which the excess was measured, in N
    #[arg(long, default_value = "10", value_name = "N", value_parser = number("N", "force", FORCES_N))]
    at: f64,
    /// Lowest and highest measured height, in mm
    #[arg(long, value_name = "FROM,TO", default_value = "-7,7", value_parser = heights_mm, allow_hyphen_values = true)]
    range_mm: [f64; 2],
    /// Id of the device's plugin
    #[arg(long, default_value = "simulated", value_name = "ID")]
    device: String,
    /// Serial number of the device (default: the file is valid for every serial number)
    #[arg(long, value_name = "TEXT")]
    serial: Option<String>,
    /// Calibration file to write
    #[arg(long, value_parser = new_file, value_name = "FILE.toml")]
    out: PathBuf,
}

fn heights_mm(text: &str) -> Result<[f64; 2], String> {
    let ends = text.split(',').map(real).collect::<Result<Vec<_>, _>>()?;
    ends.try_into().map_err(|_| "write FROM,TO, such as -7,7".to_owned())
}

pub(super) fn run(arguments: &ImportArguments) -> Result<(), CommandError> {
    let ImportArguments { excess, at, range_mm, device, serial, out } = arguments;
    let from_report = excess.is_empty();
    let excess = if from_report { &thesis::POLYNOMIAL_N_PER_MM[..] } else { excess };
    let mut coefficients: Vec<f64> = excess.iter().map(|coefficient| coefficient / at).collect();
    if let Some(first) = coefficients.first_mut() {
        *first += 1.0;
    }
    let vertical = VerticalCurve { range_mm: *range_mm, coefficients_per_mm: coefficients };
    vertical.calibration().map_err(|invalid| {
        CommandError::Usage(match invalid {
            InvalidCalibration::Range(_) => {
                let [from, to] = range_mm;
                format!(
                    "--range-mm {from},{to}: write two heights within 1000 mm of the centre, the lower first"
                )
            }
            InvalidCalibration::Count(_) => format!("--excess: {invalid}"),
            InvalidCalibration::Share { height_m, share } => format!(
                "the ratio of delivered to commanded force is {share} at {:.3} mm, but must be between 0.5 and 2; correct \
                 --excess, --at or --range-mm",
                height_m * 1.0e3
            ),
        })
    })?;
    let note = if from_report {
        format!("CMU-RI-TR-07-21, section 3.4, taken at a commanded force of {at} N")
    } else {
        format!("excess in N at a commanded force of {at} N")
    };
    let file = CalibrationFile {
        format: FORMAT,
        device: CalibratedDevice { plugin: device.clone(), serial: serial.clone().unwrap_or_default() },
        vertical,
        quality: Quality::default(),
        provenance: provenance(Source::Imported, Some(note)),
    };
    write_calibration(out, &file)?;
    say!("written: {}", out.display());
    Ok(())
}
