//! Figures of a study: figures 17 and 18 of CMU-RI-TR-07-21 with the study's data, Weber fractions of individual subjects, and
//! movements; in `tracks` and `psychometric` the answers of a difference experiment.

mod psychometric;
mod tracks;

use flotor_analysis::{
    JndAnalysis, KinematicMeasure, MagnitudeAnalysis, ResponseRow, ThresholdCell, published,
};
use flotor_plot::{Axis, Bin, ErrorBar, Figure, Panel, Quantity, Series};
use flotor_statistics::describe::{MeanInterval, mean};
use flotor_study::protocol::Stimulus;
use flotor_study::trial::Modality;

pub(super) use psychometric::psychometric;
pub(super) use tracks::tracks;

/// Height of a single-panel figure, px.
const HEIGHT_PX: f64 = 340.0;

/// Style slot of error bars over filled bars: text colour.
const INK: usize = 6;

/// Legend of the error bars.
const ONE_ERROR: &str = "± 1 standard error";

/// Modalities with their legends, in the order of their colours.
const MODALITIES: [(Modality, &str); 2] =
    [(Modality::Vh, "vision + haptics"), (Modality::H, "haptics alone")];

/// Plots figure 18: thresholds as bars over the base, one bar per modality, with standard errors; if the study is comparable,
/// also the thesis's mean Weber fractions times the base.
pub(super) fn thresholds(analysis: &JndAnalysis, stimulus: &Stimulus) -> Figure {
    let cells = |modality| analysis.thresholds.iter().filter(move |cell| cell.modality == modality);
    let mut bases: Vec<f64> = cells(Modality::Vh).map(|cell| cell.base).collect();
    bases.sort_by(f64::total_cmp);
    let gap =
        bases.windows(2).filter_map(|pair| Some(pair.get(1)? - pair.first()?)).fold(f64::INFINITY, f64::min);
    // Two bars and their gap fill two thirds of the distance between bases.
    let width = if gap.is_finite() { gap / 3.0 } else { bases.first().map_or(1.0, |base| base / 10.0) };
    let centre = |slot: usize, base: f64| base + if slot == 0 { -0.5 * width } else { 0.5 * width };
    let (name, unit) = stimulus.name_and_unit();
    let mut panel = Panel::new(Axis::linear("Threshold", unit));
    for (slot, (modality, name)) in MODALITIES.into_iter().enumerate() {
        let bar = |cell: &ThresholdCell| Bin {
            from: centre(slot, cell.base) - 0.46 * width,
            to: centre(slot, cell.base) + 0.46 * width,
            height: cell.threshold.mean,
        };
        panel = panel.series(Series::histogram(name, cells(modality).map(bar)).slot(slot));
    }
    for (slot, (modality, _)) in MODALITIES.into_iter().enumerate() {
        let errors = cells(modality).map(|cell| error_bar(centre(slot, cell.base), &cell.threshold));
        let name = if slot == 0 { ONE_ERROR } else { "" };
        panel = panel.series(Series::errors(name, errors).slot(INK));
    }
    if let Some(weber) = analysis.thesis.weber() {
        let of = |(slot, weber): (usize, f64)| {
            bases.iter().map(move |base| (centre(slot, *base), weber * base)).collect::<Vec<_>>()
        };
        let thesis = weber.into_iter().enumerate().flat_map(of);
        panel = panel.series(Series::points("thesis: its Weber fraction times the base", thesis).slot(2));
    }
    Figure::new("Thresholds", Axis::linear(format!("Base {name}"), unit).levels(bases))
        .subtitle("Mean over subjects")
        .panel_height_px(HEIGHT_PX)
        .panel(panel)
}

/// Plots each subject's Weber fraction with haptics alone over the fraction with vision and haptics.
pub(super) fn subjects(analysis: &JndAnalysis) -> Figure {
    let weber_percent = |rows: &[ResponseRow], modality: Modality| {
        let here = rows.iter().filter(|row| row.modality == modality);
        mean(&here.map(|row| row.response / row.stimulus * 100.0).collect::<Vec<_>>())
    };
    let of_subjects = analysis.responses.chunk_by(|one, next| one.subject == next.subject);
    let point = |rows| (weber_percent(rows, Modality::Vh), weber_percent(rows, Modality::H));
    let points: Vec<(f64, f64)> = of_subjects.map(point).collect();
    let most = points.iter().flat_map(|(vh, h)| [*vh, *h]).fold(1.0, f64::max).ceil();
    let mut panel = Panel::new(Axis::linear("Weber fraction, haptics alone", "%").range(0.0, most))
        .series(Series::points("a subject", points).slot(0))
        .series(Series::line("no difference", [(0.0, 0.0), (most, most)]).slot(3));
    if let Some([vh, h]) = analysis.thesis.weber().map(|weber| weber.map(|weber| weber * 100.0)) {
        panel = panel.series(Series::points("thesis, mean", [(vh, h)]).slot(2));
    }
    Figure::new("Subjects", Axis::linear("Weber fraction, vision + haptics", "%").range(0.0, most))
        .subtitle("Above the line: worse without vision")
        .panel_height_px(HEIGHT_PX)
        .panel(panel)
}

