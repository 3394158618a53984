//! What happened, as marks along the time: where a limit cut the force, where ticks were missed, where a parameter changed.

use crate::decimate::bucket_width_s;
use crate::history::History;
use crate::palette::Palette;
use egui::{Color32, CornerRadius, Rect, Sense, Ui, WidgetInfo};
use flotor_core::trace::Events;
use std::collections::VecDeque;

/// Number of intervals, at most, into which the time shown is divided.
const INTERVALS: usize = 400;

/// How bad what happened is, from the worst; each has its colour.
const RANKS: [&[Events]; 3] = [
    &[Events::EMERGENCY_STOP, Events::DEVICE_FAULT, Events::MODEL_FAULT, Events::OSCILLATION_DAMPED],
    &[
        Events::FORCE_LIMITED,
        Events::TORQUE_LIMITED,
        Events::BOUNDARY,
        Events::MISSED,
        Events::HOLDING,
        Events::VELOCITY_LIMITED,
        Events::NOT_FINITE,
        Events::IMPLAUSIBLE_SAMPLE,
        Events::MODEL_DEGRADED,
        Events::PARTNER_SILENT,
    ],
    &[Events::PARAMETER_CHANGED],
];

/// Events of the time shown, kept from picture to picture as the traces are.
#[derive(Clone, Debug, Default)]
pub struct Marks {
    width_s: f64,
    /// Number of an interval, and what happened in it.
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

    /// Paints the marks at the foot of the traces; what they are is said to who points at one.
    pub fn show(&mut self, ui: &mut Ui, history: &History, span_s: [f64; 2], frame: Rect, palette: &Palette) {
        self.look(history, span_s);
        let per_s = f64::from(frame.width()) / (span_s[1] - span_s[0]);
        #[allow(clippy::cast_possible_truncation)] // points
        let x = |time_s: f64| frame.left() + ((time_s - span_s[0]) * per_s) as f32;
        let strip = Rect::from_min_max(egui::pos2(frame.left(), frame.bottom() - 7.0), frame.max);
        let response = ui.interact(strip, ui.scope_id().with("marks"), Sense::hover());
        let pointed = response.hover_pos().map(|at| at.x);
        let (mut said, mut all) = (Vec::new(), Events::NONE);
        for (number, events) in &self.kept {
            let (from, to) = (x(number * self.width_s), x((number + 1.0) * self.width_s));
            let area = Rect::from_x_y_ranges(from.max(frame.left())..=to.min(frame.right()), strip.y_range());
            let Some(rank) = rank(*events) else { continue };
            all.insert(*events);
            ui.painter().rect_filled(area, CornerRadius::ZERO, color(rank, palette));
            if pointed.is_some_and(|at| area.x_range().contains(at)) {
                said = names(*events);
            }
        }
        let all = names(all);
        if !all.is_empty() {
            let label = format!("Marked on the time axis: {}", all.join(", "));
            response.widget_info(|| WidgetInfo::labeled(egui::Role::Image, true, &label));
        }
        if !said.is_empty() {
            response.on_hover_text(said.join("\n"));
        }
    }
}

fn rank(events: Events) -> Option<usize> {
    RANKS.iter().position(|rank| rank.iter().any(|event| events.intersects(*event)))
}

fn color(rank: usize, palette: &Palette) -> Color32 {
    match rank {
        0 => palette.fault,
        1 => palette.warning,
        _ => palette.cursor,
    }
}

/// Names of what is marked.
fn names(events: Events) -> Vec<String> {
    let marked = |bit: u32| {
        let event = Events::from_bits(1 << bit);
        events.intersects(event) && rank(event).is_some()
    };
    let bits = (0..).zip(Events::NAMES).filter(|(bit, _)| marked(*bit));
    bits.map(|(_, name)| name.replace('_', " ")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::{Keep, unknown_run};
    use flotor_core::trace::{RECORD_WORDS, TickRecord};
    use flotor_sync::Words;

    #[test]
    fn an_event_of_one_tick_is_marked_and_each_sample_is_looked_at_once() {
        let mut history = History::new(unknown_run(), Keep::All);
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
