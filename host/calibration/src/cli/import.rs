//! `flotor calibrate import`: somebody else's numbers as a calibration file.

use super::{force_n, provenance, write_calibration};
use crate::thesis;
use clap::Args;
use flotor_command::CommandError;
use flotor_command::say;
use flotor_session::calibration_file::{
    CalibratedDevice, CalibrationFile, FORMAT, Quality, Source, VerticalCurve,
};
use std::path::PathBuf;

/// Write a calibration file from the thesis's polynomial, or from any other.
#[derive(Args)]
#[command(
    after_help = "The excess p(z) = c0 + c1 z + c2 z² ... in N (z in mm) was measured at a commanded force F; \
    the file stores the\nratio 1 + p / F. Without --excess, the command uses the polynomial of CMU-RI-TR-07-21.\n\n\
    Examples:\n  \
    flotor calibrate import --out thesis.toml\n  \
    flotor calibrate import --excess 0.19,-0.026,-0.0045 --at 10 --device maglev --serial 7 --out mine.toml"
)]
pub(super) struct ImportArguments {
    /// Coefficients of 1, z, z² ... in N, N/mm, N/mm² ...
    #[arg(long, value_name = "C0,C1,...", value_delimiter = ',', allow_hyphen_values = true)]
    excess: Vec<f64>,
    /// Commanded force of the measured excess, in N
    #[arg(long, default_value = "10", value_name = "N", value_parser = force_n)]
    at: f64,
    /// Lowest and highest measured height, in mm
    #[arg(
        long,
        value_name = "FROM,TO",
        value_delimiter = ',',
        num_args = 2,
        default_value = "-7,7",
        allow_hyphen_values = true
    )]
    range_mm: Vec<f64>,
    /// Id of the device's plugin
    #[arg(long, default_value = "simulated", value_name = "ID")]
    device: String,
    /// Serial number of the device (default: valid for all)
    #[arg(long, default_value = "", value_name = "TEXT")]
    serial: String,
    /// Calibration file to write
    #[arg(long, value_name = "FILE.toml")]
    out: PathBuf,
}

pub(super) fn run(arguments: &ImportArguments) -> Result<(), CommandError> {
    let ImportArguments { excess, at, range_mm, device, serial, out } = arguments;
    let from_report = excess.is_empty();
    let excess = if from_report { &thesis::POLYNOMIAL_N_PER_MM[..] } else { excess };
    let mut coefficients: Vec<f64> = excess.iter().map(|coefficient| coefficient / at).collect();
    if let Some(first) = coefficients.first_mut() {
        *first += 1.0;
    }
    let range_mm = [range_mm.first(), range_mm.get(1)].map(|end| end.copied().unwrap_or(f64::NAN));
    let vertical = VerticalCurve { range_mm, coefficients_per_mm: coefficients };
    vertical
        .calibration()
        .map_err(|invalid| CommandError::Usage(format!("invalid polynomial: {invalid}")))?;
    let note = if from_report {
        format!("CMU-RI-TR-07-21, section 3.4, taken at a commanded force of {at} N")
    } else {
        format!("excess in N at a commanded force of {at} N")
    };
    let file = CalibrationFile {
        format: FORMAT,
        device: CalibratedDevice { plugin: device.clone(), serial: serial.clone() },
        vertical,
        quality: Quality::default(),
        provenance: provenance(Source::Imported, Some(note)),
    };
    write_calibration(out, &file)?;
    say!("written: {}", out.display());
    Ok(())
}
