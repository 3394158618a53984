//! Same binary, same seed, same inputs: the same bits. And what the virtual clock is for: speed.

use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use serde_json::Value;

/// Runs the demo on the virtual clock; its summary.
fn summary(more: &[&str]) -> Value {
    let mut arguments = vec!["run", "--clock", "virtual", "--seed", "1", "--json", "-"];
    arguments.extend(more);
    let ran = Flotor::with(arguments).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    serde_json::from_str(&ran.stdout).expect("the summary is JSON")
}

fn digest(summary: &Value) -> &str {
    summary["trace_digest"].as_str().expect("a digest is text")
}

#[test]
fn the_same_run_leaves_the_same_trace() {
    assert_eq!(digest(&summary(&[])), digest(&summary(&[])));
}

#[test]
fn another_parameter_leaves_another_trace() {
    let softer = summary(&["--set", "spring.gamma_n=16.96"]);
    assert_ne!(digest(&summary(&[])), digest(&softer));
}

#[test]
fn observers_do_not_touch_the_run() {
    let scratch = Scratch::default();
    let (recording, plot) = (scratch.path().join("run.mcap"), scratch.path().join("run.svg"));
    let watched =
        summary(&["--record", &recording.display().to_string(), "--plot", &plot.display().to_string()]);
    assert_eq!(digest(&summary(&[])), digest(&watched));
    assert!(std::fs::read_to_string(plot).expect("the plot is there").starts_with("<svg"));
}

#[test]
fn a_recording_replays_bit_for_bit_and_a_changed_one_does_not() {
    let scratch = Scratch::default();
    let recording = scratch.path().join("run.mcap").display().to_string();
    let _ = summary(&["--duration", "2s", "--record", &recording]);
    let same = Flotor::with(["replay", &recording, "--json", "-"]).run();
    assert_eq!(same.code, Some(exit_code::OK), "{same:?}");
    let report: Value = serde_json::from_str(&same.stdout).expect("the report is JSON");
    assert_eq!((&report["bit_exact"], &report["ticks"]), (&Value::from(true), &Value::from(2000)));
    let changed = Flotor::with(["replay", &recording, "--set", "spring.gamma_n=18", "--json", "-"]).run();
    assert_eq!(changed.code, Some(exit_code::OK), "{changed:?}");
    let report: Value = serde_json::from_str(&changed.stdout).expect("the report is JSON");
    // The axial force scales with gamma: 18 / 16.97 - 1 of a peak of some newtons.
    assert!(report["max_force_n"].as_f64().is_some_and(|force_n| force_n > 0.1), "{report}");
}

/// Virtual seconds per wall-clock second over a minute of the demo; best of three, since neighbours only slow it.
fn speed(more: &[&str]) -> f64 {
    let mut arguments = vec!["--duration", "60s"];
    arguments.extend(more);
    let once = || {
        let summary = summary(&arguments);
        summary["elapsed_s"].as_f64().unwrap_or(0.0) / summary["wall_s"].as_f64().unwrap_or(f64::INFINITY)
    };
    (0..3).map(|_| once()).fold(0.0, f64::max)
}

#[test]
fn the_virtual_clock_is_200_times_real_time_100_with_preset_full_and_10_with_a_recording() {
    if cfg!(debug_assertions) {
        eprintln!("skipped: this is a promise of optimised builds; `cargo test --release` checks it");
        return;
    }
    let scratch = Scratch::default();
    let (bare, recorded) =
        (speed(&[]), speed(&["--record", &scratch.path().join("run.mcap").display().to_string()]));
    let full = speed(&["--set", "device.preset=full"]);
    println!(
        "{bare:.0} times real time, {recorded:.0} times with a recording, {full:.0} times with preset full"
    );
    assert!(full >= 100.0, "{full:.0} times real time with preset full");
    assert!(bare >= 200.0, "{bare:.0} times real time");
    assert!(recorded >= 10.0, "{recorded:.0} times real time with a recording");
}
