//! Export of traces to files: numbers (CSV), lines (SVG), pixels (PNG).

use crate::palette::{Look, Palette};
use crate::picture::{PictureError, draw_without_window, write_png};
use crate::ui::export_options::ExportFormat;
use crate::ui::force_position::said;
use crate::ui::plot_stack::{PlotStack, TooLow, TraceSource};
use crate::ui::readout::subtitle_of;
use crate::ui::view3d::pixels;
use egui::{UiBuilder, vec2};
use flotor_core::trace::Events;
use flotor_history::History;
use flotor_history::derived::ForcePosition;
use flotor_history::quantity::{Quantity, Units};
use flotor_plot::{Axis, Figure, Mark, Panel, Paper, Series, Spans};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Error of an export.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// The file cannot be written.
    #[error("cannot write `{}`: {cause}; check the folder, its permissions and the free disk space", path.display())]
    Write {
        /// Path of the file.
        path: PathBuf,
        /// Error of the system.
        #[source]
        cause: std::io::Error,
    },
    /// The picture is too low for the traces.
    #[error(transparent)]
    TooLow(#[from] TooLow),
}

/// Pixels per point of a picture.
const SCALE: f32 = 2.0;
/// Height of title and margins, points.
const TITLE_PT: f32 = 66.0;

/// Writes the shown traces of a device to an unused file name in the working folder; returns its path. `device` is the device's
/// name, if the run has several devices.
///
/// # Errors
/// [`ExportError`] if the file cannot be written, or a picture is too low for the traces.
pub fn export(
    history: &History,
    device: Option<&str>,
    plots: &PlotStack,
    format: ExportFormat,
) -> Result<PathBuf, ExportError> {
    let path = free_name(format.extension());
    write(history, device, plots, format, &path)?;
    Ok(path)
}

/// Writes the shown traces of a device to a file.
///
/// # Errors
/// [`ExportError`] if the file cannot be written, or a picture is too low for the traces.
pub fn write(
    history: &History,
    device: Option<&str>,
    plots: &PlotStack,
    format: ExportFormat,
    path: &Path,
) -> Result<(), ExportError> {
    if format != ExportFormat::Csv {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // pixels
        let [height_px, least_px] =
            [plots.export.size_px[1], least_height_px(plots)].map(|length| length as usize);
        plots.has_room(height_px, least_px)?;
    }
    let written = match format {
        ExportFormat::Csv => std::fs::write(path, csv(history, plots)),
        ExportFormat::Svg => std::fs::write(path, svg(history, device, plots)),
        ExportFormat::Png => write_png(path, &png(history, device, plots)).map_err(|error| match error {
            PictureError::Write { cause, .. } => cause,
            other => std::io::Error::other(other),
        }),
    };
    written.map_err(|cause| ExportError::Write { path: path.to_owned(), cause })
}

/// Returns the smallest height for a picture with readable traces, pixels.
#[must_use]
pub fn least_height_px(plots: &PlotStack) -> f64 {
    f64::from((SCALE * (plots.least_height_pt() + TITLE_PT)).ceil())
}

/// Returns every sample of the displayed time span as CSV, with a column and its unit for each component.
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

/// Returns the traces as SVG lines, and force over position if shown.
#[must_use]
pub fn svg(history: &History, device: Option<&str>, plots: &PlotStack) -> String {
    let [from_s, to_s] = plots.span_s(history);
    let panel = |quantity: &Quantity| {
        let (unit, per_si) = quantity.unit(plots.units);
        let line = |(component, name): (usize, &&str)| {
            let samples = history.between(from_s, to_s);
            Series::line(*name, samples.map(|s| (s.time_s(), quantity.value(s, component) * per_si)))
                .axis(component)
        };
        let axis = Axis::linear(quantity.name(), unit).least_range(quantity.least_range(plots.units));
        let axis = match plots.values_of(*quantity) {
            Some([low, high]) => axis.range(low * per_si, high * per_si),
            None => axis,
        };
        let lines = quantity.components().iter().enumerate().map(line);
        with_events(history, [from_s, to_s], lines.fold(Panel::new(axis), Panel::series))
    };
    let paper = match plots.export.look {
        Look::Light => Paper::Light,
        Look::Dark => Paper::Dark,
    };
    let run = subtitle_of(history.run());
    let curve =
        plots.force_position.axis.map(|axis| (axis, ForcePosition::of(history.between(from_s, to_s), axis)));
    let subtitle = match &curve {
        // The heading of a panel is a single line, too short for these numbers.
        Some((_, curve)) => format!("{run}. Force over position: {}", said(curve, plots.units)),
        None => run,
    };
    let figure =
        Figure::new(plots.export.title(history, device), Axis::linear("Time", "s").range(from_s, to_s))
            .subtitle(subtitle)
            .size_px(plots.export.size_px.map(|length| length / f64::from(SCALE)))
            .scale(f64::from(SCALE))
            .paper(paper);
    let beside = curve.map(|(axis, curve)| force_position(&curve, plots.units, axis));
    plots.in_sight().iter().map(panel).chain(beside).fold(figure, Figure::panel).to_svg()
}

/// Marks faults and limits of the displayed time in a panel.
fn with_events(history: &History, [from_s, to_s]: [f64; 2], mut panel: Panel) -> Panel {
    let (mut limited, mut faults) = (Spans::default(), Events::NONE);
    for sample in history.between(from_s, to_s) {
        for (fault, name) in sample.events.named().filter(|(event, _)| Events::FAULTS.intersects(*event)) {
            if !faults.intersects(fault) {
                panel = panel.mark(Mark::fault_at_x(sample.time_s(), name));
            }
        }
        // A fault is marked only at its start.
        faults = sample.events;
        match sample.events.intersects(Events::LIMITS) {
            true => limited.extend(sample.time_s()),
            false => limited.interrupt(),
        }
    }
    panel.limited(limited)
}

/// Returns the panel of force over position along an axis.
fn force_position(curve: &ForcePosition, units: Units, axis: usize) -> Panel {
    let (unit, per_m) = Quantity::Position.unit(units);
    let name = Quantity::Position.components().get(axis).copied().unwrap_or_default();
    let points = curve.points.iter().map(|[x, force]| (x * per_m, *force));
    let position =
        Axis::linear(format!("Position {name}"), unit).least_range(Quantity::Position.least_range(units));
    Panel::with_x(position, Axis::of("Force on the hand", flotor_plot::Quantity::Force))
        .series(Series::line("", points).axis(axis))
}

fn png(history: &History, device: Option<&str>, plots: &PlotStack) -> egui::ColorImage {
    let (look, size_px) = (plots.export.look, plots.export.size_px);
    let palette = Palette::of(look);
    let mut plots = plots.clone();
    #[allow(clippy::cast_possible_truncation)] // pixels
    let size = vec2(size_px[0] as f32, size_px[1] as f32);
    let title = plots.export.title(history, device);
    draw_without_window(pixels(size), SCALE, look, |ui| {
        let inside = ui.max_rect().shrink2(vec2(16.0, 8.0));
        let mut ui = ui.new_child(UiBuilder::new().max_rect(inside));
        ui.heading(&title);
        ui.weak(subtitle_of(history.run()));
        plots.still(&mut ui, TraceSource { history, device: None, compared: None }, f64::NAN, &palette);
    })
}

fn free_name(ending: &str) -> PathBuf {
    let names = (1..).map(|number| PathBuf::from(format!("flotor-traces-{number}.{ending}")));
    names.into_iter().find(|path| !path.exists()).unwrap_or_default()
}
