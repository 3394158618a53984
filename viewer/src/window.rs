//! Window on a display, and errors without a display or adapter.

use crate::app::{Start, Viewer};
use crate::cost::{self, Cost};
use crate::display_options::DisplayOptions;
use crate::palette::{Look, Palette};
use crate::pointer_order::PointerOrder;
use crate::saved_settings::SavedSettings;
use egui::{Ui, ViewportBuilder};
use std::any::Any;
use std::panic::{self, AssertUnwindSafe};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::time::Duration;

/// Smallest width and height of a window, points: room for emergency stop, state, warnings and clock.
const LEAST_SIZE_PT: [f32; 2] = [320.0, 200.0];

/// Error of a window.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WindowError {
    /// There is no display.
    #[error(
        "cannot open a window: {0}; without a display, `flotor view --screenshot OUT.png FILE.mcap` draws a \
         picture"
    )]
    NoDisplay(String),
    /// There is no adapter for drawing.
    #[error(
        "cannot open a window: {0}; install a driver for your GPU, or (Debian, Ubuntu) `libegl1 libgl1-mesa-dri` \
         for drawing on the processor; without either, `flotor view --screenshot OUT.png FILE.mcap` draws a picture"
    )]
    NoAdapter(String),
    /// The display or the adapter of an open window was lost.
    #[error("the window was lost: {0}; check the display and its driver")]
    Lost(String),
    /// The program panicked in an open window; the panic hook has printed the place in the source.
    #[error("internal error of the window: {0}; please report this error with your last action")]
    Broken(String),
}

/// Options of a window; an option that is not given keeps its saved setting.
#[derive(Clone, Copy, Debug, Default, PartialEq, clap::Args)]
pub struct WindowOptions {
    /// Light or dark (default: dark, with --export light; in a window: the look of the last window)
    #[arg(long, value_enum)]
    pub look: Option<Look>,
    /// Width and height of picture or window, 64 to 8192 pixels each (default: 1280x800, with --export 1800x1000, higher if
    /// the traces need it; in a window: the size of the last window)
    #[arg(long, value_parser = size, value_name = "WxH")]
    pub size: Option<[usize; 2]>,
    /// Size of text and lines, 1 to 3 (default: 1; in a window: the scale of the last window)
    #[arg(long, value_parser = scale, value_name = "FACTOR", conflicts_with = "export")]
    pub scale: Option<f32>,
    /// Measure processor time and memory of the opened window over 1 to 3600 seconds, then close it; opening may take up to half
    /// a minute more
    #[arg(long, value_parser = seconds, value_name = "SECONDS", conflicts_with_all = ["screenshot", "export", "sitting"])]
    pub measure: Option<Duration>,
}

/// Parses a size in pixels, such as `1280x800`.
fn size(text: &str) -> Result<[usize; 2], String> {
    let wrong = || {
        format!(
            "`{text}` is not a size; write width and height in pixels, as in 1280x800, each from 64 to 8192"
        )
    };
    let (width, height) = text.split_once('x').ok_or_else(wrong)?;
    let length =
        |text: &str| text.parse().ok().filter(|length| (64..=8192).contains(length)).ok_or_else(wrong);
    Ok([length(width)?, length(height)?])
}

/// Parses a duration in seconds, such as `10`.
fn seconds(text: &str) -> Result<Duration, String> {
    let wrong = || format!("`{text}` is not a valid duration; write 1 to 3600 seconds");
    let seconds: f64 =
        text.parse().ok().filter(|seconds| (1.0..=3600.0).contains(seconds)).ok_or_else(wrong)?;
    Ok(Duration::from_secs_f64(seconds))
}

/// Parses a scale of text, such as `1.5`.
fn scale(text: &str) -> Result<f32, String> {
    let wrong = || format!("`{text}` is not a valid scale of text; write 1 to 3");
    text.parse().ok().filter(|scale| (1.0..=3.0).contains(scale)).ok_or_else(wrong)
}

/// Returns the settings to save: the current settings, except options of the command line that the user has not changed since.
fn for_the_next_time(
    mut now: SavedSettings,
    before: &SavedSettings,
    request: WindowOptions,
    chosen: &DisplayOptions,
) -> SavedSettings {
    if chosen.traces() == Some(&now.traces[..]) {
        now.traces.clone_from(&before.traces);
    }
    if request.look == Some(now.look) {
        now.look = before.look;
    }
    if request.scale.is_some_and(|scale| (scale - now.zoom).abs() < 1.0e-3) {
        now.zoom = before.zoom;
    }
    let is_as_requested = |size: [usize; 2]| {
        size.iter().zip(now.size_pt).all(|(requested, is)| (*requested as f32 - is).abs() < 2.0)
    };
    if request.size.is_some_and(is_as_requested) {
        now.size_pt = before.size_pt;
    }
    now
}

