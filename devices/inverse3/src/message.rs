//! Encoders of messages to the service, and parsers of its messages.
//!
//! Names and shapes are those of the Inverse Service 3.5 (Haply Robotics, "WebSocket protocol" and "Control commands" of
//! its documentation). A state contains all devices; only the selected arm and grip are read.

use crate::json::{Cursor, Malformed, Scalar};
use crate::session_error::SessionError;
use flotor_hal::{DQuat, DVec3};
use std::io::Write;

/// Names of the service's lists of arms and grips.
const ARMS: &str = "inverse3";
const GRIPS: [&str; 3] = ["verse_grip", "wireless_verse_grip", "custom_verse_grip"];
/// Buttons of a grip, from bit 0.
const BUTTONS: [&str; 3] = ["a", "b", "c"];
/// Status flags that must not be false.
const READY: [&str; 3] = ["calibrated", "power_supply", "ready"];
/// Message without changes, answered with a state.
pub const LOOK: &[u8] = b"{}";
/// Smallest norm of a quaternion that is accepted and normalised.
const SHORTEST: f64 = 1.0e-3;

/// Grip, identified by its list in the service's messages and its id.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grip {
    /// Name of the service's list that contains the grip, such as `verse_grip`.
    pub kind: &'static str,
    /// Id, as sent by the service.
    pub id: String,
}

/// Devices of a service.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Inventory {
    /// Ids of the arms.
    pub arms: Vec<String>,
    /// Grips of all kinds.
    pub grips: Vec<Grip>,
}

/// Devices selected for a session.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Chosen {
    /// Id of the selected arm.
    pub arm: String,
    /// Selected grip; `None` without one.
    pub grip: Option<Grip>,
}

/// State of the selected devices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Position of the cursor, m.
    pub position_m: DVec3,
    /// Velocity of the cursor, m/s.
    pub velocity_m_per_s: DVec3,
    /// Force of the device on the hand, N, including commands of other programs.
    pub force_n: DVec3,
    /// Orientation of the grip; identity without one.
    pub orientation: DQuat,
    /// Buttons of the grip, a to c from bit 0.
    pub buttons: u32,
    /// True while any session commands the device.
    pub is_commanded: bool,
}

/// Lists the devices in a message of the service, except devices with escape sequences in their ids. Not real-time.
///
/// # Errors
/// If the message is not JSON, or a list has another shape.
pub fn inventory(text: &[u8]) -> Result<Inventory, Malformed> {
    let mut found = Inventory::default();
    let id = |cursor: &mut Cursor<'_>| -> Result<Option<String>, Malformed> {
        let id = match cursor.at(&["device_id"])? {
            // Ids are sent back verbatim: reject ids with escapes.
            Some(Scalar::Text(id)) if !id.contains('\\') => Some(id.to_owned()),
            _ => None,
        };
        cursor.skip()?;
        Ok(id)
    };
    let mut cursor = Cursor::new(text);
    cursor.fields(|name, cursor| {
        if name == ARMS {
            return cursor.elements(|element| id(element).map(|id| found.arms.extend(id)));
        }
        match GRIPS.into_iter().find(|kind| *kind == name) {
            Some(kind) => cursor
                .elements(|element| id(element).map(|id| found.grips.extend(id.map(|id| Grip { kind, id })))),
            None => cursor.skip(),
        }
    })?;
    cursor.end()?;
    Ok(found)
}

/// Required value of a setting of the arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setting {
    /// Path of the value within the arm's element of a state.
    pub path: &'static [&'static str],
    /// Required value; also the default of an absent optional setting.
    pub value: Scalar<'static>,
    /// Presence of a setting: required or optional.
    pub presence: Presence,
}

/// Presence of a setting in a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presence {
    /// Must be present.
    Required,
    /// May be absent; then the service's default applies.
    Optional,
}

