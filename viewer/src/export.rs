//! Traces as files: numbers, lines, pixels.

use crate::decimate::min_max;
use crate::history::History;
use crate::palette::{Look, Palette};
use crate::picture::{draw_without_window, write_png};
use crate::quantity::Quantity;
use crate::trace::Trace;
use crate::ui::plot_stack::{ExportFormat, PlotStack};
use crate::ui::plots::{PlotView, plot};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Why there is no file.
#[derive(Debug, thiserror::Error)]
#[error("cannot write `{}`: {cause}; start the viewer in a folder you may write to", path.display())]
pub struct ExportError {
    path: PathBuf,
    #[source]
    cause: std::io::Error,
}

/// Size of pictures, points; drawn twice as fine.
const WIDTH: f32 = 900.0;
const HEIGHT_OF_ONE: f32 = 190.0;
const SCALE: f32 = 2.0;

/// Writes what is shown into the working folder, under a name that is not taken.
///
/// # Errors
/// [`ExportError`].
pub fn export(
    history: &History,
    plots: &PlotStack,
    format: ExportFormat,
    look: Look,
) -> Result<PathBuf, ExportError> {
    let ending = match format {
        ExportFormat::Csv => "csv",
        ExportFormat::Svg => "svg",
        ExportFormat::Png => "png",
    };
    let path = free_name(ending);
    write(history, plots, format, look, &path).map_err(|cause| ExportError { path: path.clone(), cause })?;
    Ok(path)
}

/// Writes what is shown into a file.
///
/// # Errors
/// What the system says.
pub fn write(
    history: &History,
    plots: &PlotStack,
    format: ExportFormat,
    look: Look,
    path: &Path,
) -> std::io::Result<()> {
    match format {
        ExportFormat::Csv => std::fs::write(path, csv(history, plots)),
        ExportFormat::Svg => std::fs::write(path, svg(history, plots, look)),
        ExportFormat::Png => {
            let image = png(history, plots, look);
            write_png(path, &image).map_err(std::io::Error::other)
        }
    }
}

/// Every sample of the time shown, a column for each component, with its unit.
#[must_use]
pub fn csv(history: &History, plots: &PlotStack) -> String {
    let [from_s, to_s] = plots.span_s(history);
    let mut text = "time_s".to_owned();
    let columns = || {
        plots.shown.iter().flat_map(|quantity| (0..quantity.components().len()).map(move |k| (*quantity, k)))
    };
    for (quantity, component) in columns() {
        let (unit, _) = quantity.unit(plots.units);
        let _ = write!(text, ",{} {} ({unit})", quantity.name(), quantity.components()[component]);
    }
    text.push('\n');
    for sample in history.between(from_s, to_s) {
        let _ = write!(text, "{}", sample.time_s());
        for (quantity, component) in columns() {
            let (_, per_si) = quantity.unit(plots.units);
            let _ = write!(text, ",{}", quantity.value(sample, component) * per_si);
        }
        text.push('\n');
    }
    text
}

/// The traces as lines, as many points as can be seen.
#[must_use]
pub fn svg(history: &History, plots: &PlotStack, look: Look) -> String {
    const LEFT: f64 = 64.0;
    const BOTTOM: f64 = 24.0;
    let palette = Palette::of(look);
    let span_s = plots.span_s(history);
    let (width, each) = (f64::from(WIDTH), f64::from(HEIGHT_OF_ONE));
    let height = each * plots.shown.len() as f64 + BOTTOM;
    let hex = |color: egui::Color32| format!("#{:02x}{:02x}{:02x}", color.r(), color.g(), color.b());
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" \
         font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"{}\"/>\n",
        hex(palette.panel)
    );
    let mut top = 0.0;
    for quantity in &plots.shown {
        let frame = Frame { left: LEFT, top: top + 28.0, right: width - 12.0, bottom: top + each - 4.0 };
        svg += &frame.plot(history, plots, *quantity, span_s, &palette, hex);
        top += each;
    }
    for part in 0..=5 {
        let share = f64::from(part) / 5.0;
        let (x, time_s) = (LEFT + share * (width - 12.0 - LEFT), span_s[0] + share * (span_s[1] - span_s[0]));
        let color = hex(palette.faint);
        let _ = writeln!(
            svg,
            "<text x=\"{x:.1}\" y=\"{:.1}\" fill=\"{color}\" text-anchor=\"middle\">{time_s:.2} s</text>",
            height - 8.0
        );
    }
    svg + "</svg>\n"
}

