//! Traces one above the other over one time, and what a person chooses about them.

use crate::history::History;
use crate::palette::Palette;
use crate::player::Motion;
use crate::quantity::{Quantity, Units};
use crate::trace::Trace;
use crate::ui::marks::Marks;
use crate::ui::plots::{PlotView, plot};
use crate::ui::style::SMALL_PT;
use egui::{Color32, ComboBox, RichText, Role, Ui, WidgetInfo};
use std::collections::BTreeMap;

/// Lengths of time that can be shown, s.
pub const WINDOWS_S: [f64; 5] = [2.0, 5.0, 10.0, 30.0, 60.0];

/// The traces shown to who has not chosen others.
pub const FIRST_TRACES: [Quantity; 2] = [Quantity::Force, Quantity::Position];

/// Narrower, the choices take two rows, points.
const ROOM_FOR_ONE_ROW_PT: f32 = 720.0;

/// How much of the past is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Window {
    /// All of it.
    Whole,
    /// So many seconds, ending at the newest.
    Newest(f64),
}

/// What a person asks for beside the traces themselves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PlotRequest {
    /// Another moment, s.
    Seek(f64),
    /// A file of what is shown.
    Export(ExportFormat),
}

/// Files that traces go into.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportFormat {
    /// Numbers.
    Csv,
    /// A picture of lines.
    Svg,
    /// A picture of pixels.
    Png,
}

/// The traces shown.
#[derive(Clone, Debug)]
pub struct PlotStack {
    /// From the top.
    pub shown: Vec<Quantity>,
    /// How much of the past.
    pub window: Window,
    /// Units of all numbers.
    pub units: Units,
    /// What has been made of the history, for each quantity shown so far.
    traces: BTreeMap<Quantity, Trace>,
    /// What happened, beneath the traces.
    marks: Marks,
    /// End of a window that is shorter than the run, s; the newest while none has been shown.
    end_s: f64,
    /// Where the pointer was in the last picture, s.
    hover_s: Option<f64>,
}

impl PlotStack {
    /// Force and position.
    #[must_use]
    pub fn new(window: Window) -> Self {
        Self {
            shown: FIRST_TRACES.to_vec(),
            window,
            units: Units::Handy,
            traces: BTreeMap::new(),
            marks: Marks::default(),
            end_s: f64::INFINITY,
            hover_s: None,
        }
    }

    /// Another run is shown from now on.
    pub fn start_over(&mut self) {
        self.traces.clear();
        self.marks = Marks::default();
        self.end_s = f64::INFINITY;
    }

    /// Samples looked at so far: once for each quantity, not once for each picture.
    #[must_use]
    pub fn visited(&self) -> u64 {
        self.traces.values().map(Trace::visited).sum()
    }

    /// First and last time shown, s.
    #[must_use]
    pub fn span_s(&self, history: &History) -> [f64; 2] {
        let [first_s, last_s] = history.span_s();
        match self.window {
            Window::Whole => [first_s, last_s.max(first_s + 1.0e-3)],
            Window::Newest(length_s) => {
                let end_s = self.end_s.min(last_s);
                // Before the run there is nothing to show: its beginning stays at the left until it is longer.
                let from_s = (end_s - length_s).max(first_s.min(end_s));
                [from_s, from_s + length_s]
            }
        }
    }