/// Returns the required settings of the arm; `force_gate` is the gain of the force gate.
#[must_use]
pub fn settings(force_gate: f64) -> [Setting; 15] {
    use Presence::{Optional, Required};
    use Scalar::{Flag, Number, Text};
    let setting = |path, value, presence| Setting { path, value, presence };
    [
        setting(&["config", "basis", "permutation"], Text("XYZ"), Required),
        setting(&["config", "preset"], Text("arm_front_centered"), Required),
        setting(&["config", "filters", "force_gate", "gain"], Number(force_gate), Required),
        setting(&["config", "filters", "damping", "scalar"], Number(0.0), Required),
        setting(&["config", "filters", "damping", "vector", "x"], Number(0.0), Optional),
        setting(&["config", "filters", "damping", "vector", "y"], Number(0.0), Optional),
        setting(&["config", "filters", "damping", "vector", "z"], Number(0.0), Optional),
        setting(&["config", "gravity_compensation", "enabled"], Flag(true), Optional),
        setting(&["state", "transform", "position", "x"], Number(0.0), Optional),
        setting(&["state", "transform", "position", "y"], Number(0.0), Optional),
        setting(&["state", "transform", "position", "z"], Number(0.0), Optional),
        setting(&["state", "transform", "rotation", "w"], Number(1.0), Optional),
        setting(&["state", "transform", "scale", "x"], Number(1.0), Optional),
        setting(&["state", "transform", "scale", "y"], Number(1.0), Optional),
        setting(&["state", "transform", "scale", "z"], Number(1.0), Optional),
    ]
}

/// Encodes the message that changes the settings and requests a full state, which contains all settings. Not real-time.
#[must_use]
pub fn configure(chosen: &Chosen, force_gate: f64) -> String {
    let view = "\"preset\":\"arm_front_centered\",\"basis\":{\"permutation\":\"XYZ\"}";
    let no_transform = "\"set_transform\":{\"transform\":{\"position\":{\"x\":0,\"y\":0,\"z\":0},\
        \"rotation\":{\"w\":1,\"x\":0,\"y\":0,\"z\":0},\"scale\":{\"x\":1,\"y\":1,\"z\":1}}}";
    let grip = chosen.grip.as_ref().map_or_else(String::new, |Grip { kind, id }| {
        format!(
            ",\"{kind}\":[{{\"device_id\":\"{id}\",\"configure\":{{{view}}},\"commands\":{{{no_transform}}}}}]"
        )
    });
    let Chosen { arm, .. } = chosen;
    format!(
        "{{\"session\":{{\"configure\":{{\"profile\":{{\"name\":\"flotor\"}}}},\"force_render_full_state\":{{}}}},\
         \"{ARMS}\":[{{\"device_id\":\"{arm}\",\"configure\":{{{view},\
         \"filters\":{{\"force_gate\":{{\"gain\":{force_gate}}},\"damping\":{{\"scalar\":0}}}}}},\
         \"commands\":{{{no_transform}}}}}]{grip}}}"
    )
}

/// Returns path and text of the first setting of the arm that differs from its required value; `None` if all agree.
/// Not real-time.
///
/// # Errors
/// [`SessionError`] if the message is malformed or does not contain the arm.
pub fn differing(
    text: &[u8],
    arm: &str,
    settings: &[Setting],
) -> Result<Option<(&'static [&'static str], String)>, SessionError> {
    let mut found = None;
    Cursor::new(text).fields(|name, cursor| {
        if name != ARMS {
            return cursor.skip();
        }
        cursor.elements(|element| {
            if element.at(&["device_id"])? == Some(Scalar::Text(arm)) {
                found = Some(*element);
            }
            element.skip()
        })
    })?;
    let element = found.ok_or(SessionError::Unplugged)?;
    for Setting { path, value, presence } in settings {
        match element.at(path)? {
            Some(said) if said == *value => {}
            None if *presence == Presence::Optional => {}
            None => return Ok(Some((path, format!("missing, not {value}")))),
            Some(said) => return Ok(Some((path, format!("{said}, not {value}")))),
        }
    }
    Ok(None)
}

