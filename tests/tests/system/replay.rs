//! A recording is asked again: what a person set for that stays set, the models find the files of the run,
//! and a difference nobody asked for is explained by what the recording itself tells.

use flotor_core::trace::{Events, TickRecord};
use flotor_core::{Clock, ModelOutputs};
use flotor_hal::{DVec3, Wrench};
use flotor_record::{NamedFile, Recorder, Recording, RunDescription};
use flotor_tests::TestSize;
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use serde_json::Value;
use std::path::{Path, PathBuf};

const DEVICE: &str = "[device]\nplugin = \"simulated\"\n[device.parameters]\nhand = \"oscillate\"\n\
                      hand_centre_mm = -2\nhand_amplitude_mm = 1\nhand_frequency_hz = 2\n";

/// Runs the text of a scene on the virtual clock; the recording.
fn recorded(scratch: &Scratch, scene: &str) -> PathBuf {
    let scene = scratch.file("scene.toml", scene).display().to_string();
    let recording = scratch.path().join("run.mcap");
    let to = recording.display().to_string();
    let ran = Flotor::with(["run", &scene, "--clock", "virtual", "--record", &to]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    recording
}

fn replay(recording: &Path, more: &[&str]) -> Flotor {
    let recording = recording.display().to_string();
    Flotor::with(["replay", &recording].iter().chain(more))
}

/// The summary of a replay that ends with this code.
fn report(recording: &Path, more: &[&str], code: i32) -> Value {
    let ran = replay(recording, &[&["--json", "-"][..], more].concat()).run();
    assert_eq!(ran.code, Some(code), "{ran:?}");
    serde_json::from_str(&ran.stdout).expect("the summary is JSON")
}

fn text(report: &Value, key: &str) -> String {
    report[key].as_str().unwrap_or_else(|| panic!("no text `{key}` in {report}")).to_owned()
}

fn number(report: &Value, key: &str) -> u64 {
    report[key].as_u64().unwrap_or_else(|| panic!("no number `{key}` in {report}"))
}

/// A copy in which the run was described or went otherwise; records for which `edit` says `None` are lost.
fn copy(
    recording: &Path,
    name: &str,
    describe: impl FnOnce(&mut RunDescription),
    edit: impl Fn(TickRecord) -> Option<TickRecord>,
) -> PathBuf {
    let copy = recording.with_file_name(name);
    let mut whole = Recording::open(recording).expect("it was just recorded");
    let mut run = whole.run().clone();
    describe(&mut run);
    let _ = std::fs::remove_file(&copy); // of the edit before
    let mut recorder = Recorder::create(&copy, &run).expect("scratch can be written");
    while let Some(record) = whole.next() {
        let record = record.expect("it is whole");
        for change in whole.take_changes() {
            recorder.change(&change).expect("there is room");
        }
        if let Some(record) = edit(record) {
            recorder.record(&record).expect("there is room");
        }
    }
    recorder.finish().expect("there is room");
    copy
}

/// The same with the run described as it was.
fn edited(recording: &Path, edit: impl Fn(TickRecord) -> Option<TickRecord>) -> PathBuf {
    copy(recording, "edited.mcap", |_| (), edit)
}

/// Another wrench than the models would give, and what happened in that tick.
fn otherwise(record: TickRecord, events: Events) -> TickRecord {
    let mut other = record;
    let wrench = record.model.wrench().expect("it was recorded") + Wrench::from_force(DVec3::Z);
    let energy_j = record.model.energy_j().unwrap_or_default();
    other.model = ModelOutputs::new(wrench, energy_j).limited_to(record.model.computed());
    other.events.insert(events);
    other
}

// ---------------------------------------------------------------- what is set stays set

#[test]
fn a_value_set_for_one_plugin_is_not_forced_on_the_one_that_took_its_place() {
    let scratch = Scratch::default();
    let scene = format!(
        "duration_s = 1\n{DEVICE}[[model]]\nplugin = \"spring\"\n\
         [[change]]\nat_s = 0.4\nswap = \"spring\"\nplugin = \"wall\"\n\
         [change.parameters]\nstiffness_n_per_m = 400\n"
    );
    let recording = recorded(&scratch, &scene);
    assert_eq!(report(&recording, &[], exit_code::OK)["bit_exact"], Value::from(true));
    let other = report(&recording, &["--set", "spring.gamma_n=5"], exit_code::OK);
    let [first, last] = ["first_tick", "last_tick"].map(|key| number(&other, key));
    // The wall, which knows no `gamma_n`, is alone once the spring has faded: a tenth of a second, and a
    // tick's rounding.
    assert!(first < 400 && (400..=501).contains(&last), "{other}");
}

#[test]
fn a_value_set_for_another_plugin_is_held_against_what_changed_in_the_run() {
    let scratch = Scratch::default();
    let scene = format!(
        "duration_s = 1\n{DEVICE}[[model]]\nplugin = \"wall\"\n[model.parameters]\nstiffness_n_per_m = 300\n\
         [[change]]\nat_s = 0.5\nset = \"wall.stiffness_n_per_m=600\"\n"
    );
    let recording = recorded(&scratch, &scene);
    let set = ["--set", "wall.stiffness_n_per_m=0"];
    let alone = report(&recording, &set, exit_code::OK);
    let exchanged = report(&recording, &["--model", "wall=wall", set[0], set[1]], exit_code::OK);
    // In both, the whole recorded force is what is missing.
    for key in ["max_force_n", "first_tick", "last_tick"] {
        assert_eq!(alone[key], exchanged[key], "{key}");
    }
    assert!(number(&alone, "last_tick") > 900, "{alone}");
}

#[test]
fn another_plugin_takes_the_place_of_a_model_on_all_its_devices() {
    let scratch = Scratch::default();
    let device = |name: &str| DEVICE.replace("[device]", &format!("[[device]]\nname = \"{name}\""));
    let [left, right] = ["left", "right"].map(device);
    let scene = format!(
        "duration_s = 0.5\n{left}{right}[[model]]\nplugin = \"spring\"\ndevice = [\"left\", \"right\"]\n"
    );
    let recording = recorded(&scratch, &scene);
    let both = report(&recording, &["--model", "spring=wall"], exit_code::OK);
    let each = ["--model", "spring@left=wall", "--model", "spring@right=wall"];
    let each = report(&recording, &each, exit_code::OK);
    for key in ["differing_ticks", "max_force_n", "rms_force_n"] {
        assert_eq!(both[key], each[key], "{key}");
    }
    let one = report(&recording, &["--model", "spring@left=wall"], exit_code::OK);
    assert!(number(&one, "differing_ticks") < number(&both, "differing_ticks"), "{one} {both}");
    let unknown = replay(&recording, &["--model", "sprng=wall"]).run();
    assert_eq!(unknown.code, Some(exit_code::CONFIGURATION), "{unknown:?}");
    assert!(unknown.error().contains("spring@left, spring@right"), "{unknown:?}");
}

// ---------------------------------------------------------------- what is missing, and why it differs

/// The recording of a model that remembers nothing.
fn plain(scratch: &Scratch) -> PathBuf {
    recorded(scratch, &format!("duration_s = 1\n{DEVICE}[[model]]\nplugin = \"spring\"\n"))
}

#[test]
fn missing_ticks_are_told_and_do_not_matter_to_a_model_that_remembers_nothing() {
    let scratch = Scratch::default();
    let whole = plain(&scratch);
    let told = report(&whole, &[], exit_code::OK);
    assert_eq!((&told["complete"], number(&told, "missing_ticks")), (&Value::from(true), 0), "{told}");
    let gap = edited(&whole, |record| (!(500..510).contains(&record.tick)).then_some(record));
    let told = report(&gap, &[], exit_code::OK);
    assert_eq!((&told["bit_exact"], &told["complete"]), (&Value::from(true), &Value::from(false)), "{told}");
    assert_eq!((number(&told, "missing_ticks"), number(&told, "first_missing_tick")), (10, 500), "{told}");
    let words = replay(&gap, &[]).run().stdout;
    assert!(words.contains("but 10 ticks are missing"), "{words}");
}

/// Why a replay without any change fails, as JSON and as the words on standard error.
fn why(recording: &Path) -> (Value, String) {
    let told = report(recording, &[], exit_code::OTHER)["why_apart"].clone();
    let Ran { stderr, .. } = replay(recording, &[]).run();
    (told, stderr)
}

#[test]
fn what_the_run_itself_tells_is_the_cause_and_not_another_build() {
    let scratch = Scratch::default();
    let whole = plain(&scratch);
    let from_700 = |events: Events| {
        move |record: TickRecord| Some(if record.tick < 700 { record } else { otherwise(record, events) })
    };
    let (told, words) = why(&edited(&whole, from_700(Events::MODEL_FAULT)));
    assert_eq!((text(&told, "cause").as_str(), number(&told, "tick")), ("model_out", 700));
    assert!(words.contains("in tick 700") && !words.contains("another build"), "{words}");

    let (told, words) = why(&edited(&whole, from_700(Events::MODEL_OVERRUN)));
    assert_eq!((text(&told, "cause").as_str(), number(&told, "tick")), ("model_late", 700));
    assert!(words.contains("in tick 700") && !words.contains("another build"), "{words}");

    let gap = |record: TickRecord| from_700(Events::NONE)(record).filter(|record| record.tick / 10 != 60);
    let (told, words) = why(&edited(&whole, gap));
    assert_eq!((text(&told, "cause").as_str(), number(&told, "after_tick")), ("gap", 599));
    assert!(words.contains("ticks are missing after tick 599 (10 of them)"), "{words}");

    let late = |record: TickRecord| from_700(Events::NONE)(record).filter(|record| record.tick >= 300);
    let (told, words) = why(&edited(&whole, late));
    assert_eq!((text(&told, "cause").as_str(), number(&told, "first_tick")), ("joined_late", 300));
    assert!(words.contains("begins at tick 300"), "{words}");

    let (told, words) = why(&edited(&whole, from_700(Events::NONE)));
    assert_eq!(text(&told, "cause"), "other_build");
    assert!(words.contains("another build of the plugin, or another machine"), "{words}");
}

#[test]
fn an_overrun_that_changed_nothing_is_no_cause() {
    let scratch = Scratch::default();
    let whole = plain(&scratch);
    let edit = |mut record: TickRecord| {
        if record.tick == 100 {
            record.events.insert(Events::MODEL_OVERRUN);
        }
        Some(if record.tick == 700 { otherwise(record, Events::NONE) } else { record })
    };
    let recording = edited(&whole, edit);
    let (told, _) = why(&recording);
    assert_eq!(text(&told, "cause"), "other_build");
    let words = replay(&recording, &[]).run().stdout;
    assert!(words.contains("bit for bit before 700 and after 700"), "{words}");
}

#[test]
fn fields_of_a_run_in_real_time_cannot_be_repeated() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let scratch = Scratch::default();
    let scene =
        format!("duration_s = 0.5\n{DEVICE}[[model]]\nplugin = \"membrane\"\n[model.field]\nrate_hz = 200\n");
    let whole = recorded(&scratch, &scene);
    let in_real_time = |run: &mut RunDescription| run.clock = Clock::Real;
    let recording = copy(&whole, "real.mcap", in_real_time, |record| {
        Some(if record.tick < 400 { record } else { otherwise(record, Events::NONE) })
    });
    let (told, words) = why(&recording);
    assert_eq!(text(&told, "cause"), "field_on_real_clock");
    assert_eq!(text(&told, "model"), "membrane");
    assert!(words.contains("`membrane` ran asynchronously in real time"), "{words}");
}

