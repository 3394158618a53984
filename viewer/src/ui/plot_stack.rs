//! Traces one above the other over one time, and what a person chooses about them.

mod choices;

use crate::chosen::Chosen;
use crate::export::ExportOptions;
use crate::palette::Palette;
use crate::trace::Trace;
use crate::ui::force_position::ForcePositionPlot;
use crate::ui::marks::Marks;
use crate::ui::plots::{Lines, Maximise, PlotView, plot};
use crate::ui::zoom::{Wheel, ZoomRequest};
use egui::{Rect, Ui, UiBuilder};
use flotor_history::History;
use flotor_history::player::Motion;
use flotor_history::quantity::{Quantity, Units};
use std::collections::BTreeMap;
use std::path::Path;

/// The traces shown to who has not chosen others.
pub const FIRST_TRACES: [Quantity; 2] = [Quantity::Force, Quantity::Position];

/// Height of the row of choices with the gap beneath, points.
const CHOICES_PT: f32 = 30.0;
/// No trace is lower than this, points: three marks of an axis are still apart. Traces without room are scrolled to.
const LEAST_TRACE_PT: f32 = 48.0;
/// Height of a trace for which the 3D view gives way, points.
const GOOD_TRACE_PT: f32 = 60.0;
/// Distance of headings and traces, points.
const GAP_PT: f32 = 3.0;
/// Turn of the wheel by which the next trace comes into sight, points.
const SCROLL_PT: f32 = 30.0;
/// Narrower, force over position has the room of the traces, points.
const ROOM_BESIDE_PT: f32 = 560.0;
/// No trace of a picture is lower than this, points: nobody can scroll there, and the marks of the axis need their numbers.
const LEAST_TRACE_OF_PICTURE_PT: f32 = 58.0;
/// Height of what stands above a trace, and of the times below the last one, points.
const HEADING_PT: f32 = 29.0;
const TIMES_PT: f32 = 22.0;
/// Height of what stands above a trace, with the gaps around it, points.
const HEADING_AND_GAPS_PT: f32 = 32.0;
/// Shortest time that can be shown, s: a few ticks.
const LEAST_TIME_S: f64 = 5.0e-3;

/// How much of the past is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Window {
    /// All of it.
    Whole,
    /// So many seconds, ending at the newest.
    Newest(f64),
    /// From one time to another, s.
    Between(f64, f64),
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

impl ExportFormat {
    /// What a file is to be, by the ending of its name.
    ///
    /// # Errors
    /// In a line: it has another.
    pub fn of_file(file: &Path) -> Result<Self, String> {
        match file.extension().and_then(|ending| ending.to_str()) {
            Some("csv") => Ok(Self::Csv),
            Some("svg") => Ok(Self::Svg),
            Some("png") => Ok(Self::Png),
            _ => Err(format!("`{}` ends neither with .csv, nor .svg, nor .png", file.display())),
        }
    }
}

/// Why traces cannot be drawn into a picture of a given height.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the picture is {height_px} pixels high, and for {count} traces that can be read it has to be {least_px}; make it higher, or choose fewer traces"
)]
pub struct TooLow {
    /// How many they are.
    pub count: usize,
    /// Height the picture has to have, pixels.
    pub least_px: usize,
    /// Height it has, pixels.
    pub height_px: usize,
}

/// What traces are drawn of.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    /// The samples of a device.
    pub history: &'a History,
    /// Name of the device, where there are several.
    pub device: Option<&'a str>,
    /// The samples of the same device in a second recording, dashed beneath the others.
    pub compared: Option<&'a History>,
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
    /// Force over position, beside the traces.
    pub force_position: ForcePositionPlot,
    /// How files of traces are made.
    pub export: ExportOptions,
    /// The one that has the room of all.
    alone: Option<Quantity>,
    /// Values shown of a trace that is zoomed, SI.
    values: BTreeMap<Quantity, [f64; 2]>,
    /// How much of the past was shown before a zoom.
    unzoomed: Window,
    /// What has been made of the history, for each quantity shown so far.
    traces: BTreeMap<Quantity, Trace>,
    /// The same of the second recording.
    compared: BTreeMap<Quantity, Trace>,
    /// What happened, beneath the traces.
    marks: Marks,
    /// End of a window that is shorter than the run, s; the newest while none has been shown.
    end_s: f64,
    /// Where the pointer was in the last picture, s.
    hover_s: Option<f64>,
    /// Number of the first trace in sight, of those that have no room together.
    first: usize,
    /// How many traces are out of sight above and below.
    out_of_sight: [usize; 2],
    /// Turn of the wheel since the last trace came into sight, points.
    turned_pt: f32,
}