/// Plots figure 17: mean ratings over the stimulus, with standard errors and the linear trend.
pub(super) fn ratings(analysis: &MagnitudeAnalysis, stimulus: &Stimulus) -> Figure {
    let cells = |modality| analysis.ratings.iter().filter(move |cell| cell.modality == modality);
    let values: Vec<f64> = cells(Modality::Vh).map(|cell| cell.stimulus).collect();
    let span = values.iter().fold(0.0_f64, |most, value| most.max(*value))
        - values.iter().fold(f64::INFINITY, |least, value| least.min(*value));
    // Offset the modalities horizontally, so that neither error bar hides the other.
    let beside = |slot: usize, x: f64| x + if slot == 0 { -0.004 * span } else { 0.004 * span };
    let mut panel = Panel::new(Axis::linear("Rating, scaled", ""));
    for (slot, (modality, name)) in MODALITIES.into_iter().enumerate() {
        let errors = cells(modality).map(|cell| error_bar(beside(slot, cell.stimulus), &cell.rating));
        let label = if slot == 0 { ONE_ERROR } else { "" };
        panel = panel.series(Series::errors(label, errors).slot(slot));
        let points = cells(modality).map(|cell| (beside(slot, cell.stimulus), cell.rating.mean));
        panel = panel.series(Series::points(name, points).slot(slot));
    }
    if let Some(trend) = analysis.trend.tested() {
        let line =
            cells(Modality::Vh).map(|cell| (cell.stimulus, trend.intercept + trend.slope * cell.stimulus));
        let thesis = format!(" (thesis: {})", published::LINEAR_R2);
        let label = format!("linear trend, R² {:.3}{}", analysis.linear_r2, analysis.thesis.text(&thesis));
        panel = panel.series(Series::line(label, line).slot(2));
    }
    let (name, unit) = stimulus.name_and_unit();
    Figure::new("Perceived against real", Axis::linear(name, unit))
        .subtitle("Mean over subjects")
        .panel_height_px(HEIGHT_PX)
        .panel(panel)
}

/// Plots movement measures over the stimulus; `None` without measurements.
pub(super) fn movements(
    measures: &[KinematicMeasure],
    levels: &[f64],
    stimulus: &Stimulus,
) -> Option<Figure> {
    if measures.is_empty() {
        return None;
    }
    let (name, unit) = stimulus.name_and_unit();
    let mut figure = Figure::new("Exploration", Axis::linear(name, unit))
        .subtitle(
            "Along the vertical; mean over subjects and modalities, bars: ± 1 standard error over subjects",
        )
        .columns(3)
        .panel_height_px(170.0);
    for measure in measures {
        let (name, quantity) = match measure.measure {
            "mean speed" => ("Mean speed", Quantity::Velocity),
            "mean acceleration" => ("Mean acceleration", Quantity::Acceleration),
            _ => ("Mean force", Quantity::Force),
        };
        let (_, per_si) = quantity.unit();
        let mut cells: Vec<(f64, f64, f64)> =
            (levels.iter().zip(&measure.means).zip(&measure.standard_errors))
                .map(|((level, mean), error)| (*level, mean * per_si, error * per_si))
                .collect();
        cells.sort_by(|a, b| a.0.total_cmp(&b.0));
        let points = || cells.iter().map(|(level, mean, _)| (*level, *mean));
        let errors = cells.iter().map(|(level, mean, error)| ErrorBar::around(*level, *mean, *error));
        let panel = Panel::new(Axis::of(name, quantity).with_zero())
            .series(Series::line("", points()).slot(0))
            .series(Series::points("", points()).slot(0))
            .series(Series::errors("", errors).slot(INK));
        figure = figure.panel(panel);
    }
    Some(figure)
}

/// Returns an error bar of one standard error in each direction.
fn error_bar(x: f64, value: &MeanInterval) -> ErrorBar {
    ErrorBar::around(x, value.mean, value.se)
}
