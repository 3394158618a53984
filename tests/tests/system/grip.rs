//! A grip from the fingers to the recording: what is felt there, what limits it, and what takes it away.

use flotor_core::grip::GripRecord;
use flotor_core::trace::{Events, TickRecord};
use flotor_record::{Recording, TraceDigest};
use flotor_servo::RunEnd;
use flotor_tests::library::plugin_file;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::watched::{Watched, watch};
use serde_json::Value;
use std::path::Path;

/// Stiffness, N/m, and width, m, of the thing between the fingers.
const STIFFNESS_N_PER_M: f64 = 500.0;
const WIDTH_M: f64 = 0.015;

/// Fingers that close on a thing twice, with further tables.
fn fingers(tables: &str) -> String {
    format!(
        "duration_s = 2\n[device]\nplugin = \"simulated\"\n[device.parameters]\nfingers = \"on\"\n\
         [[model]]\nplugin = \"load\"\n[model.parameters]\ngrip_stiffness_n_per_m = {STIFFNESS_N_PER_M}\n\
         grip_width_mm = 15\n{tables}"
    )
}

/// The faulty device with a grip at 10 mm, on a thing of 15 mm.
fn faulty(fault: &str) -> String {
    format!(
        "duration_s = 0.2\n[device]\nplugin = \"{}\"\n[device.parameters]\ngrip = \"on\"\n{fault}\n\
         [[model]]\nplugin = \"load\"\n[model.parameters]\ngrip_stiffness_n_per_m = {STIFFNESS_N_PER_M}\n\
         grip_width_mm = 15\n[limits]\nramp_s = 0\n",
        plugin_file("fixture-faulty-device").display()
    )
}

fn grip(record: &TickRecord) -> GripRecord {
    record.grip.expect("the device has a grip")
}

fn digest(run: &Watched) -> String {
    let mut digest = TraceDigest::new();
    run.records.iter().for_each(|record| digest.update(record));
    digest.finish()
}

fn felt(opening_m: f64) -> f64 {
    (STIFFNESS_N_PER_M * (WIDTH_M - opening_m)).max(0.0)
}

#[test]
fn a_thing_between_the_fingers_is_felt_fades_in_and_keeps_to_the_limits() {
    let run = watch(&fingers("[limits]\ngrip_force_n = 1\n"));
    let mut last = 0.0;
    for record in &run.records {
        let GripRecord { state, model, commanded } = grip(record);
        // Scales of one change no bit.
        assert_eq!(model.to_bits(), felt(state.opening).to_bits(), "tick {}", record.tick);
        assert!((0.0..=1.0).contains(&commanded), "tick {}: {commanded}", record.tick);
        // Full scale in a millisecond, and a rounding.
        assert!((commanded - last).abs() <= 8.0 + 1.0e-12, "tick {}: {last} to {commanded}", record.tick);
        let is_limited = record.events.intersects(Events::FORCE_LIMITED);
        match record.events.intersects(Events::RAMPING) {
            true => assert!(commanded <= model, "tick {}", record.tick),
            false => {
                assert_eq!((commanded, is_limited), (model.min(1.0), model > 1.0), "tick {}", record.tick)
            }
        }
        last = commanded;
    }
    let most = run.records.iter().map(|record| grip(record).commanded).fold(0.0, f64::max);
    assert_eq!(most, 1.0, "a hand of 400 N/m that closes by 10 mm more presses with more than a newton");
}

#[test]
fn a_grip_that_nothing_acts_on_changes_nothing_for_the_handle() {
    let scene = fingers("").replace("= 500", "= 0");
    let (with, without) = (watch(&scene), watch(&scene.replace("fingers = \"on\"\n", "")));
    let handle = |run: &Watched| -> Vec<_> {
        run.records
            .iter()
            .map(|record| (record.pose, record.commanded, record.delivered, record.events))
            .collect()
    };
    assert!(handle(&with) == handle(&without));
    assert!(without.records.iter().all(|record| record.grip.is_none()));
    assert!(with.records.iter().any(|record| grip(record).state.opening < 0.006), "the fingers close");
    assert_ne!(digest(&with), digest(&without));
}

#[test]
fn a_model_in_a_process_of_its_own_acts_at_the_grip_with_the_same_bits() {
    let isolated = fingers("").replace("plugin = \"load\"\n", "plugin = \"load\"\nisolation = \"process\"\n");
    let scratch = Scratch::default();
    let digest = |name: &str, scene: String| {
        let scene = scratch.file(name, scene).display().to_string();
        let ran = Flotor::with(["run", &scene, "--clock", "virtual", "--json", "-"]).run();
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
        let summary: Value = serde_json::from_str(&ran.stdout).expect("the summary is JSON");
        assert!(
            summary["devices"][0]["peak_grip_force_n"].as_f64().is_some_and(|peak_n| peak_n > 1.0),
            "{summary}"
        );
        summary["trace_digest"].clone()
    };
    assert_eq!(digest("here.toml", fingers("")), digest("process.toml", isolated));
}