impl PlotStack {
    /// Force and position.
    #[must_use]
    pub fn new(window: Window) -> Self {
        Self {
            shown: FIRST_TRACES.to_vec(),
            window,
            units: Units::Handy,
            force_position: ForcePositionPlot::default(),
            export: ExportOptions::default(),
            alone: None,
            values: BTreeMap::new(),
            unzoomed: window,
            traces: BTreeMap::new(),
            compared: BTreeMap::new(),
            marks: Marks::default(),
            end_s: f64::INFINITY,
            hover_s: None,
            first: 0,
            out_of_sight: [0; 2],
            turned_pt: 0.0,
        }
    }

    /// Returns the height with which all traces can be read well, with the choices above them, points.
    #[must_use]
    pub fn good_height_pt(&self) -> f32 {
        CHOICES_PT + (HEADING_PT + GOOD_TRACE_PT) * self.in_sight().len().max(1) as f32 + TIMES_PT
    }

    /// Returns the height with which one trace can be read, with the choices above it, points.
    #[must_use]
    pub const fn least_height_of_one_pt() -> f32 {
        CHOICES_PT + HEADING_PT + LEAST_TRACE_PT + TIMES_PT
    }

    /// Shows what a command line says.
    pub fn choose(&mut self, chosen: &Chosen) {
        if let Some(traces) = chosen.traces() {
            self.shown = traces.to_vec();
        }
        self.force_position.axis = chosen.force_position;
    }

    /// The height with which every trace of a picture can be read, points.
    #[must_use]
    pub fn least_height_pt(&self) -> f32 {
        (HEADING_AND_GAPS_PT + LEAST_TRACE_OF_PICTURE_PT) * self.in_sight().len().max(1) as f32 + TIMES_PT
    }

    /// Whether every trace can be read in a picture of one height, if that takes another, pixels.
    ///
    /// # Errors
    /// [`TooLow`].
    pub fn has_room(&self, height_px: usize, least_px: usize) -> Result<(), TooLow> {
        let count = self.in_sight().len();
        if height_px >= least_px { Ok(()) } else { Err(TooLow { count, least_px, height_px }) }
    }

    /// Draws the traces, and force over position, into all of the room there is: a picture, in which nothing can be pressed.
    pub fn still(&mut self, ui: &mut Ui, seen: Seen<'_>, cursor_s: f64, palette: &Palette) {
        let Seen { history, device, .. } = seen;
        let span_s = self.span_of_both_s(seen);
        let mut left = ui.available_rect_before_wrap();
        if self.force_position.axis.is_some() {
            let beside;
            (left, beside) = split_for_force_position(left, 16.0);
            let mut right = ui.new_child(UiBuilder::new().max_rect(beside).id_salt("force over position"));
            self.force_position.show(&mut right, (history, f64::NAN), span_s, self.units, palette);
        }
        // The last time of an axis stands half beside it.
        let mut ui = ui.new_child(UiBuilder::new().max_rect(left.with_max_x(left.right() - 16.0)));
        ui.spacing_mut().item_spacing.y = GAP_PT;
        let in_sight = self.in_sight();
        let count = in_sight.len().max(1) as f32;
        let height = (ui.available_height() - HEADING_AND_GAPS_PT * count - 16.0) / count;
        for (index, quantity) in in_sight.iter().enumerate() {
            let time_axis = index + 1 == in_sight.len();
            let view = PlotView {
                device,
                span_s,
                cursor_s,
                units: self.units,
                height: height + if time_axis { 14.0 } else { 0.0 },
                time_axis,
                values: self.shown_values_of(*quantity),
                maximise: Maximise::No,
                wheel: Wheel::Zooms,
            };
            let mut traces = [Trace::of(*quantity), Trace::of(*quantity)];
            let [trace, compared] = &mut traces;
            let compared = seen.compared.map(|history| Lines { history, trace: compared });
            let drawn = plot(&mut ui, Lines { history, trace }, compared, view, palette);
            self.marks.show_faults(&ui, history, span_s, drawn.frame, palette);
            if time_axis {
                self.marks.show(&mut ui, history, span_s, drawn.frame, palette);
            }
        }
    }

    /// Values shown of a trace that is zoomed, in the units shown.
    fn shown_values_of(&self, quantity: Quantity) -> Option<[f64; 2]> {
        let (_, per_si) = quantity.unit(self.units);
        self.values_of(quantity).map(|values| values.map(|value| value * per_si))
    }

    /// Another run is shown from now on.
    pub fn start_over(&mut self) {
        self.look_at_another();
        self.end_s = f64::INFINITY;
        self.zoom_out();
        self.values.clear();
    }

    /// Another device of the same run is shown from now on.
    pub fn look_at_another(&mut self) {
        self.traces.clear();
        self.forget_compared();
        self.marks = Marks::default();
        self.force_position.start_over();
    }

