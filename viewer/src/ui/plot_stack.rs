//! Stack of traces over one time axis, with the user's choices.

mod choices;

use crate::display_options::DisplayOptions;
use crate::palette::Palette;
use crate::trace::Trace;
use crate::ui::export_options::{ExportFormat, ExportOptions};
use crate::ui::force_position::ForcePositionPlot;
use crate::ui::marks::Marks;
use crate::ui::plots::{Lines, Maximise, PlotView, plot};
use crate::ui::zoom::{Wheel, ZoomRequest};
use egui::{Rect, Ui, UiBuilder};
use flotor_history::History;
use flotor_history::player::Motion;
use flotor_history::quantity::{Quantity, Units};
use std::collections::BTreeMap;

/// Default traces.
pub const FIRST_TRACES: [Quantity; 2] = [Quantity::Force, Quantity::Position];

/// Height of the row of choices with the gap beneath, points.
const CHOICES_PT: f32 = 30.0;
/// Smallest height of a trace, points: room for three marks of an axis. Traces that do not fit are reached by scrolling.
const LEAST_TRACE_PT: f32 = 48.0;
/// Height up to which a trace takes precedence over the 3D view, points.
const GOOD_TRACE_PT: f32 = 60.0;
/// Distance between headings and traces, points.
const GAP_PT: f32 = 3.0;
/// Rotation of the wheel that scrolls by one trace, points.
const SCROLL_PT: f32 = 30.0;
/// Width below which force over position replaces the traces, points.
const ROOM_BESIDE_PT: f32 = 560.0;
/// Smallest height of a trace in a picture, points: a picture cannot be scrolled, and the marks of the axis need their numbers.
const LEAST_TRACE_OF_PICTURE_PT: f32 = 58.0;
/// Height of the heading of a trace, and of the time axis below the last trace, points.
const HEADING_PT: f32 = 29.0;
const TIMES_PT: f32 = 22.0;
/// Height of the heading of a trace with its gaps, points.
const HEADING_AND_GAPS_PT: f32 = 32.0;
/// Shortest time span that can be shown, s: a few ticks.
const LEAST_TIME_S: f64 = 5.0e-3;

/// Displayed time span.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Window {
    /// The whole run.
    Whole,
    /// The newest seconds; the value is the length, s.
    Newest(f64),
    /// From one time to another, s.
    Between(f64, f64),
}

/// Request of the user, besides changes of the plots.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PlotRequest {
    /// Display another time, s.
    Seek(f64),
    /// Export the shown traces to a file.
    Export(ExportFormat),
}

/// Error of a picture too low for its traces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the picture is {height_px} pixels high, but readable traces ({count}) need {least_px} pixels; increase \
     the height (on the command line with --size), or choose fewer traces"
)]
pub struct TooLow {
    /// Number of traces.
    pub count: usize,
    /// Required height of the picture, pixels.
    pub least_px: usize,
    /// Actual height of the picture, pixels.
    pub height_px: usize,
}

/// Data source of the traces.
#[derive(Clone, Copy, Debug)]
pub struct TraceSource<'a> {
    /// Samples of a device.
    pub history: &'a History,
    /// Name of the device, if there are several.
    pub device: Option<&'a str>,
    /// Samples of the same device in a second recording, drawn dashed beneath the first.
    pub compared: Option<&'a History>,
}

/// Stack of traces, with their time span, units and zoom.
#[derive(Clone, Debug)]
pub struct PlotStack {
    /// Shown quantities, from the top.
    pub shown: Vec<Quantity>,
    /// Displayed time span.
    pub window: Window,
    /// Units of all numbers.
    pub units: Units,
    /// Force over position, beside the traces.
    pub force_position: ForcePositionPlot,
    /// Options for pictures of the traces.
    pub export: ExportOptions,
    /// Maximised quantity, if any.
    alone: Option<Quantity>,
    /// Range of values of each zoomed trace, SI.
    values: BTreeMap<Quantity, [f64; 2]>,
    /// Time span before a zoom.
    unzoomed: Window,
    /// Decimated traces of the history, for each quantity shown so far.
    traces: BTreeMap<Quantity, Trace>,
    /// Decimated traces of the second recording.
    compared: BTreeMap<Quantity, Trace>,
    /// Marks of events beneath the traces.
    marks: Marks,
    /// End of a window that is shorter than the run, s; infinite before the first picture.
    end_s: f64,
    /// Time under the pointer in the last picture, s.
    hover_s: Option<f64>,
    /// Number of the first visible trace, if not all fit.
    first: usize,
    /// Number of hidden traces above and below.
    out_of_sight: [usize; 2],
    /// Rotation of the wheel since the last scroll, points.
    turned_pt: f32,
}

