//! Marks of events over time: bars at the foot of the traces for parameter changes and for the events [`Events::LIMITS`], such as a
//! limited force or missed ticks, and a line with a cross over the traces for each fault.

use crate::palette::Palette;
use egui::{Color32, CornerRadius, Rect, Sense, Stroke, Ui, WidgetInfo, pos2, vec2};
use flotor_core::trace::Events;
use flotor_history::History;
use flotor_history::decimate::bucket_width_s;
use std::collections::VecDeque;

/// Largest number of intervals in the displayed time.
const INTERVALS: usize = 400;

/// Classes of marked events, the most severe first; each has its colour. Changes of parameters are marked separately.
const RANKS: [Events; 2] = [Events::FAULTS, Events::LIMITS];
/// Hover text of the mark of a parameter change.
const CHANGE: &str = "parameter changed";

/// Half the size of the cross of a fault, and the distance of its centre from the top of a trace, points.
const CROSS_PT: f32 = 4.5;
const CROSS_DEPTH_PT: f32 = 8.0;

/// Events of the displayed time span, kept from frame to frame like the traces.
#[derive(Clone, Debug, Default)]
pub struct Marks {
    width_s: f64,
    /// Number of each interval, and its events.
    kept: VecDeque<(f64, Events)>,
    next: u64,
}

impl Marks {
    fn look(&mut self, history: &History, span_s: [f64; 2]) {
        let width_s = bucket_width_s(span_s[1] - span_s[0], INTERVALS);
        let first = history.number_at(span_s[0]);
        let is_earlier =
            self.kept.front().is_some_and(|(number, _)| number * self.width_s > span_s[0] + width_s);
        if width_s != self.width_s || self.next < first || is_earlier {
            *self = Self { width_s, kept: VecDeque::new(), next: first };
        }
        for sample in history.from_number(self.next).take_while(|sample| sample.time_s() <= span_s[1]) {
            self.next += 1;
            let number = (sample.time_s() / width_s).floor();
            match self.kept.back_mut() {
                Some((last, events)) if *last == number => events.insert(sample.events),
                _ => self.kept.push_back((number, sample.events)),
            }
        }
        while self.kept.front().is_some_and(|(number, _)| (number + 1.0) * width_s < span_s[0]) {
            self.kept.pop_front();
        }
    }

    /// Paints a line with a cross over a trace wherever a fault begins.
    pub fn show_faults(
        &mut self,
        ui: &Ui,
        history: &History,
        span_s: [f64; 2],
        frame: Rect,
        palette: &Palette,
    ) {
        self.look(history, span_s);
        let (painter, stroke) = (ui.painter_at(frame), Stroke::new(1.6, palette.fault));
        let mut before = Events::NONE;
        for (number, events) in &self.kept {
            let is_new = events
                .named()
                .any(|(event, _)| Events::FAULTS.intersects(event) && !before.intersects(event));
            before = *events;
            if !is_new {
                continue;
            }
            let x = place(number * self.width_s, span_s, frame);
            painter.line_segment([pos2(x, frame.top()), pos2(x, frame.bottom())], stroke);
            for dy in [-CROSS_PT, CROSS_PT] {
                let middle = pos2(x, frame.top() + CROSS_DEPTH_PT);
                painter.line_segment([middle - vec2(CROSS_PT, dy), middle + vec2(CROSS_PT, dy)], stroke);
            }
        }
    }

    /// Paints the marks at the foot of the traces; the mark under the pointer shows its events as hover text.
    pub fn show(&mut self, ui: &mut Ui, history: &History, span_s: [f64; 2], frame: Rect, palette: &Palette) {
        self.look(history, span_s);
        let x = |time_s: f64| place(time_s, span_s, frame);
        let strip = Rect::from_min_max(egui::pos2(frame.left(), frame.bottom() - 7.0), frame.max);
        let response = ui.interact(strip, ui.scope_id().with("marks"), Sense::hover());
        let pointed = response.hover_pos().map(|at| at.x);
        let area = |number: f64| {
            let (from, to) = (x(number * self.width_s), x((number + 1.0) * self.width_s));
            Rect::from_x_y_ranges(from.max(frame.left())..=to.min(frame.right()), strip.y_range())
        };
        let is_pointed = |area: Rect| pointed.is_some_and(|at| area.x_range().contains(at));
        let (mut said, mut has_changes) = (Vec::new(), false);
        let mut last = f64::NAN;
        for time_s in history.changes_between_s(span_s[0], span_s[1]) {
            let number = (time_s / self.width_s).floor();
            if number == last {
                continue;
            }
            (last, has_changes) = (number, true);
            ui.painter().rect_filled(area(number), CornerRadius::ZERO, palette.cursor);
            if is_pointed(area(number)) {
                said = vec![CHANGE.to_owned()];
            }
        }
        let mut all = Events::NONE;
        for (number, events) in &self.kept {
            let Some(rank) = rank(*events) else { continue };
            all.insert(*events);
            ui.painter().rect_filled(area(*number), CornerRadius::ZERO, color(rank, palette));
            if is_pointed(area(*number)) {
                said.extend(names(*events));
            }
        }
        let mut all = names(all);
        all.extend(has_changes.then(|| CHANGE.to_owned()));
        if !all.is_empty() {
            let label = format!("Marked on the time axis: {}", all.join(", "));
            response.widget_info(|| WidgetInfo::labeled(egui::Role::Image, true, &label));
        }
        if !said.is_empty() {
            response.on_hover_text(said.join("\n"));
        }
    }
}

/// Returns the x coordinate of a time in a frame, points.
fn place(time_s: f64, span_s: [f64; 2], frame: Rect) -> f32 {
    let per_s = f64::from(frame.width()) / (span_s[1] - span_s[0]);
    #[allow(clippy::cast_possible_truncation)] // points
    let beside = ((time_s - span_s[0]) * per_s) as f32;
    frame.left() + beside
}

fn rank(events: Events) -> Option<usize> {
    RANKS.iter().position(|rank| events.intersects(*rank))
}

fn color(rank: usize, palette: &Palette) -> Color32 {
    match rank {
        0 => palette.fault,
        _ => palette.warning,
    }
}

/// Returns the names of the marked events.
fn names(events: Events) -> Vec<String> {
    events.named().filter(|(event, _)| rank(*event).is_some()).map(|(_, name)| name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_core::trace::{RECORD_WORDS, TickRecord};
    use flotor_history::{Retention, unknown_run};
    use flotor_sync::Words;

    #[test]
    fn an_event_of_one_tick_is_marked_and_each_sample_is_looked_at_once() {
        let mut history = History::new(unknown_run(), Retention::All);
        for tick in 0..10_000 {
            let mut record = TickRecord::from_words(&[0; RECORD_WORDS]);
            (record.tick, record.time_ns) = (tick, tick * 1_000_000);
            if tick == 4321 {
                record.events = Events::MISSED;
            }
            history.push(&record);
        }
        let mut marks = Marks::default();
        marks.look(&history, [0.0, 9.0]);
        let marked: Vec<f64> = marks
            .kept
            .iter()
            .filter(|(_, events)| rank(*events).is_some())
            .map(|(n, _)| n * marks.width_s)
            .collect();
        assert_eq!(marked.len(), 1);
        assert!((marked[0] - 4.321).abs() <= marks.width_s, "{marked:?}");
        let next = marks.next;
        marks.look(&history, [0.5, 9.5]);
        assert_eq!(marks.next, next + 500);
        assert_eq!(names(Events::MISSED), ["missed"]);
        assert!(names(Events::RAMPING).is_empty());
    }
}
