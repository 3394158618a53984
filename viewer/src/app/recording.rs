//! Recordings in the window: in place of a run, or over it.

use super::source::{Parts, Source};
use super::{Heading, Recorded, Viewer};
use crate::devices::Devices;
use crate::scene::SceneBuilder;
use crate::ui::plot_stack::Window;
use egui::{DroppedFile, Ui};
use flotor_history::compared::Compared;
use flotor_history::player::Player;
use flotor_history::{History, Sample};
use std::path::{Path, PathBuf};
use std::sync::Arc;

impl Viewer {
    /// Opens a recording dropped on an empty window; otherwise shows it over the current run, so that a session and its emergency stop stay
    /// visible.
    pub(super) fn open_dropped(&mut self, ui: &Ui) {
        let path = |file: &Arc<dyn DroppedFile + Send + Sync>| file.path().to_path_buf();
        let dropped: Vec<PathBuf> = ui.input(|input| input.raw.dropped_files.iter().map(path).collect());
        for file in dropped {
            if matches!(self.source, Source::Waiting(_)) {
                self.open(&file);
            } else {
                self.lay_over(&file);
            }
        }
    }

    /// Shows a recording over the current run, or a warning if the file cannot be read.
    fn lay_over(&mut self, file: &Path) {
        match Compared::read(file) {
            Ok(compared) => {
                self.compared = Some(compared);
                self.plots.forget_compared();
            }
            Err(error) => self.say(error.to_string()),
        }
    }

    /// Shows a recording in place of the current run, or a warning if the file cannot be read.
    pub(super) fn open(&mut self, file: &Path) {
        match History::read(file) {
            Ok(histories) => {
                let plugins = self.opening.plugins.clone();
                self.opening.typed.clear();
                self.show_recording(Recorded {
                    file: Some(file.into()),
                    ..Recorded::new(histories, plugins)
                });
            }
            Err(error) => self.say(error.to_string()),
        }
    }

    /// Shows a recording, at the time of the largest force unless another time is given.
    pub(super) fn show_recording(&mut self, recorded: Recorded) {
        let Recorded { histories, at_s, plugins, file, compared } = recorded;
        let devices = Devices::new(histories);
        let parts = Parts::of_recording(devices.history().run(), &plugins);
        let strongest_s = devices.history().strongest().map(Sample::time_s);
        self.opening.plugins = plugins;
        file.iter().for_each(|file| self.opening.remember(file));
        self.replace_run(Source::Recording, devices, parts);
        self.compared = compared;
        self.player = Player::at(at_s.or(strongest_s).unwrap_or(0.0));
        self.plots.window = Window::Whole;
    }

    /// Replaces the displayed run by another; resets view and plots, and ends a drag and a comparison.
    pub(super) fn replace_run(&mut self, source: Source, devices: Devices, parts: Parts) {
        let Parts { shapes, panels, missing, guide, limits } = parts;
        self.heading = Heading::of(devices.history().run());
        self.view.reset(SceneBuilder::extent(&shapes, devices.count()));
        (self.source, self.devices) = (source, devices);
        (self.shapes, self.panels, self.missing) = (shapes, panels, missing);
        self.shape_version += 1;
        (self.guide, self.drag, self.limits) = (guide, None, limits);
        self.compared = None;
        self.plots.start_over();
    }
}
