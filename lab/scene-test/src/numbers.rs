//! Lookup of values in a run's JSON by path: `peak_force_n`, `energy.port_lowest_j`, `events.boundary`, `plugins.spring.health`.

use flotor_core::trace::Events;
use serde_json::Value;
use std::sync::OnceLock;

/// Returns the value at a path; `None` if the path does not exist or its value is null. List entries are addressed by name, or by
/// index from 0; an event that did not happen has the count 0.
pub(crate) fn at<'j>(json: &'j Value, path: &str) -> Option<&'j Value> {
    let found = path.split('.').try_fold(json, step);
    let is_event = || path.strip_prefix("events.").is_some_and(|event| Events::NAMES.contains(&event));
    found.or_else(|| is_event().then(|| NEVER.get_or_init(|| 0.into()))).filter(|value| !value.is_null())
}

/// Returns the model outputs that a run has to compute for the number at a path.
pub(crate) fn outputs_for(path: &str) -> &'static [&'static str] {
    if path == "energy.loop_generated_j" { &["torque", "energy"] } else { &[] }
}

/// Count of an event that did not happen.
static NEVER: OnceLock<Value> = OnceLock::new();

fn step<'j>(json: &'j Value, part: &str) -> Option<&'j Value> {
    match json {
        Value::Object(fields) => fields.get(part),
        Value::Array(entries) => {
            let named = entries.iter().find(|entry| entry.get("name").and_then(Value::as_str) == Some(part));
            named.or_else(|| entries.get(part.parse::<usize>().ok()?))
        }
        _ => None,
    }
}

/// Returns an error message with the nearest existing path if a path does not exist in the JSON of a run; `None` if the path
/// exists.
pub(crate) fn misspelt(json: &Value, path: &str) -> Option<String> {
    let mut paths = Vec::new();
    leaves(json, "", &mut paths);
    paths.extend(Events::NAMES.iter().map(|event| format!("events.{event}")));
    if paths.iter().any(|known| known == path) || path.split('.').try_fold(json, step).is_some_and(is_leaf) {
        return None;
    }
    Some(format!("a run has no number `{path}`{}", did_you_mean(path, paths.iter().map(String::as_str))))
}

fn is_leaf(value: &Value) -> bool {
    !(value.is_object() || value.is_array())
}

fn leaves(json: &Value, above: &str, found: &mut Vec<String>) {
    let mut below = |name: &str, value: &Value| {
        let path = if above.is_empty() { name.to_owned() } else { format!("{above}.{name}") };
        leaves(value, &path, found);
    };
    match json {
        Value::Object(fields) => fields.iter().for_each(|(name, value)| below(name, value)),
        Value::Array(entries) => {
            for (index, entry) in entries.iter().enumerate() {
                let name = entry.get("name").and_then(Value::as_str);
                below(name.unwrap_or(&index.to_string()), entry);
            }
        }
        _ => found.push(above.to_owned()),
    }
}

/// Returns a hint at the most similar known word; empty if none is similar.
pub(crate) fn did_you_mean<'k>(word: &str, known: impl Iterator<Item = &'k str>) -> String {
    let nearest = known
        .map(|known| (strsim::damerau_levenshtein(word, known), known))
        .min_by_key(|(distance, _)| *distance)
        .filter(|(distance, _)| *distance * 2 <= word.len().max(4));
    nearest.map_or_else(String::new, |(_, known)| format!("; did you mean `{known}`?"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_path_enters_tables_lists_and_events() {
        let json = json!({"peak_force_n": 2.5, "energy": {"port_end_j": null}, "events": {"ramping": 2},
            "plugins": [{"name": "device", "health": "ok"}, {"name": "spring", "health": "failed"}]});
        assert_eq!(at(&json, "peak_force_n"), Some(&json!(2.5)));
        assert_eq!(at(&json, "plugins.spring.health"), Some(&json!("failed")));
        assert_eq!(at(&json, "plugins.0.health"), Some(&json!("ok")));
        assert_eq!(at(&json, "events.boundary"), Some(&json!(0)));
        assert_eq!(at(&json, "energy.port_end_j"), None, "no value");
        for path in ["peak_force_n", "energy.port_end_j", "events.boundary", "plugins.0.health"] {
            assert_eq!(misspelt(&json, path), None);
        }
        let told = misspelt(&json, "energy.port_ends_j").unwrap();
        assert!(told.contains("did you mean `energy.port_end_j`?"), "{told}");
        let told = misspelt(&json, "events.bondary").unwrap();
        assert!(told.contains("did you mean `events.boundary`?"), "{told}");
        assert!(misspelt(&json, "energy").is_some(), "a table is no number");
    }
}
