//! The order of what a pointer does, kept when a picture comes late.
//!
//! A window that was busy gets all that happened meanwhile with one picture, and a widget is then told the last position of the
//! pointer only: a slider that was let go, and a pointer that moved on after that, would leave the slider where the pointer is.
//! Here a picture gets what happened up to the next press or release, and the pictures after it get the rest.

use egui::{Event, RawInput};
use std::collections::VecDeque;

/// Splits the input of a late picture at presses and releases.
#[derive(Debug, Default)]
pub struct PointerOrder {
    /// What the pictures to come will be told, in order.
    waiting: VecDeque<Event>,
}

impl PointerOrder {
    /// Leaves in the input of a picture what happened up to the next press or release; true if there is more, for which
    /// another picture should be made at once. Keys never wait: one of them is the emergency stop.
    pub fn split(&mut self, input: &mut RawInput) -> bool {
        let arrived = std::mem::take(&mut input.events);
        let (pointer, others): (Vec<_>, Vec<_>) = arrived.into_iter().partition(is_of_pointer);
        self.waiting.extend(pointer);
        while let Some(event) = self.waiting.pop_front() {
            let is_boundary = matches!(event, Event::PointerButton { .. });
            input.events.push(event);
            if is_boundary {
                break;
            }
        }
        input.events.extend(others);
        !self.waiting.is_empty()
    }
}

fn is_of_pointer(event: &Event) -> bool {
    matches!(
        event,
        Event::PointerMoved(_)
            | Event::MouseMoved(_)
            | Event::PointerButton { .. }
            | Event::PointerGone
            | Event::Touch { .. }
            | Event::MouseWheel { .. }
            | Event::Zoom(_)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::{Key, Modifiers, PointerButton, Pos2, pos2};

    fn button(at: Pos2, pressed: bool) -> Event {
        Event::PointerButton { pos: at, button: PointerButton::Primary, pressed, modifiers: Modifiers::NONE }
    }

    fn key(key: Key) -> Event {
        Event::Key { key, physical_key: None, pressed: true, repeat: false, modifiers: Modifiers::NONE }
    }

    /// What each picture is told, until nothing waits.
    fn pictures(events: Vec<Event>) -> Vec<Vec<Event>> {
        let mut order = PointerOrder::default();
        let (mut told, mut input) = (Vec::new(), RawInput { events, ..RawInput::default() });
        loop {
            let more = order.split(&mut input);
            told.push(std::mem::take(&mut input.events));
            if !more {
                return told;
            }
        }
    }

    #[test]
    fn a_release_is_the_last_that_a_picture_is_told_of_the_pointer() {
        let (at, away) = (pos2(10.0, 5.0), pos2(90.0, 5.0));
        let moved = Event::PointerMoved;
        let told = pictures(vec![moved(at), button(at, false), moved(away), button(away, true), moved(at)]);
        assert_eq!(
            told,
            [vec![moved(at), button(at, false)], vec![moved(away), button(away, true)], vec![moved(at)]]
        );
    }

    #[test]
    fn keys_come_with_the_first_picture_however_much_the_pointer_did() {
        let at = pos2(10.0, 5.0);
        let told = pictures(vec![button(at, true), button(at, false), key(Key::Space)]);
        assert!(told[0].contains(&key(Key::Space)), "{told:?}");
        assert_eq!(told.len(), 2);
        assert_eq!(pictures(Vec::new()), [Vec::new()]);
    }
}
