//! Layout of an experimenter's window: bar, messages, side panel, 3D view, traces.
//!
//! Space is allocated by priority: emergency stop and state of the run ([`top_bar`]), messages ([`messages`]), the clock (in the bar of
//! the playback and over the view), numbers and the other texts over the view ([`overlay`]), traces, panel.
//!
//! [`top_bar`]: crate::ui::top_bar
//! [`messages`]: crate::ui::messages
//! [`overlay`]: crate::ui::overlay

use super::words::State;
use super::{Source, VIEW_PARTS, Viewer};
use crate::experiment::key_of;
use crate::export::export;
use crate::palette::Palette;
use crate::panel::Panel;
use crate::scene::{Moment, SceneBuilder};
use crate::ui::handle::HINT;
use crate::ui::messages::{Extent, Messages};
use crate::ui::overlay::{Corner, Overlay};
use crate::ui::plot_stack::{PlotRequest, PlotStack, TraceSource};
use crate::ui::style::SMALL_PT;
use crate::ui::top_bar::{PanelSwitch, STOP, Stop, TopBar, TopBarRequest};
use crate::ui::view3d::Subject;
use crate::ui::{device_row, legend, parameters, readout, standing, style};
use egui::{
    Align, Button, CursorIcon, Frame, Layout, Margin, Panel as Edge, Rect, RichText, Role, ScrollArea, Sense,
    Ui, WidgetInfo, vec2,
};
use flotor_history::Sample;
use flotor_history::compared::Compared;
use flotor_live::{Ask, SetValue};
use std::time::Instant;

/// Height of the bar at which its texts have their usual size, points.
const USUAL_BAR_PT: f32 = 42.0;
/// Largest fraction of the window height for the messages of a run that is over.
const MOST_OF_HEIGHT: f32 = 0.3;
/// Accessible name of the border between view and traces.
const BORDER: &str = "Border between view and traces";
/// Smallest fraction of the height for the 3D view above traces.
const LEAST_VIEW_PART: f32 = 0.27;
/// Height of the row with the names of the devices, points.
const DEVICES_PT: f32 = 28.0;

/// Returns the fraction of the height for the 3D view: less in low windows and above many traces.
fn view_part(height_pt: f32, traces_pt: f32) -> f32 {
    let most = match height_pt {
        ..360.0 => LEAST_VIEW_PART,
        ..480.0 => 0.46,
        _ => 0.56,
    };
    most.min(1.0 - traces_pt / height_pt).max(LEAST_VIEW_PART)
}

/// Returns whether an area of this height has room for traces beneath the 3D view.
fn has_room_for_traces(height_pt: f32) -> bool {
    (1.0 - LEAST_VIEW_PART) * height_pt >= PlotStack::least_height_of_one_pt()
}

impl Viewer {
    pub(super) fn top(&mut self, ui: &mut Ui, palette: &Palette) {
        let State { words, status } = self.state();
        // The screens of a sitting show the state, in the language of the person.
        let words = if self.is_for_subject() { "" } else { words };
        let title = match &self.source {
            Source::Waiting(_) => "Flotor",
            // A subject must not see the names of parameters.
            _ if self.is_for_subject() => "",
            _ => self.heading.title.as_str(),
        };
        // A rehearsal shows the same bar as a sitting.
        let can_stop = self.source.is_running() || self.is_rehearsal();
        let bar = TopBar {
            title,
            state: words,
            status,
            stop: can_stop.then(|| self.stop()),
            scale: (ui.available_height() / USUAL_BAR_PT).max(1.0),
            panel: match self.is_panel_shown(ui.ctx()) {
                _ if self.is_for_subject() => PanelSwitch::None,
                true => PanelSwitch::PutAway,
                false => PanelSwitch::BringOut,
            },
            look: (!self.is_for_subject()).then_some(self.look),
        };
        match bar.show(ui, palette) {
            Some(TopBarRequest::EmergencyStop) => self.ask(Ask::EmergencyStop),
            Some(TopBarRequest::SwitchLook) => self.switch_look(ui.ctx()),
            Some(TopBarRequest::SwitchPanel) => self.switch_panel(ui.ctx()),
            None => {}
        }
    }

