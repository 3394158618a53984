//! Key presses with their modifiers.

use egui::{Event, InputState, Key};

/// Returns whether a key was pressed without Ctrl, Alt or Command, which give the key another meaning. Checks the modifiers at the
/// time of the press: after a short press, they may be released again when the frame is drawn.
#[must_use]
pub fn pressed_alone(input: &InputState, wanted: Key) -> bool {
    input.events.iter().any(|event| {
        matches!(event, Event::Key { key, pressed: true, modifiers, .. }
            if *key == wanted && !(modifiers.ctrl || modifiers.alt || modifiers.command))
    })
}