    /// Another second recording is shown from now on, or none.
    pub fn forget_compared(&mut self) {
        self.compared.clear();
    }

    /// The traces in sight, from the top.
    #[must_use]
    pub fn in_sight(&self) -> Vec<Quantity> {
        self.alone.map_or_else(|| self.shown.clone(), |alone| vec![alone])
    }

    /// Values shown of a trace that is zoomed, SI.
    #[must_use]
    pub fn values_of(&self, quantity: Quantity) -> Option<[f64; 2]> {
        self.values.get(&quantity).copied()
    }

    /// Gives the first trace, or the one named, the room of all; or all their own again.
    pub fn switch_maximised(&mut self, quantity: Option<Quantity>) {
        self.alone = match self.alone {
            None if self.shown.len() > 1 => quantity.or_else(|| self.shown.first().copied()),
            _ => None,
        };
    }

    fn zoom_out(&mut self) {
        if matches!(self.window, Window::Between(..)) {
            self.window = self.unzoomed;
        }
    }

    fn zoom(&mut self, quantity: Quantity, request: ZoomRequest) {
        let (_, per_si) = quantity.unit(self.units);
        let (time_s, values) = match request {
            ZoomRequest::Box(time_s, values) => (Some(time_s), Some(values)),
            ZoomRequest::Time(time_s) => (Some(time_s), None),
            ZoomRequest::Values(values) => (None, Some(values)),
            ZoomRequest::All => {
                self.zoom_out();
                self.values.remove(&quantity);
                (None, None)
            }
        };
        if let Some([from_s, to_s]) = time_s.filter(|[from_s, to_s]| to_s - from_s >= LEAST_TIME_S) {
            if !matches!(self.window, Window::Between(..)) {
                self.unzoomed = self.window;
            }
            self.window = Window::Between(from_s, to_s);
        }
        let is_range = |[low, high]: &[f64; 2]| low.is_finite() && high.is_finite() && low < high;
        if let Some(values) = values.filter(is_range) {
            self.values.insert(quantity, values.map(|value| value / per_si));
        }
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
            Window::Between(from_s, to_s) => [from_s, to_s],
            Window::Newest(length_s) => {
                let end_s = self.end_s.min(last_s);
                // Before the run there is nothing to show: its beginning stays at the left until it is longer.
                let from_s = (end_s - length_s).max(first_s.min(end_s));
                [from_s, from_s + length_s]
            }
        }
    }

    /// Returns first and last time shown, s: of all, those of both recordings.
    fn span_of_both_s(&self, seen: Seen<'_>) -> [f64; 2] {
        let span_s = self.span_s(seen.history);
        match (self.window, seen.compared.map(History::span_s)) {
            (Window::Whole, Some([first_s, last_s])) => [span_s[0].min(first_s), span_s[1].max(last_s)],
            _ => span_s,
        }
    }

    /// Shows the row of choices and the traces; says what was requested.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        seen: Seen<'_>,
        now_s: f64,
        motion: Motion,
        palette: &Palette,
    ) -> Vec<PlotRequest> {
        self.end_s = self.end_of_window(seen.history.span_s(), now_s, motion);
        let mut requests = Vec::new();
        self.choices(ui, palette, &mut requests);
        let (span_s, cursor_s) = (self.span_of_both_s(seen), self.hover_s.unwrap_or(now_s));
        if self.force_position.axis.is_some() && ui.available_width() < ROOM_BESIDE_PT {
            self.force_position.show(ui, (seen.history, cursor_s), span_s, self.units, palette);
        } else if self.force_position.axis.is_some() {
            let (left, beside) = split_for_force_position(ui.available_rect_before_wrap(), 12.0);
            let mut right = ui.new_child(UiBuilder::new().max_rect(beside).id_salt("force over position"));
            self.force_position.show(&mut right, (seen.history, cursor_s), span_s, self.units, palette);
            let mut left = ui.new_child(UiBuilder::new().max_rect(left).id_salt("over time"));
            self.over_time(&mut left, seen, now_s, palette, &mut requests);
        } else {
            self.over_time(ui, seen, now_s, palette, &mut requests);
        }
        requests
    }

    /// Shows the traces: all of them, or as many as have room, with the number of the others.
    fn over_time(
        &mut self,
        ui: &mut Ui,
        seen: Seen<'_>,
        now_s: f64,
        palette: &Palette,
        requests: &mut Vec<PlotRequest>,
    ) {
        let all = self.in_sight();
        let room_for = |count: usize| {
            let count = count.max(1) as f32;
            (ui.available_height() - HEADING_PT * count - TIMES_PT) / count
        };
        let fits = |count: &usize| room_for(*count) >= LEAST_TRACE_PT;
        let count = (1..=all.len()).rev().find(fits).unwrap_or(1);
        let wheel = if count < all.len() { Wheel::Scrolls } else { Wheel::Zooms };
        self.scroll(ui, all.len().saturating_sub(count));
        let shown = all.get(self.first..self.first + count).unwrap_or(&all);
        self.out_of_sight = [self.first, all.len().saturating_sub(self.first + count)];
        let height_pt = room_for(count).max(LEAST_TRACE_PT);
        requests.extend(self.stack(ui, seen, now_s, (shown, height_pt, wheel), palette));
    }

    /// Brings the next trace into sight, or the one before, when the wheel turns over the traces.
    fn scroll(&mut self, ui: &Ui, last: usize) {
        let is_over = ui.rect_contains_pointer(ui.available_rect_before_wrap());
        let turned = |input: &egui::InputState| (input.smooth_scroll_delta().y, input.modifiers.alt);
        let (turn_pt, zooms) = ui.input(turned);
        if is_over && !zooms {
            self.turned_pt -= turn_pt;
        }
        if last == 0 {
            self.turned_pt = 0.0;
        }
        let steps = (self.turned_pt / SCROLL_PT).trunc();
        self.turned_pt -= steps * SCROLL_PT;
        #[allow(clippy::cast_possible_truncation)] // a handful
        let first = self.first.saturating_add_signed(steps as isize);
        self.first = first.min(last);
    }

    /// Shows traces of a height, one above the other.
    fn stack(
        &mut self,
        ui: &mut Ui,
        seen: Seen<'_>,
        now_s: f64,
        (shown, height_pt, wheel): (&[Quantity], f32, Wheel),
        palette: &Palette,
    ) -> Vec<PlotRequest> {
        let Seen { history, device, .. } = seen;
        let span_s = self.span_of_both_s(seen);
        let cursor_s = self.hover_s.unwrap_or(now_s);
        let maximise = match (self.alone, self.shown.len()) {
            (Some(_), _) => Maximise::Done,
            (None, 0 | 1) => Maximise::No,
            (None, _) => Maximise::Possible,
        };
        self.hover_s = None;
        ui.spacing_mut().item_spacing.y = GAP_PT;
        let mut requests = Vec::new();
        for (index, quantity) in shown.iter().copied().enumerate() {
            let time_axis = index + 1 == shown.len();
            let height = if time_axis { height_pt + 14.0 } else { height_pt };
            let values = self.shown_values_of(quantity);
            let view = PlotView {
                device,
                span_s,
                cursor_s,
                units: self.units,
                height,
                time_axis,
                values,
                maximise,
                wheel,
            };
            let trace = self.traces.entry(quantity).or_insert_with(|| Trace::of(quantity));
            let compared = seen.compared.map(|history| {
                let trace = self.compared.entry(quantity).or_insert_with(|| Trace::of(quantity));
                Lines { history, trace }
            });
            let answer = plot(ui, Lines { history, trace }, compared, view, palette);
            self.marks.show_faults(ui, history, span_s, answer.frame, palette);
            if time_axis {
                self.marks.show(ui, history, span_s, answer.frame, palette);
            }
            self.hover_s = self.hover_s.or(answer.hover_s);
            requests.extend(answer.seek_s.map(PlotRequest::Seek));
            if answer.switches_maximised {
                self.switch_maximised(Some(quantity));
            }
            if let Some(request) = answer.zoom {
                self.zoom(quantity, request);
            }
        }
        requests
    }

    /// A trace that is looked at stands still, as long as the moment shown is in it and not at its edge.
    fn end_of_window(&self, [first_s, last_s]: [f64; 2], now_s: f64, motion: Motion) -> f64 {
        /// Part of the window between the moment and an edge.
        const MARGIN: f64 = 0.1;
        match (motion, self.window) {
            (Motion::Follow, _) | (_, Window::Whole | Window::Between(..)) => last_s,
            (_, Window::Newest(length_s)) => {
                let margin_s = MARGIN * length_s;
                let near = self.end_s.clamp(now_s + margin_s, now_s + length_s - margin_s);
                near.max(first_s + length_s).min(last_s)
            }
        }
    }

    /// Shows or hides a quantity; the last one stays.
    pub fn toggle(&mut self, quantity: Quantity) {
        self.alone = None;
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

/// The room of the traces, and of force over position to the right of them.
fn split_for_force_position(all: Rect, gap_pt: f32) -> (Rect, Rect) {
    /// Part of the width that force over position gets.
    const PART: f32 = 0.36;
    let beside = all.with_min_x(all.right() - (PART * all.width()).round());
    (all.with_max_x(beside.left() - gap_pt), beside)
}
