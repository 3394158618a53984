//! `flotor calibrate`: how much of the vertical force arrives, and what is done about it.

use super::{CommandError, run, style, write_json};
use crate::calibration::file::{
    CalibratedDevice, CalibrationFile, FORMAT, Provenance, Quality, Source, VerticalCurve, today,
};
use crate::calibration::fit::{Candidate, Fit, fit};
use crate::calibration::procedure::{Plan, measure};
use crate::calibration::rig::SimulatedRig;
use crate::calibration::verify::{ErrorCurve, PROBE_N};
use crate::calibration::{CalibrationError, picture, thesis};
use crate::registry::Registry;
use clap::{Args, Subcommand};
use flotor_hal::VerticalCalibration;
use flotor_hal::abi::PluginKind;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Calibrate a device: measure, check, or take over somebody else's numbers.
#[derive(Args)]
pub(crate) struct CalibrateArguments {
    #[command(subcommand)]
    command: CalibrateCommand,
}

#[derive(Subcommand)]
enum CalibrateCommand {
    /// Measure how much of the vertical force arrives at each height, and fit it
    Vertical(VerticalArguments),
    /// Measure the error without and with a calibration file
    Verify(VerifyArguments),
    /// Make a calibration file of the report's polynomial, or of any other
    Import(ImportArguments),
}

/// Measure how much of the vertical force arrives at each height, and fit it.
#[derive(Args)]
#[command(
    after_help = "The handle is locked in all axes but the vertical and pushes against a force sensor that \
    is lowered step by step.\n\nExamples:\n  \
    flotor calibrate vertical --simulated\n  \
    flotor calibrate vertical --simulated --out calibration.toml --plot calibration.svg\n  \
    flotor calibrate vertical --simulated --force 8,10,12,14 --steps 28 --step-mm 0.5 --json -"
)]
struct VerticalArguments {
    /// Calibrate the simulated flotor in a simulated rig (the only rig so far)
    #[arg(long, required = true)]
    simulated: bool,
    /// Commanded vertical forces in N, at least two
    #[arg(long, value_name = "N", value_delimiter = ',', default_value = "10,12", value_parser = force_n)]
    force: Vec<f64>,
    /// How often each force is measured over all heights
    #[arg(long, default_value_t = 2, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100))]
    runs: u32,
    /// Steps down from the top
    #[arg(long, default_value_t = 14, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=200))]
    steps: u32,
    /// Length of a step in mm
    #[arg(long, default_value_t = 1.0, value_name = "MM")]
    step_mm: f64,
    /// Readings of the force sensor at each height
    #[arg(long, default_value_t = 10, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    readings: u32,
    /// Seed of sensor noise
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// Write the calibration file
    #[arg(long, value_name = "FILE.toml")]
    out: Option<PathBuf>,
    /// Draw readings, fit, residuals and the error before and after
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// Write the result as JSON (- for standard output)
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Measure the error without and with a calibration file.
#[derive(Args)]
#[command(after_help = "Example:\n  flotor calibrate verify calibration.toml --simulated")]
struct VerifyArguments {
    /// The calibration file
    file: PathBuf,
    /// Ask the simulated flotor in a simulated rig (the only rig so far)
    #[arg(long, required = true)]
    simulated: bool,
    /// Seed of sensor noise
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// Write the result as JSON (- for standard output)
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Make a calibration file of the report's polynomial, or of any other.
#[derive(Args)]
#[command(
    after_help = "The excess p(z) = c0 + c1 z + c2 z² ... in N (z in mm) was measured at a commanded force F; \
    what is kept is the\nshare 1 + p / F. Without --excess, the polynomial of CMU-RI-TR-07-21 is taken.\n\n\
    Examples:\n  \
    flotor calibrate import --out thesis.toml\n  \
    flotor calibrate import --excess 0.19,-0.026,-0.0045 --at 10 --device maglev --serial 7 --out mine.toml"
)]
struct ImportArguments {
    /// Coefficients of 1, z, z² ... in N, N/mm, N/mm² ...
    #[arg(long, value_name = "C0,C1,...", value_delimiter = ',', allow_hyphen_values = true)]
    excess: Vec<f64>,
    /// Commanded force in N the excess was measured at
    #[arg(long, default_value = "10", value_name = "N", value_parser = force_n)]
    at: f64,
    /// Lowest and highest height in mm it was measured at
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
    /// Serial number of the device (default: fits every one)
    #[arg(long, default_value = "", value_name = "TEXT")]
    serial: String,
    /// Where to write the calibration file
    #[arg(long, value_name = "FILE.toml")]
    out: PathBuf,
}

/// The device that is calibrated in a simulated rig.
const SIMULATED: &str = "simulated";

pub(crate) fn run(arguments: &CalibrateArguments) -> Result<(), CommandError> {
    match &arguments.command {
        CalibrateCommand::Vertical(arguments) => vertical(arguments),
        CalibrateCommand::Verify(arguments) => verify(arguments),
        CalibrateCommand::Import(arguments) => import(arguments),
    }
}

