//! `flotor calibrate vertical`: readings, fit, error before and after.

use super::rig::RigArguments;
use super::{FORCES_N, provenance, refused, write_calibration};
use crate::fit::{Candidate, Fit, fit};
use crate::procedure::{Plan, Reading, measure};
use crate::verify::{ErrorCurve, PROBE_N};
use crate::{picture, thesis};
use clap::Args;
use flotor_command::options::{JsonOption, count, new_file, number, svg_file};
use flotor_command::{CommandError, print_result, progress_bar, style, write_text};
use flotor_hal::VerticalCalibration;
use flotor_session::calibration_file::{
    CalibratedDevice, CalibrationFile, FORMAT, Provenance, Quality, Source, VerticalCurve,
};
use serde::Serialize;
use std::path::PathBuf;

/// Measure the ratio of delivered to commanded vertical force at each height, and fit it.
#[derive(Args)]
#[command(
    after_help = "The handle is locked in all axes but the vertical and pushes against a force sensor that \
    is lowered step by step. The sensor answers `R` with `F 1.234`, a force in N. The program requests one height after \
    the other and reads the sensor while the handle rests there.\n\nExamples:\n  \
    flotor calibrate vertical --simulated\n  \
    flotor calibrate vertical --simulated --out calibration.toml --plot calibration.svg\n  \
    flotor calibrate vertical --simulated --force 8,10,12,14 --steps 28 --step-mm 0.5 --json -\n  \
    flotor calibrate vertical --device maglev --sensor /dev/ttyUSB0 --out mine.toml"
)]
pub(super) struct VerticalArguments {
    #[command(flatten)]
    rig: RigArguments,
    /// Commanded vertical forces in N, at least two
    #[arg(long, value_name = "N", value_delimiter = ',', default_value = "10,12", value_parser = number("N", "force", FORCES_N), allow_hyphen_values = true)]
    force: Vec<f64>,
    /// Number of sweeps over all heights for each force
    #[arg(long, default_value_t = 2, value_name = "N", value_parser = count(1..=100_u32))]
    runs: u32,
    /// Number of steps down, 7 to 200, from half of their total length above home to half below; at most 22 mm in all
    #[arg(long, default_value_t = 14, value_name = "N", value_parser = count(7..=200_u32))]
    steps: u32,
    /// Length of a step in mm
    #[arg(long, default_value_t = 1.0, value_name = "MM", value_parser = number("mm", "length", 0.01..=22.0))]
    step_mm: f64,
    /// Readings of the force sensor at each height
    #[arg(long, default_value_t = 10, value_name = "N", value_parser = count(1..=1000_u32))]
    readings: u32,
    /// Write the calibration file
    #[arg(long, value_parser = new_file, value_name = "FILE.toml")]
    out: Option<PathBuf>,
    /// Plot readings, fit, residuals and the error before and after
    #[arg(long, value_parser = svg_file, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    json: JsonOption,
}

/// JSON output of `vertical`.
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
    #[serde(skip_serializing_if = "Option::is_none")]
    seed: Option<u64>,
}

/// Correction with its residual error.
#[derive(Clone, Debug, Serialize)]
struct ErrorRow {
    correction: &'static str,
    error_percent: f64,
}

