//! The bar above everything: title, state of the run, emergency stop.
//!
//! The emergency stop and the state are never shortened. The other parts get what is left, in this order: the buttons, the name of the
//! panel's button, the title, which is shortened with "…".

use crate::palette::{Look, Palette};
use crate::ui::overlay::width_pt;
use crate::ui::style::{BODY_PT, SMALL_PT, quiet};
use egui::text::{LayoutJob, TextFormat};
use egui::{
    Align, Button, Color32, CornerRadius, FontId, Label, Layout, RichText, Role, Stroke, Ui, WidgetInfo, vec2,
};

/// Name of the emergency stop in front of an experimenter.
pub const STOP: &str = "EMERGENCY STOP";
/// Width of a button that is a sign, with its gaps, and of the dot before the state, points.
const SIGN_PT: f32 = 32.0;
const DOT_PT: f32 = 18.0;
/// A title narrower than this says nothing, points.
const LEAST_TITLE_PT: f32 = 40.0;

/// What stands in the bar.
pub struct TopBar<'a> {
    /// Title of the scene.
    pub title: &'a str,
    /// State of the run, in a word or two.
    pub state: &'a str,
    /// Whether the state is in order.
    pub status: RunStatus,
    /// The emergency stop, while there is a run to stop.
    pub stop: Option<Stop>,
    /// Size of the emergency stop, of the usual one.
    pub scale: f32,
    /// What the button of the panel does.
    pub panel: PanelSwitch,
    /// Light or dark, where that can be switched.
    pub look: Option<Look>,
}

/// The emergency stop: what its button says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stop {
    /// Name.
    pub name: String,
    /// Name of its key.
    pub key: &'static str,
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

    /// Shows the buttons that have room in so many points.
    fn switches(&self, ui: &mut Ui, mut room_pt: f32) -> Option<TopBarRequest> {
        let mut request = None;
        let long = "☰ Parameters";
        let long_pt = width_pt(ui.painter(), long, FontId::proportional(15.0)) + SIGN_PT;
        let sign = match self.panel {
            PanelSwitch::None => None,
            // Who does not see the panel is told that there is one.
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

/// Shows the one button that must be found without a search: in the same colours light and dark, with its key.
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
    let response = ui.add(button).on_hover_text(format!("No force at once; the run is over (key: {key})"));
    response.widget_info(|| WidgetInfo::labeled(Role::Button, true, name));
    response
}
