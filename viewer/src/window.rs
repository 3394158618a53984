//! A real window: display, device, and what is said where there is none.

use crate::app::{Start, Viewer};
use crate::palette::Look;
use egui::ViewportBuilder;
use std::panic::{self, AssertUnwindSafe};

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

/// Opens a window and stays until it is closed.
///
/// # Errors
/// [`WindowError`].
pub fn open(start: Start, look: Look, size: [usize; 2], scale: f32) -> Result<(), WindowError> {
    #[allow(clippy::cast_precision_loss)] // pixels
    let size = size.map(|length| length as f32);
    let viewport = ViewportBuilder::default()
        .with_title("Flotor")
        .with_app_id("flotor-viewer")
        .with_inner_size(size)
        .with_min_inner_size([640.0, 480.0]);
    let options = eframe::NativeOptions { viewport, ..eframe::NativeOptions::default() };
    let run = || {
        eframe::run_native(
            "flotor-viewer",
            options,
            Box::new(move |creation| {
                creation.egui_ctx.set_zoom_factor(scale);
                let device = creation.wgpu_render_state.as_ref();
                Ok(Box::new(Viewer::new(&creation.egui_ctx, device, start, look)))
            }),
        )
    };
    // Libraries of the display that are missing are a panic of those who load them.
    let said = panic::take_hook();
    panic::set_hook(Box::new(|_| {}));
    let result = panic::catch_unwind(AssertUnwindSafe(run));
    panic::set_hook(said);
    match result {
        Ok(Ok(())) => Ok(()),
        Ok(Err(eframe::Error::Wgpu(error))) => Err(WindowError::NoAdapter(one_line(&error.to_string()))),
        Ok(Err(error)) => Err(WindowError::NoDisplay(one_line(&error.to_string()))),
        Err(panic) => {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
            Err(WindowError::NoDisplay(one_line(text.unwrap_or("the display's libraries do not work"))))
        }
    }
}

/// The first line of what a library says, without its full stop.
fn one_line(text: &str) -> String {
    let line = text.lines().map(str::trim).find(|line| !line.is_empty()).unwrap_or("nothing can be opened");
    line.trim_end_matches('.').to_owned()
}