#[test]
fn what_was_changed_is_not_the_only_cause_where_a_model_was_out() {
    let scratch = Scratch::default();
    let recording = edited(&plain(&scratch), |record| {
        Some(if record.tick < 700 { record } else { otherwise(record, Events::MODEL_FAULT) })
    });
    let set = ["--set", "spring.gamma_n=5"];
    let told = report(&recording, &set, exit_code::OK);
    assert_eq!(
        (number(&told, "first_tick") < 700, number(&told["why_apart"], "tick")),
        (true, 700),
        "{told}"
    );
    let words = replay(&recording, &set).run().stdout;
    assert!(words.contains("for another reason as well: in tick 700"), "{words}");
}

// ---------------------------------------------------------------- files

const SOFT: &str = "compression_mm,force_n\n0,0\n6,2\n12,5\n";
const STIFF: &str = "compression_mm,force_n\n0,0\n6,4\n12,10\n";

#[test]
fn the_file_of_the_run_is_found_or_the_replay_is_refused() {
    let scratch = Scratch::default();
    let curve = scratch.file("c.csv", SOFT);
    let model = "[[model]]\nplugin = \"measured\"\n[model.parameters]\ncurve = \"c.csv\"\n";
    let whole = recorded(&scratch, &format!("duration_s = 0.5\n{DEVICE}{model}"));
    let file = NamedFile::read(&curve).expect("it was just written");
    let beside = |run: &mut RunDescription| {
        let plugin = run.plugins.iter_mut().find(|plugin| plugin.id == "measured").expect("it ran");
        plugin.parameters.extend(file.to_parameters("curve"));
    };
    let recording = copy(&whole, "with-file.mcap", beside, Some);

    // Another file of that name, where the command runs, is not asked.
    let elsewhere = scratch.folder("elsewhere");
    std::fs::write(elsewhere.join("c.csv"), STIFF).expect("scratch can be written");
    let ran = replay(&recording, &[]).inside(&elsewhere).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");

    // Recording and file have travelled.
    let moved = scratch.folder("moved");
    for (from, name) in [(&recording, "run.mcap"), (&curve, "c.csv")] {
        std::fs::copy(from, moved.join(name)).expect("scratch can be written");
    }
    std::fs::remove_file(&curve).expect("it was there");
    let ran = replay(&moved.join("run.mcap"), &[]).inside(&elsewhere).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");

    let gone = replay(&recording, &[]).run();
    assert_eq!(gone.code, Some(exit_code::CONFIGURATION), "{gone:?}");
    assert!(gone.error().contains("no longer exists"), "{gone:?}");

    std::fs::write(&curve, STIFF).expect("scratch can be written");
    let other = replay(&recording, &[]).run();
    assert_eq!(other.code, Some(exit_code::CONFIGURATION), "{other:?}");
    let now = NamedFile::read(&curve).expect("it was just written").hash_text();
    for part in ["c.csv", &now, &file.hash_text(), "--set measured.curve=FILE"] {
        assert!(other.error().contains(part), "`{part}`: {other:?}");
    }
    // What a person names is not asked where it comes from.
    let named = format!("measured.curve={}", curve.display());
    let asked = replay(&recording, &["--set", &named]).run();
    assert_eq!(asked.code, Some(exit_code::OK), "{asked:?}");
}

