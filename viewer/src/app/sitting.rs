//! The window in front of a person in a sitting: one screen at a time, the emergency stop, and nothing else.

use super::{Source, Viewer};
use crate::experiment::{Prompt, screens};
use crate::palette::Palette;
use crate::scene::SceneBuilder;
use egui::{CentralPanel, Frame, Key, Panel as Edge, Rect, Ui, ViewportCommand};
use flotor_live::Ask;
use flotor_study::screen::Screen;

/// Height of the words beneath the 3D view, points.
const ROOM_FOR_WORDS_PT: f32 = 84.0;

impl Viewer {
    /// The sitting under way, if this window is one.
    #[must_use]
    pub fn prompt(&self) -> Option<&Prompt> {
        self.sitting.as_ref()
    }

    /// Shows the screen of a sitting, and tells the experiment what the person does.
    pub(super) fn sit(&mut self, ui: &mut Ui, palette: &Palette) {
        let is_running = self.source.is_running();
        let stop_key = self.sitting.as_ref().map(|prompt| prompt.stop_key.key());
        if is_running && stop_key.is_some_and(|key| ui.input(|input| input.key_pressed(key))) {
            self.ask(Ask::EmergencyStop);
        }
        let Some(mut prompt) = self.sitting.take() else { return };
        if prompt.take_in() {
            self.bell.ring();
        }
        if let Some(rest) = prompt.warned_for() {
            ui.ctx().request_repaint_after(rest); // to take it out of sight again
        }
        if prompt.screen() == Some(&Screen::Over) || prompt.is_lost() {
            if ui.input(|input| input.key_pressed(Key::Enter)) {
                ui.ctx().send_viewport_cmd(ViewportCommand::Close);
            }
        } else if is_running {
            screens::keys(ui).into_iter().for_each(|key| prompt.key(key));
        }
        let plain = Frame::new().fill(palette.panel).inner_margin(egui::Margin::symmetric(16, 4));
        Edge::top("top")
            .exact_size(48.0)
            .frame(plain)
            .show_separator_line(false)
            .show(ui, |ui| self.top(ui, palette));
        CentralPanel::default().frame(Frame::new().fill(palette.panel)).show(ui, |ui| {
            let area = ui.max_rect();
            self.screen(ui, area, &prompt, palette);
        });
        self.sitting = Some(prompt);
    }

    fn screen(&mut self, ui: &mut Ui, area: Rect, prompt: &Prompt, palette: &Palette) {
        const CALL: &str = "Please call the experimenter";
        let samples = self.devices.at(self.player.now_s);
        match (&self.source, prompt.screen(), samples) {
            (_, Some(Screen::Over), _) => screens::show(ui, area, prompt, palette),
            _ if prompt.is_lost() => self.words(ui, area, "The experiment has stopped", CALL, palette),
            (Source::Live { .. }, ..) if !self.source.is_running() => {
                self.words(ui, area, "The device has stopped", CALL, palette);
            }
            (Source::Live { .. } | Source::Recording, Some(_), Some(samples)) => {
                if prompt.shows_scene() {
                    // Nothing of what is drawn may tell how stiff it is: no arrows, no colours of the moment's
                    // largest force, and a wire that stays what it is.
                    self.view.shows_arrows = false;
                    // What to press stands beneath it, not before it.
                    let view = area.with_max_y(area.bottom() - ROOM_FOR_WORDS_PT);
                    self.scene(ui, view, &samples);
                    self.view.keys(ui, SceneBuilder::extent(&self.shapes, self.devices.count()));
                }
                screens::show(ui, area, prompt, palette);
            }
            _ => self.words(ui, area, "One moment", "The device is being started", palette),
        }
    }
}
