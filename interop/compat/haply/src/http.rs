//! HTTP interface: version, devices, sessions, and the settings of a device.

use crate::connection::{Answer, Request, failed};
use crate::device::{grip_id, inverse_id, kept_at_first};
use crate::message::{NO_TRANSFORM, set};
use crate::service::{MOST_SETTINGS_BYTES, Service, Session, Shared};
use crate::state::{Extent, damping, force_gate, session_json, write};
use crate::view::{Transform, View};
use serde_json::{Value, json};

/// Emulated version of the service.
const VERSION: &str = "3.5.0";

/// Carries out a request and returns the reply.
pub(crate) fn answer(service: &Service, request: &Request) -> Answer {
    let (path, query) = request.target.split_once('?').unwrap_or((&request.target, ""));
    let parts: Vec<&str> = path.split('/').filter(|part| !part.is_empty()).collect();
    let body: Value = serde_json::from_str(&request.body).unwrap_or(Value::Null);
    route(service, &request.method, &parts, query, &body)
}

fn ok() -> Answer {
    (200, json!({ "ok": true }))
}

fn done(data: Value) -> Answer {
    (200, json!({ "ok": true, "data": data }))
}

fn route(service: &Service, method: &str, parts: &[&str], query: &str, body: &Value) -> Answer {
    match (method, parts) {
        ("GET", [] | ["version"] | ["3.0" | "3.1", "version"]) => (200, version()),
        ("GET", ["devices"]) => (200, devices(service)),
        ("GET", ["expert", "status"]) => {
            let devices = service.host.stations().len();
            (200, json!({ "detection": {}, "devices": devices, "sessions": sessions(service), "global": {} }))
        }
        ("GET", ["sessions"]) => {
            let sessions = sessions(service);
            done(json!({ "session_count": sessions.len(), "sessions": sessions }))
        }
        (_, ["sessions", id, rest @ ..]) => session(service, method, id, rest, body),
        ("GET", ["settings"]) => done(json!(service.shared().settings)),
        ("POST", ["settings"]) => match body {
            Value::Object(settings) => {
                let mut shared = service.shared();
                stored(settings.iter().all(|(key, value)| shared.keep_setting(key, value)))
            }
            _ => failed(400, "the settings must be a JSON object"),
        },
        (_, ["settings", key]) => setting(service, method, key, body),
        ("POST", ["save_configuration"] | ["ports", _, "reset"]) => ok(),
        (_, [kind, device, "config", name @ ..]) => {
            configured(service, method, [kind, device], &name.join("/"), query, body)
        }
        (_, [kind, device, "state", "transform"]) => {
            configured(service, method, [kind, device], "transform", query, body)
        }
        _ => unknown_route(method, parts),
    }
}

fn unknown_route(method: &str, parts: &[&str]) -> Answer {
    let path = parts.join("/");
    failed(404, &format!("unknown route `{method} /{path}`; see the documentation of the service"))
}

/// Returns the reply to a request to store a setting: success, or status 507 if there was no room.
fn stored(had_room: bool) -> Answer {
    let full = format!("the settings need more than {MOST_SETTINGS_BYTES} bytes; shorten or delete some");
    if had_room { ok() } else { failed(507, &full) }
}

fn sessions(service: &Service) -> Vec<Value> {
    service.shared().sessions.iter().map(session_json).collect()
}

fn version() -> Value {
    json!({
        "build_time": "", "git_branch": "", "git_describe": format!("{VERSION}-flotor-{}", env!("CARGO_PKG_VERSION")),
        "git_hash": "", "git_tag": VERSION, "project_name": "flotor-haply-service", "project_version": format!("{VERSION}.0"),
    })
}

/// Returns the inventory, as a new session sees it.
fn devices(service: &Service) -> Value {
    let mut text = String::new();
    write(&mut text, service, 0, Extent::Inventory);
    serde_json::from_str(&text).unwrap_or_default()
}

fn session(service: &Service, method: &str, id: &str, rest: &[&str], body: &Value) -> Answer {
    let mut shared = service.shared();
    let own = id.parse().ok().and_then(|id| shared.session_mut(id));
    let Some(own) = own else { return unknown_session(id) };
    match (method, rest) {
        ("GET", []) => done(session_json(own)),
        ("GET", ["profile"]) => done(json!({ "name": own.profile })),
        ("POST", ["profile"]) => match body.get("name").and_then(Value::as_str) {
            Some(name) => {
                name.clone_into(&mut own.profile);
                done(json!({ "name": name }))
            }
            None => failed(400, "the profile needs a text `name`"),
        },
        ("DELETE", ["profile"]) => {
            "default".clone_into(&mut own.profile);
            ok()
        }
        _ => unknown_route(method, &[&["sessions", id][..], rest].concat()),
    }
}

fn unknown_session(which: &str) -> Answer {
    failed(404, &format!("`{which}` selects no session; `GET /sessions` lists the sessions"))
}