#[test]
fn a_recorded_grip_is_replayed_to_the_bit_and_drawn() {
    let scratch = Scratch::default();
    let scene = scratch.file("grip.toml", fingers("")).display().to_string();
    let [recording, picture] =
        ["run.mcap", "run.svg"].map(|name| scratch.path().join(name).display().to_string());
    let ran =
        Flotor::with(["run", &scene, "--clock", "virtual", "--record", &recording, "--plot", &picture]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let picture = std::fs::read_to_string(picture).expect("it was drawn");
    assert!(picture.contains("Opening of the grip") && picture.contains("Effort at the grip"));
    let recorded = Recording::open(Path::new(&recording)).expect("it was just recorded");
    let recorded: Vec<_> = recorded.map(|record| grip(&record.expect("it is whole"))).collect();
    let run = watch(&fingers(""));
    assert!(recorded.iter().eq(run.records.iter().map(grip).collect::<Vec<_>>().iter()));
    let replay = |more: &[&str]| -> Value {
        let ran = Flotor::with(["replay", &recording, "--json", "-"].iter().chain(more)).run();
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
        serde_json::from_str(&ran.stdout).expect("the summary is JSON")
    };
    let same = replay(&[]);
    assert_eq!((&same["bit_exact"], &same["max_effort"]), (&true.into(), &0.0.into()), "{same}");
    let softer = replay(&["--set", "load.grip_stiffness_n_per_m=200"]);
    let deepest_m = recorded.iter().map(|grip| WIDTH_M - grip.state.opening).fold(0.0, f64::max);
    let differs = softer["max_effort"].as_f64().expect("a number");
    // Two products and a difference of numbers of a few newtons.
    assert!((differs - 300.0 * deepest_m).abs() < 1.0e-12, "{softer}");
    assert_eq!((&softer["bit_exact"], &softer["max_force_n"]), (&false.into(), &0.0.into()), "{softer}");
}

#[test]
fn a_scaled_scene_scales_the_grip_as_the_handle() {
    let scaled = fingers("[model.mapping]\nmotion_scale = 2\nforce_scale = 0.5\n");
    for record in &watch(&scaled).records {
        let GripRecord { state, model, .. } = grip(record);
        // Powers of two change no bit of a mantissa.
        assert_eq!(model, 0.5 * felt(2.0 * state.opening), "tick {}", record.tick);
    }
}

#[test]
fn whatever_takes_the_force_of_the_handle_takes_that_of_the_grip() {
    let run = watch(&faulty("fault = \"over-temperature\"\nat_tick = 50"));
    assert!(run.records.iter().take(50).skip(1).all(|record| grip(record).commanded == felt(0.01)));
    assert_eq!(run.records.last().map(|record| (record.tick, grip(record).commanded)), Some((50, 0.0)));

    let run = watch(&faulty("fault = \"stale-samples\"\nat_tick = 50"));
    assert_eq!(run.outcome.end, RunEnd::Finished);
    for record in run.records.iter().skip(1) {
        let expected = if record.events.intersects(Events::HOLDING) { 0.0 } else { felt(0.01) };
        assert_eq!(grip(record).commanded, expected, "tick {}", record.tick);
    }
}

#[test]
fn a_grip_that_fails_takes_all_force_with_it() {
    let run = watch(&faulty("fault = \"nan-grip\"\nat_tick = 50"));
    for record in run.records.iter().skip(1) {
        let (force_n, effort) = (record.commanded.force().z, grip(record).commanded);
        assert!(grip(record).state.opening.is_finite(), "tick {}", record.tick);
        match record.tick {
            ..50 => assert!(force_n < 0.0 && effort == felt(0.01), "tick {}", record.tick),
            // Ten ticks without a usable sample are borne.
            60.. => assert_eq!((force_n, effort), (0.0, 0.0), "tick {}", record.tick),
            _ => assert!(record.events.intersects(Events::NOT_FINITE), "tick {}", record.tick),
        }
    }
    let run = watch(&faulty("fault = \"panics-in-grip\"\nat_tick = 50"));
    assert!(matches!(run.outcome.end, RunEnd::DeviceFault(_)), "{:?}", run.outcome.end);
    assert_eq!(run.records.last().map(|record| record.tick), Some(50));
}

#[test]
fn a_grip_that_no_host_can_limit_is_refused_in_one_line() {
    let scratch = Scratch::default();
    let scene = scratch.file("bad.toml", faulty("fault = \"bad-grip\"")).display().to_string();
    let ran = Flotor::with(["run", &scene, "--clock", "virtual"]).run();
    assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{ran:?}");
    assert!(
        ran.stderr.contains("the grip is of kind 0") && ran.stderr.trim().lines().count() == 1,
        "{ran:?}"
    );
}
