//! List of shortcuts of the window.

use egui::{Context, Grid, RichText, ScrollArea, Window};

/// Keys and their effects.
const KEYS: [(&str, &str); 28] = [
    ("Space", "emergency stop; of a recording: play"),
    ("Enter", "takes a typed number; Escape leaves it"),
    ("Ctrl+Z", "the value before the last change"),
    ("Drag the handle", "guides a simulated hand; release it to give it back"),
    ("Wheel, Q  E, Shift", "meanwhile: nearer and away; finer"),
    ("W A S D", "turn the view"),
    ("+  -", "nearer, farther"),
    ("R", "the experimenter's view"),
    ("F", "follow the newest tick"),
    ("Left  Right", "a second back or on"),
    ("Shift+Left  Right", "ten seconds"),
    ("Ctrl+Left  Right", "a tick"),
    ("Home  End", "beginning and end"),
    ("M", "one trace in the room of all, and back"),
    ("Right drag on a trace", "a box: these times and values"),
    ("Wheel on a trace", "values larger or smaller; of more traces than have room: the next"),
    ("Alt+wheel on a trace", "values larger or smaller"),
    ("Ctrl+wheel on a trace", "time longer or shorter"),
    ("Middle drag on a trace", "shifts the time"),
    ("Double click on a trace", "all of it again"),
    ("1 to 9", "numbers and traces of this device"),
    ("U", "millimetres or SI"),
    ("P", "parameters"),
    ("L", "light or dark"),
    ("Ctrl +  Ctrl -", "larger, smaller"),
    ("Escape", "puts a second recording away"),
    ("F11", "full screen"),
    ("F1  ?", "these keys"),
];

/// Shows the list of shortcuts until it is closed.
pub fn keys(context: &Context, is_open: &mut bool) {
    let window = Window::new("Keys").open(is_open).collapsible(false).resizable(false);
    window.anchor(egui::Align2::CENTER_CENTER, egui::Vec2::ZERO).show(context, |ui| {
        ScrollArea::vertical().max_height(0.7 * context.content_rect().height()).show(ui, |ui| {
            Grid::new("keys").num_columns(2).spacing([24.0, 4.0]).show(ui, |ui| {
                for (key, does) in KEYS {
                    ui.label(RichText::new(key).strong());
                    ui.label(does);
                    ui.end_row();
                }
            });
        });
    });
}
