//! Row above the traces: quantities, number of hidden traces, time span, units, export.

use super::{PlotRequest, PlotStack, Window};
use crate::palette::Palette;
use crate::ui::export_options::ExportFormat;
use crate::ui::overlay::width_pt;
use crate::ui::style::SMALL_PT;
use clap::ValueEnum;
use egui::containers::menu::{MenuButton, MenuConfig};
use egui::{Color32, ComboBox, FontId, PopupCloseBehavior, RichText, Role, Ui, WidgetInfo};
use flotor_history::quantity::{Quantity, Units};

/// Selectable time spans, s.
const WINDOWS_S: [f64; 5] = [2.0, 5.0, 10.0, 30.0, 60.0];

/// Height below which the choice of traces is a menu, points.
const ROOM_FOR_TABS_PT: f32 = 230.0;
/// Width of the choices of time, units and export, points.
const PRESENTATION_PT: f32 = 200.0;
/// Width of the number of hidden traces, points.
const MORE_PT: f32 = 130.0;

impl PlotStack {
    /// Shows the row of choices and collects the requests.
    pub(super) fn choices(&mut self, ui: &mut Ui, palette: &Palette, requests: &mut Vec<PlotRequest>) {
        let more_pt = if self.out_of_sight == [0; 2] { 0.0 } else { MORE_PT };
        let has_tabs = ui.available_height() >= ROOM_FOR_TABS_PT
            && ui.available_width() >= tabs_pt(ui) + PRESENTATION_PT + more_pt;
        ui.horizontal(|ui| {
            if has_tabs {
                self.quantities(ui, palette);
            } else {
                ui.menu_button(RichText::new("Traces").size(SMALL_PT + 0.5), |ui| {
                    ui.horizontal_wrapped(|ui| self.quantities(ui, palette));
                });
            }
            if ui.available_width() >= PRESENTATION_PT + more_pt {
                self.more(ui, palette);
            }
            self.presentation(ui, requests);
        });
    }

    /// Shows the number of hidden traces.
    fn more(&self, ui: &mut Ui, palette: &Palette) {
        let counts = self.out_of_sight.into_iter().zip(["above", "below"]).filter(|(count, _)| *count > 0);
        let more: Vec<String> = counts.map(|(count, place)| format!("{count} more {place}")).collect();
        if !more.is_empty() {
            ui.label(RichText::new(more.join(", ")).size(SMALL_PT).color(palette.faint))
                .on_hover_text("The wheel scrolls the traces; with Alt it zooms values");
        }
    }

    /// Shows the quantities, for switching each on or off.
    fn quantities(&mut self, ui: &mut Ui, palette: &Palette) {
        ui.spacing_mut().item_spacing.x = 4.0;
        for quantity in Quantity::value_variants().iter().copied() {
            let is_shown = self.shown.contains(&quantity);
            let text = RichText::new(quantity.name()).size(SMALL_PT + 0.5);
            // White on the blue of a selection, in both looks.
            let text = text.color(if is_shown { Color32::WHITE } else { palette.faint });
            if ui.selectable_label(is_shown, text).clicked() {
                self.toggle(quantity);
            }
        }
        let is_shown = self.force_position.axis.is_some();
        let text = RichText::new("F(x)").size(SMALL_PT + 0.5);
        let text = text.color(if is_shown { Color32::WHITE } else { palette.faint });
        if ui.selectable_label(is_shown, text).on_hover_text("Force over position").clicked() {
            self.force_position.toggle();
        }
    }

    /// Shows time span, units and export, from the right.
    fn presentation(&mut self, ui: &mut Ui, requests: &mut Vec<PlotRequest>) {
        ui.spacing_mut().item_spacing.x = 4.0;
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            let menu = MenuConfig::new().close_behavior(PopupCloseBehavior::CloseOnClickOutside);
            let button = MenuButton::new(RichText::new("Export").size(SMALL_PT + 0.5)).config(menu);
            button.ui(ui, |ui| {
                self.export.choose(ui);
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
            if switch.on_hover_text("Units of numbers and traces: millimetres and degrees, or SI (U); a parameter has the unit of its key").clicked() {
                self.switch_units();
            }
            let shown = match self.window {
                Window::Whole => "all".to_owned(),
                Window::Newest(length_s) => format!("{length_s} s"),
                Window::Between(..) => "zoomed".to_owned(),
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
}

/// Returns the width of the choice of quantities, points.
fn tabs_pt(ui: &Ui) -> f32 {
    let font = FontId::proportional(SMALL_PT + 0.5);
    let names = Quantity::value_variants().iter().map(|quantity| quantity.name()).chain(["F(x)"]);
    let tab_pt =
        |name| width_pt(ui.painter(), name, font.clone()) + 2.0 * ui.spacing().button_padding.x + 4.0;
    names.map(tab_pt).sum()
}
