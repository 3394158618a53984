//! Bar at the top of the window: title, state of the run, emergency stop.
//!
//! The emergency stop and the state are never shortened. The remaining width goes to the other parts in this order: the buttons, the
//! name of the panel's button, the title, which is shortened with "…".

use crate::palette::{Look, Palette};
use crate::ui::overlay::width_pt;
use crate::ui::style::{BODY_PT, SMALL_PT, quiet};
use egui::text::{LayoutJob, TextFormat};
use egui::{
    Align, Button, Color32, CornerRadius, FontId, Label, Layout, RichText, Role, Stroke, Ui, WidgetInfo, vec2,
};

/// Name of the emergency stop in an experimenter's window.
pub const STOP: &str = "EMERGENCY STOP";
/// Width of a symbol button with its gaps, and of the dot before the state, points.
const SIGN_PT: f32 = 32.0;
const DOT_PT: f32 = 18.0;
/// Smallest width of a readable title, points.
const LEAST_TITLE_PT: f32 = 40.0;

/// Content of the bar.
pub struct TopBar<'a> {
    /// Title of the scene.
    pub title: &'a str,
    /// State of the run, in one or two words.
    pub state: &'a str,
    /// Severity of the state.
    pub status: RunStatus,
    /// Emergency stop; `None` without a run to stop.
    pub stop: Option<Stop>,
    /// Factor on the usual size of the emergency stop.
    pub scale: f32,
    /// Effect of the button for the panel.
    pub panel: PanelSwitch,
    /// Current colour scheme; `None` without a button that switches it.
    pub look: Option<Look>,
}

/// Texts on the button of the emergency stop.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stop {
    /// Name of the button.
    pub name: String,
    /// Name of the key.
    pub key: &'static str,
}

/// Effect of the button for the panel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PanelSwitch {
    /// No button.
    None,
    /// Hide the panel.
    PutAway,
    /// Show the panel.
    BringOut,
}

/// Severity of the state of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunStatus {
    /// No run, or a normal end.
    Idle,
    /// The run continues normally.
    InOrder,
    /// The run continues with a warning.
    Warning,
    /// The run ended by a fault or an emergency stop, or the connection is lost.
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

/// Request of a pressed button.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TopBarRequest {
    /// Emergency stop.
    EmergencyStop,
    /// Switch to the other colour scheme.
    SwitchLook,
    /// Show or hide the panel.
    SwitchPanel,
}

impl TopBar<'_> {
    /// Shows the bar; returns the request of a pressed button.
    pub fn show(&self, ui: &mut Ui, palette: &Palette) -> Option<TopBarRequest> {
        let mut request = None;
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            if self.stop.as_ref().is_some_and(|stop| emergency_stop(ui, stop, self.scale).clicked()) {
                request = Some(TopBarRequest::EmergencyStop);
            }
            let state_pt = DOT_PT + width_pt(ui.painter(), self.state, FontId::proportional(BODY_PT)) + 12.0;
            request = request.or(self.switches(ui, ui.available_width() - state_pt));
            self.state(ui, palette);
            if ui.available_width() >= LEAST_TITLE_PT {
                ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                    let title = RichText::new(self.title).size(BODY_PT + 2.5).strong();
                    ui.add(Label::new(title).truncate()).on_hover_text(self.title);
                });
            }
        });
        request
    }

    /// Shows the buttons that fit into this width, points.
    fn switches(&self, ui: &mut Ui, mut room_pt: f32) -> Option<TopBarRequest> {
        let mut request = None;
        let long = "☰ Parameters";
        let long_pt = width_pt(ui.painter(), long, FontId::proportional(15.0)) + SIGN_PT;
        let sign = match self.panel {
            PanelSwitch::None => None,
            // The long name shows users that there is a hidden panel.
            PanelSwitch::BringOut if room_pt >= long_pt + SIGN_PT + LEAST_TITLE_PT => Some((long, long_pt)),
            PanelSwitch::BringOut | PanelSwitch::PutAway => Some(("☰", SIGN_PT)),
        };
        if let Some((sign, sign_pt)) = sign.filter(|(_, sign_pt)| room_pt >= *sign_pt) {
            room_pt -= sign_pt;
            if quiet(ui, sign, "Parameters (P)").clicked() {
                request = Some(TopBarRequest::SwitchPanel);
            }
        }
        let switch = self.look.filter(|_| room_pt >= SIGN_PT).map(|look| match look {
            Look::Dark => ("☀", "Light (L)"),
            Look::Light => ("🌙", "Dark (L)"),
        });
        if switch.is_some_and(|(sign, help)| quiet(ui, sign, help).clicked()) {
            request = Some(TopBarRequest::SwitchLook);
        }
        request
    }

    fn state(&self, ui: &mut Ui, palette: &Palette) {
        let dot = self.status.color(palette);
        let is_quiet = matches!(self.status, RunStatus::Idle | RunStatus::InOrder);
        let color = if is_quiet { palette.text } else { dot };
        ui.add(Label::new(RichText::new(self.state).color(color)).extend());
        let (area, _) = ui.allocate_exact_size(vec2(10.0, 10.0), egui::Sense::hover());
        ui.painter().circle_filled(area.center(), 4.0, dot);
    }
}

/// Shows the button of the emergency stop, with the name of its key, in the same conspicuous colours in both looks.
fn emergency_stop(ui: &mut Ui, Stop { name, key }: &Stop, scale: f32) -> egui::Response {
    const RED: Color32 = Color32::from_rgb(196, 30, 36);
    const YELLOW: Color32 = Color32::from_rgb(255, 214, 64);
    let format = |size_pt: f32, color: Color32| TextFormat {
        valign: Align::Center,
        ..TextFormat::simple(FontId::proportional(scale * size_pt), color)
    };
    let mut text = LayoutJob::default();
    text.append(name, 0.0, format(BODY_PT, Color32::WHITE));
    text.append(key, 8.0 * scale, format(SMALL_PT, YELLOW));
    let button = Button::new(text)
        .fill(RED)
        .stroke(Stroke::new(1.5, YELLOW))
        .corner_radius(CornerRadius::same(6))
        .min_size(vec2(150.0, 32.0_f32.min(ui.available_height())) * scale);
    let response =
        ui.add(button).on_hover_text(format!("Zero force at once, and the end of the run (key: {key})"));
    response.widget_info(|| WidgetInfo::labeled(Role::Button, true, name));
    response
}