fn setting(service: &Service, method: &str, key: &str, body: &Value) -> Answer {
    let mut shared = service.shared();
    match method {
        "GET" => match shared.settings.get(key) {
            Some(value) => (200, value.clone()),
            None => failed(404, &format!("unknown setting `{key}`; set the setting with POST first")),
        },
        "POST" => stored(shared.keep_setting(key, body)),
        "DELETE" => {
            shared.settings.remove(key);
            ok()
        }
        _ => failed(405, "use GET, POST or DELETE"),
    }
}

/// Returns the numbers of the devices that a path selects, and their kind: 0 for arms, 1 for grips; `None` without a match.
fn selected(service: &Service, [kind, device]: [&str; 2]) -> Option<(Vec<usize>, usize)> {
    let count = service.host.stations().len();
    let (part, name): (usize, fn(usize) -> String) = match kind {
        "inverse3" | "inverse3x" | "minverse" | "*inverse" => (0, inverse_id),
        "verse_grip" | "wireless_verse_grip" | "custom_verse_grip" | "*verse_grip" => (1, grip_id),
        _ => return None,
    };
    let numbers = match (device, device.parse::<usize>()) {
        ("*", _) => (0..count).collect(),
        (_, Ok(index)) if index < count => vec![index],
        _ => (0..count).filter(|number| name(*number).eq_ignore_ascii_case(device)).collect::<Vec<_>>(),
    };
    (!numbers.is_empty()).then_some((numbers, part))
}

/// Returns the ids of the sessions that a query selects: by id, by profile and index, or all without `session=`.
fn of_query(shared: &Shared, query: &str) -> Vec<u64> {
    let expression = query.split('&').find_map(|pair| pair.strip_prefix("session=")).map(decoded);
    let ids = |sessions: Vec<&Session>| sessions.into_iter().map(|session| session.id).collect();
    let Some(expression) = expression else { return ids(shared.sessions.iter().collect()) };
    if let Ok(id) = expression.trim_start_matches('#').parse::<u64>() {
        return ids(shared.session(id).into_iter().collect());
    }
    let (profile, index) = expression.trim_start_matches(':').rsplit_once(':').map_or_else(
        || match expression.strip_prefix(':') {
            Some(index) => ("*".to_owned(), index.to_owned()),
            None => (expression.clone(), "0".to_owned()),
        },
        |(profile, index)| (profile.to_owned(), index.to_owned()),
    );
    // The name of the profile contains colons, and there is no index.
    let (profile, index) = match index.parse::<i64>() {
        Ok(index) => (profile, index),
        Err(_) => (expression.trim_start_matches(':').to_owned(), 0),
    };
    let found: Vec<&Session> =
        shared.sessions.iter().filter(|session| is_like(&session.profile, &profile)).collect();
    let distance = usize::try_from(index.unsigned_abs()).ok();
    // A negative index counts from the end.
    let place =
        if index < 0 { distance.and_then(|distance| found.len().checked_sub(distance)) } else { distance };
    ids(place.and_then(|place| found.get(place).copied()).into_iter().collect())
}

/// Returns true if a name matches a pattern with `*` and `?`.
fn is_like(name: &str, pattern: &str) -> bool {
    let (name, pattern): (Vec<char>, Vec<char>) = (name.chars().collect(), pattern.chars().collect());
    let (mut at, mut of, mut star) = (0, 0, None);
    while let Some(letter) = name.get(at) {
        match pattern.get(of) {
            Some('*') => {
                star = Some((at, of));
                of += 1;
            }
            Some(wanted) if *wanted == '?' || wanted == letter => (at, of) = (at + 1, of + 1),
            // Backtrack: the last `*` matches one character more.
            _ => match star {
                Some((from, place)) => {
                    star = Some((from + 1, place));
                    (at, of) = (from + 1, place + 1);
                }
                None => return false,
            },
        }
    }
    pattern.get(of..).unwrap_or_default().iter().all(|rest| *rest == '*')
}

