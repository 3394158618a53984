//! Texts over the 3D view: title, numbers, warnings.

use crate::palette::Palette;
use crate::scene::SceneFacts;
use crate::ui::overlay::{Corner, GAP_PT, MARGIN_PT, Overlay, shortened};
use crate::ui::plots::digits;
use crate::ui::style::{BODY_PT, SMALL_PT, TITLE_PT};
use egui::{Align2, Color32, FontId, vec2};
use flotor_core::Clock;
use flotor_core::trace::Events;
use flotor_history::Sample;
use flotor_history::quantity::{Quantity, Units};
use flotor_record::RunDescription;

/// Largest fraction of the width of the view for rows of numbers: wider rows would cover the body.
const MOST_OF_WIDTH: f32 = 0.5;
/// Height of a row of numbers, points.
const ROW_PT: f32 = BODY_PT + 3.0;
/// Width of the units at the end of the rows, with a gap, and of their names, points.
const UNIT_PT: f32 = 42.0;
const NAME_PT: f32 = 66.0;
/// Largest number of characters of a device's name in a warning.
const MOST_OF_NAME: usize = 20;

/// Text for an unknown number: the energy if a model does not report its own, or a rate before the second tick.
const NOT_GIVEN: &str = "not given";

/// Events of the loop, which concern all devices.
const OF_THE_LOOP: Events = Events::MISSED;

/// Returns the title of the scene of a run; `A run` if there is none.
#[must_use]
pub fn title_of(run: &RunDescription) -> String {
    let scene: Option<toml::Table> = run.scene_toml.parse().ok();
    let title = scene.as_ref().and_then(|table| table.get("title")).and_then(toml::Value::as_str);
    title.unwrap_or("A run").to_owned()
}

/// Returns the plugins of a run, its rate and its clock, in one line.
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

/// Paints the title and the subtitle of a run, shortened, into the upper left.
pub fn title(overlay: &mut Overlay, run: &RunDescription, palette: &Palette) {
    line(overlay, &title_of(run), TITLE_PT, palette.text);
    line(overlay, &subtitle_of(run), SMALL_PT, palette.faint);
}

/// Returns the height of title, subtitle and this number of warnings, points.
#[must_use]
pub fn heading_pt(warnings: usize) -> f32 {
    /// Height of a line of text, as a multiple of the size of the text.
    const LINE: f32 = 1.4;
    let lines_pt = TITLE_PT + SMALL_PT + warnings as f32 * BODY_PT;
    2.0 * MARGIN_PT + LINE * lines_pt + GAP_PT * (1 + warnings) as f32
}

/// Paints warnings, shortened, beneath the title.
pub fn paint_warnings(overlay: &mut Overlay, warnings: &[String], palette: &Palette) {
    warnings.iter().for_each(|warning| line(overlay, &format!("⚠ {warning}"), BODY_PT, palette.warning));
}

/// Paints a hint for the experimenter, shortened, into the upper left.
pub fn hint(overlay: &mut Overlay, text: &str, palette: &Palette) {
    line(overlay, text, SMALL_PT, palette.faint);
}

/// Paints a line, shortened to the width of the view, into the upper left.
fn line(overlay: &mut Overlay, text: &str, size_pt: f32, color: Color32) {
    let width_pt = overlay.inside().width();
    let galley = shortened(overlay.painter(), text, FontId::proportional(size_pt), color, width_pt);
    if let Some(rect) = overlay.take(Corner::LeftTop, galley.size()) {
        overlay.painter().galley(rect.min, galley, color);
    }
}

/// Row of numbers: up to three values of one unit.
#[derive(Clone, Debug, PartialEq)]
pub struct NumberRow {
    /// Name of the quantity.
    pub name: &'static str,
    /// Values, from the left, with their colours.
    pub values: Vec<(String, Color32)>,
    /// Unit of the values.
    pub unit: &'static str,
}

/// Returns the rows of numbers of a sample, the most important first.
#[must_use]
pub fn rows(sample: &Sample, units: Units, palette: &Palette) -> Vec<NumberRow> {
    let shown = [Quantity::Force, Quantity::Torque, Quantity::Position, Quantity::Rotation, Quantity::Energy];
    let row = |quantity: Quantity| {
        let (unit, per_si) = quantity.unit(units);
        let count = quantity.components().len();
        let value = |component: usize| {
            let value = quantity.value(sample, component) * per_si;
            let text = match quantity {
                Quantity::Energy if value.is_nan() => NOT_GIVEN.to_owned(),
                _ => digits(value, units),
            };
            (text, if count == 3 { palette.components[component] } else { palette.text })
        };
        NumberRow { name: quantity.name(), values: (0..count).map(value).collect(), unit }
    };
    shown.into_iter().map(row).collect()
}

/// Returns the rows of the haptic rate (ticks) and the graphic rate (frames) of a running session, Hz.
#[must_use]
pub fn rates(haptic_hz: Option<f64>, graphic_hz: Option<f64>, palette: &Palette) -> [NumberRow; 2] {
    let row = |name: &'static str, rate_hz: Option<f64>| {
        let text = rate_hz.map_or_else(|| NOT_GIVEN.to_owned(), |rate_hz| format!("{rate_hz:.1}"));
        NumberRow { name, values: vec![(text, palette.text)], unit: "Hz" }
    };
    [row("Haptics", haptic_hz), row("Graphics", graphic_hz)]
}

