//! Encoder of messages to clients: the state of all devices. The first message of a session, and each message requested with
//! `force_render_full_state`, also has configuration and session.

use crate::device::{ARM_M, grip_id, inverse_id, joint_angles};
use crate::service::{Service, Session, Shared};
use crate::view::{Transform, View, of_vector};
use flotor_compat::{Axes, State};
use flotor_hal::{DQuat, DVec3};
use serde_json::ser::{CompactFormatter, Formatter};
use serde_json::{Value, json};
use std::fmt::Write;
use std::io;

/// Parts of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Extent {
    /// State and status, after each message.
    State,
    /// State, status and configuration.
    Inventory,
    /// State, status, configuration and session.
    All,
}

/// Encodes a message for a session, replacing the contents of `text`.
pub(crate) fn write(text: &mut String, service: &Service, session: u64, extent: Extent) {
    text.clear();
    let shared = service.shared();
    let plain = Session { id: session, profile: String::new(), started: String::new(), views: Vec::new() };
    let own = shared.session(session).unwrap_or(&plain);
    let _ = write!(text, "{{\"session_id\":{session}");
    if extent == Extent::All {
        let _ = write!(text, ",\"session\":{}", session_json(own));
    }
    text.push_str(",\"inverse3\":[");
    devices(text, service, &shared, own, extent, arm);
    text.push_str("],\"verse_grip\":[],\"wireless_verse_grip\":[");
    devices(text, service, &shared, own, extent, grip);
    text.push_str("],\"custom_verse_grip\":[]}");
}

/// Encodes a session.
pub(crate) fn session_json(session: &Session) -> Value {
    json!({
        "session_id": session.id,
        "config": { "profile": { "name": session.profile }, "started_time": session.started },
    })
}

/// Device with its state, for the encoder.
struct Seen<'a> {
    service: &'a Service,
    shared: &'a Shared,
    number: usize,
    state: State,
    axes: Axes,
    is_alive: bool,
}