/// What machines read of `vertical`.
#[derive(Serialize)]
struct VerticalReport<'a> {
    device: &'a str,
    serial: &'a str,
    error_before_percent: f64,
    error_after_percent: f64,
    rows: &'a [ErrorRow],
    degree: usize,
    range_mm: [f64; 2],
    coefficients_per_mm: &'a [f64],
    residual_n: f64,
    band_95_percent: f64,
    weight_n: f64,
    weight_95_n: f64,
    candidates: &'a [Candidate],
    readings: usize,
    seed: u64,
}

/// One correction, and the error it leaves.
#[derive(Clone, Debug, Serialize)]
struct ErrorRow {
    correction: &'static str,
    error_percent: f64,
}

/// Number of corrections that are compared.
const CORRECTIONS: u64 = 4;

/// A way to correct the force: by the device, by the command, or not at all.
struct Correction<'a> {
    name: &'static str,
    calibration: Option<VerticalCalibration>,
    command_n: &'a dyn Fn(f64) -> f64,
}

fn vertical(arguments: &VerticalArguments) -> Result<(), CommandError> {
    let VerticalArguments { force, runs, steps, step_mm, readings, seed, .. } = arguments;
    let half_mm = f64::from(*steps) * step_mm * 0.5;
    if !(*step_mm > 0.0 && half_mm <= 11.0) {
        return Err(CommandError::Usage(format!(
            "--steps {steps} of {step_mm} mm: the handle reaches 11 mm to either side"
        )));
    }
    let plan = Plan {
        forces_n: force.clone(),
        runs: *runs,
        top_m: half_mm * 1.0e-3,
        step_m: step_mm * 1.0e-3,
        steps: *steps,
        readings: *readings,
    };
    let mut rig = simulated_rig(*seed)?;
    let serial = rig.serial().map_err(refused)?;
    let progress =
        run::progress_bar(plan.stops() + CORRECTIONS * ErrorCurve::HEIGHTS, "{percent:>3} %  {wide_bar}");
    let readings = measure(&mut rig, &plan, || progress.inc(1)).map_err(refused)?;
    let fit = fit(&readings).map_err(refused)?;
    let report = thesis::calibration(force.iter().copied().fold(f64::INFINITY, f64::min));
    let report = report.map_err(|invalid| refused(invalid.into()))?;

    let uncorrected = |_: f64| PROBE_N;
    let as_report = |height_m: f64| thesis::command_n(PROBE_N, height_m);
    let corrections = [
        Correction { name: "none", calibration: None, command_n: &uncorrected },
        Correction { name: "report, spring force only", calibration: None, command_n: &as_report },
        Correction { name: "report, total command", calibration: Some(report), command_n: &uncorrected },
        Correction {
            name: "this fit, total command",
            calibration: Some(fit.calibration),
            command_n: &uncorrected,
        },
    ];
    let mut curves = Vec::new();
    for Correction { name, calibration, command_n } in corrections {
        rig.calibrate(calibration);
        curves.push((name, ErrorCurve::measure(&mut rig, command_n, || progress.inc(1)).map_err(refused)?));
    }
    progress.finish_and_clear();
    let rows: Vec<ErrorRow> = curves
        .iter()
        .map(|(correction, curve)| ErrorRow { correction, error_percent: curve.error_percent() })
        .collect();
    let error = |row: Option<&ErrorRow>| row.map_or(f64::NAN, |row| row.error_percent);
    let (before, after) = (error(rows.first()), error(rows.last()));

    if arguments.json.as_deref() != Some(Path::new("-")) {
        say!("{}", to_text(&fit, &rows, readings.len()));
    }
    let curve = VerticalCurve::of(&fit.calibration);
    if let Some(path) = &arguments.json {
        let report = VerticalReport {
            device: SIMULATED,
            serial: &serial,
            error_before_percent: before,
            error_after_percent: after,
            rows: &rows,
            degree: fit.degree,
            range_mm: curve.range_mm,
            coefficients_per_mm: &curve.coefficients_per_mm,
            residual_n: fit.residual_n,
            band_95_percent: fit.band_95_percent,
            weight_n: fit.weight_n[0],
            weight_95_n: fit.weight_n[1],
            candidates: &fit.candidates,
            readings: readings.len(),
            seed: *seed,
        };
        write_json(path, &report)?;
    }
    if let Some(path) = &arguments.plot {
        let curves: Vec<_> = curves.iter().map(|(name, curve)| (*name, curve)).collect();
        std::fs::write(path, picture::to_svg(&readings, &fit, &report, &curves))
            .map_err(|cause| CommandError::file(path, "cannot write the plot", cause))?;
    }
    if let Some(path) = &arguments.out {
        let file = CalibrationFile {
            format: FORMAT,
            device: CalibratedDevice { plugin: SIMULATED.to_owned(), serial },
            vertical: curve,
            quality: Quality {
                readings: u32::try_from(readings.len()).ok(),
                residual_n: Some(fit.residual_n),
                band_95_percent: Some(fit.band_95_percent),
                error_before_percent: Some(before),
                error_after_percent: Some(after),
                weight_n: Some(fit.weight_n[0]),
            },
            provenance: Provenance { seed: i64::try_from(*seed).ok(), ..provenance(Source::Measured, None) },
        };
        write_calibration(path, &file)?;
    }
    Ok(())
}