/// Opens a window and blocks until it is closed; returns its cost, if `request` has a duration to measure.
///
/// # Errors
/// [`WindowError`] without a display or an adapter, or if the open window is lost or panics.
pub fn open(
    start: Start,
    chosen: DisplayOptions,
    request: WindowOptions,
) -> Result<Option<Cost>, WindowError> {
    // A sitting looks the same for all users.
    let file = if matches!(start, Start::Sitting(..)) { None } else { SavedSettings::file() };
    let mut saved_settings = file.as_deref().map(SavedSettings::load).unwrap_or_default();
    let before = saved_settings.clone();
    saved_settings.look = request.look.unwrap_or(saved_settings.look);
    saved_settings.zoom = request.scale.unwrap_or(saved_settings.zoom);
    let size = request.size.map_or(saved_settings.size_pt, |size| size.map(|length| length as f32));
    let viewport = ViewportBuilder::default()
        .with_title("Flotor")
        .with_app_id("flotor-viewer")
        .with_inner_size(size)
        .with_min_inner_size(LEAST_SIZE_PT)
        // A subject sees only the screen of the sitting.
        .with_fullscreen(matches!(start, Start::Sitting(..)));
    let options = eframe::NativeOptions { viewport, ..eframe::NativeOptions::default() };
    let (tells, watched) = channel();
    watched_over(|opened| {
        let opened = Arc::clone(opened);
        eframe::run_native(
            "flotor-viewer",
            options,
            Box::new(move |creation| {
                opened.store(true, Ordering::Relaxed);
                creation.egui_ctx.set_zoom_factor(saved_settings.zoom);
                let device = creation.wgpu_render_state.as_ref();
                let mut viewer = Viewer::new(&creation.egui_ctx, device, start, saved_settings.look);
                viewer.restore(&creation.egui_ctx, &saved_settings);
                viewer.choose(&chosen);
                Ok(Box::new(Kept {
                    viewer,
                    file,
                    kept: saved_settings,
                    before,
                    request,
                    chosen,
                    pointer: PointerOrder::default(),
                    measure: request.measure.map(|duration| (duration, tells)),
                }))
            }),
        )
    })?;
    Ok(watched.try_recv().ok())
}

/// Runs a window, which sets the flag when open, and converts its end to a result. Missing libraries of the display cause a panic
/// in the crates that load them: until the window is open, a panic means that there is no display, and becomes one line.
/// Afterwards a panic is a bug; the previous hook prints the panic with its place, whether it can be caught or not.
fn watched_over(run: impl FnOnce(&Arc<AtomicBool>) -> eframe::Result) -> Result<(), WindowError> {
    let opened = Arc::new(AtomicBool::new(false));
    let before = Arc::new(panic::take_hook());
    let (is_open, tells) = (Arc::clone(&opened), Arc::clone(&before));
    panic::set_hook(Box::new(move |info| {
        if is_open.load(Ordering::Relaxed) {
            tells(info);
        }
    }));
    let result = panic::catch_unwind(AssertUnwindSafe(|| run(&opened)));
    panic::set_hook(Box::new(move |info| before(info)));
    match (result, opened.load(Ordering::Relaxed)) {
        (Ok(Ok(())), _) => Ok(()),
        (Ok(Err(error)), true) => Err(WindowError::Lost(one_line(&error.to_string()))),
        (Ok(Err(eframe::Error::Wgpu(error))), false) => {
            Err(WindowError::NoAdapter(one_line(&error.to_string())))
        }
        (Ok(Err(error)), false) => Err(WindowError::NoDisplay(one_line(&error.to_string()))),
        (Err(panic), true) => Err(WindowError::Broken(words_of(&*panic, "a panic without a message"))),
        (Err(panic), false) => {
            Err(WindowError::NoDisplay(words_of(&*panic, "the libraries of the display cannot be loaded")))
        }
    }
}

/// Returns the message of a panic in one line.
fn words_of(panic: &(dyn Any + Send), otherwise: &str) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    one_line(text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or(otherwise))
}

/// Window that saves its settings whenever they change.
struct Kept {
    viewer: Viewer,
    file: Option<PathBuf>,
    kept: SavedSettings,
    /// Saved settings at the start, and the options of the command line, which are not saved.
    before: SavedSettings,
    request: WindowOptions,
    chosen: DisplayOptions,
    pointer: PointerOrder,
    /// Pending measurement: its duration, and the channel for the result.
    measure: Option<(Duration, Sender<Cost>)>,
}

