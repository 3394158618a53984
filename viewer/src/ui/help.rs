//! List of shortcuts of the window.

use egui::{Context, Grid, RichText, ScrollArea, Window};

/// Keys and their effects.
const KEYS: [(&str, &str); 28] = [
    ("Space", "emergency stop; in a recording: play"),
    ("Enter", "apply a typed number; Escape discards the number"),
    ("Ctrl+Z", "undo the last change"),
    ("Drag the handle", "guides a simulated hand until released"),
    ("Wheel, Q  E, Shift", "while dragging: depth; finer steps"),
    ("W A S D", "turn the view"),
    ("+  -", "nearer, farther"),
    ("R", "the experimenter's view"),
    ("F", "follow the newest tick"),
    ("Left  Right", "one second back or forward"),
    ("Shift+Left  Right", "ten seconds"),
    ("Ctrl+Left  Right", "a tick"),
    ("Home  End", "beginning and end"),
    ("M", "maximise one trace, and restore"),
    ("Right drag on a trace", "zoom to a box of times and values"),
    ("Wheel on a trace", "zoom the values; with many traces: scroll"),
    ("Alt+wheel on a trace", "zoom the values"),
    ("Ctrl+wheel on a trace", "zoom the time"),
    ("Middle drag on a trace", "shifts the time"),
    ("Double click on a trace", "reset the zoom"),
    ("1 to 9", "numbers and traces of this device"),
    ("U", "millimetres or SI"),
    ("P", "parameters"),
    ("L", "light or dark"),
    ("Ctrl +  Ctrl -", "larger, smaller"),
    ("Escape", "close the second recording"),
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
