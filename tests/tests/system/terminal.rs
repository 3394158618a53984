//! Names and messages of strangers reach a terminal without control characters, in results and in errors.

use flotor_tests::library::build_folder;
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;

/// Sets a title, rings, changes the colour, and reverses the direction of the text.
const HOSTILE: &str = "\u{1b}]0;owned\u{7}\u{1b}[31mRED\u{1b}[0m\u{202e}\u{9b}31m";
/// The end of the same name as a terminal receives it.
const SHOWN: &str = "RED\\u{1b}[0m\\u{202e}\\u{9b}31m";

/// All of the output is free of control characters, and one part of it shows the name.
#[track_caller]
fn assert_escaped(ran: &Ran) {
    let said = format!("{}{}", ran.stdout, ran.stderr);
    let controls: Vec<char> = (said.chars())
        .filter(|character| {
            character.is_control() && !"\n\t".contains(*character) || *character == '\u{202e}'
        })
        .collect();
    assert_eq!(controls, Vec::<char>::new(), "{ran:?}");
    assert!(said.contains(SHOWN), "{ran:?}");
}

#[test]
fn the_title_of_a_scene_and_the_name_of_a_recording_are_escaped() {
    let scratch = Scratch::default();
    // Other control characters are refused in a title.
    let scene = "title = \"\\u202e\"\n[device]\nplugin = \"simulated\"\n[[model]]\nplugin = \"spring\"\n";
    let scene = scratch.file("scene.toml", scene).display().to_string();
    let recording = scratch.path().join(format!("{HOSTILE}.mcap")).display().to_string();
    let run = ["run", &scene, "--clock", "virtual", "--duration", "10ms", "--record", &recording];
    let ran = Flotor::with(run).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    assert!(ran.stdout.starts_with("\\u{202e}\n"), "{ran:?}");
    let replayed = Flotor::with(["replay", &recording]).run();
    assert_eq!(replayed.code, Some(exit_code::OK), "{replayed:?}");
    assert_escaped(&replayed);
}

#[test]
fn the_folder_of_a_study_is_escaped() {
    let scratch = Scratch::default();
    let out = scratch.path().join(HOSTILE);
    let arguments =
        ["study", "jnd", "--subjects", "1", "--seed", "1", "--out", out.to_str().expect("it is text")];
    let ran = Flotor::with(arguments).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    assert_escaped(&ran);
}

#[test]
fn who_pressed_an_emergency_stop_is_escaped() {
    use std::os::unix::fs::DirBuilderExt;
    let scratch = Scratch::default();
    let folder = scratch.path().join("flotor");
    std::fs::DirBuilder::new().mode(0o700).create(&folder).expect("a scratch folder can be written to");
    let press = serde_json::json!({ "press": { "number": 1, "who": HOSTILE } });
    std::fs::write(folder.join("latch"), format!("{press}\n")).expect("likewise");
    let flotor = |arguments: &[&str]| {
        Flotor::with(arguments).env("XDG_RUNTIME_DIR", &scratch.path().display().to_string()).run()
    };
    let refused = flotor(&["run", "--duration", "100ms"]);
    assert_eq!(refused.code, Some(exit_code::DEVICE_FAULT), "{refused:?}");
    assert_escaped(&refused);
    let released = flotor(&["release"]);
    assert_eq!(released.code, Some(exit_code::OK), "{released:?}");
    assert_escaped(&released);
}

#[test]
fn options_that_do_not_exist_are_escaped() {
    let option = format!("--{HOSTILE}");
    for command in ["run", "study", "validate", "test", "calibrate", "scenes"] {
        // On a terminal the parser leaves the escapes of the argument beside its own colours.
        let ran = Flotor::with([command, &option]).env("NO_COLOR", "1").run();
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{command}: {ran:?}");
        assert_escaped(&ran);
    }
}

/// Arguments of a user, and names of devices, reach the lines and errors of emulators.
#[test]
fn lines_of_emulators_are_escaped() {
    let set = format!("{HOSTILE}=1");
    let cases: [&[&str]; 2] = [&["maglev", "--listen", HOSTILE], &["maglev", "--set", &set]];
    // Refused by the parser of the options.
    let option = format!("--{HOSTILE}");
    let refused = ["maglev", "falcon", "haply-service"].map(|emulator| [emulator, option.as_str()]);
    let is_built = |emulator: &str| build_folder().join(format!("flotor-{emulator}-emulator")).is_file();
    let refused = refused.iter().map(|arguments| &arguments[..]).filter(|arguments| is_built(arguments[0]));
    for arguments in cases.into_iter().chain(refused) {
        let ran = Flotor::with([&["emulate"], arguments].concat()).run();
        assert_ne!(ran.code, Some(exit_code::OK), "{arguments:?}: {ran:?}");
        assert_escaped(&ran);
    }
}
