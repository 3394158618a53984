//! A study on one page: figures 17 or 18 of CMU-RI-TR-07-21 with this study's data, and every number next to the
//! report's. One HTML file that needs no other.

use crate::plot::{Axis, Bin, Figure, Panel, Series};
use flotor_statistics::describe::MeanInterval;
use flotor_study::analysis::{Analysis, JndAnalysis, MagnitudeAnalysis};
use flotor_study::protocol::Protocol;
use flotor_study::trial::Modality;

/// The page.
#[must_use]
pub fn html(protocol: &Protocol, analysis: &Analysis) -> String {
    let stimulus = protocol.stimulus().to_string();
    let (title, figures) = match analysis {
        Analysis::Jnd(analysis) => {
            (format!("Just noticeable difference of {stimulus}"), vec![thresholds(analysis, &stimulus)])
        }
        Analysis::Magnitude(analysis) => {
            (format!("Perceived magnitude of {stimulus}"), vec![ratings(analysis, &stimulus)])
        }
    };
    let figures: String = figures.iter().map(|figure| format!("<figure>{figure}</figure>\n")).collect();
    let settings = serde_json::to_string_pretty(protocol).unwrap_or_default();
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>{title}</title>\n\
         <meta name=\"viewport\" content=\"width=device-width\">\n<style>{STYLE}</style>\n</head>\n<body>\n\
         <h1>{title}</h1>\n{figures}<h2>Results, next to CMU-RI-TR-07-21</h2>\n<pre>{}</pre>\n\
         <h2>Protocol</h2>\n<pre>{}</pre>\n</body>\n</html>\n",
        escaped(&analysis.to_text()),
        escaped(&settings),
        title = escaped(&title),
    )
}

/// Reads on light and dark screens and on paper.
const STYLE: &str = "body{font-family:system-ui,sans-serif;max-width:62rem;margin:2rem auto;padding:0 1rem;\
    color-scheme:light dark}figure{margin:1rem 0}svg{max-width:100%;height:auto}pre{overflow-x:auto;line-height:1.4}";

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// Figure 18: thresholds as bars over the base, a bar for each modality, with standard errors.
fn thresholds(analysis: &JndAnalysis, stimulus: &str) -> String {
    let cells = |modality| analysis.thresholds.iter().filter(move |cell| cell.modality == modality);
    let mut bases: Vec<f64> = cells(Modality::Vh).map(|cell| cell.base).collect();
    bases.sort_by(f64::total_cmp);
    let gap =
        bases.windows(2).filter_map(|pair| Some(pair.get(1)? - pair.first()?)).fold(f64::INFINITY, f64::min);
    // Two bars and their distance fill two thirds of the gap between bases.
    let width = if gap.is_finite() { gap / 3.0 } else { bases.first().map_or(1.0, |base| base / 10.0) };
    let mut panel = Panel::new(Axis::linear("Threshold", "unit of the stimulus"));
    for (slot, (modality, name, side)) in
        [(Modality::Vh, "vision + haptics", -1.0), (Modality::H, "haptics alone", 1.0)]
            .into_iter()
            .enumerate()
    {
        let centre = |base: f64| base + 0.5 * side * width;
        let bar = |cell: &flotor_study::analysis::ThresholdCell| Bin {
            from: centre(cell.base) - 0.48 * width,
            to: centre(cell.base) + 0.48 * width,
            height: cell.threshold.mean,
        };
        panel = panel.series(Series::histogram(name, cells(modality).map(bar)).slot(slot));
        let errors = cells(modality).flat_map(|cell| error_bar(centre(cell.base), &cell.threshold));
        panel = panel.series(Series::line("", errors).slot(slot + 2));
    }
    let weber = &analysis.weber;
    Figure::new("Thresholds (figure 18)", Axis::linear(format!("Base {stimulus}"), ""))
        .subtitle(format!(
            "{} subjects; Weber fractions {:.1} % with vision, {:.1} % without (report: 14.2 and 17.2 %); lines: \
             standard errors",
            analysis.subjects,
            weber.vh * 100.0,
            weber.h * 100.0
        ))
        .panel_height_px(360.0)
        .panel(panel)
        .to_svg()
}

/// Figure 17: mean ratings over the stimulus, with standard errors and the linear trend.
fn ratings(analysis: &MagnitudeAnalysis, stimulus: &str) -> String {
    let cells = |modality| analysis.ratings.iter().filter(move |cell| cell.modality == modality);
    let mut panel = Panel::new(Axis::linear("Rating, scaled", ""));
    for (slot, (modality, name)) in
        [(Modality::Vh, "vision + haptics"), (Modality::H, "haptics alone")].into_iter().enumerate()
    {
        let points = cells(modality).map(|cell| (cell.stimulus, cell.rating.mean));
        panel = panel.series(Series::points(name, points).slot(slot));
        let errors = cells(modality).flat_map(|cell| error_bar(cell.stimulus, &cell.rating));
        panel = panel.series(Series::line("", errors).slot(slot));
    }
    let trend = &analysis.trend;
    let ends = cells(Modality::Vh).map(|cell| (cell.stimulus, trend.intercept + trend.slope * cell.stimulus));
    panel = panel.series(Series::line("linear trend", ends).slot(2));
    Figure::new("Perceived against real (figure 17)", Axis::linear(stimulus, ""))
        .subtitle(format!(
            "{} subjects; R² of the linear trend {:.3} (report: 0.983); lines: standard errors",
            analysis.subjects, analysis.linear_r2
        ))
        .panel_height_px(360.0)
        .panel(panel)
        .to_svg()
}

/// A vertical stroke of one standard error each way, and a break behind it.
fn error_bar(x: f64, value: &MeanInterval) -> [(f64, f64); 3] {
    [(x, value.mean - value.se), (x, value.mean + value.se), (x, f64::NAN)]
}
