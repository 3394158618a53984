//! What stands in the corners of the 3D view: title, numbers of the moment, warnings.

use crate::history::Sample;
use crate::palette::Palette;
use crate::quantity::{Quantity, Units};
use crate::scene::SceneFacts;
use crate::ui::plots::digits;
use crate::ui::style::{BODY_PT, SMALL_PT, TITLE_PT};
use egui::{Align2, Color32, FontId, Painter, Pos2, Rect, vec2};
use flotor_core::Clock;
use flotor_core::trace::Events;
use flotor_record::RunDescription;

/// Distance of text from the edges, points.
const MARGIN: f32 = 22.0;

/// Narrower, the numbers would stand before the body: the time has to do, and those above the traces, points.
const ROOM_FOR_NUMBERS_PT: f32 = 560.0;

/// The energy of models of which one does not give its own.
const NOT_GIVEN: &str = "not given";

/// Title of a run and what it was made with.
#[must_use]
pub fn title_of(run: &RunDescription) -> String {
    let scene: Option<toml::Table> = run.scene_toml.parse().ok();
    let title = scene.as_ref().and_then(|table| table.get("title")).and_then(toml::Value::as_str);
    title.unwrap_or("A run").to_owned()
}

/// The plugins of a run, its rate and its clock, in one line.
#[must_use]
pub fn subtitle_of(run: &RunDescription) -> String {
    let plugins = run.plugins.iter().map(|plugin| format!("{} {}", plugin.id, plugin.version));
    let clock = match run.clock {
        Clock::Real => "real time",
        Clock::Virtual => "virtual clock",
    };
    let parts = plugins.chain([format!("{} Hz", run.rate_hz), clock.to_owned()]);
    parts.collect::<Vec<_>>().join("  ·  ")
}

/// Paints title and subtitle into the upper left.
pub fn title(painter: &Painter, area: Rect, run: &RunDescription, palette: &Palette) {
    let corner = area.left_top() + vec2(MARGIN, MARGIN - 4.0);
    let text = |at: Pos2, text: String, size: f32, color: Color32| {
        painter.text(at, Align2::LEFT_TOP, text, FontId::proportional(size), color)
    };
    let first = text(corner, title_of(run), TITLE_PT, palette.text);
    text(first.left_bottom() + vec2(0.0, 3.0), subtitle_of(run), SMALL_PT, palette.faint);
}

/// Paints the numbers of a moment into the upper right, a line a quantity.
pub fn numbers(painter: &Painter, area: Rect, sample: &Sample, units: Units, palette: &Palette) {
    let right = area.right() - MARGIN;
    let mut y = area.top() + MARGIN - 2.0;
    let line = BODY_PT + 6.0;
    let (large, mono) = (FontId::monospace(BODY_PT + 3.0), FontId::monospace(BODY_PT - 1.0));
    let (small, name) = (FontId::proportional(SMALL_PT), FontId::proportional(SMALL_PT + 0.5));
    let time = format!("{:.3} s", sample.time_s());
    painter.text(Pos2::new(right, y), Align2::RIGHT_TOP, time, large, palette.text);
    y += line + 6.0;
    if area.width() < ROOM_FOR_NUMBERS_PT {
        return;
    }
    let column = match units {
        Units::Handy => 60.0,
        Units::Si => 76.0,
    };
    let shown = [Quantity::Force, Quantity::Torque, Quantity::Position, Quantity::Rotation, Quantity::Energy];
    for quantity in shown {
        // In a low view the last ones would stand before what is below it.
        if y + line > area.bottom() {
            return;
        }
        let (unit, per_si) = quantity.unit(units);
        painter.text(Pos2::new(right - 34.0, y), Align2::LEFT_TOP, unit, small.clone(), palette.faint);
        let mut x = right - 42.0;
        for component in (0..quantity.components().len()).rev() {
            let value = quantity.value(sample, component) * per_si;
            let value = match quantity {
                Quantity::Energy if value.is_nan() => NOT_GIVEN.to_owned(),
                _ => digits(value, units),
            };
            let color =
                if quantity.components().len() == 3 { palette.components[component] } else { palette.text };
            painter.text(Pos2::new(x, y), Align2::RIGHT_TOP, value, mono.clone(), color);
            x -= column;
        }
        x = right - 42.0 - 3.0 * column;
        painter.text(Pos2::new(x - 4.0, y), Align2::RIGHT_TOP, quantity.name(), name.clone(), palette.faint);
        y += line;
    }
}

/// What people should know about a moment, and what to do about it; most urgent first.
#[must_use]
pub fn warnings(sample: &Sample, facts: &SceneFacts) -> Vec<&'static str> {
    happened(sample.events).chain(of_shapes(facts)).collect()
}

/// What people should know about what happened to a device.
pub fn happened(events: Events) -> impl Iterator<Item = &'static str> {
    const WORDS: [(Events, &str); 10] = [
        (Events::DEVICE_FAULT, "Device fault: force is off; see the log for what to do"),
        (Events::MODEL_FAULT, "A model failed: it gives no force any more; stop and look at the log"),
        (Events::FORCE_LIMITED, "Excess force: limited by the envelope; ease off"),
        (Events::TORQUE_LIMITED, "Excess torque: limited by the envelope; ease off"),
        (Events::BOUNDARY, "Outside the boundary: move back towards the middle"),
        (Events::STALE_SAMPLE, "Stale data: the device had no new sample; check its cable"),
        (Events::IMPLAUSIBLE_SAMPLE, "Impossible sample: not used; check the device and its cable"),
        (Events::NOT_FINITE, "A number was not finite: counted as no force"),
        (Events::MISSED, "Late: ticks were missed; `flotor doctor` says how to keep time"),
        (Events::MODEL_DEGRADED, "The model left its domain: its answer is a safe continuation"),
    ];
    WORDS.iter().filter(move |(event, _)| events.intersects(*event)).map(|(_, words)| *words)
}

/// What people should know about the bodies that are drawn.
pub fn of_shapes(facts: &SceneFacts) -> impl Iterator<Item = &'static str> {
    let shape = [
        (facts.lifted, "Off its seat: the lower plate hangs in the air, without load"),
        (facts.touching, "Coils touch: from here the spring is far stiffer than the model"),
        (facts.no_shape, "No shape at this pose: the model gives none"),
    ];
    shape.into_iter().filter(|(is, _)| *is).map(|(_, words)| words)
}

/// Paints warnings beneath the title.
pub fn paint_warnings(painter: &Painter, area: Rect, warnings: &[&str], palette: &Palette) {
    let mut at = area.left_top() + vec2(MARGIN, MARGIN + TITLE_PT + SMALL_PT + 18.0);
    for warning in warnings {
        let text = format!("⚠ {warning}");
        let shown = painter.text(at, Align2::LEFT_TOP, text, FontId::proportional(BODY_PT), palette.warning);
        at = shown.left_bottom() + vec2(0.0, 4.0);
    }
}
