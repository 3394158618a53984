//! What a device plugin is tested for on whatever stands in for its device: the rules of the contract, and the demo.

use crate::library::{plugin_file, rules_of_a_device};
use crate::program::{Flotor, exit_code};
use crate::scratch::Scratch;
use crate::workspace_root;

/// That `flotor validate` checks every rule of a device on a plugin with these parameters (`KEY=VALUE`), and each holds.
///
/// # Panics
/// If one does not hold, or is not checked.
pub fn assert_every_rule_holds(package: &str, parameters: &[&str]) {
    let library = plugin_file(package).display().to_string();
    let sets = parameters.iter().flat_map(|parameter| ["--set", *parameter]);
    let ran = Flotor::with(["validate", &library, "--timeout", "60s"].into_iter().chain(sets)).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    assert_eq!(ran.stdout.matches("  ok ").count(), rules_of_a_device(), "{}", ran.stdout);
}

/// The demo with two lines changed: the plugin of the device, and one of its parameters. The path of the scene.
///
/// # Panics
/// If the demo has no such lines.
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

/// That `flotor run` with these arguments, and these variables of the environment, runs to its end with a force.
///
/// # Panics
/// If it does not.
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