    /// Shows the row of choices and the traces; says what was requested.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        history: &History,
        now_s: f64,
        motion: Motion,
        palette: &Palette,
    ) -> Vec<PlotRequest> {
        self.end_s = self.end_of_window(history.span_s(), now_s, motion);
        let mut requests = Vec::new();
        if ui.available_width() < ROOM_FOR_ONE_ROW_PT {
            ui.horizontal_wrapped(|ui| self.quantities(ui, palette));
            ui.horizontal(|ui| self.presentation(ui, &mut requests));
        } else {
            ui.horizontal(|ui| {
                self.quantities(ui, palette);
                self.presentation(ui, &mut requests);
            });
        }
        let span_s = self.span_s(history);
        let count = self.shown.len();
        let height = (ui.available_height() - 29.0 * count as f32 - 22.0) / count.max(1) as f32;
        let cursor_s = self.hover_s.unwrap_or(now_s);
        self.hover_s = None;
        for (index, quantity) in self.shown.clone().into_iter().enumerate() {
            let time_axis = index + 1 == count;
            let height = if time_axis { height + 14.0 } else { height }.max(24.0);
            let view = PlotView { span_s, cursor_s, units: self.units, height, time_axis };
            let trace = self.traces.entry(quantity).or_insert_with(|| Trace::of(quantity));
            let answer = plot(ui, history, trace, view, palette);
            if time_axis {
                self.marks.show(ui, history, span_s, answer.frame, palette);
            }
            self.hover_s = self.hover_s.or(answer.hover_s);
            requests.extend(answer.seek_s.map(PlotRequest::Seek));
        }
        requests
    }

    /// A trace that is looked at stands still, as long as the moment shown is in it and not at its edge.
    fn end_of_window(&self, [first_s, last_s]: [f64; 2], now_s: f64, motion: Motion) -> f64 {
        /// Part of the window between the moment and an edge.
        const MARGIN: f64 = 0.1;
        match (motion, self.window) {
            (Motion::Follow, _) | (_, Window::Whole) => last_s,
            (_, Window::Newest(length_s)) => {
                let margin_s = MARGIN * length_s;
                let near = self.end_s.clamp(now_s + margin_s, now_s + length_s - margin_s);
                near.max(first_s + length_s).min(last_s)
            }
        }
    }

    /// Which quantities are shown.
    fn quantities(&mut self, ui: &mut Ui, palette: &Palette) {
        ui.spacing_mut().item_spacing.x = 4.0;
        for quantity in Quantity::ALL {
            let is_shown = self.shown.contains(&quantity);
            let text = RichText::new(quantity.name()).size(SMALL_PT + 0.5);
            // White on the blue of what is chosen, light and dark.
            let text = text.color(if is_shown { Color32::WHITE } else { palette.faint });
            if ui.selectable_label(is_shown, text).clicked() {
                self.toggle(quantity);
            }
        }
    }

    /// How they are shown, from the right.
    fn presentation(&mut self, ui: &mut Ui, requests: &mut Vec<PlotRequest>) {
        ui.spacing_mut().item_spacing.x = 4.0;
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            ui.menu_button(RichText::new("Export").size(SMALL_PT + 0.5), |ui| {
                for (format, name) in
                    [(ExportFormat::Csv, "CSV"), (ExportFormat::Svg, "SVG"), (ExportFormat::Png, "PNG")]
                {
                    if ui.button(name).clicked() {
                        requests.push(PlotRequest::Export(format));
                        ui.close();
                    }
                }
            });
            let units = match self.units {
                Units::Handy => "mm, N",
                Units::Si => "SI",
            };
            let switch = ui.button(RichText::new(units).size(SMALL_PT + 0.5));
            if switch.on_hover_text("Units: millimetres and degrees, or SI (U)").clicked() {
                self.switch_units();
            }
            let shown = match self.window {
                Window::Whole => "all".to_owned(),
                Window::Newest(length_s) => format!("{length_s} s"),
            };
            let list = ComboBox::from_id_salt("window").selected_text(shown).width(64.0).show_ui(ui, |ui| {
                ui.selectable_value(&mut self.window, Window::Whole, "all");
                for length_s in WINDOWS_S {
                    ui.selectable_value(&mut self.window, Window::Newest(length_s), format!("{length_s} s"));
                }
            });
            list.response.widget_info(|| WidgetInfo::labeled(Role::ComboBox, true, "Time shown"));
        });
    }

    /// Shows or hides a quantity; the last one stays.
    pub fn toggle(&mut self, quantity: Quantity) {
        match self.shown.iter().position(|shown| *shown == quantity) {
            Some(_) if self.shown.len() == 1 => {}
            Some(index) => {
                self.shown.remove(index);
            }
            None => {
                self.shown.push(quantity);
                self.shown.sort();
            }
        }
    }

    /// Millimetres or metres.
    pub fn switch_units(&mut self) {
        self.units = match self.units {
            Units::Handy => Units::Si,
            Units::Si => Units::Handy,
        };
    }
}
