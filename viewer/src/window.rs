//! A real window: display, device, and what is said where there is none.

use crate::app::{Start, Viewer};
use crate::cost::{self, Cost};
use crate::palette::{Look, Palette};
use crate::remembered::Remembered;
use egui::{Ui, ViewportBuilder};
use std::panic::{self, AssertUnwindSafe};
use std::path::PathBuf;
use std::sync::mpsc::{Sender, channel};
use std::time::Duration;

/// Why there is no window.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WindowError {
    /// Nowhere to open it.
    #[error(
        "no window: {0}; without a display, `flotor view --screenshot OUT.png FILE.mcap` draws a picture"
    )]
    NoDisplay(String),
    /// Nothing to draw it with.
    #[error(
        "no window: {0}; install a driver for your GPU, or `libegl1 libgl1-mesa-dri` for drawing on the processor; without \
         either, `flotor view --screenshot OUT.png FILE.mcap` draws a picture"
    )]
    NoAdapter(String),
}

/// What a command line says about a window; what it does not say is as it was the last time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WindowWish {
    /// Light or dark.
    pub look: Option<Look>,
    /// Width and height, points.
    pub size: Option<[usize; 2]>,
    /// Size of text and lines.
    pub scale: Option<f32>,
    /// Watch what the window costs for so long, and close it then.
    pub measure: Option<Duration>,
}

/// Opens a window and stays until it is closed; gives what it cost, if that was asked for.
///
/// # Errors
/// [`WindowError`].
pub fn open(start: Start, wish: WindowWish) -> Result<Option<Cost>, WindowError> {
    // A sitting looks the same for everybody.
    let file = if matches!(start, Start::Sitting(..)) { None } else { Remembered::file() };
    let mut remembered = file.as_deref().map(Remembered::load).unwrap_or_default();
    remembered.look = wish.look.unwrap_or(remembered.look);
    remembered.zoom = wish.scale.unwrap_or(remembered.zoom);
    #[allow(clippy::cast_precision_loss)] // pixels
    let size = wish.size.map_or(remembered.size_pt, |size| size.map(|length| length as f32));
    let viewport = ViewportBuilder::default()
        .with_title("Flotor")
        .with_app_id("flotor-viewer")
        .with_inner_size(size)
        .with_min_inner_size([640.0, 480.0]);
    let options = eframe::NativeOptions { viewport, ..eframe::NativeOptions::default() };
    let (tells, watched) = channel();
    let run = || {
        eframe::run_native(
            "flotor-viewer",
            options,
            Box::new(move |creation| {
                creation.egui_ctx.set_zoom_factor(remembered.zoom);
                let device = creation.wgpu_render_state.as_ref();
                let mut viewer = Viewer::new(&creation.egui_ctx, device, start, remembered.look);
                viewer.recall(&creation.egui_ctx, &remembered);
                Ok(Box::new(Kept {
                    viewer,
                    file,
                    kept: remembered,
                    measure: wish.measure.map(|duration| (duration, tells)),
                }))
            }),
        )
    };
    // Libraries of the display that are missing are a panic of those who load them.
    let said = panic::take_hook();
    panic::set_hook(Box::new(|_| {}));
    let result = panic::catch_unwind(AssertUnwindSafe(run));
    panic::set_hook(said);
    match result {
        Ok(Ok(())) => Ok(watched.try_recv().ok()),
        Ok(Err(eframe::Error::Wgpu(error))) => Err(WindowError::NoAdapter(one_line(&error.to_string()))),
        Ok(Err(error)) => Err(WindowError::NoDisplay(one_line(&error.to_string()))),
        Err(panic) => {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
            Err(WindowError::NoDisplay(one_line(text.unwrap_or("the display's libraries do not work"))))
        }
    }
}

/// A window whose choices are kept whenever they change.
struct Kept {
    viewer: Viewer,
    file: Option<PathBuf>,
    kept: Remembered,
    /// What is still to be watched, and who wants to know.
    measure: Option<(Duration, Sender<Cost>)>,
}

impl eframe::App for Kept {
    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        if let Some((duration, tells)) = self.measure.take() {
            cost::watch(ui.ctx(), duration, tells);
        }
        self.viewer.show(ui);
        let Some(file) = &self.file else { return };
        let size_pt = ui.input(|input| input.viewport().inner_rect.map(|rect| rect.size().into()));
        let now = Remembered {
            size_pt: size_pt.unwrap_or(self.kept.size_pt),
            zoom: ui.ctx().zoom_factor(),
            ..self.viewer.remembered()
        };
        // Not with every picture while something is pulled.
        if now != self.kept && !ui.input(|input| input.pointer.any_down()) {
            let _ = now.save(file); // a full disk costs the choices of the next time, and nothing now
            self.kept = now;
        }
    }

    fn clear_color(&self, _visuals: &egui::Visuals) -> [f32; 4] {
        Palette::of(self.viewer.look()).panel.to_normalized_gamma_f32()
    }
}

/// The first line of what a library says, without its full stop.
fn one_line(text: &str) -> String {
    let line = text.lines().map(str::trim).find(|line| !line.is_empty()).unwrap_or("nothing can be opened");
    line.trim_end_matches('.').to_owned()
}
