//! A running loop is changed from outside: a change comes at its tick and at once for all models, is
//! told to observers before that tick, and a recording repeats it bit for bit.

use flotor_core::trace::{Events, TickRecord};
use flotor_core::{Change, ChangeOutcome};
use flotor_record::Recorder;
use flotor_servo::{Clock, StopSwitch};
use flotor_session::scene::Scene;
use flotor_session::{ControlError, Controls, NewValue, Observer, RunOptions, RunRecording};
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::watched::{prepared, watch};
use serde_json::Value;
use std::path::Path;

/// Two springs side by side on the simulated flotor, held by a hand.
const TWO_SPRINGS: &str = r#"
duration_s = 2

[device]
plugin = "simulated"

[[model]]
plugin = "spring"
name = "first"

[[model]]
plugin = "spring"
name = "second"
"#;

fn with(changes: &str) -> String {
    format!("{TWO_SPRINGS}\n{changes}")
}

fn changed_ticks(records: &[TickRecord]) -> Vec<u64> {
    let changed = |record: &&TickRecord| record.events.intersects(Events::PARAMETER_CHANGED);
    records.iter().filter(changed).map(|record| record.tick).collect()
}

#[test]
fn a_scheduled_change_is_felt_from_its_tick_on_and_not_before() {
    let plain = watch(TWO_SPRINGS);
    let changed = watch(&with("[[change]]\nat_s = 0.7004\nset = \"first.gamma_n=30\"\n"));
    // 0.7004 s lies between two ticks: the one after it is the first that knows.
    assert_eq!(changed_ticks(&changed.records), [701]);
    let same = |(a, b): &(&TickRecord, &TickRecord)| a.model == b.model && a.pose == b.pose;
    let first = plain.records.iter().zip(&changed.records).position(|pair| !same(&pair));
    assert_eq!(first, Some(701), "the wrench differs from the changed tick on");
    let [(seen, change)] = changed.changes.as_slice() else { panic!("{:?}", changed.changes) };
    assert_eq!((*seen, change.tick, change.time_ns), (701, 701, 701_000_000), "told before its tick");
    assert_eq!((change.plugin.as_str(), change.parameter.as_str()), ("first", "gamma_n"));
    assert_eq!((change.value.as_str(), change.number), ("30", 30.0));
    assert_eq!(change.outcome, ChangeOutcome::Applied);
}

#[test]
fn changes_of_one_time_reach_all_models_in_one_tick() {
    let both = r#"[[change]]
at_s = 1.0
set = ["first.gamma_n=8.485", "second.gamma_n=8.485"]
"#;
    let (plain, halved) = (watch(TWO_SPRINGS), watch(&with(both)));
    assert_eq!(changed_ticks(&halved.records), [1000]);
    let (before, after) = (plain.records[1000].model, halved.records[1000].model);
    assert!(before.force().z.abs() > 0.1, "the hand is in the springs at that time: {before:?}");
    // The law is homogeneous in gamma once all rigidities scale with it; along the axis gamma alone counts.
    let ratio = after.force().z / before.force().z;
    assert!((ratio - 0.5).abs() < 0.02, "both springs are half as stiff in the same tick: {ratio}");
}

#[test]
fn a_value_that_does_not_fit_is_refused_by_the_plugin_and_the_run_goes_on() {
    // In mode gamma, alpha follows from gamma.
    let refused = watch(&with("[[change]]\nat_s = 1\nset = \"first.alpha_n_mm2=100\"\n"));
    assert_eq!(refused.changes.len(), 1);
    assert_eq!(refused.changes[0].1.outcome, ChangeOutcome::Refused);
    let plain = watch(TWO_SPRINGS);
    let same = plain.records.iter().zip(&refused.records).all(|(a, b)| a.model == b.model);
    assert!(same && refused.records.len() == plain.records.len());
}

/// Sends changes when it sees a tick.
struct Meddler<'a> {
    controls: Controls,
    at_tick: u64,
    act: &'a dyn Fn(&Controls),
    changes: Vec<Change>,
    ticks: u64,
}

impl Observer for Meddler<'_> {
    fn observe(&mut self, record: &TickRecord) {
        self.ticks += 1;
        if record.tick == self.at_tick {
            (self.act)(&self.controls);
        }
    }

    fn change(&mut self, change: &Change) {
        self.changes.push(change.clone());
    }
}

/// Runs the two springs; at tick 100, as observed, somebody acts on the loop.
fn meddle(act: &dyn Fn(&Controls)) -> (Vec<Change>, u64) {
    let session = prepared(Clock::Virtual, TWO_SPRINGS);
    let controls = session.controls();
    let mut meddler = Meddler { controls, at_tick: 100, act, changes: Vec::new(), ticks: 0 };
    let outcome = session.run(&mut meddler, &StopSwitch::default()).expect("it runs");
    assert!(outcome.elapsed_ns > 0);
    (meddler.changes, meddler.ticks)
}

