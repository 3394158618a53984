//! Window for a person in a sitting: one screen at a time and the emergency stop.

use super::{Source, Viewer};
use crate::experiment::{Prompt, key_of, screens};
use crate::palette::Palette;
use crate::scene::SceneBuilder;
use egui::{CentralPanel, Frame, Key, Panel as Edge, Rect, Ui, ViewportCommand};
use flotor_live::Ask;
use flotor_study::screen::Screen;

/// Height of the bar as a fraction of the window height, and its smallest height, points.
const BAR_PART: f32 = 0.06;
const LEAST_BAR_PT: f32 = 48.0;

impl Viewer {
    /// Returns the prompt of the sitting; `None` in a window for an experimenter.
    #[must_use]
    pub fn prompt(&self) -> Option<&Prompt> {
        self.sitting.as_ref()
    }

    /// Shows the screen of a sitting, and sends the input of the person to the experiment.
    pub(super) fn sit(&mut self, ui: &mut Ui, palette: &Palette) {
        let is_running = self.source.is_running();
        let stop_key = self.sitting.as_ref().map(|prompt| key_of(prompt.stop_key));
        if is_running && stop_key.is_some_and(|key| ui.input(|input| input.key_pressed(key))) {
            self.ask(Ask::EmergencyStop);
        }
        let Some(mut prompt) = self.sitting.take() else { return };
        if prompt.poll() {
            self.bell.ring();
        }
        if let Some(rest) = prompt.warned_for() {
            ui.ctx().request_repaint_after(rest); // to hide the warning again
        }
        if prompt.screen() == Some(&Screen::Over) || prompt.is_lost() {
            if ui.input(|input| input.key_pressed(Key::Enter)) {
                ui.ctx().send_viewport_cmd(ViewportCommand::Close);
            }
        } else if is_running {
            screens::keys(ui).into_iter().for_each(|key| prompt.key(key));
        }
        let plain = Frame::new().fill(palette.panel).inner_margin(egui::Margin::symmetric(16, 4));
        self.sitting = Some(prompt); // the bar reads its texts
        let bar_pt = (BAR_PART * ui.available_height()).max(LEAST_BAR_PT);
        Edge::top("top")
            .exact_size(bar_pt)
            .frame(plain)
            .show_separator_line(false)
            .show(ui, |ui| self.top(ui, palette));
        let Some(prompt) = self.sitting.take() else { return };
        CentralPanel::default().frame(Frame::new().fill(palette.panel)).show(ui, |ui| {
            let area = ui.max_rect();
            self.screen(ui, area, &prompt, palette);
        });
        self.sitting = Some(prompt);
    }

    fn screen(&mut self, ui: &mut Ui, area: Rect, prompt: &Prompt, palette: &Palette) {
        let texts = &prompt.texts;
        let samples = self.devices.at(self.player.now_s);
        match (&self.source, prompt.screen(), samples) {
            (_, Some(Screen::Over), _) => screens::show(ui, area, prompt, palette),
            _ if prompt.is_lost() => {
                screens::line(ui, area, [&texts.experiment_stopped, &texts.call], palette)
            }
            (Source::Live { .. }, ..) if !self.source.is_running() => {
                screens::line(ui, area, [&texts.device_stopped, &texts.call], palette);
            }
            (Source::Live { .. } | Source::Recording, Some(_), Some(samples)) => {
                if prompt.shows_scene() {
                    // The picture must not reveal the stiffness: no arrows, no colours of the moment's
                    // largest force, and a wire that does not follow the parameters.
                    self.view.shows_arrows = false;
                    self.scene(ui, screens::beneath_scene(area).0, &samples);
                    self.view.keys(ui, SceneBuilder::extent(&self.shapes, self.devices.count()));
                }
                screens::show(ui, area, prompt, palette);
            }
            _ => screens::line(ui, area, [&texts.wait, &texts.starting], palette),
        }
    }
}
