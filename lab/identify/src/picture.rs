//! Picture of an identification: fit, residuals, and the perceptible difference.

use crate::identification::Identification;
use crate::measurement::{Measurement, mean};
use flotor_plot::{Axis, Figure, Panel, Quantity, Series};

const MM_PER_M: f64 = 1.0e3;
/// Just noticeable difference of a force, as a fraction of the force (Pang, Tan and Durlach 1991: 5 to 10 %).
const FORCE_JND: f64 = 0.07;
/// Number of means in the drawing of the difference: noise of single samples is not perceptible.
const MEANS: usize = 400;

/// Draws an identification as SVG. Not real-time.
#[must_use]
pub fn to_svg(measurement: &Measurement, identification: &Identification) -> String {
    let x_mm: Vec<f64> = measurement.displacement_m().iter().map(|x| x * MM_PER_M).collect();
    let pairs = |values: &[f64]| x_mm.iter().copied().zip(values.iter().copied()).collect::<Vec<_>>();
    let fit = Panel::new(Axis::of("Force on the object", Quantity::Force))
        .series(Series::line("measured", pairs(measurement.force_n())))
        .series(Series::line(identification.closest.id(), pairs(&identification.prediction_n)));
    let residuals = identification.residuals_n(measurement);
    let residual = Panel::new(Axis::linear("Measured less predicted", "mN").least_range(1.0))
        .series(Series::points("samples", pairs(&residuals.iter().map(|n| n * 1.0e3).collect::<Vec<_>>())));
    Figure::new(
        format!("Identified law: {}", identification.name()),
        Axis::of("Displacement", Quantity::Length),
    )
    .subtitle(format!(
        "{} samples; residual {:.4} N, of which {:.4} N is not noise",
        x_mm.len(),
        identification.rms_n,
        identification.structure_n
    ))
    .panel_height_px(180.0)
    .panel(fit)
    .panel(residual)
    .panel(felt(measurement, identification, &residuals))
    .to_svg()
}

/// Draws means of the residuals between the limits of the just noticeable difference.
fn felt(measurement: &Measurement, identification: &Identification, residuals_n: &[f64]) -> Panel {
    let size = residuals_n.len().div_ceil(MEANS).max(1);
    let means = |values: &[f64]| values.chunks(size).map(mean).collect::<Vec<f64>>();
    let (x, residual_n, force_n) =
        (means(measurement.displacement_m()), means(residuals_n), means(&identification.prediction_n));
    let x_mm = || x.iter().map(|x| x * MM_PER_M);
    let mut limits: Vec<(f64, f64)> =
        x_mm().zip(force_n.iter().map(|n| FORCE_JND * n.abs() * 1.0e3)).collect();
    limits.sort_by(|(one, _), (other, _)| one.total_cmp(other));
    let below: Vec<(f64, f64)> = limits.iter().map(|(x, limit)| (*x, -limit)).collect();
    Panel::new(Axis::linear("Difference felt, means", "mN").least_range(1.0))
        .series(Series::points(
            "difference",
            x_mm().zip(residual_n.iter().map(|n| n * 1.0e3)).collect::<Vec<_>>(),
        ))
        .series(
            Series::line(format!("just noticeable: {:.0} % of the force", FORCE_JND * 100.0), limits).slot(2),
        )
        .series(Series::line("", below).slot(2))
}