/// Encodes the command of a force, N, replacing the contents of `text`. Real-time: bounded, no allocation once `text` has the
/// capacity.
pub fn force(text: &mut Vec<u8>, arm: &str, force_n: DVec3) {
    let DVec3 { x, y, z } = force_n;
    text.clear();
    // Writing to memory cannot fail.
    let _ = write!(
        text,
        "{{\"{ARMS}\":[{{\"device_id\":\"{arm}\",\"commands\":{{\"set_cursor_force\":{{\"vector\":\
         {{\"x\":{x:e},\"y\":{y:e},\"z\":{z:e}}}}}}}}}]}}"
    );
}

/// Reads the fields of an object by name; NaN, which no JSON has, for a missing field.
fn parts<const N: usize>(cursor: &mut Cursor<'_>, names: [&str; N]) -> Result<[f64; N], Malformed> {
    let mut parts = [f64::NAN; N];
    cursor.fields(|name, cursor| {
        match parts.iter_mut().zip(names).find(|(_, part)| *part == name) {
            Some((place, _)) => *place = cursor.number()?,
            None => cursor.skip()?,
        }
        Ok(())
    })?;
    Ok(parts)
}

fn whole<const N: usize>(field: &'static str, parts: [f64; N]) -> Result<[f64; N], SessionError> {
    if parts.iter().any(|part| part.is_nan()) {
        Err(SessionError::Missing(field))
    } else if parts.iter().all(|part| part.is_finite()) {
        Ok(parts)
    } else {
        Err(SessionError::Infinite(field))
    }
}

/// Parsed element of an arm.
struct Arm {
    is_chosen: bool,
    position: [f64; 3],
    velocity: [f64; 3],
    force: [f64; 3],
    is_ready: bool,
    is_commanded: bool,
}

/// Parsed element of a grip.
struct Held {
    is_chosen: bool,
    orientation: [f64; 4],
    buttons: u32,
    is_ready: bool,
}

fn is_ready(cursor: &mut Cursor<'_>) -> Result<bool, Malformed> {
    let mut is_ready = true;
    cursor.fields(|name, cursor| match READY.contains(&name) {
        true => cursor.flag().map(|flag| is_ready &= flag),
        false => cursor.skip(),
    })?;
    Ok(is_ready)
}

fn arm(cursor: &mut Cursor<'_>, chosen: &str) -> Result<Arm, Malformed> {
    let none = [f64::NAN; 3];
    let mut arm = Arm {
        is_chosen: false,
        position: none,
        velocity: none,
        force: none,
        is_ready: true,
        is_commanded: false,
    };
    cursor.fields(|name, cursor| match name {
        "device_id" => cursor.text().map(|id| arm.is_chosen = id == chosen),
        "status" => is_ready(cursor).map(|is_ready| arm.is_ready = is_ready),
        "state" => cursor.fields(|name, cursor| {
            let place = match name {
                "cursor_position" => &mut arm.position,
                "cursor_velocity" => &mut arm.velocity,
                "current_cursor_force" => &mut arm.force,
                "control_mode" => return cursor.text().map(|mode| arm.is_commanded = mode != "idle"),
                _ => return cursor.skip(),
            };
            *place = parts(cursor, ["x", "y", "z"])?;
            Ok(())
        }),
        _ => cursor.skip(),
    })?;
    Ok(arm)
}

fn held(cursor: &mut Cursor<'_>, chosen: &str) -> Result<Held, Malformed> {
    let mut held = Held { is_chosen: false, orientation: [f64::NAN; 4], buttons: 0, is_ready: true };
    cursor.fields(|name, cursor| match name {
        "device_id" => cursor.text().map(|id| held.is_chosen = id == chosen),
        "status" => is_ready(cursor).map(|is_ready| held.is_ready = is_ready),
        "state" => cursor.fields(|name, cursor| match name {
            "orientation" => {
                parts(cursor, ["w", "x", "y", "z"]).map(|orientation| held.orientation = orientation)
            }
            "buttons" => {
                cursor.fields(|name, cursor| match BUTTONS.iter().position(|button| *button == name) {
                    Some(bit) => cursor.flag().map(|pressed| held.buttons |= u32::from(pressed) << bit),
                    None => cursor.skip(),
                })
            }
            _ => cursor.skip(),
        }),
        _ => cursor.skip(),
    })?;
    Ok(held)
}

