//! The window in front of a subject: one screen at a time, the emergency stop, and nothing else.

use super::{Source, Viewer};
use crate::experiment::{Experiment, screens};
use crate::palette::Palette;
use crate::scene::Visible;
use crate::ui::view3d::Subject;
use egui::{CentralPanel, Frame, Key, Panel as Edge, Ui};
use flotor_live::{Ask, SetValue};

/// A sitting in a window.
pub struct Sitting {
    pub(super) experiment: Experiment,
    /// The value the loop was told last.
    told: Option<f64>,
    /// Why it cannot go on.
    pub(super) broken: Option<String>,
}

impl Sitting {
    pub(super) fn new(experiment: Experiment) -> Self {
        Self { experiment, told: None, broken: None }
    }
}

impl Viewer {
    /// The sitting under way, if this window is one.
    #[must_use]
    pub fn experiment(&self) -> Option<&Experiment> {
        self.sitting.as_ref().map(|sitting| &sitting.experiment)
    }

    /// Shows the screen of a sitting, follows keys, and tells the loop what is to be felt.
    pub(super) fn sit(&mut self, ui: &mut Ui, palette: &Palette) {
        let is_running = self.source.is_running();
        if is_running && ui.input(|input| input.key_pressed(Key::Space)) {
            self.ask(Ask::EmergencyStop);
        }
        let Some(mut sitting) = self.sitting.take() else { return };
        if is_running && sitting.broken.is_none() {
            for key in screens::keys(ui) {
                sitting.broken = sitting.experiment.key(key).err().map(|error| error.to_string());
            }
            self.tell_stimulus(&mut sitting);
        }
        let plain = Frame::new().fill(palette.panel).inner_margin(egui::Margin::symmetric(16, 4));
        Edge::top("top")
            .exact_size(48.0)
            .frame(plain)
            .show_separator_line(false)
            .show(ui, |ui| self.top(ui, palette));
        CentralPanel::default().frame(Frame::new().fill(palette.panel)).show(ui, |ui| {
            let area = ui.max_rect();
            let sample = self.history.at(self.player.now_s).copied();
            match (&sitting.broken, &self.source, sample) {
                (Some(reason), ..) => self.words(ui, area, "The sitting cannot go on", reason, palette),
                (None, Source::Live { .. }, _) if !is_running => {
                    self.words(ui, area, "The device has stopped", "Please call the experimenter", palette);
                }
                (None, Source::Live { .. }, Some(sample)) => {
                    if sitting.experiment.shows_scene() {
                        // Nothing of what is drawn may tell how stiff it is: no arrows, no colours of the moment's
                        // largest force, and a wire that stays what it is.
                        self.view.visible = Visible { arrows: false, ..Visible::default() };
                        let subject = Subject {
                            shapes: &mut self.shapes,
                            version: self.shape_version,
                            sample: &sample,
                            scale: self.tally.scale(),
                        };
                        self.facts = self.view.show(ui, area, self.look, subject);
                    }
                    screens::show(ui, area, &sitting.experiment, palette);
                }
                _ => self.words(ui, area, "One moment", "The device is being started", palette),
            }
        });
        self.sitting = Some(sitting);
    }

    /// The next stimulus goes to the loop once, before the subject is told to feel it.
    fn tell_stimulus(&mut self, sitting: &mut Sitting) {
        let Some((stimulus, value)) = sitting.experiment.stimulus() else { return };
        if sitting.told == Some(value) {
            return;
        }
        let (plugin, parameter) = (stimulus.model.clone(), stimulus.parameter.clone());
        self.ask(Ask::Set { values: vec![SetValue { plugin, parameter, value: value.to_string() }] });
        sitting.told = Some(value);
    }
}
