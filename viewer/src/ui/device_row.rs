//! Row of the devices of a run, to choose the device for numbers and traces.

use crate::ui::overlay::{shortened, width_pt};
use egui::{Button, ComboBox, Role, TextStyle, Ui, WidgetInfo};

/// Smallest width of a name on a button, points.
const LEAST_NAME_PT: f32 = 60.0;

/// Shows the names as buttons, if necessary shortened to equal widths, or as a list if the buttons would be too narrow; returns the
/// number of a newly chosen device.
pub fn choose(ui: &mut Ui, names: &[&str], chosen: usize) -> Option<usize> {
    let around_pt = 2.0 * ui.spacing().button_padding.x + ui.spacing().item_spacing.x;
    let name_pt = |name: &&str| width_pt(ui.painter(), name, TextStyle::Button.resolve(ui.style()));
    let all_pt: f32 = names.iter().map(|name| name_pt(name) + around_pt).sum();
    let share_pt = ui.available_width() / names.len().max(1) as f32 - around_pt;
    if all_pt <= ui.available_width() {
        buttons(ui, names, chosen, f32::INFINITY)
    } else if share_pt >= LEAST_NAME_PT {
        buttons(ui, names, chosen, share_pt)
    } else {
        list(ui, names, chosen)
    }
}

fn help(number: usize, name: &str) -> String {
    format!("Numbers and traces of {name} ({})", number + 1)
}

fn buttons(ui: &mut Ui, names: &[&str], chosen: usize, most_pt: f32) -> Option<usize> {
    let mut now = None;
    for (number, name) in names.iter().enumerate() {
        let font = TextStyle::Button.resolve(ui.style());
        let galley = shortened(ui.painter(), name, font, ui.visuals().text_color(), most_pt);
        let button = ui.add(Button::selectable(number == chosen, galley)).on_hover_text(help(number, name));
        button.widget_info(|| WidgetInfo::labeled(Role::Button, true, *name));
        if button.clicked() {
            now = Some(number);
        }
    }
    now
}

fn list(ui: &mut Ui, names: &[&str], chosen: usize) -> Option<usize> {
    let mut now = chosen;
    let shown = names.get(chosen).copied().unwrap_or_default();
    let list = ComboBox::from_id_salt("device").selected_text(shown).width(ui.available_width()).truncate();
    list.show_ui(ui, |ui| {
        for (number, name) in names.iter().enumerate() {
            ui.selectable_value(&mut now, number, *name).on_hover_text(help(number, name));
        }
    });
    (now != chosen).then_some(now)
}