/// Parses the state of the selected devices. Real-time: bounded by the length of the message, no allocation.
///
/// # Errors
/// A [`SessionError`]: the state is malformed, a device is missing or not ready, or a number is missing or infinite.
pub fn sample(text: &[u8], chosen: &Chosen) -> Result<Sample, SessionError> {
    let (mut of_arm, mut of_grip) = (None, None);
    let mut cursor = Cursor::new(text);
    cursor.fields(|name, cursor| match &chosen.grip {
        _ if name == ARMS => cursor.elements(|element| {
            let arm = arm(element, &chosen.arm)?;
            of_arm = of_arm.take().or(arm.is_chosen.then_some(arm));
            Ok(())
        }),
        Some(grip) if name == grip.kind => cursor.elements(|element| {
            let held = held(element, &grip.id)?;
            of_grip = of_grip.take().or(held.is_chosen.then_some(held));
            Ok(())
        }),
        _ => cursor.skip(),
    })?;
    cursor.end()?;
    let arm = of_arm.ok_or(SessionError::Unplugged)?;
    let (orientation, buttons) = match (&chosen.grip, of_grip) {
        (None, _) => (DQuat::IDENTITY, 0),
        (Some(_), None) => return Err(SessionError::Unplugged),
        (Some(_), Some(held)) if !held.is_ready => return Err(SessionError::NotReady),
        (Some(_), Some(held)) => {
            let [w, x, y, z] = whole("orientation", held.orientation)?;
            let turned = DQuat::from_xyzw(x, y, z, w);
            // Single precision: the norm is nearly one, and never zero.
            if turned.length() < SHORTEST {
                return Err(SessionError::Missing("orientation"));
            }
            (turned.normalize(), held.buttons)
        }
    };
    if !arm.is_ready {
        return Err(SessionError::NotReady);
    }
    Ok(Sample {
        position_m: whole("cursor_position", arm.position)?.into(),
        velocity_m_per_s: whole("cursor_velocity", arm.velocity)?.into(),
        force_n: whole("current_cursor_force", arm.force)?.into(),
        orientation,
        buttons,
        is_commanded: arm.is_commanded,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stand_in;
    use proptest::prelude::*;

    fn chosen() -> Chosen {
        let grip = Grip { kind: "wireless_verse_grip", id: stand_in::GRIP.to_owned() };
        Chosen { arm: stand_in::ARM.to_owned(), grip: Some(grip) }
    }

    #[test]
    fn a_state_says_where_the_cursor_is_and_how_the_grip_is_held() {
        let text = stand_in::state(DVec3::new(0.01, -0.02, 0.03), DVec3::new(0.0, 0.0, 1.5));
        let read = sample(text.as_bytes(), &chosen()).expect("it is a state");
        assert_eq!(read.position_m, DVec3::new(0.01, -0.02, 0.03));
        assert_eq!((read.force_n, read.buttons), (DVec3::new(0.0, 0.0, 1.5), 0b101));
        // A quarter about z, to the precision of a normalisation.
        assert!((read.orientation * DVec3::X - DVec3::Y).length() < 1.0e-15, "{read:?}");
        let devices = inventory(text.as_bytes()).expect("it is a message");
        assert_eq!(devices.arms, [stand_in::OTHER_ARM, stand_in::ARM]);
        assert_eq!(devices.grips, [chosen().grip.expect("there is one")]);
    }

    #[test]
    fn whatever_a_state_lacks_is_named() {
        let text = stand_in::state(DVec3::ZERO, DVec3::ZERO);
        for (from, to, error) in [
            (
                "\"cursor_position\":{\"x\":0.0,",
                "\"cursor_position\":{",
                SessionError::Missing("cursor_position"),
            ),
            ("\"cursor_velocity\"", "\"velocity\"", SessionError::Missing("cursor_velocity")),
            (
                "\"current_cursor_force\":{\"x\":0.0",
                "\"current_cursor_force\":{\"x\":NaN",
                SessionError::NoState,
            ),
            (
                "\"current_cursor_force\":{\"x\":0.0",
                "\"current_cursor_force\":{\"x\":null",
                SessionError::NoState,
            ),
            (
                "\"current_cursor_force\":{\"x\":0.0",
                "\"current_cursor_force\":{\"x\":1e999",
                SessionError::Infinite("current_cursor_force"),
            ),
            ("\"orientation\":{\"w\":", "\"orientation\":{\"v\":", SessionError::Missing("orientation")),
            (stand_in::ARM, "FFFF", SessionError::Unplugged),
            (stand_in::GRIP, "FFFF", SessionError::Unplugged),
            ("\"power_supply\":true", "\"power_supply\":false", SessionError::NotReady),
            ("]}", "]", SessionError::NoState),
        ] {
            let broken = text.replace(from, to);
            assert_ne!(broken, text, "{from}");
            assert_eq!(sample(broken.as_bytes(), &chosen()), Err(error), "{to}");
        }
    }

    #[test]
    fn a_setting_that_was_not_taken_is_named() {
        let reported = stand_in::configured(0.0);
        let compare = |text: &str| differing(text.as_bytes(), stand_in::ARM, &settings(0.0));
        assert_eq!(compare(&reported), Ok(None));
        for (from, to, name) in [
            ("\"gain\":0", "\"gain\":0.3", "gain"),
            ("XYZ", "XZY", "permutation"),
            ("\"enabled\":true", "\"enabled\":false", "enabled"),
            ("\"transform\":{}", "\"transform\":{\"scale\":{\"x\":2}}", "x"),
            ("\"damping\"", "\"dumping\"", "scalar"),
        ] {
            let other = reported.replace(from, to);
            let found = compare(&other).expect("the arm is there").expect("it differs");
            assert_eq!(found.0.last(), Some(&name), "{to}");
        }
    }

    proptest! {
        /// A number that is sent is the number that is read, to the bit.
        #[test]
        fn a_force_is_sent_to_the_bit(force_n in prop::array::uniform3(prop::num::f64::NORMAL | prop::num::f64::ZERO)) {
            let mut text = Vec::with_capacity(512);
            force(&mut text, "F001", force_n.into());
            let mut sent = [0.0; 3];
            Cursor::new(&text).fields(|name, cursor| {
                assert_eq!(name, ARMS);
                cursor.elements(|element| {
                    for (place, part) in sent.iter_mut().zip(["x", "y", "z"]) {
                        let path = ["commands", "set_cursor_force", "vector", part];
                        if let Some(Scalar::Number(number)) = element.at(&path)? {
                            *place = number;
                        }
                    }
                    element.skip()
                })
            }).expect("it is JSON");
            prop_assert_eq!(sent, force_n);
            prop_assert!(text.len() <= 512 && text.capacity() == 512);
        }

        /// Any change of a byte of a state gives a sample or a trouble.
        #[test]
        fn a_changed_byte_never_gives_what_is_not_finite(at in 0..900_usize, byte in any::<u8>()) {
            let mut text = stand_in::state(DVec3::X * 0.01, DVec3::Z).into_bytes();
            let at = at % text.len();
            text[at] = byte;
            if let Ok(read) = sample(&text, &chosen()) {
                prop_assert!(read.position_m.is_finite() && read.velocity_m_per_s.is_finite());
                prop_assert!(read.force_n.is_finite() && (read.orientation.length() - 1.0).abs() < 1.0e-12);
            }
        }
    }
}