    /// Returns the name and the key of the emergency stop: the space bar, or in a sitting the configured key.
    fn stop(&self) -> Stop {
        match &self.sitting {
            Some(prompt) => Stop { name: prompt.texts.stop.clone(), key: key_of(prompt.stop_key).name() },
            None => Stop { name: STOP.to_owned(), key: egui::Key::Space.name() },
        }
    }

    /// Shows the row of messages beneath the bar.
    pub(super) fn messages(&mut self, ui: &mut Ui, palette: &Palette) {
        const MARGIN_PT: i8 = 16;
        let warnings = self.warnings();
        let compared = || self.compared.as_ref().map(Compared::text);
        let otherwise = self.done().or_else(compared).unwrap_or_else(|| self.heading.subtitle.clone());
        let is_over = matches!(self.source, Source::Live { .. }) && !self.source.is_running();
        let extent = if is_over {
            Extent::Lines { most_pt: MOST_OF_HEIGHT * ui.available_height() }
        } else {
            Extent::Line
        };
        let messages = Messages { warnings: &warnings, otherwise: &otherwise, extent };
        let height_pt = messages.height_pt(ui, ui.available_width() - 2.0 * f32::from(MARGIN_PT));
        Edge::top("messages")
            .exact_size(height_pt)
            .show_separator_line(false)
            .frame(Frame::new().fill(palette.panel).inner_margin(Margin::symmetric(MARGIN_PT, 0)))
            .show(ui, |ui| messages.show(ui, palette));
    }

