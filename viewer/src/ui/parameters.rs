//! Panel of a plugin: a row for each parameter, in three groups.

use crate::palette::Palette;
use crate::panel::{Editability, Panel, PanelEntry, Value};
use crate::ui::style;
use crate::ui::style::SMALL_PT;
use egui::{
    Align, Button, CollapsingHeader, ComboBox, DragValue, Key, Layout, RichText, Slider, SliderClamping, Ui,
};
use flotor_live::ParameterShape;

/// Ratio of the ends of a range above which its slider is logarithmic.
const LOGARITHMIC_FROM: f64 = 200.0;

/// Edit of a parameter by the user.
enum Edit {
    /// Start of a change, with the value before; the value may have changed already.
    Begun(Value),
    /// Continuation of a change.
    Goes,
    /// Reset to the value at the start of the run.
    Reset,
}

/// Shows a panel; returns the indices of the parameters changed by the user.
pub fn panel(ui: &mut Ui, panel: &mut Panel, palette: &Palette) -> Vec<usize> {
    let mut changed = Vec::new();
    let title =
        if panel.name == panel.id { panel.name.clone() } else { format!("{} ({})", panel.name, panel.id) };
    CollapsingHeader::new(RichText::new(title).strong()).id_salt(&panel.name).default_open(true).show(
        ui,
        |ui| {
            let of = |panel: &Panel, wanted: fn(&Editability) -> bool| -> Vec<usize> {
                let editability = |(_, entry): &(usize, &PanelEntry)| wanted(&entry.editability);
                panel.entries.iter().enumerate().filter(editability).map(|(index, _)| index).collect()
            };
            for index in of(panel, |editability| *editability == Editability::Free) {
                let before = panel.entries[index].value.clone();
                match row(ui, &mut panel.entries[index], palette) {
                    Some(Edit::Begun(value)) => panel.begin(index, value),
                    Some(Edit::Reset) => {
                        changed.extend(panel.reset(index).then_some(index));
                        continue;
                    }
                    Some(Edit::Goes) | None => {}
                }
                changed.extend((panel.entries[index].value != before).then_some(index));
            }
            if panel.can_undo() {
                let undo = ui.add(Button::new(RichText::new("Undo").size(SMALL_PT)).frame(false));
                if undo.on_hover_text("Undo the last change (Ctrl+Z)").clicked() {
                    changed.extend(panel.undo());
                }
            }
            if let Some(refusal) = &panel.refusal {
                ui.colored_label(palette.warning, format!("⚠ {refusal}"));
            }
            let follow = of(panel, |editability| matches!(editability, Editability::Follows(_)));
            if !follow.is_empty() {
                heading(ui, "Computed, or without effect", palette);
                for index in follow {
                    let _ = row(ui, &mut panel.entries[index], palette);
                }
            }
            let fixed = of(panel, |editability| *editability == Editability::Fixed);
            if !fixed.is_empty() {
                CollapsingHeader::new(RichText::new("Fixed").size(SMALL_PT).color(palette.faint))
                    .id_salt((&panel.name, "fixed"))
                    .default_open(false)
                    .show(ui, |ui| {
                        fixed.into_iter().for_each(|index| fact(ui, &panel.entries[index], palette))
                    });
            }
        },
    );
    changed
}

/// Returns the symbol used in papers for a parameter of this name, if any.
fn symbol(name: &str) -> Option<&'static str> {
    Some(match name {
        "alpha" => "α",
        "beta" => "β",
        "gamma" => "γ",
        "youngs modulus" => "E",
        "shear modulus" => "G",
        "poisson ratio" => "ν",
        "friction" | "seat friction" => "µ",
        _ => return None,
    })
}

fn show_symbol(ui: &mut Ui, name: &str, palette: &Palette) {
    if let Some(symbol) = symbol(name) {
        ui.label(RichText::new(symbol).color(palette.faint));
    }
}

fn heading(ui: &mut Ui, text: &str, palette: &Palette) {
    ui.add_space(4.0);
    ui.label(RichText::new(text).size(SMALL_PT).color(palette.faint));
}

