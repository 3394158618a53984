//! Picture of a calibration: readings and curves, residuals, and the error before and after.

use super::fit::Fit;
use super::procedure::Reading;
use super::verify::ErrorCurve;
use flotor_hal::VerticalCalibration;
use flotor_plot::{Axis, Figure, Panel, Quantity, Series};

const MM_PER_M: f64 = 1.0e3;
/// Horizontal distance of readings of different forces at one height, mm.
const APART_MM: f64 = 0.16;
/// Colour slots of the fit and of the thesis's polynomial, equal in every panel.
const FIT: usize = 2;
const REPORT: usize = 3;

/// Draws readings, fit and errors as SVG. `curves`: error curves with their names, first the curve without correction.
#[must_use]
pub fn to_svg(
    readings: &[Reading],
    fit: &Fit,
    thesis: &VerticalCalibration,
    curves: &[(&str, &ErrorCurve)],
) -> String {
    let subtitle = format!(
        "delivered over commanded force; degree {} by cross-validation; residual {:.3} N; 95 % band ±{:.3} %; weight {:.2} ± {:.2} N",
        fit.degree, fit.residual_n, fit.band_95_percent, fit.weight_n[0], fit.weight_n[1]
    );
    let mut errors = Panel::new(Axis::of("Delivered over commanded", Quantity::Percent));
    // In the order of the corrections: none, the two of the thesis, the fit.
    for ((name, curve), slot) in curves.iter().zip([0, 1, REPORT, FIT]) {
        let samples = curve.ratios.iter().map(|(height_m, ratio)| (height_m * MM_PER_M, ratio * 100.0));
        let label = format!("{name}: {:.2} %", curve.error_percent());
        errors = errors.series(Series::line(label, samples).slot(slot));
    }
    Figure::new("Vertical calibration", Axis::of("Height", Quantity::Length))
        .subtitle(subtitle)
        .panel_height_px(180.0)
        .panel(shares(readings, fit, thesis))
        .panel(residuals(readings, fit))
        .panel(errors)
        .to_svg()
}

fn shares(readings: &[Reading], fit: &Fit, thesis: &VerticalCalibration) -> Panel {
    let [weight_n, _] = fit.weight_n;
    let line = |calibration: &VerticalCalibration| {
        let ([from, to], calibration) = (fit.calibration.range_m(), *calibration);
        (0..=100).map(move |step| {
            let height_m = from + (to - from) * f64::from(step) / 100.0;
            (height_m * MM_PER_M, calibration.share(height_m) * 100.0)
        })
    };
    let mut panel = Panel::new(Axis::of("Delivered share", Quantity::Percent));
    for (shift_mm, (force_n, readings)) in side_by_side(by_force(readings)) {
        let share = readings.iter().map(|(_, reading)| {
            (
                reading.height_m * MM_PER_M + shift_mm,
                (reading.force_n + weight_n) / reading.commanded_n * 100.0,
            )
        });
        panel = panel.series(Series::points(format!("read at {force_n} N"), share.collect::<Vec<_>>()));
    }
    panel
        .series(Series::line("fit", line(&fit.calibration)).slot(FIT))
        .series(Series::line("report's polynomial", line(thesis)).slot(REPORT))
}

fn residuals(readings: &[Reading], fit: &Fit) -> Panel {
    let mut panel = Panel::new(Axis::linear("Residual", "mN").least_range(1.0));
    for (shift_mm, (force_n, readings)) in side_by_side(by_force(readings)) {
        let samples = readings.iter().map(|(index, reading)| {
            let residual_n = fit.residuals_n.get(*index).copied().unwrap_or(f64::NAN);
            (reading.height_m * MM_PER_M + shift_mm, residual_n * 1.0e3)
        });
        panel = panel.series(Series::points(format!("at {force_n} N"), samples.collect::<Vec<_>>()));
    }
    panel
}

/// Returns each group with its horizontal offset, mm, centred on the height.
fn side_by_side<T>(groups: Vec<T>) -> impl Iterator<Item = (f64, T)> {
    let middle = 0.5 * groups.len().saturating_sub(1) as f64;
    groups.into_iter().enumerate().map(move |(index, group)| ((index as f64 - middle) * APART_MM, group))
}

/// Groups readings by commanded force, in order of appearance, with their index.
fn by_force(readings: &[Reading]) -> Vec<(f64, Vec<(usize, &Reading)>)> {
    let mut groups: Vec<(f64, Vec<(usize, &Reading)>)> = Vec::new();
    for (index, reading) in readings.iter().enumerate() {
        match groups.iter_mut().find(|(force_n, _)| *force_n == reading.commanded_n) {
            Some((_, members)) => members.push((index, reading)),
            None => groups.push((reading.commanded_n, vec![(index, reading)])),
        }
    }
    groups
}
