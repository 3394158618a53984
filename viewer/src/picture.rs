//! Picture of a run at one time, without a window, a display or a GPU.

use crate::canvas::Canvas;
use crate::devices::Devices;
use crate::display_options::DisplayOptions;
use crate::flat::FlatRasterizer;
use crate::palette::{Look, Palette};
use crate::scene::{Moment, SceneBuilder, SceneFacts};
use crate::shape::Shape;
use crate::ui::overlay::Overlay;
use crate::ui::plot_stack::{PlotStack, TooLow, TraceSource, Window};
use crate::ui::view3d::{Subject, View3d};
use crate::ui::{legend, readout, style};
use egui::{ColorImage, Context, RawInput, Rect, Ui, pos2, vec2};
use flotor_drawing::camera::{Camera, View};
use flotor_history::History;
use flotor_history::quantity::Units;
use std::path::{Path, PathBuf};

/// Options of a picture.
#[derive(Clone, Debug)]
pub struct PictureOptions {
    /// Width and height, pixels.
    pub size_px: [usize; 2],
    /// Pixels per point: 2 draws everything twice as large as 1.
    pub scale: f32,
    /// Colour scheme of the picture, light or dark.
    pub look: Look,
    /// Direction and zoom; `None`: the default view.
    pub view: Option<View>,
    /// Display options.
    pub chosen: DisplayOptions,
    /// Time, s; `None`: the time of the largest force.
    pub at_s: Option<f64>,
}

/// Error of a picture.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// The recording has no ticks.
    #[error("the recording has no ticks to show; record a longer run")]
    Empty,
    /// The run has no device of this name.
    #[error("the run has no device `{name}`; name one of its devices: {}", known.join(", "))]
    Device {
        /// Requested name.
        name: String,
        /// Names of the devices of the run.
        known: Vec<String>,
    },
    /// The time is outside the recording.
    #[error("{at_s} s is outside the recording; choose a time from {:.4} to {:.4} s", span_s[0], span_s[1])]
    Moment {
        /// Requested time, s.
        at_s: f64,
        /// First and last time of the recording, s.
        span_s: [f64; 2],
    },
    /// The picture is too low for the traces.
    #[error(transparent)]
    TooLow(#[from] TooLow),
    /// The file cannot be written.
    #[error("cannot write the picture `{}`: {cause}; check the folder, its permissions and the free disk space", path.display())]
    Write {
        /// Path of the file.
        path: PathBuf,
        /// Error of the system.
        #[source]
        cause: std::io::Error,
    },
}

/// Fraction of the height for the 3D view.
const VIEW_PART: f32 = 0.60;
/// Margins above and below the traces, points.
const BESIDE_PLOTS_PT: f32 = 12.0;
/// Samples per pixel and direction of the 3D view.
const SAMPLES: usize = 3;

/// Returns the number of the device of this name in a recording.
///
/// # Errors
/// [`PictureError::Device`] if there is no such device.
pub fn number_of(histories: &[History], name: &str) -> Result<usize, PictureError> {
    let known = || histories.iter().map(History::device_name);
    let number = known().position(|known| known == name);
    number.ok_or_else(|| PictureError::Device {
        name: name.to_owned(),
        known: known().map(str::to_owned).collect(),
    })
}

/// Checks that a time, s, is inside a recording, from one period before its first tick to 1.5 periods after its last tick; a
/// recording without ticks passes.
///
/// # Errors
/// [`PictureError::Moment`] if the time is outside.
pub fn has_moment(histories: &[History], at_s: f64) -> Result<(), PictureError> {
    let Some(first) = histories.first().filter(|first| !first.is_empty()) else { return Ok(()) };
    let span_s = first.span_s();
    // A run of ten seconds has no tick at 10 s, but users request this time.
    let period_s = 1.0 / first.run().rate_hz.max(1.0);
    let is_inside = at_s >= span_s[0] - period_s && at_s <= span_s[1] + 1.5 * period_s;
    if is_inside { Ok(()) } else { Err(PictureError::Moment { at_s, span_s }) }
}