impl PlotStack {
    /// Creates a stack with the default traces.
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

    /// Returns the height at which all traces are easy to read, with the choices above, points.
    #[must_use]
    pub fn good_height_pt(&self) -> f32 {
        CHOICES_PT + (HEADING_PT + GOOD_TRACE_PT) * self.in_sight().len().max(1) as f32 + TIMES_PT
    }

    /// Returns the height at which one trace is readable, with the choices above, points.
    #[must_use]
    pub const fn least_height_of_one_pt() -> f32 {
        CHOICES_PT + HEADING_PT + LEAST_TRACE_PT + TIMES_PT
    }

    /// Applies the traces and the axis of force over position of a command line.
    pub fn choose(&mut self, chosen: &DisplayOptions) {
        if let Some(traces) = chosen.traces() {
            self.shown = traces.to_vec();
        }
        self.force_position.axis = chosen.force_position;
    }

    /// Returns the height at which every trace of a picture is readable, points.
    #[must_use]
    pub fn least_height_pt(&self) -> f32 {
        (HEADING_AND_GAPS_PT + LEAST_TRACE_OF_PICTURE_PT) * self.in_sight().len().max(1) as f32 + TIMES_PT
    }

    /// Checks that a picture has the required height `least_px`, pixels.
    ///
    /// # Errors
    /// [`TooLow`] if the picture is lower.
    pub fn has_room(&self, height_px: usize, least_px: usize) -> Result<(), TooLow> {
        let count = self.in_sight().len();
        if height_px >= least_px { Ok(()) } else { Err(TooLow { count, least_px, height_px }) }
    }

    /// Draws the traces, and force over position, into the available area, as a picture without controls.
    pub fn still(&mut self, ui: &mut Ui, seen: TraceSource<'_>, cursor_s: f64, palette: &Palette) {
        self.traces.clear();
        self.forget_compared();
        let mut left = ui.available_rect_before_wrap();
        if self.force_position.axis.is_some() {
            left = self.show_beside(ui, seen, (f64::NAN, 16.0), palette);
        }
        // Half of the last number of the time axis is beyond its end.
        let mut ui = ui.new_child(UiBuilder::new().max_rect(left.with_max_x(left.right() - 16.0)));
        let in_sight = self.in_sight();
        let count = in_sight.len().max(1) as f32;
        let height_pt = (ui.available_height() - HEADING_AND_GAPS_PT * count - 16.0) / count;
        let controls = (Maximise::No, Wheel::Zooms);
        self.stack(&mut ui, (seen, cursor_s), (&in_sight, height_pt), controls, palette);
    }

    /// Returns the range of values of a zoomed trace, in the displayed units.
    fn shown_values_of(&self, quantity: Quantity) -> Option<[f64; 2]> {
        let (_, per_si) = quantity.unit(self.units);
        self.values_of(quantity).map(|values| values.map(|value| value * per_si))
    }

    /// Clears traces and zoom, for a new run.
    pub fn start_over(&mut self) {
        self.look_at_another();
        self.end_s = f64::INFINITY;
        self.zoom_out();
        self.values.clear();
    }

    /// Clears all traces, the marks and the curves of force over position, for a newly chosen device of the same run.
    pub fn look_at_another(&mut self) {
        self.traces.clear();
        self.forget_compared();
        self.marks = Marks::default();
    }

    /// Clears the traces of the second recording, and the curves of force over position.
    pub fn forget_compared(&mut self) {
        self.compared.clear();
        self.force_position.start_over();
    }

    /// Returns the chosen quantities from the top, or only the maximised quantity.
    #[must_use]
    pub fn in_sight(&self) -> Vec<Quantity> {
        self.alone.map_or_else(|| self.shown.clone(), |alone| vec![alone])
    }

    /// Returns the range of values of a zoomed trace, SI; `None` without a zoom.
    #[must_use]
    pub fn values_of(&self, quantity: Quantity) -> Option<[f64; 2]> {
        self.values.get(&quantity).copied()
    }

    /// Maximises the named trace, else the first trace; if a trace is maximised, restores all traces.
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

    /// Returns the number of samples processed so far: once for each quantity, not once for each frame.
    #[must_use]
    pub fn visited(&self) -> u64 {
        self.traces.values().map(Trace::visited).sum()
    }