/// What machines read of `verify`.
#[derive(Serialize)]
struct VerifyReport {
    error_before_percent: f64,
    error_after_percent: f64,
}

fn verify(arguments: &VerifyArguments) -> Result<(), CommandError> {
    let usage =
        |error: crate::calibration::file::CalibrationFileError| CommandError::Usage(error.to_string());
    let (file, calibration) = CalibrationFile::load(&arguments.file).map_err(usage)?;
    let mut rig = simulated_rig(arguments.seed)?;
    let serial = rig.serial().map_err(refused)?;
    file.check_device(&arguments.file.display().to_string(), SIMULATED, &serial).map_err(usage)?;
    let progress = run::progress_bar(2 * ErrorCurve::HEIGHTS, "{percent:>3} %  {wide_bar}");
    let mut error = |calibration| {
        rig.calibrate(calibration);
        let curve = ErrorCurve::measure(&mut rig, &|_| PROBE_N, || progress.inc(1)).map_err(refused)?;
        Ok::<f64, CommandError>(curve.error_percent())
    };
    let (before, after) = (error(None)?, error(Some(calibration))?);
    progress.finish_and_clear();
    if arguments.json.as_deref() != Some(Path::new("-")) {
        say!("{}", style::title("error of the vertical force over 14 mm, peak to peak"));
        say!("  without {before:>8.3} %\n  with    {after:>8.3} %");
    }
    if let Some(path) = &arguments.json {
        write_json(path, &VerifyReport { error_before_percent: before, error_after_percent: after })?;
    }
    Ok(())
}

fn import(arguments: &ImportArguments) -> Result<(), CommandError> {
    let ImportArguments { excess, at, range_mm, device, serial, out } = arguments;
    let from_report = excess.is_empty();
    let excess = if from_report { &thesis::POLYNOMIAL_N_PER_MM[..] } else { excess };
    let mut coefficients: Vec<f64> = excess.iter().map(|coefficient| coefficient / at).collect();
    if let Some(first) = coefficients.first_mut() {
        *first += 1.0;
    }
    let range_mm = [range_mm.first(), range_mm.get(1)].map(|end| end.copied().unwrap_or(f64::NAN));
    let vertical = VerticalCurve { range_mm, coefficients_per_mm: coefficients };
    vertical.calibration().map_err(|invalid| CommandError::Usage(format!("these numbers: {invalid}")))?;
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

fn provenance(source: Source, note: Option<String>) -> Provenance {
    let program = format!("flotor {}", env!("CARGO_PKG_VERSION"));
    Provenance { source, program, date: Some(today()), seed: None, note }
}

fn write_calibration(path: &Path, file: &CalibrationFile) -> Result<(), CommandError> {
    let text = file.to_text().map_err(|error| CommandError::Failed(error.to_string()))?;
    std::fs::write(path, text)
        .map_err(|cause| CommandError::file(path, "cannot write the calibration", cause))?;
    Ok(())
}

fn simulated_rig(seed: u64) -> Result<SimulatedRig, CommandError> {
    Ok(SimulatedRig::new(Registry::search(&[]).load(SIMULATED, PluginKind::Device)?, seed))
}

fn refused(error: CalibrationError) -> CommandError {
    match error {
        CalibrationError::Plugin(error) => error.into(),
        CalibrationError::Fault(fault) => CommandError::DeviceFault(fault),
        CalibrationError::Setting(_) | CalibrationError::Refused(_) => {
            CommandError::PluginRefused(error.to_string())
        }
        CalibrationError::TooFew { .. } => CommandError::Usage(error.to_string()),
        other => CommandError::Failed(other.to_string()),
    }
}

fn to_text(fit: &Fit, rows: &[ErrorRow], readings: usize) -> String {
    let mut lines = vec![style::title("degree   error of prediction (each height from the others)")];
    for candidate in &fit.candidates {
        let mark = if candidate.degree == fit.degree { "  <- taken" } else { "" };
        let Candidate { degree, error_n, standard_error_n } = candidate;
        lines.push(format!(
            "  {degree:>4}   {:>8.2} ± {:.2} mN{mark}",
            error_n * 1.0e3,
            standard_error_n * 1.0e3
        ));
    }
    lines.push(format!(
        "{readings} readings, residual {:.1} mN, 95 % band of the shape ±{:.3} %, weight {:.3} ± {:.3} N\n",
        fit.residual_n * 1.0e3,
        fit.band_95_percent,
        fit.weight_n[0],
        fit.weight_n[1]
    ));
    lines.push(style::title("correction                     error over 14 mm, peak to peak"));
    lines.extend(rows.iter().map(|row| format!("  {:<28} {:>8.3} %", row.correction, row.error_percent)));
    lines.join("\n")
}

fn force_n(text: &str) -> Result<f64, String> {
    let force_n: f64 = text.trim().parse().map_err(|_| format!("`{text}` is no force"))?;
    if (1.0..=50.0).contains(&force_n) { Ok(force_n) } else { Err("legal is 1 to 50 N".to_owned()) }
}