#[test]
fn what_is_sent_together_is_applied_together() {
    let (changes, _) = meddle(&|controls| {
        let value = |plugin, value| NewValue { plugin, parameter: "gamma_n", value };
        let both = [value("first", "20"), value("second", "21")];
        controls.set_parameters_at_once(&both).expect("both are right");
    });
    let told: Vec<(&str, &str)> = changes.iter().map(|c| (c.plugin.as_str(), c.value.as_str())).collect();
    assert_eq!(told, [("first", "20"), ("second", "21")]);
    assert_eq!(changes[0].tick, changes[1].tick);
}

/// A slider that jumps to the end of its range must not make the force jump: from 16.97 to 10 000 N in two ticks was a limit
/// cycle of 140 N at the hand.
#[test]
fn a_live_request_moves_at_the_rate_of_the_soft_range_and_every_step_is_reported() {
    let (changes, _) = meddle(&|controls| {
        let value = |plugin, value| NewValue { plugin, parameter: "gamma_n", value };
        controls.set_parameters(&[value("first", "10000"), value("second", "17.5")]).expect("both are legal");
    });
    let of =
        |plugin| changes.iter().filter(move |change| change.plugin == plugin).map(|change| change.number);
    let (first, second): (Vec<f64>, Vec<f64>) = (of("first").collect(), of("second").collect());
    // From a third of 16.97 N to three times it, a tenth of that in 50 ms: 0.0905 N in a tick.
    let most = (3.0 - 1.0 / 3.0) * 16.97 * 2.0 * 1.0e-3;
    let steps = |values: &[f64]| values.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
    assert!(first[0] - 16.97 <= most * 1.001 && steps(&first) <= most * 1.001, "{most}: {first:?}");
    let last = *first.last().expect("it moves");
    assert!(last > 16.97 && last < 16.97 + 2.0 * 2.0 * (3.0 - 1.0 / 3.0) * 16.97, "{last} after two seconds");
    assert_eq!(second.last(), Some(&17.5), "what is near is reached: {second:?}");
    assert!(changes.iter().all(|change| change.outcome == ChangeOutcome::Applied));
}

/// Steps are changes of the recording: a replay needs no rate, and is not slowed.
#[test]
fn a_recording_of_a_live_request_replays_bit_for_bit() {
    let scratch = Scratch::default();
    let path = scratch.path().join("moved.mcap");
    let session = prepared(Clock::Virtual, TWO_SPRINGS);
    let scene = Scene::parse(Path::new("scene.toml"), TWO_SPRINGS).expect("the scene is right");
    let options = RunOptions { clock: Clock::Virtual, seed: 1 };
    let run = flotor_session::run_description::describe(&scene, &options, session.plugins());
    struct Recording<'a>(Meddler<'a>, RunRecording);
    impl Observer for Recording<'_> {
        fn observe(&mut self, record: &TickRecord) {
            self.0.observe(record);
            self.1.observe(record);
        }
        fn change(&mut self, change: &Change) {
            self.0.change(change);
            self.1.change(change);
        }
    }
    let act: &dyn Fn(&Controls) =
        &|controls| controls.set_parameter("first", "gamma_n", "40").expect("it is legal");
    let meddler = Meddler { controls: session.controls(), at_tick: 100, act, changes: Vec::new(), ticks: 0 };
    let recorder = Recorder::create(&path, &run).expect("a scratch file");
    let mut both = Recording(meddler, RunRecording::new(Some(recorder)));
    session.run(&mut both, &StopSwitch::default()).expect("it runs");
    both.1.finish(&[]).expect("the disk is not full");
    assert!(both.0.changes.len() > 20, "{}", both.0.changes.len());
    let ran = Flotor::with(["replay", &path.display().to_string(), "--json", "-"]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let summary: Value = serde_json::from_str(&ran.stdout).expect("the summary is JSON");
    assert_eq!(summary["bit_exact"], Value::from(true), "{summary}");
}

/// A spring the device cannot render: the force swings between its limits, is damped, and the run is ended with the reason,
/// although nobody watches.
#[test]
fn a_run_whose_force_swings_between_its_limits_is_damped_and_ended() {
    let scratch = Scratch::default();
    let scene = scratch.file("scene.toml", TWO_SPRINGS).display().to_string();
    let sets = ["--set", "first.gamma_n=10000", "--set", "second.gamma_n=10000"];
    let arguments = ["run", &scene, "--clock", "virtual", "--duration", "20s", "--json", "-"];
    let ran = Flotor::with(arguments.into_iter().chain(sets)).run();
    assert_eq!(ran.code, Some(exit_code::DEVICE_FAULT), "{ran:?}");
    assert!(ran.stderr.contains("oscillated between its limits"), "{ran:?}");
    let summary: Value = serde_json::from_str(&ran.stdout).expect("the summary is JSON");
    assert_eq!(summary["end"], Value::from("oscillation"), "{summary}");
    assert!(summary["events"]["oscillation_damped"].as_u64() > Some(0), "{summary}");
    assert!(summary["elapsed_s"].as_f64() < Some(10.0), "{summary}");
}