    /// Returns the first and last displayed time, s.
    #[must_use]
    pub fn span_s(&self, history: &History) -> [f64; 2] {
        let [first_s, last_s] = history.span_s();
        match self.window {
            Window::Whole => [first_s, last_s.max(first_s + 1.0e-3)],
            Window::Between(from_s, to_s) => [from_s, to_s],
            Window::Newest(length_s) => {
                let end_s = self.end_s.min(last_s);
                // Before the run there is nothing to show: the start of the run stays at the left until the run is longer than the window.
                let from_s = (end_s - length_s).max(first_s.min(end_s));
                [from_s, from_s + length_s]
            }
        }
    }

    /// Returns the first and last displayed time, s; the window `Whole` covers both recordings.
    fn span_of_both_s(&self, seen: TraceSource<'_>) -> [f64; 2] {
        let span_s = self.span_s(seen.history);
        match (self.window, seen.compared.map(History::span_s)) {
            (Window::Whole, Some([first_s, last_s])) => [span_s[0].min(first_s), span_s[1].max(last_s)],
            _ => span_s,
        }
    }

    /// Shows the row of choices and the traces; returns the requests of the user.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        seen: TraceSource<'_>,
        now_s: f64,
        motion: Motion,
        palette: &Palette,
    ) -> Vec<PlotRequest> {
        self.end_s = self.end_of_window(seen.history.span_s(), now_s, motion);
        let mut requests = Vec::new();
        self.choices(ui, palette, &mut requests);
        let (span_s, cursor_s) = (self.span_of_both_s(seen), self.hover_s.unwrap_or(now_s));
        if self.force_position.axis.is_some() && ui.available_width() < ROOM_BESIDE_PT {
            let both = (seen.history, seen.compared, cursor_s);
            self.force_position.show(ui, both, span_s, self.units, palette);
        } else if self.force_position.axis.is_some() {
            let left = self.show_beside(ui, seen, (cursor_s, 12.0), palette);
            let mut left = ui.new_child(UiBuilder::new().max_rect(left).id_salt("over time"));
            self.over_time(&mut left, seen, now_s, palette, &mut requests);
        } else {
            self.over_time(ui, seen, now_s, palette, &mut requests);
        }
        requests
    }

    /// Shows force over position at the right of the available area; returns the area for the traces, left of it and a gap.
    fn show_beside(
        &mut self,
        ui: &mut Ui,
        seen: TraceSource<'_>,
        (cursor_s, gap_pt): (f64, f32),
        palette: &Palette,
    ) -> Rect {
        /// Fraction of the width for force over position.
        const PART: f32 = 0.36;
        let all = ui.available_rect_before_wrap();
        let beside = all.with_min_x(all.right() - (PART * all.width()).round());
        let (both, span_s) = ((seen.history, seen.compared, cursor_s), self.span_of_both_s(seen));
        let mut right = ui.new_child(UiBuilder::new().max_rect(beside).id_salt("force over position"));
        self.force_position.show(&mut right, both, span_s, self.units, palette);
        all.with_max_x(beside.left() - gap_pt)
    }

    /// Shows all traces, or as many as fit, and stores the number of the others.
    fn over_time(
        &mut self,
        ui: &mut Ui,
        seen: TraceSource<'_>,
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
        let maximise = match (self.alone, self.shown.len()) {
            (Some(_), _) => Maximise::Done,
            (None, 0 | 1) => Maximise::No,
            (None, _) => Maximise::Possible,
        };
        let cursor_s = self.hover_s.unwrap_or(now_s);
        let controls = (maximise, wheel);
        requests.extend(self.stack(ui, (seen, cursor_s), (shown, height_pt), controls, palette));
    }

    /// Scrolls by whole traces when the wheel is turned over the traces.
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

    /// Shows traces of a given height, one above the other.
    fn stack(
        &mut self,
        ui: &mut Ui,
        (seen, cursor_s): (TraceSource<'_>, f64),
        (shown, height_pt): (&[Quantity], f32),
        (maximise, wheel): (Maximise, Wheel),
        palette: &Palette,
    ) -> Vec<PlotRequest> {
        let TraceSource { history, device, .. } = seen;
        let span_s = self.span_of_both_s(seen);
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

    /// Returns the end of the displayed window: constant as long as the displayed time is inside the window and not near an edge.
    fn end_of_window(&self, [first_s, last_s]: [f64; 2], now_s: f64, motion: Motion) -> f64 {
        /// Smallest distance of the displayed time from an edge, as a fraction of the window.
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

    /// Shows or hides a quantity, and restores all traces if one is maximised; the last quantity cannot be hidden.
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

    /// Switches between handy units (mm) and SI.
    pub fn switch_units(&mut self) {
        self.units = match self.units {
            Units::Handy => Units::Si,
            Units::Si => Units::Handy,
        };
    }
}
