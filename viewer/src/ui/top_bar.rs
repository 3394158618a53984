//! The bar above everything: what is shown, how it stands, and the emergency stop.

use crate::palette::{Look, Palette};
use crate::ui::style::{BODY_PT, SMALL_PT, quiet};
use egui::{Align, Button, Color32, CornerRadius, Layout, RichText, Stroke, Ui, vec2};

/// What stands in the bar.
pub struct TopBar<'a> {
    /// Title of the scene.
    pub title: &'a str,
    /// Plugins, rate and clock.
    pub subtitle: &'a str,
    /// How the run stands, in a word or two.
    pub standing: &'a str,
    /// Whether that is in order.
    pub status: RunStatus,
    /// Whether there is a run to stop.
    pub can_stop: bool,
    /// What the button of the panel does.
    pub panel: PanelSwitch,
    /// Light or dark, where that can be switched.
    pub look: Option<Look>,
}

/// What the button of the panel does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PanelSwitch {
    /// There is none.
    None,
    /// It puts the panel away.
    PutAway,
    /// It brings it out.
    BringOut,
}

/// Whether a run is in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunStatus {
    /// Nothing runs, and nothing is wrong.
    Idle,
    /// It runs.
    InOrder,
    /// It runs, and not as it should.
    Warning,
    /// It ended by a fault or an emergency stop, or cannot be reached.
    Failed,
}

impl RunStatus {
    fn color(self, palette: &Palette) -> Color32 {
        match self {
            Self::Idle => palette.faint,
            Self::InOrder => palette.well,
            Self::Warning => palette.warning,
            Self::Failed => palette.fault,
        }
    }
}

/// What was pressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TopBarRequest {
    /// The emergency stop.
    EmergencyStop,
    /// The other look.
    SwitchLook,
    /// The panel in or out of sight.
    SwitchPanel,
}

impl TopBar<'_> {
    /// Shows the bar.
    pub fn show(&self, ui: &mut Ui, palette: &Palette) -> Option<TopBarRequest> {
        let mut request = None;
        ui.horizontal_centered(|ui| {
            ui.label(RichText::new(self.title).size(BODY_PT + 2.5).strong());
            ui.add_space(6.0);
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                if self.can_stop && emergency_stop(ui).clicked() {
                    request = Some(TopBarRequest::EmergencyStop);
                }
                ui.add_space(4.0);
                let sign = match self.panel {
                    PanelSwitch::None => None,
                    PanelSwitch::PutAway => Some("☰"),
                    // Who does not see it is told that it is there.
                    PanelSwitch::BringOut => Some("☰ Parameters"),
                };
                if sign.is_some_and(|sign| quiet(ui, sign, "Parameters (P)").clicked()) {
                    request = Some(TopBarRequest::SwitchPanel);
                }
                let switch = self.look.map(|look| match look {
                    Look::Dark => ("☀", "Light (L)"),
                    Look::Light => ("🌙", "Dark (L)"),
                });
                if switch.is_some_and(|(sign, help)| quiet(ui, sign, help).clicked()) {
                    request = Some(TopBarRequest::SwitchLook);
                }
                ui.add_space(6.0);
                let dot = self.status.color(palette);
                let color = if matches!(self.status, RunStatus::Idle | RunStatus::InOrder) {
                    palette.text
                } else {
                    dot
                };
                // A long reason leaves room for the title; all of it is below the pointer.
                let most = (ui.available_width() * 0.6).max(80.0);
                let standing = egui::Label::new(RichText::new(self.standing).color(color)).truncate();
                ui.allocate_ui_with_layout(
                    vec2(most, ui.available_height()),
                    Layout::right_to_left(Align::Center),
                    |ui| {
                        ui.add(standing).on_hover_text(self.standing);
                        let (area, _) = ui.allocate_exact_size(vec2(10.0, 10.0), egui::Sense::hover());
                        ui.painter().circle_filled(area.center(), 4.0, dot);
                    },
                );
                ui.add_space(6.0);
                ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                    let text = RichText::new(self.subtitle).size(SMALL_PT).color(palette.faint);
                    ui.add(egui::Label::new(text).truncate());
                });
            });
        });
        request
    }
}

/// The one button that must be found without looking for it: the same colours light and dark.
fn emergency_stop(ui: &mut Ui) -> egui::Response {
    const RED: Color32 = Color32::from_rgb(196, 30, 36);
    let text = RichText::new("EMERGENCY STOP").size(BODY_PT).strong().color(Color32::WHITE);
    let button = Button::new(text)
        .fill(RED)
        .stroke(Stroke::new(1.5, Color32::from_rgb(255, 214, 64)))
        .corner_radius(CornerRadius::same(6))
        .min_size(vec2(150.0, 32.0));
    ui.add(button).on_hover_text("No force at once; the run is over (space bar)")
}