/// Readings with their fit, and the errors of the corrections under comparison.
struct Measured {
    device: CalibratedDevice,
    readings: Vec<Reading>,
    fit: Fit,
    /// Polynomial of the thesis.
    report: VerticalCalibration,
    /// Residual error by name of the correction: first without any, last this fit.
    curves: Vec<(&'static str, ErrorCurve)>,
}

const UNCORRECTED: &str = "none";
const FITTED: &str = "this fit, total command";

pub(super) fn run(arguments: &VerticalArguments) -> Result<(), CommandError> {
    let plan = plan(arguments)?;
    let measured =
        if arguments.rig.simulated { simulated(arguments, &plan)? } else { device(arguments, &plan)? };
    report_on(arguments, &measured)
}

fn plan(arguments: &VerticalArguments) -> Result<Plan, CommandError> {
    let VerticalArguments { force, runs, steps, step_mm, readings, .. } = arguments;
    let half_mm = f64::from(*steps) * step_mm * 0.5;
    if half_mm > 11.0 {
        return Err(CommandError::Usage(format!(
            "--steps {steps} of {step_mm} mm: the handle reaches 11 mm to either side; choose steps of at most 22 mm in all"
        )));
    }
    if let [first, others @ ..] = force.as_slice()
        && others.iter().all(|other| other == first)
    {
        let why = format!("--force {first}: give at least two different forces, such as 10,12");
        return Err(CommandError::Usage(why));
    }
    Ok(Plan {
        forces_n: force.clone(),
        runs: *runs,
        top_m: half_mm * 1.0e-3,
        step_m: step_mm * 1.0e-3,
        steps: *steps,
        readings: *readings,
    })
}

/// Number of corrections that are compared in the simulated rig.
const CORRECTIONS: u64 = 4;

/// Calibrates the simulated rig. Its error is known without sensor noise, and a sweep is cheap, so the thesis's two
/// corrections are compared as well.
fn simulated(arguments: &VerticalArguments, plan: &Plan) -> Result<Measured, CommandError> {
    let mut rig = arguments.rig.simulated_rig()?;
    let device = rig.device().map_err(refused)?;
    let length = plan.stops() + CORRECTIONS * ErrorCurve::HEIGHTS;
    let progress = progress_bar(length, "{percent:>3} %  {wide_bar}");
    let readings = measure(&mut rig, plan, || progress.inc(1)).map_err(refused)?;
    let (fit, report) = (fit(&readings).map_err(refused)?, report(plan)?);
    let uncorrected = |_: f64| PROBE_N;
    let as_report = |height_m: f64| thesis::command_n(PROBE_N, height_m);
    // The device corrects the force, or the command does, or neither.
    let mut curve = |name, calibration, command_n: &dyn Fn(f64) -> f64| {
        rig.calibrate(calibration);
        let curve = ErrorCurve::measure(&mut rig, command_n, || progress.inc(1)).map_err(refused)?;
        Ok::<_, CommandError>((name, curve))
    };
    let curves = vec![
        curve(UNCORRECTED, None, &uncorrected)?,
        curve("thesis, spring force only", None, &as_report)?,
        curve("thesis, total command", Some(report), &uncorrected)?,
        curve(FITTED, Some(fit.calibration), &uncorrected)?,
    ];
    progress.finish_and_clear();
    Ok(Measured { device, readings, fit, report, curves })
}

/// Calibrates a device. The error is read from the force sensor: without correction in the readings of the fit, with
/// correction in one more run over all heights.
fn device(arguments: &VerticalArguments, plan: &Plan) -> Result<Measured, CommandError> {
    let check = Plan { forces_n: plan.forces_n.iter().copied().take(1).collect(), runs: 1, ..plan.clone() };
    let (mut rig, progress) = arguments.rig.device_rig(plan.stops() + check.stops())?;
    rig.check(plan).map_err(refused)?;
    let device = rig.device().clone();
    let readings = measure(&mut rig, plan, || progress.inc(1)).map_err(refused)?;
    let (fit, report) = (fit(&readings).map_err(refused)?, report(plan)?);
    rig.calibrate(&fit.calibration).map_err(refused)?;
    let after = measure(&mut rig, &check, || progress.inc(1)).map_err(refused)?;
    progress.finish_and_clear();
    let [weight_n, _] = fit.weight_n;
    let curves = vec![
        (UNCORRECTED, ErrorCurve::of_readings(&readings, weight_n)),
        (FITTED, ErrorCurve::of_readings(&after, weight_n)),
    ];
    Ok(Measured { device, readings, fit, report, curves })
}

fn report(plan: &Plan) -> Result<VerticalCalibration, CommandError> {
    let least_n = plan.forces_n.iter().copied().fold(f64::INFINITY, f64::min);
    thesis::calibration(least_n).map_err(|invalid| refused(invalid.into()))
}

fn report_on(arguments: &VerticalArguments, measured: &Measured) -> Result<(), CommandError> {
    let Measured { device, readings, fit, report, curves } = measured;
    let rows: Vec<ErrorRow> = curves
        .iter()
        .map(|(correction, curve)| ErrorRow { correction, error_percent: curve.error_percent() })
        .collect();
    let error = |row: Option<&ErrorRow>| row.map_or(f64::NAN, |row| row.error_percent);
    let (before, after) = (error(rows.first()), error(rows.last()));
    let seed = arguments.rig.simulated.then_some(arguments.rig.seed);

    let curve = VerticalCurve::of(&fit.calibration);
    let for_machines = VerticalReport {
        device: &device.plugin,
        serial: &device.serial,
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
        seed,
    };
    print_result(arguments.json.file(), &for_machines, || to_text(fit, &rows, readings.len()))?;
    let curves: Vec<_> = curves.iter().map(|(name, curve)| (*name, curve)).collect();
    write_text(arguments.plot.as_deref(), || picture::to_svg(readings, fit, report, &curves))?;
    if let Some(path) = &arguments.out {
        let file = CalibrationFile {
            format: FORMAT,
            device: device.clone(),
            vertical: curve,
            quality: Quality {
                readings: u32::try_from(readings.len()).ok(),
                residual_n: Some(fit.residual_n),
                band_95_percent: Some(fit.band_95_percent),
                error_before_percent: Some(before),
                error_after_percent: Some(after),
                weight_n: Some(fit.weight_n[0]),
            },
            provenance: Provenance {
                seed: seed.and_then(|seed| i64::try_from(seed).ok()),
                ..provenance(Source::Measured, None)
            },
        };
        write_calibration(path, &file)?;
    }
    Ok(())
}

fn to_text(fit: &Fit, rows: &[ErrorRow], readings: usize) -> String {
    let mut lines = vec![style::title("degree   error of prediction (each height from the others)")];
    for candidate in &fit.candidates {
        let mark = if candidate.degree == fit.degree { "  <- selected" } else { "" };
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
    lines.push(style::title("correction                     error over all heights, peak to peak"));
    lines.extend(rows.iter().map(|row| format!("  {:<28} {:>8.3} %", row.correction, row.error_percent)));
    lines.join("\n")
}
