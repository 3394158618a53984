//! The panel of a plugin: a row for each parameter, in three groups.

use crate::palette::Palette;
use crate::panel::{Knob, Panel, Standing, Value};
use crate::ui::style::SMALL_PT;
use egui::{Align, CollapsingHeader, ComboBox, DragValue, Layout, RichText, Slider, Ui};
use flotor_live::ParameterShape;

/// Ranges wider than this are travelled in steps of the same ratio.
const LOGARITHMIC_FROM: f64 = 200.0;

/// Shows a panel; gives the indices of the parameters a person has changed.
pub fn panel(ui: &mut Ui, panel: &mut Panel, palette: &Palette) -> Vec<usize> {
    let mut changed = Vec::new();
    let title =
        if panel.name == panel.id { panel.name.clone() } else { format!("{} ({})", panel.name, panel.id) };
    CollapsingHeader::new(RichText::new(title).strong()).id_salt(&panel.name).default_open(true).show(
        ui,
        |ui| {
            let of = |panel: &Panel, wanted: fn(&Standing) -> bool| -> Vec<usize> {
                let standing = |(_, knob): &(usize, &Knob)| wanted(&knob.standing);
                panel.knobs.iter().enumerate().filter(standing).map(|(index, _)| index).collect()
            };
            for index in of(panel, |standing| *standing == Standing::Free) {
                changed.extend(row(ui, &mut panel.knobs[index], palette).then_some(index));
            }
            if let Some(refusal) = &panel.refusal {
                ui.colored_label(palette.warning, format!("⚠ {refusal}"));
            }
            let follow = of(panel, |standing| matches!(standing, Standing::Follows(_)));
            if !follow.is_empty() {
                heading(ui, "Follow from these", palette);
                for index in follow {
                    let _ = row(ui, &mut panel.knobs[index], palette);
                }
            }
            let fixed = of(panel, |standing| *standing == Standing::Fixed);
            if !fixed.is_empty() {
                CollapsingHeader::new(RichText::new("Fixed").size(SMALL_PT).color(palette.faint))
                    .id_salt((&panel.name, "fixed"))
                    .default_open(fixed.len() == panel.knobs.len())
                    .show(ui, |ui| {
                        fixed.into_iter().for_each(|index| fact(ui, &panel.knobs[index], palette))
                    });
            }
        },
    );
    changed
}

fn heading(ui: &mut Ui, text: &str, palette: &Palette) {
    ui.add_space(4.0);
    ui.label(RichText::new(text).size(SMALL_PT).color(palette.faint));
}

/// A parameter that can be pulled, or follows; true if it was pulled.
fn row(ui: &mut Ui, knob: &mut Knob, palette: &Palette) -> bool {
    let (name, unit, help) = (knob.name.clone(), knob.unit().to_owned(), help(knob));
    let is_free = knob.standing == Standing::Free;
    let shape = knob.parameter.shape.clone();
    match (&mut knob.value, shape) {
        (Value::Number(number), ParameterShape::Real { min, max, .. }) => {
            let before = *number;
            let mut label = None;
            ui.horizontal(|ui| {
                let shown =
                    ui.label(RichText::new(&name).color(if is_free { palette.text } else { palette.faint }));
                label = Some(shown.on_hover_text(&help).id);
                ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                    ui.label(RichText::new(format!("{unit:<4}")).size(SMALL_PT).color(palette.faint));
                    let drag = DragValue::new(number).range(min..=max).speed(speed(before)).max_decimals(4);
                    let drag = ui.add_enabled(is_free, drag);
                    label.map(|label| drag.labelled_by(label).on_hover_text(&help));
                });
            });
            ui.spacing_mut().slider_width = ui.available_width() - 2.0;
            let logarithmic = min > 0.0 && max / min > LOGARITHMIC_FROM;
            let slider = Slider::new(number, min..=max).show_value(false).logarithmic(logarithmic);
            let slider = ui.add_enabled(is_free, slider);
            label.map(|label| slider.labelled_by(label).on_hover_text(&help));
            ui.add_space(2.0);
            *number != before
        }
        (Value::Choice(index), ParameterShape::Choice { choices, .. }) => {
            let before = *index;
            ui.horizontal(|ui| {
                let label = ui.label(&name).on_hover_text(&help);
                ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                    let now = choices.get(before).cloned().unwrap_or_default();
                    let list = ComboBox::from_id_salt(&name).selected_text(now).show_ui(ui, |ui| {
                        for (at, choice) in choices.iter().enumerate() {
                            ui.selectable_value(index, at, choice);
                        }
                    });
                    list.response.labelled_by(label.id);
                });
            });
            *index != before
        }
        _ => {
            fact(ui, knob, palette);
            false
        }
    }
}

/// A parameter that only stands there.
fn fact(ui: &mut Ui, knob: &Knob, palette: &Palette) {
    let typed = match &knob.value {
        Value::Number(number) => format!("{} {}", short(*number), knob.unit()),
        _ => knob.typed(),
    };
    ui.horizontal(|ui| {
        ui.label(RichText::new(&knob.name).color(palette.faint)).on_hover_text(help(knob));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            ui.add(egui::Label::new(if typed.is_empty() { "–" } else { &typed }).truncate());
        });
    });
}

/// What a person reads who asks: what it is, how far it goes, where it starts, why it cannot be pulled.
fn help(knob: &Knob) -> String {
    let mut help = format!("{}\n{}", knob.parameter.doc, knob.parameter.id);
    if let ParameterShape::Real { min, max, default } = knob.parameter.shape {
        help += &format!("  ·  {min} to {max} {unit}, default {default}", unit = knob.unit());
    }
    match &knob.standing {
        Standing::Free => {}
        Standing::Follows(reason) if reason.is_empty() => help += "\nFollows from other values",
        Standing::Follows(reason) => help += &format!("\n{reason}"),
        Standing::Fixed => help += "\nCannot change while the loop runs",
    }
    help
}

/// A number in as many digits as a person reads.
fn short(number: f64) -> f64 {
    const DIGITS: i32 = 6;
    #[allow(clippy::cast_possible_truncation)] // a power of ten
    let power = 10.0_f64.powi(DIGITS - 1 - number.abs().max(f64::MIN_POSITIVE).log10().floor() as i32);
    let rounded = (number * power).round() / power;
    if rounded.is_finite() { rounded } else { number }
}

/// Change of a number for a point of dragging: a thousandth of it.
fn speed(number: f64) -> f64 {
    (number.abs() * 2.0e-3).max(1.0e-4)
}