// ---------------------------------------------------------------- a saved state

/// Objects with a history: friction, masses, a rod past buckling.
const WITH_HISTORY: [&str; 3] = [
    "plugin = \"wall\"\n[model.parameters]\nfriction = 0.5\n",
    "plugin = \"membrane\"\n",
    "plugin = \"spring\"\n[model.parameters]\npreset = \"slender\"\nvariant = \"rod\"\n",
];

#[test]
fn a_replay_from_a_saved_state_is_the_run_to_the_bit() {
    for model in WITH_HISTORY {
        let scratch = Scratch::default();
        let recording = recorded(&scratch, &format!("duration_s = 1\n{DEVICE}[[model]]\n{model}"));
        let state = scratch.path().join("state.json").display().to_string();
        let saved = report(&recording, &["--save-state", &state, "--at-tick", "617"], exit_code::OK);
        assert_eq!(saved["bit_exact"], Value::from(true), "{model}");
        let started = report(&recording, &["--from-state", &state], exit_code::OK);
        assert_eq!(started["bit_exact"], Value::from(true), "{model}");
        assert_eq!(number(&started, "begins_at_tick"), 617, "{model}");
        assert_eq!(number(&started, "ticks"), number(&saved, "ticks") - 617, "{model}");
    }
}

#[test]
fn a_saved_state_holds_what_changed_before_it() {
    let scratch = Scratch::default();
    let change = "[[change]]\nat_s = 0.4\nset = \"wall.friction=0.2\"\n";
    let scene = format!("duration_s = 1\n{DEVICE}[[model]]\n{}{change}", WITH_HISTORY[0]);
    let recording = recorded(&scratch, &scene);
    let state = scratch.path().join("state.json").display().to_string();
    report(&recording, &["--save-state", &state, "--at-tick", "617"], exit_code::OK);
    let started = report(&recording, &["--from-state", &state], exit_code::OK);
    assert_eq!(started["bit_exact"], Value::from(true));
}