/// Paints the time, s, and as many rows of numbers as fit into the upper right.
pub fn numbers(overlay: &mut Overlay, time_s: f64, rows: &[NumberRow], units: Units, palette: &Palette) {
    clock(overlay, time_s, palette);
    let column_pt = match units {
        Units::Handy => 60.0,
        Units::Si => 76.0,
    };
    let size = vec2(UNIT_PT + 3.0 * column_pt + NAME_PT, ROW_PT);
    if size.x > MOST_OF_WIDTH * overlay.inside().width() {
        return;
    }
    let (mono, small) = (FontId::monospace(BODY_PT - 1.0), FontId::proportional(SMALL_PT));
    for row in rows {
        let Some(rect) = overlay.take(Corner::RightTop, size) else { return };
        let text = |x: f32, align: Align2, text: &str, font: &FontId, color: Color32| {
            overlay.painter().text(egui::pos2(x, rect.center().y), align, text, font.clone(), color);
        };
        let values_end = rect.right() - UNIT_PT;
        text(values_end + 8.0, Align2::LEFT_CENTER, row.unit, &small, palette.faint);
        for (column, (value, color)) in row.values.iter().rev().enumerate() {
            text(values_end - column as f32 * column_pt, Align2::RIGHT_CENTER, value, &mono, *color);
        }
        text(values_end - 3.0 * column_pt - 4.0, Align2::RIGHT_CENTER, row.name, &small, palette.faint);
    }
}

fn clock(overlay: &mut Overlay, time_s: f64, palette: &Palette) {
    let font = FontId::monospace(BODY_PT + 3.0);
    let galley = overlay.painter().layout_no_wrap(format!("{time_s:.3} s"), font, palette.text);
    if let Some(rect) = overlay.take(Corner::RightTop, galley.size()) {
        overlay.painter().galley(rect.min, galley, palette.text);
    }
}

/// Returns the warnings about events of the devices (with their names) and about bodies, each once, the most urgent first.
#[must_use]
pub fn warnings(devices: &[(&str, Events)], facts: &SceneFacts) -> Vec<String> {
    happened(devices).into_iter().chain(of_shapes(facts).map(str::to_owned)).collect()
}

/// Returns the warnings about events of the devices, each once, with the names of the devices concerned if there are several.
#[must_use]
pub fn happened(devices: &[(&str, Events)]) -> Vec<String> {
    const WORDS: [(Events, &str); 10] = [
        (Events::DEVICE_FAULT, "Device fault: force is off; the log has the remedy"),
        (Events::MODEL_FAULT, "A model failed and has no force any more; stop and check the log"),
        (Events::FORCE_LIMITED, "Excess force: limited by the envelope; push less"),
        (Events::TORQUE_LIMITED, "Excess torque: limited by the envelope; push less"),
        (Events::BOUNDARY, "Outside the boundary: move back towards the middle"),
        (Events::STALE_SAMPLE, "Stale data: the device had no new sample; check its cable"),
        (Events::IMPLAUSIBLE_SAMPLE, "Impossible sample: not used; check the device and its cable"),
        (Events::NOT_FINITE, "A result was not finite: replaced by zero force"),
        (Events::MISSED, "Late: ticks were missed; check with `flotor doctor`"),
        (Events::MODEL_DEGRADED, "The model left its domain: its result is extrapolated safely"),
    ];
    let warning = |(event, words): &(Events, &str)| {
        let concerned = devices.iter().filter(|(_, events)| events.intersects(*event));
        let names: Vec<String> = concerned.map(|(name, _)| short_name(name)).collect();
        match names.len() {
            0 => None,
            _ if devices.len() == 1 || event.intersects(OF_THE_LOOP) => Some((*words).to_owned()),
            // The warning comes first: a narrow window shortens the names.
            count if count == devices.len() => Some(format!("{words} (all devices)")),
            _ => Some(format!("{words} ({})", names.join(", "))),
        }
    };
    WORDS.iter().filter_map(warning).collect()
}

/// Shortens a long name with "…".
fn short_name(name: &str) -> String {
    if name.chars().count() <= MOST_OF_NAME {
        return name.to_owned();
    }
    name.chars().take(MOST_OF_NAME - 1).chain(['…']).collect()
}

/// Returns the warnings about the drawn bodies.
pub fn of_shapes(facts: &SceneFacts) -> impl Iterator<Item = &'static str> {
    let shape = [
        (facts.lifted, "Off its seat: the lower plate is in the air, without load"),
        (facts.touching, "Coils touch: from here the spring is far stiffer than the model"),
        (facts.no_shape, "The model has no shape at this pose"),
    ];
    shape.into_iter().filter(|(is, _)| *is).map(|(_, words)| words)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_warning_is_given_once_and_names_devices_unless_it_is_about_the_loop() {
        let late = Events::MISSED;
        let mut late_and_hard = late;
        late_and_hard.insert(Events::FORCE_LIMITED);
        let devices =
            [("left", late_and_hard), ("right", late), ("a-name-of-more-than-twenty-letters", late_and_hard)];
        let warnings = happened(&devices);
        assert_eq!(warnings.len(), 2, "{warnings:?}");
        assert!(warnings[0].starts_with("Excess force"), "{warnings:?}");
        assert!(warnings[0].ends_with("(left, a-name-of-more-than…)"), "{warnings:?}");
        let all = happened(&[("left", Events::FORCE_LIMITED), ("right", Events::FORCE_LIMITED)]);
        assert!(all[0].ends_with("(all devices)"), "{all:?}");
        assert!(warnings[1].starts_with("Late: ticks were missed"), "{warnings:?}");
        assert!(happened(&devices[..1])[0].starts_with("Excess force"), "the only device needs no name");
        assert!(happened(&[("left", Events::NONE)]).is_empty());
    }
}