    pub(super) fn side(&mut self, ui: &mut Ui, palette: &Palette) {
        let mut values: Vec<SetValue> = Vec::new();
        ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            ui.set_max_width(ui.available_width() - 12.0); // room for the scroll bar
            // The margin to the limits comes before all parameters.
            if let Some(sample) = self.devices.history().at(self.player.now_s) {
                standing::limits(ui, sample, &self.limits, self.plots.units, palette);
                ui.add_space(8.0);
            }
            for panel in self.models_and_devices() {
                let changed = parameters::panel(ui, panel, palette);
                values.extend(changed.into_iter().filter_map(|index| panel.change(index)));
                ui.add_space(8.0);
            }
            standing::events(ui, self.devices.event_counts(), palette);
        });
        if !values.is_empty() {
            self.ask(Ask::Set { values });
        }
    }

    /// Returns the panels in the shown order, models before devices: users mostly change models.
    fn models_and_devices(&mut self) -> impl Iterator<Item = &mut Panel> {
        let device_count = self.devices.history().run().devices().count().min(self.panels.len());
        let (devices, models) = self.panels.split_at_mut(device_count);
        models.iter_mut().chain(devices)
    }

    /// Undoes the last change of a panel, in models before devices.
    pub(super) fn undo(&mut self) {
        let undone =
            self.models_and_devices().find_map(|panel| panel.undo().and_then(|index| panel.change(index)));
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
        let area = self.choose_device(ui, area);
        let has_traces = has_room_for_traces(area.height());
        let traces_pt = self.plots.good_height_pt();
        let part = self.view_part.unwrap_or_else(|| view_part(area.height(), traces_pt));
        let part = if has_traces { part } else { 1.0 };
        let view = Rect::from_min_size(area.min, vec2(area.width(), (area.height() * part).round()));
        self.scene(ui, view, &samples);
        self.handles(ui, view, &samples, palette);
        self.texts(ui, view, &sample, palette);
        if has_traces {
            self.border(ui, area, view.bottom());
            let below = Rect::from_min_max(view.left_bottom() + vec2(12.0, 6.0), area.max - vec2(16.0, 2.0));
            self.traces(ui, below, palette);
        }
    }

    /// Shows texts over the 3D view, by priority.
    fn texts(&mut self, ui: &mut Ui, view: Rect, sample: &Sample, palette: &Palette) {
        let mut overlay = Overlay::new(ui.painter(), view);
        let (units, camera) = (self.plots.units, self.view.camera);
        let mut rows = readout::rows(sample, units, palette);
        if self.source.is_running() {
            let haptic_hz = self.devices.history().tick_rate_hz(sample.time_s());
            rows.extend(readout::rates(haptic_hz, self.frame_rate.hz(), palette));
        }
        readout::numbers(&mut overlay, sample.time_s(), &rows, units, palette);
        legend::paint(&mut overlay, view, &self.facts, &camera, palette);
        legend::axes(&mut overlay, &self.facts, &camera, palette);
        self.reset_button(ui, &mut overlay);
        if self.wants_drag_hint() {
            readout::hint(&mut overlay, HINT, palette);
        }
        let names = (self.devices.names(), self.devices.chosen());
        legend::names(&mut overlay, view, &self.facts, &camera, names, palette);
    }

    /// Shows the button that resets the view, if the view was turned.
    fn reset_button(&mut self, ui: &mut Ui, overlay: &mut Overlay) {
        let size = vec2(78.0, 22.0);
        let Some(place) = self.view.is_turned().then(|| overlay.take(Corner::RightBottom, size)).flatten()
        else {
            return;
        };
        let button = Button::new(RichText::new("Reset view").size(SMALL_PT));
        if ui.put(place, button).on_hover_text("The experimenter's view (R)").clicked() {
            self.view.reset(SceneBuilder::extent(&self.shapes, self.devices.count()));
        }
    }

    /// Shows the traces in an area.
    fn traces(&mut self, ui: &mut Ui, area: Rect, palette: &Palette) {
        let mut ui = ui.new_child(egui::UiBuilder::new().max_rect(area).id_salt("plots"));
        let motion = self.player.motion;
        let compared = self.compared.as_ref().and_then(|compared| compared.history(self.devices.chosen()));
        let seen = TraceSource { history: self.devices.history(), device: self.devices.name(), compared };
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

    /// Handles the border between view and traces: a drag moves the border, a double click restores the default.
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

    /// Shows a row to choose the device for numbers and traces, if there are several devices; returns the area beneath.
    fn choose_device(&mut self, ui: &mut Ui, area: Rect) -> Rect {
        if self.devices.count() < 2 {
            return area;
        }
        let (row, beneath) = area.split_top_bottom_at_y(area.top() + DEVICES_PT);
        let inside = row.shrink2(vec2(16.0, 0.0));
        let layout = Layout::left_to_right(Align::Center);
        let mut row = ui.new_child(egui::UiBuilder::new().max_rect(inside).id_salt("devices").layout(layout));
        let names: Vec<&str> = self.devices.names().collect();
        if let Some(number) = device_row::choose(&mut row, &names, self.devices.chosen()) {
            self.look_at(number);
        }
        beneath
    }

    /// Chooses the device for numbers and traces.
    pub(super) fn look_at(&mut self, number: usize) {
        if self.devices.choose(number) {
            self.plots.look_at_another();
        }
    }

    /// Shows the 3D view at the displayed time.
    pub(super) fn scene(&mut self, ui: &mut Ui, area: Rect, samples: &[Sample]) {
        let (shapes, version, scale) =
            (&mut self.shapes, self.shape_version, self.devices.scale().with_chosen(self.arrow_force_n));
        let handles = self.compared.as_ref().map(|compared| compared.handles(self.player.now_s));
        let moment = Moment { samples, compared: handles.as_deref().unwrap_or_default() };
        self.facts = self.view.show(ui, area, self.look, Subject { shapes, version, moment, scale });
    }

    /// Shows a hint in place of missing data; while there is no run, offers recordings.
    fn nothing(&mut self, ui: &mut Ui, area: Rect, palette: &Palette) {
        let (first, second) = match &self.source {
            Source::Waiting(_) => ("Waiting for a run", "Start a run in a terminal:  flotor run"),
            _ => ("No ticks yet", "Ticks appear when the loop runs"),
        };
        let inside = area.shrink2(vec2(16.0, 0.0));
        let layout = Layout::top_down(Align::Center);
        let mut inner = ui.new_child(egui::UiBuilder::new().max_rect(inside).layout(layout));
        inner.add_space(0.3 * area.height());
        inner.label(RichText::new(first).size(style::TITLE_PT));
        inner.label(RichText::new(second).color(palette.faint));
        if matches!(self.source, Source::Waiting(_)) {
            inner.add_space(8.0);
            let chosen = self.opening.show(&mut inner, palette);
            chosen.iter().for_each(|file| self.open(file));
        }
    }
}