#[test]
fn what_is_wrong_with_a_change_is_said_before_it_reaches_the_loop() {
    let (changes, ticks) = meddle(&|controls| {
        let complaint = |plugin, parameter, value| {
            controls.set_parameter(plugin, parameter, value).expect_err("it is wrong").to_string()
        };
        assert_eq!(
            complaint("frist", "gamma_n", "20"),
            "the run has no plugin `frist`; did you mean `first`? (its plugins: device, first, second)"
        );
        assert_eq!(
            complaint("first", "gama_n", "20"),
            "[first] no parameter `gama_n`; did you mean `gamma_n`?"
        );
        assert!(complaint("first", "gamma_n", "1e9").contains("must be 0.01 to 10000 N"));
        let fixed = complaint("first", "variant", "thesis");
        assert!(
            fixed.starts_with(
                "[first] `variant` cannot change while the loop runs; parameters that can change then: "
            ),
            "{fixed}"
        );
        // One that is wrong holds back the others of its group.
        let value = |parameter| NewValue { plugin: "first", parameter, value: "20" };
        assert!(controls.set_parameters(&[value("gamma_n"), value("nothing")]).is_err());
    });
    assert_eq!((changes.len(), ticks), (0, 2000));
}

#[test]
fn a_sender_is_told_when_the_loop_is_busy_and_when_it_is_over() {
    let session = prepared(Clock::Virtual, TWO_SPRINGS);
    let controls = session.controls();
    let value = NewValue { plugin: "first", parameter: "gamma_n", value: "20" };
    let send = || controls.set_parameters_at_once(&[value]);
    let sent = std::iter::repeat_with(send).take(10_000).take_while(Result::is_ok).count();
    assert!((1..10_000).contains(&sent));
    assert_eq!(send(), Err(ControlError::Busy));
    let mut meddler = Meddler {
        controls: controls.clone(),
        at_tick: u64::MAX,
        act: &|_| (),
        changes: Vec::new(),
        ticks: 0,
    };
    assert!(session.run(&mut meddler, &StopSwitch::default()).is_ok());
    assert_eq!(meddler.changes.len(), sent, "nothing that was accepted is lost");
    assert_eq!(send(), Err(ControlError::Ended));
}

#[test]
fn a_scheduled_change_that_is_wrong_is_refused_with_file_and_line() {
    let scratch = Scratch::default();
    let error = |changes: &str| {
        let scene = scratch.file("scene.toml", with(changes));
        let ran = Flotor::with(["run", &scene.display().to_string(), "--clock", "virtual"]).run();
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
        let line = ran.error().split_once("scene.toml:").expect("it names the file").1;
        line.to_owned()
    };
    assert_eq!(
        error("[[change]]\nat_s = 1\nset = \"first.gama_n=20\"\n"),
        "17: `change.set`: [first] no parameter `gama_n`; did you mean `gamma_n`?"
    );
    assert!(
        error("[[change]]\nat_s = 1\nset = \"gamma_n\"\n").starts_with("17: `change.set`: `gamma_n` is not ")
    );
    assert_eq!(error("[[change]]\nset = \"first.gamma_n=20\"\n"), "15: `change.at_s` is missing");
}

#[test]
fn a_recording_with_changes_replays_bit_for_bit_unless_the_parameter_is_held() {
    let scratch = Scratch::default();
    let recording = scratch.path().join("run.mcap").display().to_string();
    let changes = r#"
[[change]]
at_s = 0.5
set = "first.gamma_n=20.123456789012345"

[[change]]
at_s = 1.0
set = ["first.gamma_n=0.1", "second.beta_n=50", "second.gamma_n=12"]
"#;
    let scene = scratch.file("scene.toml", with(changes)).display().to_string();
    let ran = Flotor::with(["run", &scene, "--clock", "virtual", "--record", &recording]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let replay = |more: &[&str]| -> Value {
        let arguments = ["replay", &recording, "--json", "-"].into_iter().chain(more.iter().copied());
        let ran = Flotor::with(arguments).run();
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
        serde_json::from_str(&ran.stdout).expect("the summary is JSON")
    };
    assert_eq!(replay(&[])["bit_exact"], Value::from(true));
    let held = replay(&["--set", "first.gamma_n=16.97"]);
    assert_eq!(held["first_tick"], Value::from(500), "{held}");
}