impl eframe::App for Kept {
    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        if let Some((duration, tells)) = self.measure.take() {
            cost::watch(ui.ctx(), duration, tells);
        }
        self.viewer.show(ui);
        let Some(file) = &self.file else { return };
        let zoom = ui.ctx().zoom_factor();
        // In points without the zoom, because the next window opens before its zoom is set.
        let size_pt = ui.input(|input| input.viewport().inner_rect.map(|rect| (rect.size() * zoom).into()));
        let now =
            SavedSettings { size_pt: size_pt.unwrap_or(self.kept.size_pt), zoom, ..self.viewer.settings() };
        let now = for_the_next_time(now, &self.before, self.request, &self.chosen);
        // Do not save with every picture during a drag.
        if now != self.kept && !ui.input(|input| input.pointer.any_down()) {
            let _ = now.save(file); // a full disk only loses the settings
            self.kept = now;
        }
    }

    fn raw_input_hook(&mut self, context: &egui::Context, input: &mut egui::RawInput) {
        if self.pointer.split(input) {
            context.request_repaint();
        }
    }

    fn clear_color(&self, _visuals: &egui::Visuals) -> [f32; 4] {
        Palette::of(self.viewer.look()).panel.to_normalized_gamma_f32()
    }
}

/// Returns the first line of a library's message, without the full stop and without the place in the source, which is useless to users
/// without a display.
fn one_line(text: &str) -> String {
    let line =
        text.lines().map(str::trim).find(|line| !line.is_empty()).unwrap_or("no display can be opened");
    let words = match line.split_once(".rs:") {
        Some((before, after)) if before.contains(" at ") => {
            after.trim_start_matches(|c: char| c.is_ascii_digit() || c == ':').trim_start()
        }
        _ => line,
    };
    words.trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_history::quantity::Quantity;

    #[test]
    fn what_a_command_line_says_is_for_this_time_only() {
        let before = SavedSettings::default();
        let request = WindowOptions {
            look: Some(Look::Light),
            size: Some([640, 400]),
            scale: Some(2.0),
            measure: None,
        };
        let as_requested = SavedSettings {
            look: Look::Light,
            zoom: 2.0,
            size_pt: [640.0, 400.0],
            ..SavedSettings::default()
        };
        let nothing = DisplayOptions::default();
        let as_it_is = for_the_next_time(as_requested.clone(), &before, WindowOptions::default(), &nothing);
        assert_eq!(as_it_is, as_requested);
        let pulled = SavedSettings { zoom: 1.5, size_pt: [900.0, 700.0], ..as_requested.clone() };
        let kept = for_the_next_time(pulled.clone(), &before, request, &nothing);
        assert_eq!(kept, SavedSettings { look: before.look, ..pulled }, "what was changed since is kept");
        let kept = for_the_next_time(as_requested.clone(), &before, request, &nothing);
        assert_eq!(kept, before);
        let chosen = DisplayOptions::new(0, vec![Quantity::Energy], None);
        let energy = SavedSettings { traces: vec![Quantity::Energy], ..as_requested };
        assert_eq!(for_the_next_time(energy, &before, request, &chosen), before);
    }

    /// One test: the hook that is told of panics is one for all threads.
    #[test]
    fn only_a_window_that_never_opened_is_called_none() {
        let missing = watched_over(|_| panic!("libX11.so.6 not found")).expect_err("it cannot go well");
        let said = missing.to_string();
        assert!(matches!(missing, WindowError::NoDisplay(_)) && said.contains("libX11.so.6"), "{said}");

        let place =
            "event loop: os error at /a/winit/src/linux/mod.rs:757: neither DISPLAY nor the other is set.";
        assert_eq!(one_line(place), "neither DISPLAY nor the other is set");

        let broken = watched_over(|opened| {
            opened.store(true, Ordering::Relaxed);
            panic!("index out of bounds")
        });
        let said = broken.expect_err("it broke").to_string();
        assert!(
            said.starts_with("internal error of the window: index out of bounds;")
                && !said.contains("cannot open a window"),
            "{said}"
        );

        let error = || Err(eframe::Error::AppCreation("gone".into()));
        assert!(matches!(watched_over(|_| error()), Err(WindowError::NoDisplay(_))));
        let lost = watched_over(|opened| {
            opened.store(true, Ordering::Relaxed);
            error()
        });
        assert!(matches!(lost, Err(WindowError::Lost(_))));
        assert!(watched_over(|_| Ok(())).is_ok());
    }
}
