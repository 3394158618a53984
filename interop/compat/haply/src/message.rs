//! Parser of clients' messages, which applies their settings and commands.

use crate::device::{ARM_M, grip_id, inverse_id};
use crate::force::{Domain, SessionCommand};
use crate::service::{Service, Session, Shared};
use crate::view::{Basis, PRESETS, Transform, View, numbers, vector};
use flotor_hal::DVec3;
use serde_json::Value;

/// Result of a message.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Carried {
    /// Number of the first device with a command.
    pub(crate) commanded: Option<usize>,
    /// True if the message requests the full state.
    pub(crate) wants_all: bool,
}

/// Carries out a message of a session. Illegal parts are skipped and reported as events.
pub(crate) fn carry_out(service: &Service, session: u64, text: &str) -> Carried {
    let message: Value = match serde_json::from_str(text) {
        Ok(message @ Value::Object(_)) => message,
        Ok(_) => {
            service.refuse("", "the message must be a JSON object", text);
            return Carried::default();
        }
        Err(error) => {
            service.refuse("", &format!("the message is not JSON: {error}"), text);
            return Carried::default();
        }
    };
    let mut shared = service.shared();
    let mut carried = Carried::default();
    if let Some(of_session) = message.get("session") {
        carried.wants_all = of_session.get("force_render_full_state").is_some();
        if let (Some(configure), Some(own)) = (of_session.get("configure"), shared.session_mut(session)) {
            configure_session(service, own, configure);
        }
    }
    for entry in entries(&message, "inverse3") {
        let Some(device) = number(service, entry, inverse_id) else { continue };
        if let (Some(configure), Some(view)) = (entry.get("configure"), view(&mut shared, session, device, 0))
        {
            configure_device(service, view, configure);
        }
        if let Some(commands) = entry.get("commands").or_else(|| entry.get("command"))
            && command(service, &mut shared, session, device, commands)
        {
            carried.commanded = carried.commanded.or(Some(device));
        }
    }
    for kind in ["wireless_verse_grip", "verse_grip", "custom_verse_grip"] {
        for entry in entries(&message, kind) {
            let Some(device) = number(service, entry, grip_id) else { continue };
            let Some(view) = view(&mut shared, session, device, 1) else { continue };
            if let Some(configure) = entry.get("configure") {
                configure_device(service, view, configure);
            }
            if let Some(transform) = entry.get("commands").and_then(|commands| commands.get("set_transform"))
            {
                set_workspace(service, view, transform);
            }
        }
    }
    carried
}

fn entries<'a>(message: &'a Value, kind: &str) -> &'a [Value] {
    message.get(kind).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

/// Returns the number of an entry's device; reports an unknown device as an event.
fn number(service: &Service, entry: &Value, name: fn(usize) -> String) -> Option<usize> {
    let id = entry.get("device_id").and_then(Value::as_str).unwrap_or_default();
    let number = (0..service.host.stations().len()).find(|number| name(*number).eq_ignore_ascii_case(id));
    if number.is_none() {
        service.refuse("device_id", "unknown device; `GET /devices` lists the ids", &entry.to_string());
    }
    number
}

fn view(shared: &mut Shared, session: u64, device: usize, part: usize) -> Option<&mut View> {
    shared.session_mut(session)?.views.get_mut(device)?.get_mut(part)
}

fn configure_session(service: &Service, session: &mut Session, configure: &Value) {
    if let Some(name) = configure.get("profile").and_then(|profile| profile.get("name")) {
        match name.as_str() {
            Some(name) => name.clone_into(&mut session.profile),
            None => service.refuse(
                "session.configure.profile.name",
                "the value must be a text",
                &name.to_string(),
            ),
        }
    }
    if let Some(basis) = configure.get("basis") {
        match read_basis(basis) {
            Some(basis) => session.views.as_flattened_mut().iter_mut().for_each(|view| view.basis = basis),
            None => service.refuse("session.configure.basis", NO_BASIS, &basis.to_string()),
        }
    }
}

const NO_BASIS: &str = "the basis must be a permutation of X, Y and Z with signs, such as XZY or X-YZ";
pub(crate) const NO_TRANSFORM: &str = "position and scale need x, y, z, the rotation needs w, x, y, z, and no scale and no rotation \
may be 0";

pub(crate) fn read_basis(basis: &Value) -> Option<Basis> {
    basis.get("permutation").and_then(Value::as_str).and_then(Basis::parse)
}

/// Applies the settings of an entry to the session's view of a device; illegal settings are reported as events.
fn configure_device(service: &Service, view: &mut View, configure: &Value) {
    if configure.get("mount").is_some() && configure.get("preset").is_some() {
        return service.refuse("configure", "give either a preset or a mount", &configure.to_string());
    }
    for (name, value) in configure.as_object().into_iter().flatten() {
        if let Err(reason) = set(view, name, value) {
            service.refuse(&format!("configure.{name}"), &reason, &value.to_string());
        }
    }
}

