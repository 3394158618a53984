//! Reference of all keys of a scene, generated from the reader's own lookups, for the book and for editors.

use super::Scene;
use super::reader::{Known, SceneError, Source, Takes, legal};
use std::path::Path;

/// Scene with every table, so that the reader looks up every key.
const EVERY_TABLE: &str = r#"
[[device]]
plugin = "device"
name = "left"
[[device]]
plugin = "device"
name = "right"
[[coupling]]
[[coupling.end]]
device = "left"
[coupling.end.mapping]
[[coupling.end]]
device = "right"
[[model]]
plugin = "model"
device = "left"
[model.mapping.grid]
count = 1
spacing_mm = 0
[model.blend]
[model.field]
rate_hz = 1
[limits]
[boundary]
[[change]]
at_s = 0
set = "left.key=0"
"#;

/// Reference of one table of a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SectionReference {
    /// Name as in a table header, such as `model.mapping`; empty for the keys above all tables.
    pub name: String,
    /// Keys in the order of their lookup.
    pub keys: Vec<KeyReference>,
}

/// Reference of one key of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeyReference {
    /// Name of the key.
    pub key: &'static str,
    /// Type and range as text; empty if only the book describes them.
    pub takes: String,
}

/// Returns all tables of a scene, sorted by name, with all keys. Not real-time.
///
/// # Errors
/// Never in practice: a test parses the scene with every table.
pub fn reference() -> Result<Vec<SectionReference>, SceneError> {
    let source = Source::new(Path::new("every table"), EVERY_TABLE);
    Scene::read(&source)?;
    let mut sections: Vec<SectionReference> = source.into_seen().into_iter().map(section).collect();
    // Outer tables are finished after inner ones: sorted by name, the outermost first, and without duplicates.
    sections.sort_by(|a, b| a.name.cmp(&b.name));
    sections.dedup_by(|a, b| a.name == b.name);
    Ok(sections)
}

fn section((name, known): (String, Vec<Known>)) -> SectionReference {
    let key = |Known { key, takes }: Known| KeyReference { key, takes: words(&takes) };
    SectionReference { name, keys: known.into_iter().map(key).collect() }
}

fn words(takes: &Takes) -> String {
    match takes {
        Takes::Value => String::new(),
        Takes::Number(range) => format!("a number, {}", legal(range)),
        Takes::Three(range) => format!("three numbers, or one for all, {}", legal(range)),
        Takes::Bound(range) => {
            format!("one number, a norm; three, one for each axis; or `{{ norm, axes }}`; {}", legal(range))
        }
        Takes::Table => "a table".to_owned(),
        Takes::Tables => "tables, any number of them".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_table_is_there_with_its_keys() {
        let sections = reference().expect("the specimen is a scene");
        let names: Vec<&str> = sections.iter().map(|section| section.name.as_str()).collect();
        assert_eq!(
            names,
            [
                "",
                "boundary",
                "change",
                "coupling",
                "coupling.end",
                "coupling.end.mapping",
                "device",
                "limits",
                "model",
                "model.blend",
                "model.field",
                "model.mapping",
                "model.mapping.grid"
            ]
        );
        let rate = sections[0].keys.iter().find(|key| key.key == "rate_hz").expect("a scene has a rate");
        assert_eq!(rate.takes, "a number, 100 to 10000");
    }
}
