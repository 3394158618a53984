//! Tests of a device plugin on an emulator or a service in place of its device: the rules of the contract, the demo, and the
//! message about a missing torque.

use crate::library::{plugin_file, rules_of_a_device};
use crate::program::{Flotor, exit_code};
use crate::scratch::Scratch;
use crate::workspace_root;

/// Asserts that `flotor validate` checks every rule of a device on the plugin of crate `package` with these parameters
/// (`KEY=VALUE`), and that every rule holds.
///
/// # Panics
/// If a rule does not hold, or is not checked.
pub fn assert_every_rule_holds(package: &str, parameters: &[&str]) {
    let library = plugin_file(package).display().to_string();
    let sets = parameters.iter().flat_map(|parameter| ["--set", *parameter]);
    let ran = Flotor::with(["validate", &library, "--timeout", "60s"].into_iter().chain(sets)).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    assert_eq!(ran.stdout.matches("  ok ").count(), rules_of_a_device(), "{}", ran.stdout);
}

/// Writes the scene of the demo with two changed lines, the plugin of the device and the line `preset = "plain"`; returns the
/// path of the scene.
///
/// # Panics
/// If the demo does not have exactly these lines, or the scene cannot be written.
#[must_use]
pub fn demo_on(scratch: &Scratch, plugin: &str, parameter: &str) -> String {
    let demo = std::fs::read_to_string(workspace_root().join("host/scenes/demo.toml")).expect("it is there");
    let changed = demo
        .replace("plugin = \"simulated\"", &format!("plugin = \"{plugin}\""))
        .replace("preset = \"plain\"", parameter);
    let differing = demo.lines().zip(changed.lines()).filter(|(before, after)| before != after).count();
    assert_eq!(differing, 2, "{changed}");
    scratch.file("demo.toml", changed).display().to_string()
}

/// Asserts that `flotor run` with these arguments and environment variables runs to the end of its scene, with a peak force
/// above 0.1 N.
///
/// # Panics
/// If the run fails, ends early, or has a smaller peak force.
pub fn assert_runs_with_force(scratch: &Scratch, arguments: &[&str], environment: &[(&str, &str)]) {
    let json = scratch.path().join("run.json");
    let name = json.display().to_string();
    let flotor = Flotor::with(["run", "--json", &name].iter().chain(arguments));
    let ran = environment.iter().fold(flotor, |flotor, (key, value)| flotor.env(key, value)).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    let summary = std::fs::read_to_string(json).expect("it was requested");
    let summary: serde_json::Value = serde_json::from_str(&summary).expect("it is JSON");
    assert_eq!(summary["end"], "finished", "{summary}");
    assert!(summary["peak_force_n"].as_f64().is_some_and(|peak_n| peak_n > 0.1), "{summary}");
}

/// Asserts that a run of a device without torque and a model with torque reports the missing torque, unless the scene itself
/// sets the torque limit to zero. `stderr_with` runs the device and a spring with this table in the scene, and returns standard
/// error.
///
/// # Panics
/// If the message is missing, or appears with the limit in the scene.
pub fn assert_missing_torque_is_told(stderr_with: impl Fn(&str) -> String) {
    let words = "`device` exerts no torque, so the hand cannot feel the torque of a model";
    let said = stderr_with("");
    assert!(said.contains(words), "{said}");
    let said = stderr_with("[limits]\ntorque_nm = [0, 0, 0]");
    assert!(!said.contains(words), "{said}");
}

/// Runs a spring on a device whose emulator or service is at `address`, with this table in the scene; returns standard error.
///
/// # Panics
/// If the run fails.
#[must_use]
pub fn said_of_a_spring_on(plugin: &str, address: &str, table: &str) -> String {
    let scratch = Scratch::default();
    let scene = format!(
        "duration_s = 0.1\n[device]\nplugin = \"{plugin}\"\n[device.parameters]\naddress = \"{address}\"\ntimeout_ms = 9000\n\
         [[model]]\nplugin = \"spring\"\n[model.parameters]\nvariant = \"energy\"\n{table}\n"
    );
    let scene = scratch.file("spring.toml", scene).display().to_string();
    let ran = Flotor::with(["run", &scene]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    ran.stderr
}
