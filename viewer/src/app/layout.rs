//! The parts of an experimenter's window and where they stand: bar, side, middle.

use super::{Audience, Source, VIEW_PARTS, Viewer};
use crate::export::export;
use crate::history::Sample;
use crate::palette::Palette;
use crate::scene::SceneBuilder;
use crate::ui::plot_stack::PlotRequest;
use crate::ui::style::SMALL_PT;
use crate::ui::top_bar::{PanelSwitch, TopBar, TopBarRequest};
use crate::ui::view3d::Subject;
use crate::ui::{legend, parameters, readout, standing, style, warnings};
use egui::{Button, CursorIcon, Rect, RichText, Role, ScrollArea, Sense, Ui, WidgetInfo, vec2};
use flotor_live::{Ask, SetValue};
use std::time::Instant;

/// What the border is called.
const BORDER: &str = "Border between view and traces";
/// Part of the height that the 3D view gets: low windows leave room for two traces first.
fn view_part(height_pt: f32) -> f32 {
    match height_pt {
        ..360.0 => 0.30,
        ..480.0 => 0.46,
        _ => 0.56,
    }
}

impl Viewer {
    pub(super) fn top(&mut self, ui: &mut Ui, palette: &Palette) {
        let (standing, status) = self.standing();
        let (title, subtitle) = match &self.source {
            Source::Waiting(_) => ("Flotor", ""),
            // Names of parameters are nothing for a subject's eyes.
            _ if self.audience == Audience::Subject => ("", ""),
            _ => (self.heading.title.as_str(), self.heading.subtitle.as_str()),
        };
        let bar = TopBar {
            title,
            subtitle,
            standing: &standing,
            status,
            // A rehearsal shows what a person sees.
            can_stop: self.source.is_running() || self.is_rehearsal(),
            panel: match (self.audience, self.is_panel_shown(ui.ctx())) {
                (Audience::Subject, _) => PanelSwitch::None,
                (Audience::Experimenter, true) => PanelSwitch::PutAway,
                (Audience::Experimenter, false) => PanelSwitch::BringOut,
            },
            look: (self.audience == Audience::Experimenter).then_some(self.look),
        };
        match bar.show(ui, palette) {
            Some(TopBarRequest::EmergencyStop) => self.ask(Ask::EmergencyStop),
            Some(TopBarRequest::SwitchLook) => self.switch_look(ui.ctx()),
            Some(TopBarRequest::SwitchPanel) => self.switch_panel(ui.ctx()),
            None => {}
        }
    }