/// Decodes the `%` escapes of a query.
fn decoded(text: &str) -> String {
    let mut bytes = Vec::new();
    let mut rest = text.as_bytes();
    while let Some((first, after)) = rest.split_first() {
        let escaped = (*first == b'%').then(|| after.get(..2)).flatten();
        let byte = escaped.and_then(|digits| u8::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok());
        bytes.push(byte.unwrap_or(*first));
        rest = if byte.is_some() { after.get(2..).unwrap_or_default() } else { after };
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

fn configured(
    service: &Service,
    method: &str,
    device: [&str; 2],
    name: &str,
    query: &str,
    body: &Value,
) -> Answer {
    let Some((numbers, part)) = selected(service, device) else {
        let device = device.join("/");
        return failed(404, &format!("unknown device `{device}`; `GET /devices` lists the devices"));
    };
    if method == "GET" && (numbers.len() > 1 || device[1] == "*") {
        return failed(400, "a wildcard cannot be read; give one device");
    }
    let mut shared = service.shared();
    let at_first = kept_at_first();
    if let (0, Some((name, first))) = (part, at_first.get_key_value(name)) {
        let kept = numbers.iter().filter_map(|number| shared.kept.get(*number)?.get(name).cloned()).next();
        return match method {
            "GET" => done(kept.unwrap_or_default()),
            "POST" | "DELETE" => {
                let value = if method == "POST" { body } else { first };
                for number in numbers {
                    shared.kept.get_mut(number).map(|kept| kept.insert(name, value.clone()));
                }
                done(value.clone())
            }
            _ => failed(405, "use GET, POST or DELETE"),
        };
    }
    let sessions = of_query(&shared, query);
    if sessions.is_empty() {
        return unknown_session(query);
    }
    let mut last = Value::Null;
    for id in sessions {
        let Some(own) = shared.session_mut(id) else { continue };
        for number in &numbers {
            let Some(view) = own.views.get_mut(*number).and_then(|views| views.get_mut(part)) else {
                continue;
            };
            match change(view, method, name, body) {
                Ok(value) => last = value,
                Err(answer) => return answer,
            }
        }
    }
    done(last)
}

/// Settings and their methods.
const METHODS: &str = "basis, damping, force_gate, mount, preset and transform have GET, POST and DELETE, mount and transform also \
PATCH; an arm has GET, POST and DELETE of gravity_compensation, handedness, home_return and torque_scaling, too";

/// Reads or changes a setting of a view; returns its value after the change.
fn change(view: &mut View, method: &str, name: &str, body: &Value) -> Result<Value, Answer> {
    let plain = View::default();
    let short = name.strip_prefix("filters/").unwrap_or(name);
    let patched = |before: &Transform| {
        before.patched(body.get("transform").unwrap_or(body)).ok_or_else(|| failed(400, NO_TRANSFORM))
    };
    match (method, short) {
        ("GET", _) => {}
        ("POST" | "PATCH", "transform") => view.workspace = patched(&view.workspace)?,
        ("POST", _) => set(view, short, body).map_err(|why| failed(400, &why))?,
        ("PATCH", "mount") => view.set_mount(patched(&view.mount)?),
        ("DELETE", "basis") => view.basis = plain.basis,
        ("DELETE", "mount" | "preset") => {
            view.set_preset("defaults");
        }
        ("DELETE", "damping") => view.damping = plain.damping,
        ("DELETE", "force_gate") => view.force_gate = plain.force_gate,
        ("DELETE", "transform") => view.workspace = plain.workspace,
        _ => return Err(failed(405, &format!("no {method} of the setting `{name}`; {METHODS}"))),
    }
    match short {
        "basis" => Ok(json!({ "permutation": view.basis.name() })),
        "mount" => Ok(json!({ "transform": view.mount.to_json() })),
        "preset" => Ok(json!({ "preset": view.preset })),
        "damping" => Ok(damping(view)),
        "force_gate" => Ok(force_gate(view)),
        "transform" => Ok(json!({ "transform": view.workspace.to_json() })),
        _ => Err(failed(404, &format!("unknown setting `{name}`; {METHODS}"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shared() -> Shared {
        let session = |id, profile: &str| Session {
            id,
            profile: profile.to_owned(),
            started: String::new(),
            views: Vec::new(),
        };
        let sessions = vec![session(4, "default"), session(5, "co.haply.hub::demo-orb"), session(7, "myapp")];
        Shared { sessions, ..Shared::default() }
    }

    #[test]
    fn a_selector_finds_sessions_by_number_place_and_profile() {
        let shared = shared();
        let cases: [(&str, &[u64]); 13] = [
            ("", &[4, 5, 7]),
            ("session=%235", &[5]),
            ("session=7", &[7]),
            ("session=9", &[]),
            ("session=:0", &[4]),
            ("session=:-1", &[7]),
            ("session=:-4", &[]),
            ("session=myapp", &[7]),
            ("session=myapp:0", &[7]),
            ("session=myapp:1", &[]),
            ("session=:default:0", &[4]),
            ("session=co.haply.hub::*:0", &[5]),
            ("session=co.haply.hub::demo-orb", &[5]),
        ];
        for (query, ids) in cases {
            assert_eq!(of_query(&shared, query), ids, "{query}");
        }
    }

    #[test]
    fn names_fit_patterns_and_escapes_are_undone() {
        assert!(is_like("co.haply", "co.*") && is_like("abc", "a?c") && is_like("", "*"));
        assert!(!is_like("abc", "a?") && !is_like("a", "") && !is_like("ac", "a?c"));
        assert_eq!((decoded("%23a%2"), decoded("%")), ("#a%2".to_owned(), "%".to_owned()));
    }
}
