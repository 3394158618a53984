//! Keyboard shortcuts in the window of an experimenter.

use super::Viewer;
use crate::scene::SceneBuilder;
use crate::ui::key::pressed_alone;
use crate::ui::style;
use egui::{Context, Key, Ui};
use flotor_history::player::Motion;
use flotor_live::Ask;

impl Viewer {
    /// Handles shortcuts, unless a text field has the focus. The space bar, the largest key, is the emergency stop of a run
    /// regardless of the focus.
    pub(super) fn keys(&mut self, ui: &Ui) {
        let span_s = self.devices.history().span_s();
        let is_live = self.source.is_running();
        let pressed = |key: Key| ui.input(|input| pressed_alone(input, key));
        if is_live && ui.input(|input| input.key_pressed(Key::Space)) {
            self.ask(Ask::EmergencyStop);
        }
        if ui.ctx().egui_wants_keyboard_input() {
            return;
        }
        if ui.input(|input| input.modifiers.command && input.key_pressed(Key::Z)) {
            self.undo();
        }
        if !is_live && pressed(Key::Space) {
            self.player.toggle(false, span_s);
        }
        let (shift, tick) = ui.input(|input| (input.modifiers.shift, input.modifiers.command));
        let step_s = if shift { 10.0 } else { 1.0 };
        let arrows = ui.input(|input| {
            f64::from(u8::from(input.key_pressed(Key::ArrowRight)))
                - f64::from(u8::from(input.key_pressed(Key::ArrowLeft)))
        });
        if arrows != 0.0 {
            let step_s = if tick { 1.0 / self.devices.history().run().rate_hz.max(1.0) } else { step_s };
            self.player.seek(self.player.now_s + arrows * step_s, span_s);
        }
        if pressed(Key::Home) {
            self.player.seek(span_s[0], span_s);
        }
        if pressed(Key::End) {
            self.player.seek(span_s[1], span_s);
            if is_live {
                self.player.motion = Motion::Follow;
            }
        }
        if pressed(Key::F) && is_live {
            self.player.toggle(true, span_s);
        }
        if let Some(number) =
            (1..=9).position(|digit: u8| Key::from_name(&digit.to_string()).is_some_and(pressed))
        {
            self.look_at(number);
        }
        if pressed(Key::M) {
            self.plots.switch_maximised(None);
        }
        if pressed(Key::U) {
            self.plots.switch_units();
        }
        if pressed(Key::P) {
            self.switch_panel(ui.ctx());
        }
        if pressed(Key::F11) {
            let is_full = ui.input(|input| input.viewport().fullscreen.unwrap_or(false));
            ui.ctx().send_viewport_cmd(egui::ViewportCommand::Fullscreen(!is_full));
        }
        if pressed(Key::F1) || ui.input(|input| input.events.contains(&egui::Event::Text("?".to_owned()))) {
            self.shows_keys = !self.shows_keys;
        }
        if pressed(Key::Escape) && !std::mem::take(&mut self.shows_keys) {
            self.compared = None;
        }
        if pressed(Key::L) {
            self.switch_look(ui.ctx());
        }
        self.view.keys(ui, SceneBuilder::extent(&self.shapes, self.devices.count()));
    }

    pub(super) fn switch_look(&mut self, context: &Context) {
        self.look = self.look.other();
        style::apply(context, self.look);
    }
}