    pub(super) fn side(&mut self, ui: &mut Ui, palette: &Palette) {
        let mut values: Vec<SetValue> = Vec::new();
        ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            ui.set_max_width(ui.available_width() - 12.0); // room for the bar that scrolls
            // How close the hand is to the limits comes before anything that can be changed.
            if let Some(sample) = self.devices.history().at(self.player.now_s) {
                standing::limits(ui, sample, &self.limits, palette);
                ui.add_space(8.0);
            }
            // Models before devices: they are what people came for.
            let has_device = self.devices.history().run().devices().count().min(self.panels.len());
            let (device, models) = self.panels.split_at_mut(has_device);
            for panel in models.iter_mut().chain(device) {
                let changed = parameters::panel(ui, panel, palette);
                values.extend(changed.into_iter().filter_map(|index| panel.change(index)));
                ui.add_space(8.0);
            }
            standing::events(ui, self.devices.tally(), palette);
        });
        if !values.is_empty() {
            self.ask(Ask::Set { values });
        }
    }

    /// Takes back the last change of a panel: of the models first, they are what people change.
    pub(super) fn undo(&mut self) {
        let has_device = self.devices.history().run().devices().count().min(self.panels.len());
        let (device, models) = self.panels.split_at_mut(has_device);
        let mut panels = models.iter_mut().chain(device);
        let undone = panels.find_map(|panel| panel.undo().and_then(|index| panel.change(index)));
        if let Some(value) = undone {
            self.ask(Ask::Set { values: vec![value] });
        }
    }

    pub(super) fn middle(&mut self, ui: &mut Ui, palette: &Palette) {
        let area = ui.max_rect();
        let sample = self.devices.history().at(self.player.now_s).copied();
        let (Some(sample), Some(samples)) = (sample, self.devices.at(self.player.now_s)) else {
            self.nothing(ui, area, palette);
            return;
        };
        let part = self.view_part.unwrap_or_else(|| view_part(area.height()));
        let view = Rect::from_min_size(area.min, vec2(area.width(), (area.height() * part).round()));
        self.scene(ui, view, &samples);
        readout::numbers(ui.painter(), view, &sample, self.plots.units, palette);
        let camera = self.view.camera;
        legend::paint(ui.painter(), view, &self.facts, &camera, palette);
        legend::axes(ui.painter(), view, &self.facts, &camera, palette);
        let names = (self.devices.names(), self.devices.chosen());
        legend::names(ui.painter(), view, &self.facts, &camera, names, palette);
        let row = self.choose_device(ui, view);
        warnings::warnings(ui, view.with_min_y(row), &self.warnings(&sample), palette);
        if let Some(done) = self.done() {
            warnings::done(ui, view, done, palette);
        }
        self.border(ui, area, view.bottom());

        let below = Rect::from_min_max(view.left_bottom() + vec2(12.0, 6.0), area.max - vec2(16.0, 2.0));
        let mut ui = ui.new_child(egui::UiBuilder::new().max_rect(below).id_salt("plots"));
        let motion = self.player.motion;
        let seen = (self.devices.history(), self.devices.name());
        let requests = self.plots.show(&mut ui, seen, self.player.now_s, motion, palette);
        for request in requests {
            match request {
                PlotRequest::Seek(now_s) => self.player.seek(now_s, self.devices.history().span_s()),
                PlotRequest::Export(format) => {
                    match export(self.devices.history(), self.devices.name(), &self.plots, format) {
                        Ok(path) => {
                            let path = std::path::absolute(&path).unwrap_or(path);
                            self.done = Some((format!("Written: {}", path.display()), Instant::now()));
                        }
                        Err(error) => self.say(error.to_string()),
                    }
                }
            }
        }
    }

    /// The border between view and traces, which can be pulled; a double click puts it back.
    fn border(&mut self, ui: &Ui, area: Rect, y: f32) {
        let strip = Rect::from_x_y_ranges(area.x_range(), (y - 3.0)..=(y + 4.0));
        let response = ui.interact(strip, ui.scope_id().with("border"), Sense::click_and_drag());
        response.widget_info(|| WidgetInfo::labeled(Role::Splitter, true, BORDER));
        if let Some(at) = response.interact_pointer_pos().filter(|_| response.dragged()) {
            let part = (at.y - area.top()) / area.height().max(1.0);
            self.view_part = Some(part.clamp(*VIEW_PARTS.start(), *VIEW_PARTS.end()));
        }
        if response.double_clicked() {
            self.view_part = None;
        }
        response.on_hover_cursor(CursorIcon::ResizeVertical);
    }

    /// The names of the devices, where there are several, to choose the one that numbers and traces are of; the height beneath them.
    fn choose_device(&mut self, ui: &mut Ui, view: Rect) -> f32 {
        if self.devices.count() < 2 {
            return view.top();
        }
        let inside = Rect::from_min_max(view.min + vec2(16.0, 8.0), view.max);
        let mut row = ui.new_child(egui::UiBuilder::new().max_rect(inside).id_salt("devices"));
        let mut chosen = None;
        let shown = row.horizontal(|ui| {
            for (number, name) in self.devices.names().enumerate() {
                let help = format!("Numbers and traces of {name} ({})", number + 1);
                let label = ui.selectable_label(number == self.devices.chosen(), name);
                if label.on_hover_text(help).clicked() {
                    chosen = Some(number);
                }
            }
        });
        if let Some(number) = chosen {
            self.look_at(number);
        }
        shown.response.rect.bottom()
    }

    /// Numbers and traces are of this device from now on.
    pub(super) fn look_at(&mut self, number: usize) {
        if self.devices.choose(number) {
            self.plots.look_at_another();
        }
    }

    /// The 3D view at a moment.
    pub(super) fn scene(&mut self, ui: &mut Ui, area: Rect, samples: &[Sample]) {
        let (shapes, version, scale) =
            (&mut self.shapes, self.shape_version, self.devices.scale().with_chosen(self.arrow_force_n));
        self.facts = self.view.show(ui, area, self.look, Subject { shapes, version, samples, scale });
        let has_room = area.height() > 200.0 && area.width() > 200.0;
        if has_room && self.view.is_turned() && self.audience == Audience::Experimenter {
            // Above the axes, which it puts back.
            let place = Rect::from_center_size(area.right_bottom() - vec2(53.0, 106.0), vec2(78.0, 22.0));
            let button = Button::new(RichText::new("Reset view").size(SMALL_PT));
            if ui.put(place, button).on_hover_text("The experimenter's view (R)").clicked() {
                self.view.reset(SceneBuilder::framing_mm(&self.shapes, self.devices.count()));
            }
        }
    }

    /// There is nothing to show: what to do.
    fn nothing(&self, ui: &mut Ui, area: Rect, palette: &Palette) {
        let (first, second) = match &self.source {
            Source::Waiting(_) => ("Waiting for a run", "Start one in a terminal:  flotor run"),
            _ => ("No ticks yet", "They appear as soon as the loop runs"),
        };
        self.words(ui, area, first, second, palette);
    }

    /// A line and what to do about it, in the middle of an area.
    pub(super) fn words(&self, ui: &mut Ui, area: Rect, first: &str, second: &str, palette: &Palette) {
        let layout = egui::Layout::top_down(egui::Align::Center);
        let mut inner = ui.new_child(egui::UiBuilder::new().max_rect(area).layout(layout));
        inner.add_space(0.42 * area.height());
        inner.label(RichText::new(first).size(style::TITLE_PT));
        inner.label(RichText::new(second).color(palette.faint));
    }
}