struct Frame {
    left: f64,
    top: f64,
    right: f64,
    bottom: f64,
}

impl Frame {
    fn plot(
        &self,
        history: &History,
        plots: &PlotStack,
        quantity: Quantity,
        span_s: [f64; 2],
        palette: &Palette,
        hex: impl Fn(egui::Color32) -> String,
    ) -> String {
        const BUCKETS: usize = 900;
        let (unit, per_si) = quantity.unit(plots.units);
        let traces: Vec<Vec<[f64; 2]>> = (0..quantity.components().len())
            .map(|k| {
                let points = history.between(span_s[0], span_s[1]);
                let points: Vec<_> =
                    points.map(|sample| [sample.time_s(), quantity.value(sample, k) * per_si]).collect();
                min_max(points.iter().copied(), span_s, BUCKETS)
            })
            .collect();
        let (low, high) = traces
            .iter()
            .flatten()
            .fold((0.0_f64, 0.0_f64), |(low, high), [_, value]| (low.min(*value), high.max(*value)));
        let range = (high - low).max(1.0e-12);
        let at = |[time_s, value]: [f64; 2]| {
            let x = self.left + (time_s - span_s[0]) / (span_s[1] - span_s[0]) * (self.right - self.left);
            (x, self.bottom - (value - low) / range * (self.bottom - self.top))
        };
        let Self { left, top, right, bottom } = self;
        let (text, faint, grid) = (hex(palette.text), hex(palette.faint), hex(palette.grid));
        let mut svg = format!(
            "<text x=\"12\" y=\"{:.1}\" fill=\"{text}\" font-weight=\"bold\">{} <tspan fill=\"{faint}\" \
             font-weight=\"normal\">{unit}</tspan>",
            top - 10.0,
            quantity.name()
        );
        for (k, name) in quantity.components().iter().enumerate() {
            let _ =
                write!(svg, "<tspan dx=\"12\" fill=\"{}\">{name}</tspan>", hex(palette.components[k % 3]));
        }
        svg += "</text>\n";
        for value in [low, 0.0, high] {
            let (_, y) = at([span_s[0], value]);
            let _ = writeln!(
                svg,
                "<path d=\"M{left} {y:.2}H{right}\" stroke=\"{grid}\" stroke-width=\"0.5\"/><text x=\"{:.1}\" \
                 y=\"{:.2}\" fill=\"{faint}\" text-anchor=\"end\">{value:.3}</text>",
                left - 6.0,
                (y + 4.0).clamp(top + 4.0, *bottom)
            );
        }
        for (k, trace) in traces.iter().enumerate() {
            let points: Vec<String> =
                trace.iter().map(|point| at(*point)).map(|(x, y)| format!("{x:.2},{y:.2}")).collect();
            let color = hex(palette.components[k % 3]);
            let points = points.join(" ");
            let _ = writeln!(
                svg,
                "<polyline fill=\"none\" stroke=\"{color}\" stroke-width=\"1.4\" points=\"{points}\"/>"
            );
        }
        svg
    }
}

fn png(history: &History, plots: &PlotStack, look: Look) -> egui::ColorImage {
    let palette = Palette::of(look);
    let span_s = plots.span_s(history);
    let height = HEIGHT_OF_ONE * plots.shown.len() as f32;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // pixels
    let size = [WIDTH * SCALE, (height + 20.0) * SCALE].map(|length| length as usize);
    draw_without_window(size, SCALE, look, |ui| {
        let inside = ui.max_rect().shrink2(egui::vec2(12.0, 4.0));
        let mut ui = ui.new_child(egui::UiBuilder::new().max_rect(inside));
        for (index, quantity) in plots.shown.iter().enumerate() {
            let time_axis = index + 1 == plots.shown.len();
            let height = HEIGHT_OF_ONE - 30.0 + if time_axis { 14.0 } else { 0.0 };
            let view = PlotView { span_s, cursor_s: span_s[1], units: plots.units, height, time_axis };
            plot(&mut ui, history, &mut Trace::of(*quantity), view, &palette);
        }
    })
}

fn free_name(ending: &str) -> PathBuf {
    let names = (1..).map(|number| PathBuf::from(format!("flotor-traces-{number}.{ending}")));
    names.into_iter().find(|path| !path.exists()).unwrap_or_default()
}
