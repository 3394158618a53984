//! No message for a person contains a value as Rust's `Debug` prints it: outside of tests and assertions, a source uses `{:?}` only for
//! a reader that is a program, or for numbers.

use flotor_tests::{files_under, workspace_root};
use std::collections::BTreeSet;
use std::path::Path;

/// Folders of the product.
const FOLDERS: [&str; 8] = ["devices", "hal", "host", "interop", "lab", "models", "study", "viewer"];
/// Sources that use `{:?}`, with the reader of the text.
const READERS: [(&str, &str); 18] = [
    ("devices/emulation/src/rig.rs", "a scene in TOML"),
    ("devices/maglev/emulator/src/bin/flotor-maglev-emulator/main.rs", "a log: the name of a mode"),
    ("devices/maglev/emulator/src/bin/flotor-maglev-emulator/ml_api.rs", "a scene in TOML"),
    ("devices/maglev/emulator/src/bin/flotor-maglev-emulator/proxy.rs", "a scene in TOML"),
    ("devices/maglev/emulator/src/ml_api/server/state.rs", "a log: the name of a phase"),
    ("hal/loader/src/capabilities.rs", NUMBERS),
    ("hal/src/extension/calibration.rs", NUMBERS),
    ("lab/identify/src/curve.rs", "a scene in TOML"),
    ("lab/measure/src/cli/eval.rs", "a number of a CSV file"),
    ("interop/python/src/model.rs", "`repr` of Python"),
    ("host/record/src/run.rs", "a setting of a recording"),
    ("host/session/src/calibration_file.rs", NUMBERS),
    ("lab/scene-test/src/bless.rs", "a number of a TOML file"),
    ("study/program/src/study/spring.rs", "a scene in TOML"),
    ("interop/sweep/src/design.rs", "a key of the store"),
    ("models/solid/src/law.rs", "the key of a prepared solid"),
    ("models/surface/src/store.rs", "the key of a prepared surface"),
    ("viewer/drawing/src/light.rs", "a shader"),
];
/// What has an exponent so where it is large.
const NUMBERS: &str = "a person: numbers alone";
/// Beginnings of statements whose text is for a developer.
const ASSERTIONS: [&str; 4] = ["assert", "debug_assert", "panic!", "unreachable!"];

/// Lines outside of tests, comments and assertions that print a value by `Debug`.
fn lines_with_debug(source: &str) -> Vec<&str> {
    let product = source.split("#[cfg(test)]").next().unwrap_or_default();
    let mut is_assertion = false;
    let mut found = Vec::new();
    for line in product.lines().map(str::trim_start).filter(|line| !line.starts_with("//")) {
        is_assertion |= ASSERTIONS.iter().any(|start| line.starts_with(start));
        if !is_assertion && (line.contains(":?}") || line.contains(":#?}")) {
            found.push(line);
        }
        is_assertion &= !line.ends_with(';');
    }
    found
}

/// Whether a source is part of the product.
fn is_product(file: &Path) -> bool {
    let apart = ["tests", "benches", "examples", "fuzz"];
    file.file_name().is_some_and(|name| name != "tests.rs")
        && file.iter().all(|part| apart.iter().all(|folder| part != *folder))
}

#[test]
fn only_programs_read_texts_of_debug() {
    let sources = FOLDERS.into_iter().flat_map(|folder| files_under(folder, "rs").expect("it is there"));
    let mut found = BTreeSet::new();
    for file in sources.filter(|file| is_product(file)) {
        let source = std::fs::read_to_string(workspace_root().join(&file)).expect("it can be read");
        let lines = lines_with_debug(&source);
        let name = file.display().to_string();
        let has_reader = READERS.iter().any(|(listed, _)| *listed == name);
        assert!(has_reader || lines.is_empty(), "{name} prints a value of Rust's Debug: {lines:#?}");
        found.extend((!lines.is_empty()).then_some(name));
    }
    let listed: BTreeSet<String> = READERS.iter().map(|(name, _)| (*name).to_owned()).collect();
    assert_eq!(listed.difference(&found).collect::<Vec<_>>(), Vec::<&String>::new(), "no longer needed");
}

#[test]
fn a_text_of_debug_is_found_in_a_message_and_not_in_an_assertion() {
    let message = "fn f() {\n    format!(\n        \"at {pose:?}\"\n    )\n}\n";
    assert_eq!(lines_with_debug(message), ["\"at {pose:?}\""]);
    for other in [
        "    assert!(\n        is_right,\n        \"{pose:?}\"\n    );\n",
        "// at {pose:?}\n",
        "#[cfg(test)]\nmod tests {\n    let text = format!(\"{pose:?}\");\n}\n",
    ] {
        assert_eq!(lines_with_debug(other), Vec::<&str>::new(), "{other}");
    }
}
