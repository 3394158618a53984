//! Playback bar at the bottom: time, play and pause, speed.

use crate::palette::Palette;
use crate::ui::style::SMALL_PT;
use egui::{Align, ComboBox, Layout, RichText, Role, Slider, Ui, WidgetInfo};
use flotor_history::player::{Motion, Player, SPEEDS};
use flotor_history::{History, Sample};

/// Width below which the bar has only the button, the clock and the slider, points.
const ROOM_FOR_ALL_PT: f32 = 480.0;

/// Shows the playback bar of a recording or of a running host, and applies its input to the player.
pub fn playback(ui: &mut Ui, player: &mut Player, history: &History, is_live: bool, palette: &Palette) {
    let span_s = history.span_s();
    ui.horizontal_centered(|ui| {
        let name = if player.motion == Motion::Pause { "▶" } else { "⏸" };
        let help = match (player.motion, is_live) {
            (Motion::Pause, true) => "Follow the run",
            (Motion::Pause, false) => "Play",
            _ => "Pause",
        };
        let button = ui.button(RichText::new(name).size(15.0)).on_hover_text(help);
        button.widget_info(|| WidgetInfo::labeled(Role::Button, true, help));
        if button.clicked() {
            player.toggle(is_live, span_s);
        }
        // Time of the sample whose numbers are shown; a gap has no sample.
        let shown_s = history.seen_at(player.now_s).map_or(player.now_s, Sample::time_s);
        ui.monospace(format!("{shown_s:>8.3} s"));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let has_room = ui.available_width() >= ROOM_FOR_ALL_PT - 130.0;
            if !has_room {
                // Only the slider.
            } else if is_live {
                let text = if player.motion == Motion::Follow { "follows the run" } else { "stands still" };
                ui.label(RichText::new(text).size(SMALL_PT).color(palette.faint));
            } else {
                ui.checkbox(&mut player.repeats, "loop");
                let speeds =
                    ComboBox::from_id_salt("speed").selected_text(format!("{}x", player.speed)).width(60.0);
                let speeds = speeds.show_ui(ui, |ui| {
                    for speed in SPEEDS {
                        ui.selectable_value(&mut player.speed, speed, format!("{speed}x"));
                    }
                });
                speeds.response.widget_info(|| WidgetInfo::labeled(Role::ComboBox, true, "Speed"));
            }
            if has_room {
                ui.label(RichText::new(format!("{:.1} s", span_s[1])).size(SMALL_PT).color(palette.faint));
            }
            ui.spacing_mut().slider_width = ui.available_width() - 10.0;
            let mut now_s = player.now_s;
            let slider =
                Slider::new(&mut now_s, span_s[0]..=span_s[1].max(span_s[0] + 1.0e-3)).show_value(false);
            let slider = ui.add(slider.trailing_fill(true));
            slider.widget_info(|| {
                let mut info = WidgetInfo::slider(true, now_s, "Time");
                info.value = Some(now_s);
                info
            });
            if slider.changed() {
                player.seek(now_s, span_s);
            }
        });
    });
}