/// Applies one setting to a view, by its name in a message; `filters` contains further settings.
///
/// # Errors
/// The legal values, as text.
pub(crate) fn set(view: &mut View, name: &str, value: &Value) -> Result<(), String> {
    match name {
        "basis" => view.basis = read_basis(value).ok_or(NO_BASIS)?,
        "preset" => {
            let preset = value.get("preset").or(Some(value)).and_then(Value::as_str).unwrap_or_default();
            if !view.set_preset(preset) {
                let names = PRESETS.map(|(name, _)| name).join(", ");
                return Err(format!("unknown preset `{preset}`; use one of {names}"));
            }
        }
        "mount" => {
            let patch = value.get("transform").unwrap_or(value);
            view.set_mount(Transform::NONE.patched(patch).ok_or(NO_TRANSFORM)?);
        }
        "damping" => {
            let scalar = value.get("scalar").and_then(Value::as_f64).unwrap_or(0.0);
            let along =
                value.get("vector").filter(|vector| !vector.is_null()).map_or(Some(DVec3::ZERO), vector);
            let damping = along.map(|along| along + scalar).filter(|damping| damping.min_element() >= 0.0);
            view.damping = damping
                .ok_or("`vector` needs x, y, z, and their sums with `scalar` must be 0 N·s/m or more")?;
        }
        "force_gate" => {
            let gain = value.get("gain").and_then(Value::as_f64).filter(|gain| (0.0..=1.0).contains(gain));
            view.force_gate = gain.ok_or("the force gate needs a `gain` of 0 to 1")?;
        }
        "filters" => {
            for (name, value) in value.as_object().into_iter().flatten() {
                set(view, name, value)?;
            }
        }
        other => {
            return Err(format!(
                "unknown setting `{other}`; use basis, damping, force_gate, mount or preset, directly or in `filters`"
            ));
        }
    }
    Ok(())
}

fn set_workspace(service: &Service, view: &mut View, command: &Value) {
    if !is_executed(command) {
        return;
    }
    let patched = command.get("transform").and_then(|patch| view.workspace.patched(patch));
    match patched {
        Some(workspace) => view.workspace = workspace,
        None => service.refuse("set_transform", NO_TRANSFORM, &command.to_string()),
    }
}

/// Returns true if a command takes effect: with `execute: false` a program sends a command for validation only.
fn is_executed(command: &Value) -> bool {
    command.get("execute").and_then(Value::as_bool).unwrap_or(true)
}

/// Carries out the commands to a device; returns true if any was a motion or force command.
fn command(service: &Service, shared: &mut Shared, session: u64, device: usize, commands: &Value) -> bool {
    let Some(view) = view(shared, session, device, 0) else { return false };
    if let Some(transform) = commands.get("set_transform") {
        set_workspace(service, view, transform);
    }
    let damping = view.damping;
    let mut wanted = SessionCommand { domain: Domain::Cartesian, force_n: None, target_m: None, damping };
    let (mut commands_it, mut is_wanted) = (false, false);
    for (name, command) in commands.as_object().into_iter().flatten() {
        let read = |keys: [&str; 2], names| {
            keys.iter().find_map(|key| command.get(key)).and_then(|value| numbers(value, names))
        };
        let (cartesian, angular) = (["x", "y", "z"], ["a0", "a1", "a2"]);
        let value = match name.as_str() {
            "set_cursor_force" => read(["vector", "values"], cartesian),
            "set_cursor_position" => read(["position", "values"], cartesian),
            "set_angular_torques" => read(["torques", "values"], angular),
            "set_angular_position" => read(["angles", "values"], angular),
            "set_transform" | "probe_position" | "probe_cursor_position" | "probe_angular_position" => {
                continue;
            }
            other => {
                service.refuse(other, "unknown command, without effect", &command.to_string());
                continue;
            }
        };
        commands_it = true;
        let Some(value) = value else {
            service.refuse(
                name,
                "the command needs finite x, y, z (joints: a0, a1, a2)",
                &command.to_string(),
            );
            continue;
        };
        if !is_executed(command) {
            continue;
        }
        is_wanted = true;
        match name.as_str() {
            "set_cursor_force" => wanted.force_n = Some(view.force_back(value)),
            "set_cursor_position" => wanted.target_m = Some(view.position_back(value)),
            "set_angular_torques" => {
                (wanted.force_n, wanted.domain) = (Some(value / ARM_M), Domain::Angular);
            }
            _ => {
                let radians = value * (std::f64::consts::PI / 180.0);
                (wanted.target_m, wanted.domain) = (Some(radians * ARM_M), Domain::Angular);
            }
        }
    }
    if is_wanted {
        service.set(shared, session, device, wanted);
    }
    commands_it
}
