//! Ordering of clicks and keys for late frames.
//!
//! A window that was busy gets all events since the last frame at once, and a widget then sees only the last position of the
//! pointer: if the pointer moves on after the release of a slider, the slider would follow the pointer. This module passes each
//! frame the events up to the next press or release, and the rest to later frames: text typed after a click goes to the clicked
//! field. Only the keys of an emergency stop are passed at once.

use crate::experiment::key_of;
use egui::{Event, Key, RawInput};
use flotor_study::screen::StopKey;
use std::collections::VecDeque;

/// Keys that may be the emergency stop.
const STOP_KEYS: [Key; 3] = [key_of(StopKey::Escape), key_of(StopKey::Space), key_of(StopKey::F12)];

/// Queue that splits the input of a late frame at presses and releases.
#[derive(Debug, Default)]
pub struct PointerOrder {
    /// Events for later frames, in order.
    waiting: VecDeque<Event>,
}

impl PointerOrder {
    /// Limits the input of a frame to the events up to the next press or release of a button, and the keys that may be the
    /// emergency stop; returns true if more events are pending, so that another frame should be drawn at once.
    pub fn split(&mut self, input: &mut RawInput) -> bool {
        let arrived = std::mem::take(&mut input.events);
        let (ordered, others): (Vec<_>, Vec<_>) = arrived.into_iter().partition(is_in_order);
        self.waiting.extend(ordered);
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

/// Returns whether an event must keep its order relative to clicks.
fn is_in_order(event: &Event) -> bool {
    match event {
        Event::Key { key, .. } => !STOP_KEYS.contains(key),
        Event::Text(_)
        | Event::PointerMoved(_)
        | Event::MouseMoved(_)
        | Event::PointerButton { .. }
        | Event::PointerGone
        | Event::Touch { .. }
        | Event::MouseWheel { .. }
        | Event::Zoom(_) => true,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::{Modifiers, PointerButton, Pos2, pos2};

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
    fn what_was_typed_after_a_click_comes_after_it() {
        let at = pos2(10.0, 5.0);
        let (five, enter) = (Event::Text("5".to_owned()), key(Key::Enter));
        let told = pictures(vec![button(at, true), button(at, false), five.clone(), enter.clone()]);
        assert_eq!(told, [vec![button(at, true)], vec![button(at, false)], vec![five, enter]]);
    }

    #[test]
    fn a_stop_key_comes_with_the_first_picture_however_much_the_pointer_did() {
        let at = pos2(10.0, 5.0);
        let told = pictures(vec![button(at, true), button(at, false), key(Key::Space)]);
        assert!(told[0].contains(&key(Key::Space)), "{told:?}");
        assert_eq!(told.len(), 2);
        assert_eq!(pictures(Vec::new()), [Vec::new()]);
    }
}