type Part = fn(&mut String, &Seen<'_>, &[View; 2], Extent);

fn devices(text: &mut String, service: &Service, shared: &Shared, own: &Session, extent: Extent, part: Part) {
    let plain = <[View; 2]>::default();
    let is_alive = service.host.is_running();
    for (number, station) in service.host.stations().iter().enumerate() {
        if number > 0 {
            text.push(',');
        }
        let seen = Seen { service, shared, number, state: station.state(), axes: station.axes(), is_alive };
        part(text, &seen, own.views.get(number).unwrap_or(&plain), extent);
    }
}

fn arm(text: &mut String, seen: &Seen<'_>, [view, _]: &[View; 2], extent: Extent) {
    let Seen { service, shared, number, state, is_alive, .. } = seen;
    let _ = write!(text, "{{\"device_id\":\"{}\"", inverse_id(*number));
    if extent != Extent::State {
        let _ = write!(text, ",\"config\":{}", arm_config(shared, *number, view));
    }
    let [mode, domain, control] = service.control(shared, *number);
    text.push_str(",\"state\":{");
    let (position, applied_n) = (view.position(state.position_m), state.applied.force());
    vector(text, "cursor_position", position);
    vector(text, "cursor_velocity", view.velocity(state.velocity_m_per_s));
    angles(text, "angular_position", joint_angles(state.position_m));
    angles(text, "angular_velocity", joint_angles(state.velocity_m_per_s));
    quaternion(text, "body_orientation", DQuat::IDENTITY);
    vector(text, "current_cursor_force", view.force(applied_n));
    vector(text, "current_cursor_position", position);
    angles(text, "current_angular_torques", applied_n * ARM_M);
    angles(text, "current_angular_position", joint_angles(state.position_m));
    let in_use = control != "idle";
    let _ =
        write!(text, ",\"mode\":\"{mode}\",\"control_domain\":\"{domain}\",\"control_mode\":\"{control}\"");
    transform(text, &view.workspace);
    let _ = write!(
        text,
        ",\"transform_velocity\":{{}}}},\"status\":{{\"calibrated\":true,\"in_use\":{in_use},\"power_supply\":{is_alive},\
         \"ready\":{is_alive},\"started\":{is_alive}}}}}"
    );
}

fn grip(text: &mut String, seen: &Seen<'_>, [_, view]: &[View; 2], extent: Extent) {
    let Seen { number, state, axes, is_alive, .. } = seen;
    let _ = write!(text, "{{\"device_id\":\"{}\"", grip_id(*number));
    if extent != Extent::State {
        let config = json!({
            "type": "wireless_verse_grip", "port": "flotor", "major_version": 2, "minor_version": 2, "hardware_version": 1,
            "streaming_mode": "USB", "preset": view.preset, "basis": { "permutation": view.basis.name() },
            "mount": view.mount.to_json(),
        });
        let _ = write!(text, ",\"config\":{config}");
    }
    let pressed = |bit: u32| state.buttons >> bit & 1 == 1;
    let _ = write!(
        text,
        ",\"state\":{{\"battery_level\":1.0,\"battery_voltage\":4.2,\"buttons\":{{\"a\":{},\"b\":{},\"c\":{}}},\"hall\":0",
        pressed(0),
        pressed(1),
        pressed(2)
    );
    let orientation = if *axes == Axes::Three { DQuat::IDENTITY } else { state.orientation };
    quaternion(text, "orientation", view.orientation(orientation));
    transform(text, &view.workspace);
    let _ = write!(
        text,
        ",\"transform_velocity\":{{}}}},\"status\":{{\"ready\":{is_alive},\"connected\":{is_alive},\"awake\":{is_alive}}}}}"
    );
}

fn arm_config(shared: &Shared, number: usize, view: &View) -> Value {
    let id = inverse_id(number);
    let mut config = json!({
        "type": "inverse3",
        "port": "flotor",
        "device_info": { "id": id, "major_version": 7, "minor_version": 4, "device_type": 4,
            "uuid": format!("00000000-0000-0000-0000-00000000{id}") },
        "extended_device_id": format!("00000000000000000000{id}"),
        "extended_firmware_version": concat!("flotor ", env!("CARGO_PKG_VERSION")),
        "streaming_mode": "USB",
        "preset": view.preset,
        "basis": { "permutation": view.basis.name() },
        "mount": view.mount.to_json(),
        "filters": { "force_gate": force_gate(view), "damping": damping(view) },
    });
    if let (Value::Object(config), Some(kept)) = (&mut config, shared.kept.get(number)) {
        config.extend(kept.iter().map(|(name, value)| ((*name).to_owned(), value.clone())));
    }
    config
}

pub(crate) fn force_gate(view: &View) -> Value {
    json!({ "gain": view.force_gate })
}

pub(crate) fn damping(view: &View) -> Value {
    let DVec3 { x, y, z } = view.damping;
    if x == y && y == z {
        json!({ "scalar": x })
    } else {
        json!({ "scalar": 0.0, "vector": of_vector(view.damping) })
    }
}

/// Adapter that writes bytes to a string.
struct Sink<'a>(&'a mut String);

impl io::Write for Sink<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.push_str(std::str::from_utf8(bytes).map_err(io::Error::other)?);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Writes the shortest decimal representation of a number, several times faster than `format!`: a state has dozens of numbers.
fn number(text: &mut String, number: f64) {
    // Non-finite numbers are unreachable: the loop replaces them.
    let number = if number.is_finite() { number } else { 0.0 };
    let _ = CompactFormatter.write_f64(&mut Sink(text), number);
}

/// Writes the key of a member of a JSON object, after a comma if it is not the first member.
fn key(text: &mut String, name: &str) {
    text.push_str(if text.ends_with('{') { "\"" } else { ",\"" });
    text.push_str(name);
    text.push_str("\":");
}

fn transform(text: &mut String, transform: &Transform) {
    key(text, "transform");
    if *transform == Transform::NONE {
        text.push_str("{}");
    } else {
        let _ = write!(text, "{}", transform.to_json());
    }
}

fn numbers(text: &mut String, name: &str, parts: &[(&str, f64)]) {
    key(text, name);
    text.push('{');
    for (name, value) in parts {
        key(text, name);
        number(text, *value);
    }
    text.push('}');
}

fn vector(text: &mut String, name: &str, DVec3 { x, y, z }: DVec3) {
    numbers(text, name, &[("x", x), ("y", y), ("z", z)]);
}

fn angles(text: &mut String, name: &str, DVec3 { x, y, z }: DVec3) {
    numbers(text, name, &[("a0", x), ("a1", y), ("a2", z)]);
}

fn quaternion(text: &mut String, name: &str, DQuat { x, y, z, w }: DQuat) {
    numbers(text, name, &[("w", w), ("x", x), ("y", y), ("z", z)]);
}
