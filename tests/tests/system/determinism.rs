//! Same binary, same seed, same inputs: the same bits. And what the virtual clock is for: speed.

use flotor_core::trace::{RECORD_WORDS, TIMING_WORDS, TickRecord};
use flotor_record::TraceDigest;
use flotor_servo::{Clock, StopSwitch};
use flotor_session::{Observer, Session};
use flotor_sync::Words;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::tools::skipped;
use flotor_tests::watched::{prepared, watch};
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
    let report: Value = serde_json::from_str(&same.stdout).expect("the summary is JSON");
    assert_eq!((&report["bit_exact"], &report["ticks"]), (&Value::from(true), &Value::from(2000)));
    let changed = Flotor::with(["replay", &recording, "--set", "spring.gamma_n=18", "--json", "-"]).run();
    assert_eq!(changed.code, Some(exit_code::OK), "{changed:?}");
    let report: Value = serde_json::from_str(&changed.stdout).expect("the summary is JSON");
    // The axial force scales with gamma: 18 / 16.97 - 1 of a peak of some newtons.
    assert!(report["max_force_n"].as_f64().is_some_and(|force_n| force_n > 0.1), "{report}");

    let plot = scratch.path().join("difference.svg").display().to_string();
    let arguments = ["replay", &recording, "--model", "spring=wall", "--json", "-", "--plot", &plot];
    let other = Flotor::with(arguments).run();
    assert_eq!(other.code, Some(exit_code::OK), "{other:?}");
    let report: Value = serde_json::from_str(&other.stdout).expect("the summary is JSON");
    assert!(report["differing_ticks"].as_u64().is_some_and(|ticks| ticks > 1000), "{report}");
    let picture = std::fs::read_to_string(plot).expect("the picture is there");
    assert!(picture.starts_with("<svg") && picture.contains("Difference of force"));
    assert!(picture.contains("difference of torque (0 throughout)"), "neither model has a torque");
    let unknown = Flotor::with(["replay", &recording, "--model", "sprng=wall"]).run();
    assert_eq!(unknown.code, Some(exit_code::CONFIGURATION), "{unknown:?}");
}

/// The digest of a run whose observer may dawdle at a tick.
fn digest_of(session: Session, dawdle: fn(u64)) -> String {
    struct Digest(TraceDigest, fn(u64));
    impl Observer for Digest {
        fn observe(&mut self, record: &TickRecord) {
            (self.1)(record.tick);
            self.0.update(record);
        }
    }
    let mut digest = Digest(TraceDigest::new(), dawdle);
    session.run(&mut digest, &StopSwitch::default()).expect("it runs");
    digest.0.finish()
}

const CHANGING: &str = r#"
duration_s = 2
[device]
plugin = "simulated"
[device.parameters]
preset = "full"
[[model]]
plugin = "spring"
[[model]]
plugin = "wall"
[model.blend]
weight = 0
[model.mapping]
position_mm = [0, 0, -2]
[[change]]
at_s = 0.7
weight = ["spring=0.2", "wall=1"]
[[change]]
at_s = 1.1
set = "spring.gamma_n=25"
"#;

#[test]
fn sessions_side_by_side_do_not_touch_each_other() {
    let alone = digest_of(prepared(Clock::Virtual, CHANGING), |_| ());
    let beside: Vec<String> = std::thread::scope(|scope| {
        let run = |_| scope.spawn(|| digest_of(prepared(Clock::Virtual, CHANGING), |_| ()));
        let threads: Vec<_> = (0..4).map(run).collect();
        threads.into_iter().map(|thread| thread.join().expect("it ends")).collect()
    });
    assert_eq!(beside, [alone.as_str(); 4]);
}

#[test]
fn a_slow_observer_slows_the_run_and_changes_nothing() {
    let quick = digest_of(prepared(Clock::Virtual, CHANGING), |_| ());
    let slow = digest_of(prepared(Clock::Virtual, CHANGING), |tick| {
        if tick.is_multiple_of(97) {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
    });
    assert_eq!(quick, slow);
}

#[test]
fn a_shorter_run_is_the_beginning_of_a_longer_one() {
    let records = |duration: &str| watch(&CHANGING.replace("duration_s = 2", duration)).records;
    let whole = records("duration_s = 2");
    // Ends before, at, between and after the changes, and in the middle of a batch of ticks.
    for (duration, ticks) in
        [("duration_s = 0.7", 700), ("duration_s = 0.701", 701), ("duration_s = 1.5", 1500)]
    {
        let part = records(duration);
        assert_eq!(part.len(), ticks);
        let same = |(a, b): (&TickRecord, &TickRecord)| {
            let (a, b) = (a.to_words(), b.to_words());
            a[..RECORD_WORDS - TIMING_WORDS] == b[..RECORD_WORDS - TIMING_WORDS]
        };
        assert!(part.iter().zip(&whole).all(same), "{duration}");
    }
}

/// Virtual seconds per wall-clock second over a minute of the demo; best of three, since neighbours only slow it.
fn speed(more: &[&str]) -> f64 {
    let once = |_| {
        // A recording is not overwritten.
        let scratch = Scratch::default();
        let recording = scratch.path().join("run.mcap").display().to_string();
        let more = more.iter().map(|word| if *word == "RECORDING" { recording.as_str() } else { word });
        let arguments: Vec<&str> = ["--duration", "60s"].into_iter().chain(more).collect();
        let summary = summary(&arguments);
        summary["elapsed_s"].as_f64().unwrap_or(0.0) / summary["wall_s"].as_f64().unwrap_or(f64::INFINITY)
    };
    (0..3).map(once).fold(0.0, f64::max)
}

#[test]
fn a_recording_costs_a_virtual_run_at_most_a_factor_of_20_and_the_full_preset_4() {
    if cfg!(debug_assertions) {
        skipped("a promise of optimised builds; `cargo test --release` checks it");
        return;
    }
    let (bare, recorded) = (speed(&[]), speed(&["--record", "RECORDING"]));
    let full = speed(&["--set", "device.preset=full"]);
    println!(
        "{bare:.0} times real time, {recorded:.0} times with a recording, {full:.0} times with preset full"
    );
    assert!(bare > 0.0 && recorded >= bare / 20.0 && full >= bare / 4.0, "{bare} {recorded} {full}");
}
