//! The plugin of the Novint Falcon on an emulated device in another process: the rules of the contract, and the demo.

use flotor_tests::library::{build_folder, plugin_file, rules_of_a_device};
use flotor_tests::process::Owned;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::workspace_root;
use rustix::process::Signal;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::Duration;

/// The emulator in a process of its own; ended with the test.
pub(super) struct Emulator {
    process: Owned,
    pub(super) address: String,
}

impl Emulator {
    pub(super) fn start(arguments: &[&str]) -> Self {
        let program = build_folder().join(format!("flotor-falcon-emulator{}", std::env::consts::EXE_SUFFIX));
        let mut command = Command::new(program);
        let mut process = Owned::start(
            command
                .args(["--listen", "127.0.0.1:0"])
                .args(arguments)
                .stdout(Stdio::piped())
                .stderr(Stdio::piped()),
        );
        let mut first = String::new();
        let output = process.stdout.take().expect("a pipe was requested");
        BufReader::new(output).read_line(&mut first).expect("its output is text");
        let address = first.trim().strip_prefix("listening ").expect("the first line says where it is");
        Self { process, address: address.to_owned() }
    }
}

#[test]
fn with_an_emulator_every_rule_is_checked_and_holds() {
    let emulator = Emulator::start(&[]);
    let library = plugin_file("flotor-falcon").display().to_string();
    let address = format!("address={}", emulator.address);
    let ran = Flotor::with([
        "validate",
        &library,
        "--timeout",
        "60s",
        "--set",
        &address,
        "--set",
        "timeout_ms=9000",
    ])
    .run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    assert_eq!(ran.stdout.matches("  ok ").count(), rules_of_a_device(), "{}", ran.stdout);
}

/// The demo with the two lines of the device changed; then the cable is pulled.
#[test]
fn the_demo_runs_on_it_with_two_changed_lines_and_ends_when_it_is_gone() {
    let emulator = Emulator::start(&[]);
    let text = std::fs::read_to_string(workspace_root().join("host/scenes/demo.toml")).expect("it is there");
    let changed = text
        .replace("plugin = \"simulated\"", "plugin = \"falcon\"")
        .replace("preset = \"plain\"", &format!("address = \"{}\"", emulator.address));
    let differing = text.lines().zip(changed.lines()).filter(|(before, after)| before != after).count();
    assert_eq!(differing, 2);
    let scratch = Scratch::default();
    let scene = scratch.file("demo.toml", changed).display().to_string();
    let json = scratch.path().join("run.json");
    let json_path = json.display().to_string();
    let long = ["--set", "device.timeout_ms=9000"];
    let arguments = ["run", &scene, "--duration", "2s", "--json", &json_path];
    let ran = Flotor::with([&arguments[..], &long].concat()).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    let summary = std::fs::read_to_string(&json).expect("it was requested");
    let summary: serde_json::Value = serde_json::from_str(&summary).expect("it is JSON");
    assert!(summary["peak_force_n"].as_f64().is_some_and(|peak_n| peak_n > 0.1), "{summary}");

    let running = Flotor::with([&["run", &scene, "--duration", "60s"][..], &long].concat()).start();
    std::thread::sleep(Duration::from_millis(1500));
    emulator.process.signal(Signal::KILL);
    let ran = running.wait();
    assert_eq!(ran.code, Some(exit_code::DEVICE_FAULT), "{ran:#?}");
    assert!(ran.stderr.contains("the device is gone"), "{ran:#?}");
}
