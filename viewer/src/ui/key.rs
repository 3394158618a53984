//! Keys as they were pressed.

use egui::{Event, InputState, Key};

/// Returns whether a key was pressed alone: with Ctrl, Alt or Command it means something else. The modifiers are those of the press; of a
/// short one, they are up again at the end of the picture.
#[must_use]
pub fn pressed_alone(input: &InputState, wanted: Key) -> bool {
    input.events.iter().any(|event| match event {
        Event::Key { key, pressed: true, modifiers, .. } => {
            *key == wanted && !(modifiers.ctrl || modifiers.alt || modifiers.command)
        }
        _ => false,
    })
}