/// Shows a free or dependent parameter and returns the edit. The slider covers the soft range; a number outside is typed, and
/// applied with Enter.
fn row(ui: &mut Ui, entry: &mut PanelEntry, palette: &Palette) -> Option<Edit> {
    let (name, unit, help) = (entry.name.clone(), entry.unit().to_owned(), help(entry));
    let is_free = entry.editability == Editability::Free;
    let (shape, soft, is_moved) = (entry.parameter.shape.clone(), entry.parameter.soft, entry.is_moved());
    match (&mut entry.value, shape) {
        (Value::Number(number), ParameterShape::Real { min, max, .. }) => {
            let before = *number;
            let (mut label, mut wants_reset) = (None, false);
            ui.horizontal(|ui| {
                let shown =
                    ui.label(RichText::new(&name).color(if is_free { palette.text } else { palette.faint }));
                label = Some(shown.on_hover_text(&help).id);
                show_symbol(ui, &name, palette);
                ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                    ui.label(RichText::new(format!("{unit:<4}")).size(SMALL_PT).color(palette.faint));
                    let field = DragValue::new(number)
                        .range(min..=max)
                        .clamp_existing_to_range(false)
                        .speed(0.0)
                        .update_while_editing(false)
                        .max_decimals(4);
                    let field = ui.add_enabled(is_free, field);
                    let is_left = field.lost_focus() && !ui.input(|input| input.key_pressed(Key::Enter));
                    if is_left {
                        *number = before; // possibly half a number
                    }
                    label.map(|label| field.labelled_by(label).on_hover_text(&help));
                    if is_moved {
                        let text = format!("{name} as in the scene");
                        wants_reset = style::quiet(ui, "↺", &text).clicked();
                    }
                });
            });
            ui.spacing_mut().slider_width = ui.available_width() - 2.0;
            let (low, high) = soft.map_or((min, max), |soft| (soft.min, soft.max));
            let logarithmic = low > 0.0 && high / low > LOGARITHMIC_FROM;
            let slider = Slider::new(number, low..=high)
                .show_value(false)
                .clamping(SliderClamping::Edits)
                .logarithmic(logarithmic);
            let slider = ui.add_enabled(is_free, slider);
            let (begins, is_pulled) = (slider.drag_started(), slider.dragged());
            label.map(|label| slider.labelled_by(label).on_hover_text(&help));
            ui.add_space(2.0);
            match *number != before {
                _ if wants_reset => Some(Edit::Reset),
                true if begins || !is_pulled => Some(Edit::Begun(Value::Number(before))),
                true => Some(Edit::Goes),
                false if begins => Some(Edit::Begun(Value::Number(before))),
                false => None,
            }
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
            (*index != before).then_some(Edit::Begun(Value::Choice(before)))
        }
        _ => {
            fact(ui, entry, palette);
            None
        }
    }
}

/// Shows a read-only parameter.
fn fact(ui: &mut Ui, entry: &PanelEntry, palette: &Palette) {
    let typed = match &entry.value {
        Value::Number(number) => format!("{} {}", short(*number), entry.unit()),
        _ => entry.typed(),
    };
    ui.horizontal(|ui| {
        ui.label(RichText::new(&entry.name).color(palette.faint)).on_hover_text(help(entry));
        show_symbol(ui, &entry.name, palette);
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            ui.add(egui::Label::new(if typed.is_empty() { "–" } else { &typed }).truncate());
        });
    });
}

/// Returns the hover text of a parameter: description, id, range, default, and the reason if it is not editable.
fn help(entry: &PanelEntry) -> String {
    let mut help = format!("{}\n{}", entry.parameter.doc, entry.parameter.id);
    if let ParameterShape::Real { min, max, default } = entry.parameter.shape {
        help += &format!("  ·  {min} to {max} {unit}, default {default}", unit = entry.unit());
        if entry.parameter.soft.is_some_and(|soft| soft.min > min || soft.max < max) {
            help += "; type a number and Enter for values beyond the slider";
        }
    }
    match &entry.editability {
        Editability::Free => {}
        Editability::Follows(reason) if reason.is_empty() => {
            help += "\nComputed from other parameters, or without effect"
        }
        Editability::Follows(reason) => help += &format!("\n{reason}"),
        Editability::Fixed => help += "\nCannot change while the loop runs",
    }
    help
}

/// Rounds a number to six significant digits.
fn short(number: f64) -> f64 {
    const DIGITS: i32 = 6;
    #[allow(clippy::cast_possible_truncation)] // a power of ten
    let power = 10.0_f64.powi(DIGITS - 1 - number.abs().max(f64::MIN_POSITIVE).log10().floor() as i32);
    let rounded = (number * power).round() / power;
    if rounded.is_finite() { rounded } else { number }
}
