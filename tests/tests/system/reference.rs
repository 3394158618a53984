//! The reference chapters of the book are what the program, the scene reader and the plugins say of themselves.
//!
//! After a change of one of them: `FLOTOR_WRITE_REFERENCE=1 cargo test -p flotor-tests reference`.

use flotor_hal::{Mutability, Parameter, ParameterKind};
use flotor_session::registry::load_file;
use flotor_session::scene::{SectionReference, reference};
use flotor_tests::commands::whole_program;
use flotor_tests::library::plugin_file;
use flotor_tests::{crate_name_of, plugin_folders, workspace_root};
use std::fmt::Write;

const NOTE: &str = "<!-- Made by `FLOTOR_WRITE_REFERENCE=1 cargo test -p flotor-tests reference`. -->\n\n";

/// Compares a chapter with what it must be; writes it first if asked to.
fn committed(chapter: &str, text: &str) {
    let path = workspace_root().join("docs/src/reference").join(chapter);
    if std::env::var_os("FLOTOR_WRITE_REFERENCE").is_some() {
        std::fs::create_dir_all(path.parent().expect("it lies in a folder"))
            .expect("the book can be written");
        std::fs::write(&path, text).expect("the book can be written");
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        committed == text,
        "docs/src/reference/{chapter} is out of date: FLOTOR_WRITE_REFERENCE=1 cargo test -p flotor-tests reference"
    );
}

fn all_commands() -> String {
    flotor_command::reference(&whole_program())
}

#[test]
fn commands() {
    let head = "# Reference: commands\n\nEvery command with its arguments, as `--help` prints them. \
                [Command line](../command-line.md) describes their purpose.\n\n";
    let commands = all_commands();
    committed("commands.md", &format!("{NOTE}{head}{commands}"));
}

/// Commands with an option, and what the reference says of it there.
fn with_option<'a>(reference: &'a str, option: &str) -> Vec<(&'a str, &'a str)> {
    let (mut command, mut found) = ("", Vec::new());
    for line in reference.lines() {
        command = line
            .trim_start_matches('#')
            .strip_prefix(" `flotor ")
            .map_or(command, |name| name.trim_end_matches('`'));
        if line.starts_with(&format!("| `{option}")) {
            found.push((command, line));
        }
    }
    found
}

#[test]
fn an_option_of_many_commands_is_the_same_in_each() {
    let reference = all_commands();
    for (option, row, commands) in [
        (
            "--json",
            "| `--json [FILE.json]` |  | Write the result as JSON to this file; without a file or with -, to standard output |",
            "run, replay, scenes, plugins, validate, test, jitter, stability, bench, stress, study check, study spring, \
             study power, study bias, analyse, calibrate vertical, calibrate verify, identify, doctor",
        ),
        (
            "--plugin-path",
            "| `--plugin-path FOLDER` |  | Folder to search for plugins before all others (repeatable) |",
            "run, replay, view, eval, plugins, validate, test, jitter, stability, bench, stress, study jnd, \
             study magnitude, study force, study explore, calibrate vertical, calibrate verify, lend, doctor",
        ),
        (
            "--accept-shared-control-group",
            "| `--accept-shared-control-group` |  | Accept a device without a watchdog of its own although a kill of this program's \
             control group also ends the watchdog process, and no process stops the device (default: refuse) |",
            "run, study jnd, study magnitude, study force, study explore, calibrate vertical, \
             calibrate verify, lend",
        ),
    ] {
        // The standard output of `lend` belongs to the program that it runs.
        let found: Vec<_> = with_option(&reference, option)
            .into_iter()
            .filter(|found| *found.0 != *"lend" || option != "--json")
            .collect();
        let names: Vec<_> = found.iter().map(|(command, _)| *command).collect();
        assert_eq!(names.join(", "), commands, "{option}");
        found.iter().for_each(|(command, told)| assert_eq!(*told, row, "{command}"));
    }
}

fn sections() -> Vec<SectionReference> {
    reference().expect("the reader reads its own specimen")
}

#[test]
fn scenes() {
    let mut text = format!(
        "{NOTE}# Reference: scenes\n\nEvery table of a scene and every key in it, as the reader looks for them. \
         [Scenes](../scenes.md) and [Safety envelope](../safety-envelope.md) tell what they mean and what holds without \
         them.\n\n"
    );
    for section in sections() {
        let title = if section.name.is_empty() {
            "Above all tables".to_owned()
        } else {
            format!("`[{}]`", section.name)
        };
        let _ = write!(text, "## {title}\n\n| Key | Takes |\n|---|---|\n");
        for key in section.keys {
            let _ = writeln!(text, "| `{}` | {} |", key.key, key.takes);
        }
        text.push('\n');
    }
    committed("scenes.md", &text);
}

#[test]
fn every_key_of_a_scene_is_told_in_the_book() {
    let book: String = ["docs/src/scenes.md", "docs/src/safety-envelope.md", "docs/src/teleoperation.md"]
        .map(|chapter| std::fs::read_to_string(workspace_root().join(chapter)).expect("a chapter is text"))
        .concat();
    for SectionReference { name, keys } in sections() {
        for key in keys {
            assert!(book.contains(key.key), "no chapter says what `{}` in [{name}] is", key.key);
        }
    }
}

fn range(parameter: &Parameter) -> String {
    let words: Vec<String> = parameter.choices().iter().map(|word| format!("`{}`", word.as_str())).collect();
    match parameter.kind() {
        ParameterKind::Real => format!("{} to {}", parameter.min(), parameter.max()),
        ParameterKind::Choice => words.join(", "),
        ParameterKind::Text => "text".to_owned(),
        ParameterKind::File if words.is_empty() => "a file".to_owned(),
        ParameterKind::File => format!("a file, or {}", words.join(", ")),
    }
}

fn default(parameter: &Parameter) -> String {
    match parameter.kind() {
        ParameterKind::Real => parameter.default().to_string(),
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // an index of a few words
        ParameterKind::Choice => {
            let word = parameter.choices().get(parameter.default() as usize);
            word.map_or_else(String::new, |word| format!("`{}`", word.as_str()))
        }
        ParameterKind::Text | ParameterKind::File => String::new(),
    }
}

#[test]
fn parameters() {
    let mut text = format!(
        "{NOTE}# Reference: parameters\n\nEvery parameter of the plugins in this repository, as their schemas describe it. Those \
         marked live may change while the loop runs.\n\n"
    );
    for folder in plugin_folders() {
        let plugin = load_file(&plugin_file(&crate_name_of(&folder))).expect("it is built and loads");
        let metadata = plugin.metadata();
        let _ = write!(text, "## `{}`\n\n{}: {}.\n\n", metadata.id, metadata.kind.name(), metadata.doc);
        text.push_str("| Parameter | Unit | Legal | Default | | |\n|---|---|---|---|---|---|\n");
        for parameter in plugin.parameters() {
            let live = if parameter.mutability() == Mutability::Live { "live" } else { "" };
            let unit = if parameter.unit() == "1" { "" } else { parameter.unit() };
            let (id, doc) = (parameter.id(), parameter.doc().replace('|', "\\|"));
            let (range, default) = (range(parameter), default(parameter));
            let _ = writeln!(text, "| `{id}` | {unit} | {range} | {default} | {live} | {doc} |");
        }
        text.push('\n');
    }
    committed("parameters.md", &text);
}