/// Returns the smallest height of a picture with readable traces at a scale, pixels.
#[must_use]
pub fn least_height_px(chosen: &DisplayOptions, scale: f32) -> usize {
    let mut plots = PlotStack::new(Window::Whole);
    plots.choose(chosen);
    least_height_of_px(&plots, scale)
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // pixels
fn least_height_of_px(plots: &PlotStack, scale: f32) -> usize {
    let least_pt = (plots.least_height_pt() + BESIDE_PLOTS_PT) / (1.0 - VIEW_PART);
    (least_pt * scale).ceil() as usize
}

/// Draws a run at one time: 3D view, numbers, traces.
///
/// # Errors
/// [`PictureError::Empty`] without ticks, [`PictureError::TooLow`] if the traces do not fit.
pub fn picture(
    histories: Vec<History>,
    shapes: &mut [Shape],
    options: &PictureOptions,
) -> Result<ColorImage, PictureError> {
    let interface = interface(histories, shapes, options)?;
    Ok(draw_without_window(options.size_px, options.scale, options.look, interface))
}

/// Returns the interface that shows a run at one time, for [`draw_without_window`].
///
/// # Errors
/// [`PictureError::Empty`] without ticks, [`PictureError::TooLow`] if the traces do not fit.
pub fn interface(
    histories: Vec<History>,
    shapes: &mut [Shape],
    options: &PictureOptions,
) -> Result<impl FnMut(&mut Ui), PictureError> {
    let (look, palette) = (options.look, Palette::of(options.look));
    let mut devices = Devices::new(histories);
    devices.choose(options.chosen.device);
    let mut plots = PlotStack::new(Window::Whole);
    plots.choose(&options.chosen);
    plots.has_room(options.size_px[1], least_height_of_px(&plots, options.scale))?;
    let sample = match options.at_s {
        Some(at_s) => devices.history().at(at_s),
        None => devices.history().strongest(),
    };
    let sample = *sample.ok_or(PictureError::Empty)?;
    let samples = devices.at(sample.time_s()).ok_or(PictureError::Empty)?;
    let scale = devices.scale().with_chosen(options.chosen.arrow_force_n);
    let extent = SceneBuilder::extent(shapes, devices.count());
    let mut view3d = View3d::new(Canvas::on_processor(SAMPLES), extent);
    let aspect = options.size_px[0] as f64 / (options.size_px[1] as f64 * f64::from(VIEW_PART));
    view3d.camera = Camera::of(options.view, extent, aspect);
    let mut facts = SceneFacts::default();
    Ok(move |ui: &mut Ui| {
        let area = ui.max_rect();
        let view = Rect::from_min_size(area.min, vec2(area.width(), (area.height() * VIEW_PART).round()));
        let events = devices.names().zip(&samples).map(|(name, sample)| (name, sample.events));
        let warnings = readout::warnings(&events.collect::<Vec<_>>(), &facts);
        // Warnings must not cover the body.
        let (heading, below_heading) =
            view.split_top_bottom_at_y(view.top() + readout::heading_pt(warnings.len()));
        let body = if warnings.is_empty() { view } else { below_heading };
        let subject = Subject { shapes, version: 0, moment: Moment::of(&samples), scale };
        facts = view3d.show(ui, body, look, subject);
        let mut overlay = Overlay::new(ui.painter(), if warnings.is_empty() { view } else { heading });
        readout::title(&mut overlay, devices.history().run(), &palette);
        readout::paint_warnings(&mut overlay, &warnings, &palette);
        if !warnings.is_empty() {
            overlay = Overlay::new(ui.painter(), body);
        }
        let (units, camera) = (Units::default(), view3d.camera);
        let rows = readout::rows(&sample, units, &palette);
        readout::numbers(&mut overlay, sample.time_s(), &rows, units, &palette);
        legend::paint(&mut overlay, body, &facts, &camera, &palette);
        legend::axes(&mut overlay, &facts, &camera, &palette);
        let names = (devices.names(), devices.chosen());
        legend::names(&mut overlay, body, &facts, &camera, names, &palette);
        let below = Rect::from_min_max(view.left_bottom() + vec2(14.0, 8.0), area.max - vec2(4.0, 4.0));
        let mut ui = ui.new_child(egui::UiBuilder::new().max_rect(below));
        let seen = TraceSource { history: devices.history(), device: devices.name(), compared: None };
        plots.still(&mut ui, seen, sample.time_s(), &palette);
    })
}

/// Lays out an interface in a few passes until its layout is final, and draws it on the CPU.
pub fn draw_without_window(
    size_px: [usize; 2],
    scale: f32,
    look: Look,
    mut interface: impl FnMut(&mut Ui),
) -> ColorImage {
    /// Number of passes: plots have their bounds in the second pass, and the third pass draws the final layout.
    const PASSES: usize = 3;
    /// Largest width and height of a texture, pixels: the same as of the largest picture.
    const MOST_TEXTURE_PX: usize = 8192;
    let context = Context::default();
    style::apply(&context, look);
    let mut rasterizer = FlatRasterizer::default();
    let mut primitives = Vec::new();
    for pass in 0..PASSES {
        let size = vec2(size_px[0] as f32, size_px[1] as f32) / scale;
        let mut input = RawInput {
            screen_rect: Some(Rect::from_min_size(pos2(0.0, 0.0), size)),
            time: Some(pass as f64),
            max_texture_side: Some(MOST_TEXTURE_PX),
            ..RawInput::default()
        };
        if let Some(viewport) = input.viewports.get_mut(&egui::ViewportId::ROOT) {
            viewport.native_pixels_per_point = Some(scale);
        }
        let mut output = context.run_ui(input, &mut interface);
        rasterizer.update(&mut output.textures_delta);
        primitives = context.tessellate(output.shapes, output.pixels_per_point);
    }
    rasterizer.draw(&primitives, size_px, scale, Palette::of(look).panel)
}

/// Writes a picture as PNG.
///
/// # Errors
/// [`PictureError::Write`] if the file cannot be written.
pub fn write_png(path: &Path, image: &ColorImage) -> Result<(), PictureError> {
    let write = || -> Result<(), png::EncodingError> {
        let file = std::io::BufWriter::new(std::fs::File::create(path)?);
        let [width, height] = image.size.map(|length| u32::try_from(length).unwrap_or(u32::MAX));
        let mut encoder = png::Encoder::new(file, width, height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let bytes: Vec<u8> =
            image.pixels.iter().flat_map(|pixel| [pixel.r(), pixel.g(), pixel.b()]).collect();
        encoder.write_header()?.write_image_data(&bytes)
    };
    write().map_err(|cause| PictureError::Write { path: path.into(), cause: cause.into() })
}