#[test]
fn a_state_of_other_settings_or_of_no_tick_is_refused_in_one_line() {
    let scratch = Scratch::default();
    let recording = recorded(&scratch, &format!("duration_s = 0.5\n{DEVICE}[[model]]\n{}", WITH_HISTORY[0]));
    let state = scratch.path().join("state.json").display().to_string();
    report(&recording, &["--save-state", &state, "--at-tick", "300"], exit_code::OK);
    let version = std::fs::read_to_string(&state).expect("it was written");
    let other = scratch.file("other.json", version.replacen("\"version\":\"", "\"version\":\"9", 1));
    let other = other.display().to_string();
    let cases: [(&[&str], &str); 5] = [
        (
            &["--from-state", &state, "--set", "wall.friction=0.25"],
            "friction = 0.5, now it is 0.25; set friction to 0.5",
        ),
        (&["--from-state", &state, "--model", "wall=load"], "the snapshot is of `wall`, not of `load`"),
        (&["--from-state", &other], "save the state with this version"),
        (&["--save-state", &other, "--at-tick", "9999"], "the recording has no tick 9999"),
        (&["--from-state", "absent.json"], "absent.json: "),
    ];
    for (more, words) in cases {
        let ran = replay(&recording, more).run();
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
        assert!(
            ran.stderr.contains(words) && ran.stderr.trim_end().lines().count() == 1,
            "{more:?}: {ran:?}"
        );
    }
}
