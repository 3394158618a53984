//! Traces as files: numbers, lines, pixels.

use crate::history::History;
use crate::palette::{Look, Palette};
use crate::picture::{draw_without_window, write_png};
use crate::quantity::Quantity;
use crate::trace::Trace;
use crate::ui::plot_stack::{ExportFormat, PlotStack};
use crate::ui::plots::{Maximise, PlotView, plot};
use crate::ui::view3d::pixels;
use egui::vec2;
use flotor_plot::{Axis, Figure, Panel, Series};
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
        ExportFormat::Svg => std::fs::write(path, svg(history, plots)),
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
    let shown = plots.in_sight();
    let columns =
        || shown.iter().flat_map(|quantity| (0..quantity.components().len()).map(move |k| (*quantity, k)));
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
pub fn svg(history: &History, plots: &PlotStack) -> String {
    let [from_s, to_s] = plots.span_s(history);
    let panel = |quantity: &Quantity| {
        let (unit, per_si) = quantity.unit(plots.units);
        let line = |(component, name): (usize, &&str)| {
            let samples = history.between(from_s, to_s);
            Series::line(*name, samples.map(|s| (s.time_s(), quantity.value(s, component) * per_si)))
        };
        let lines = quantity.components().iter().enumerate().map(line);
        lines.fold(Panel::new(Axis::linear(quantity.name(), unit)), Panel::series)
    };
    let figure = Figure::new("Traces", Axis::linear("Time", "s").range(from_s, to_s));
    plots.in_sight().iter().map(panel).fold(figure, Figure::panel).to_svg()
}

fn png(history: &History, plots: &PlotStack, look: Look) -> egui::ColorImage {
    let palette = Palette::of(look);
    let span_s = plots.span_s(history);
    let size = vec2(WIDTH, HEIGHT_OF_ONE * plots.in_sight().len() as f32 + 20.0);
    draw_without_window(pixels(size * SCALE), SCALE, look, |ui| {
        let inside = ui.max_rect().shrink2(vec2(12.0, 4.0));
        let mut ui = ui.new_child(egui::UiBuilder::new().max_rect(inside));
        for (index, quantity) in plots.in_sight().iter().enumerate() {
            let time_axis = index + 1 == plots.in_sight().len();
            let height = HEIGHT_OF_ONE - 30.0 + if time_axis { 14.0 } else { 0.0 };
            let (_, per_si) = quantity.unit(plots.units);
            let values = plots.values_of(*quantity).map(|values| values.map(|value| value * per_si));
            let view = PlotView {
                device: None,
                span_s,
                cursor_s: span_s[1],
                units: plots.units,
                height,
                time_axis,
                values,
                maximise: Maximise::No,
            };
            plot(&mut ui, history, &mut Trace::of(*quantity), view, &palette);
        }
    })
}

fn free_name(ending: &str) -> PathBuf {
    let names = (1..).map(|number| PathBuf::from(format!("flotor-traces-{number}.{ending}")));
    names.into_iter().find(|path| !path.exists()).unwrap_or_default()
}
