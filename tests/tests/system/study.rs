//! Perception experiments through the program and through the library: what is felt, what survives a kill, what is
//! refused, and that a person at a keyboard goes the same way as a simulated observer.

#![allow(clippy::unwrap_used)] // tests may panic; counts

use flotor_core::trace::{Events, TickRecord};
use flotor_core::{Change, ChangeSubject};
use flotor_record::Recording;
use flotor_servo::StopSwitch;
use flotor_session::Observer;
use flotor_session::scene::Scene;
use flotor_study::apparatus::rig::{Rig, TrialFiles};
use flotor_study::apparatus::{Apparatus, Kinematics};
use flotor_study::log::{Incident, SittingLog};
use flotor_study::protocol::{JndProtocol, MagnitudeProtocol, Protocol, Stimulus, SubjectNumber};
use flotor_study::screen::{Input, May, Screen, ScreenStateMachine};
use flotor_study::sitting::Sitting;
use flotor_study::trial::{Exploration, Modality, Phase, Presented, Response, Trial};
use flotor_tests::TestSize;
use flotor_tests::library::plugin_file;
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::tools::{Tool, required};
use rustix::process::Signal;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

fn subject(number: u16) -> SubjectNumber {
    SubjectNumber::new(number).unwrap()
}

fn study(arguments: &[&str], out: &Path) -> Flotor {
    Flotor::with(["study"].iter().chain(arguments).chain(&["--out", out.to_str().unwrap()]))
}

fn one(number: u32, value: f64) -> Trial {
    Trial {
        number,
        phase: Phase::Main,
        replication: 1,
        track: 0,
        modality: Modality::Vh,
        presented: Presented::One { value },
        repeat: 0,
    }
}

/// Takes down how the commanded force changes from tick to tick.
#[derive(Default)]
struct Steepness {
    last_n: Option<f64>,
    largest_step_n: f64,
    slewed: u64,
    parameters: usize,
    plugins: usize,
}

impl Observer for Steepness {
    fn observe(&mut self, record: &TickRecord) {
        let force_n = record.commanded.force().z;
        if let Some(last_n) = self.last_n.replace(force_n) {
            self.largest_step_n = self.largest_step_n.max((force_n - last_n).abs());
        }
        self.slewed += u64::from(record.events.intersects(Events::SLEW_LIMITED));
    }

    fn change(&mut self, change: &Change) {
        self.parameters += usize::from(change.subject == ChangeSubject::Parameter);
        self.plugins += usize::from(change.subject == ChangeSubject::Plugin);
    }
}

fn magnitude_of(stimulus: &str, values: [f64; 3]) -> Protocol {
    let (model, parameter) = stimulus.split_once('.').unwrap();
    let stimulus = Stimulus { model: model.to_owned(), parameter: parameter.to_owned() };
    Protocol::Magnitude(MagnitudeProtocol {
        stimulus,
        values: values.to_vec(),
        ..MagnitudeProtocol::default()
    })
}

fn scene(model: &str, settings: &[&str]) -> Scene {
    let mut scene = Scene::study(model).unwrap();
    settings.iter().for_each(|set| {
        set.parse::<flotor_session::scene::PluginKeyValue>().unwrap().apply(&mut scene).unwrap()
    });
    scene
}

/// Stimuli from end to end of the range follow one another under a hand that never stops, by live parameters and by new
/// models: the force never moves faster than the hand itself moves it.
#[test]
fn stimuli_change_without_a_step_of_force() {
    for (stimulus, set, values) in [
        ("spring.gamma_n", "spring.mode=gamma", [12.0, 30.0, 48.0]),
        ("spring.wire_diameter_mm", "spring.mode=physical", [0.5, 0.6, 0.7]),
        // Read when the model is made, so a new one takes its place.
        ("wall.size_mm", "wall.shape=sphere", [8.0, 12.0, 20.0]),
    ] {
        let protocol = magnitude_of(stimulus, values);
        let model = stimulus.split_once('.').unwrap().0;
        let apparatus = Apparatus::check(scene(model, &[set]), &protocol).unwrap();
        assert_eq!(apparatus.swaps_models(), model == "wall");
        let mut rig =
            Rig::start(&apparatus, (1, subject(1)), Kinematics::Summary, None, 0.5, &StopSwitch::default())
                .unwrap();
        let mut steepness = Steepness::default();
        for (number, value) in [values[2], values[0], values[2], values[1]].into_iter().enumerate() {
            let trial = one(u32::try_from(number).unwrap(), value);
            let felt = rig.present_watched(&trial, &mut steepness).unwrap();
            assert_eq!(felt.kinematics.len(), 1, "{stimulus}");
        }
        // A hand at 0.1 m/s on the stiffest of these, 4.6 N/mm, takes half a newton with it in a tick, and a fade of
        // 0.1 s another quarter; a stiffness that changed under the hand would be a step of many newtons.
        assert!(steepness.largest_step_n < 1.0, "{stimulus}: {} N in a tick", steepness.largest_step_n);
        assert_eq!(steepness.slewed, 0, "{stimulus}: the slew limit had nothing to do");
        let changed = if apparatus.swaps_models() { steepness.plugins } else { steepness.parameters };
        assert_eq!(changed, 4, "{stimulus}");
    }
}

/// The stiffness at the hand is f m gamma / L0 (thesis eq. 77): what the simulated hand measures is what was set.
#[test]
fn the_hand_feels_the_stiffness_that_was_set() {
    let protocol = Protocol::Magnitude(MagnitudeProtocol::default());
    let apparatus = Apparatus::check(scene("spring", &[]), &protocol).unwrap();
    let mut rig =
        Rig::start(&apparatus, (3, subject(2)), Kinematics::Summary, None, 4.0, &StopSwitch::default())
            .unwrap();
    let felt: Vec<_> = [12.0, 24.0, 48.0]
        .map(|gamma_n| {
            let exploration = rig.present_watched(&one(1, gamma_n), &mut Steepness::default()).unwrap();
            let felt = exploration.kinematics[0];
            let expected = gamma_n / 0.025 * (25.0 / 15.0);
            let found = felt.felt_stiffness_n_per_m.unwrap();
            // The law bends a little under the hand's tilt and tremor; a percent is a tenth of what people can tell.
            assert!((found / expected - 1.0).abs() < 0.01, "{found} for {expected} N/m");
            felt
        })
        .to_vec();
    // As people did: more force and less movement on a stiffer spring. The manner of a hand differs from one
    // exploration to the next by more than from one spring to the next: movement is compared at the ends.
    assert!(felt.is_sorted_by(|softer, stiffer| softer.mean_force_n < stiffer.mean_force_n), "{felt:?}");
    assert!(felt[0].mean_speed_m_per_s > felt[2].mean_speed_m_per_s, "{felt:?}");
}

#[test]
fn a_trial_can_be_kept_tick_by_tick() {
    let scratch = Scratch::default();
    let protocol = Protocol::Magnitude(MagnitudeProtocol::default());
    let apparatus = Apparatus::check(scene("spring", &[]), &protocol).unwrap();
    let files = TrialFiles::make(scratch.path().join("motion"), "sub-01_task-magnitude".to_owned()).unwrap();
    let file = files.of(&one(7, 20.0));
    assert!(file.ends_with("sub-01_task-magnitude_trial-0007_motion.mcap"));
    let mut rig =
        Rig::start(&apparatus, (3, subject(1)), Kinematics::Full, Some(files), 0.5, &StopSwitch::default())
            .unwrap();
    rig.present_watched(&one(7, 20.0), &mut Steepness::default()).unwrap();
    let recording = Recording::open(&file).unwrap();
    assert_eq!(recording.run().rate_hz, 1000.0);
    let ticks: Vec<TickRecord> = recording.map(|record| record.unwrap()).collect();
    // Half a second of feeling between two fades of 0.1 s.
    assert_eq!(ticks.len(), 500 + 2 * 101);
    assert!(ticks.windows(2).all(|pair| pair[1].time_ns - pair[0].time_ns == 1_000_000));
}

/// Everything that can be wrong is told in one line, with exit code 2, and no data folder is begun.
#[test]
fn bad_input_is_refused_before_the_first_trial() {
    let scratch = Scratch::default();
    let no_force = "[device]\nplugin = \"simulated\"\n[[model]]\nplugin = \"spring\"\nname = \"other\"\n";
    let other = scratch.file("other.toml", no_force);
    let other = other.to_str().unwrap();
    let cases: [(&[&str], &str); 9] = [
        (&["jnd", "--stimulus", "spring.gama_n"], "did you mean `gamma_n`"),
        (&["jnd", "--stimulus", "sprin.gamma_n"], "sprin"),
        (&["jnd", "--stimulus", "gamma"], "MODEL.PARAMETER"),
        (&["jnd", "--scene", other, "--stimulus", "spin.gamma_n"], "has no model `spin`"),
        (&["jnd", "--bases", "9000"], "its range 0.01 to 10000"),
        (&["magnitude", "--range", "48-12"], "empty"),
        (&["magnitude", "--stimulus", "spring.alpha_n_mm2"], "mode"),
        (&["jnd", "--bases", "0"], "above 0"),
        (&["jnd", "--set", "device.hand=nowhere"], "nowhere"),
    ];
    for (arguments, reason) in cases {
        let out = scratch.path().join("data");
        let ran = study(arguments, &out).run();
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{arguments:?}: {ran:?}");
        assert!(ran.stderr.contains(reason), "{arguments:?}: {}", ran.stderr);
        assert!(!out.exists(), "{arguments:?} left data behind");
    }
}

/// A device without a hand cannot be felt by somebody simulated; a person could.
#[test]
fn a_device_that_cannot_be_felt_is_refused() {
    let scratch = Scratch::default();
    let out = scratch.path().join("data");
    let scene = "[device]\nplugin = \"fixture-faulty-device\"\n[[model]]\nplugin = \"spring\"\n";
    let scene = scratch.file("handless.toml", scene);
    let ran = study(&["jnd", "--scene", scene.to_str().unwrap()], &out).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(ran.error().contains("has no simulated hand"), "{ran:?}");
    assert!(!out.exists());
}

/// A weight pulls at a hand all the time. Subjects who feel it are not pulled out of the device's range; where a hand is
/// told to be where it feels a spring, it is, and that is said with subject and trial.
#[test]
fn a_weight_is_felt_within_the_range() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let scratch = Scratch::default();
    let felt =
        ["force", "--way", "felt", "--replications", "2", "--no-demo", "--feel", "300ms", "--subjects", "2"];
    let ran = study(&felt, &scratch.path().join("held")).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    assert!(ran.stdout.contains("2 of 2 subjects complete"), "{ran:?}");
    let low = ["--set", "device.hand_centre_mm=-4", "--set", "device.hand_amplitude_mm=6"];
    let arguments: Vec<&str> = felt.into_iter().chain(low).collect();
    let ran = study(&arguments, &scratch.path().join("dropped")).run();
    assert_eq!(ran.code, Some(exit_code::DEVICE_FAULT), "{ran:?}");
    assert!(ran.stderr.contains("note: sub-0") && ran.stderr.contains(": trial "), "{ran:?}");
}

const SMALL: [&str; 8] = ["jnd", "--bases", "26", "--replications", "2", "--no-demo", "--feel", "50ms"];

#[test]
fn a_subject_who_has_been_there_is_refused() {
    let scratch = Scratch::default();
    let out = scratch.path().join("data");
    let arguments: Vec<&str> = SMALL.into_iter().chain(["--subjects", "2", "--apparatus", "none"]).collect();
    let ran = study(&arguments, &out).run();
    assert_eq!(ran.code, Some(exit_code::OK));
    assert!(
        ran.stderr.starts_with("note: simulating about "),
        "off a terminal it says that it works: {ran:?}"
    );
    let again = study(&arguments, &out).run();
    assert_eq!(again.code, Some(exit_code::CONFIGURATION));
    assert!(again.error().contains("already complete"), "{again:?}");
    let another: Vec<&str> = arguments.iter().copied().chain(["--resume", "--seed", "9"]).collect();
    let ran = study(&another, &out).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION));
    assert!(ran.error().contains("begun with --seed 1, not 9"), "{ran:?}");
}

/// A log of another experiment would make the folder unusable: it is not written.
#[test]
fn a_folder_keeps_its_experiment() {
    let scratch = Scratch::default();
    let out = scratch.path().join("data");
    let small: Vec<&str> = SMALL.into_iter().chain(["--subjects", "1", "--apparatus", "none"]).collect();
    assert_eq!(study(&small, &out).run().code, Some(exit_code::OK));
    let refused = study(&["magnitude", "--subjects", "1", "--apparatus", "none"], &out).run();
    assert_eq!(refused.code, Some(exit_code::CONFIGURATION));
    assert!(
        refused.error().contains("sub-01_task-jnd_log.jsonl: begun with another protocol"),
        "{refused:?}"
    );
    let resumed: Vec<&str> = small.into_iter().chain(["--resume"]).collect();
    assert_eq!(study(&resumed, &out).run().code, Some(exit_code::OK));
}

/// The trials of a log and what becomes of them, without what only the clock decides.
fn trials(path: &Path) -> Vec<(Trial, Response, Exploration)> {
    let log = SittingLog::read(path).unwrap_or_else(|error| panic!("{error}"));
    log.trials
        .into_iter()
        .map(|record| (record.event.trial, record.event.response, record.event.exploration))
        .collect()
}

fn log_of(out: &Path, number: u16) -> PathBuf {
    out.join(format!("sourcedata/sub-{number:02}/sub-{number:02}_task-jnd_log.jsonl"))
}

/// SIGKILL at random moments, again and again, until the study is complete: every log is readable at every moment, no
/// trial that was on disk is ever gone, and in the end the data are to the bit those of a study nobody killed, the
/// movements of the hand included.
#[test]
fn kills_at_any_moment_lose_no_completed_trial() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let scratch = Scratch::default();
    let (whole, killed) = (scratch.path().join("whole"), scratch.path().join("killed"));
    let kills = TestSize::of_this_run().pick(12, 200);
    // Enough to do for all the kills, little enough to come through between them.
    let subjects = TestSize::of_this_run().pick(2, 8);
    let count = subjects.to_string();
    let arguments: Vec<&str> = SMALL.into_iter().chain(["--subjects", count.as_str()]).collect();
    let started = Instant::now();
    assert_eq!(study(&arguments, &whole).run().code, Some(exit_code::OK));
    let mut takes = started.elapsed();
    let numbers = 1..=u16::try_from(subjects).unwrap();

    let mut random = 0x2545_f491_4f6c_dd1d_u64;
    let mut on_disk = vec![0; subjects];
    let (mut interrupted, mut kill) = (0, 0);
    while interrupted < kills {
        kill += 1;
        assert!(kill <= 20 * kills, "only {interrupted} of {kill} came in time");
        if kill % 50 == 0 || (1..=subjects).all(|n| on_disk[n - 1] > 0 && is_complete(&killed, n)) {
            // From the start again, so that every part of a study is hit.
            let _ = std::fs::remove_dir_all(&killed);
            on_disk.fill(0);
        }
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        let resumed: Vec<&str> = arguments.iter().copied().chain(["--resume"]).collect();
        let running = study(&resumed, &killed).start();
        std::thread::sleep(takes.mul_f64((random % 1000) as f64 / 1000.0).min(Duration::from_secs(5)));
        running.kill_host();
        let came_in_time = running.wait().code == Some(exit_code::OTHER);
        interrupted += usize::from(came_in_time);
        if !came_in_time {
            takes = takes.mul_f64(0.8); // the machine was busier when it was measured
        }
        for number in numbers.clone() {
            let path = log_of(&killed, number);
            // Killed before the first line was whole: nothing had happened yet.
            if !std::fs::read_to_string(&path).is_ok_and(|text| text.contains('\n')) {
                continue;
            }
            let found = trials(&path);
            let before = &mut on_disk[usize::from(number) - 1];
            assert!(
                found.len() >= *before,
                "{}: {} trials, {before} were on disk",
                path.display(),
                found.len()
            );
            *before = found.len();
            let expected = trials(&log_of(&whole, number));
            assert_eq!(found[..], expected[..found.len()], "kill {kill}, subject {number}: another schedule");
        }
    }
    let resumed: Vec<&str> = arguments.iter().copied().chain(["--resume"]).collect();
    let last = study(&resumed, &killed).run();
    assert_eq!(last.code, Some(exit_code::OK), "{last:?}");
    for number in numbers {
        assert_eq!(trials(&log_of(&killed, number)), trials(&log_of(&whole, number)));
        let table = format!("sub-{number:02}/beh/sub-{number:02}_task-jnd_beh.tsv");
        let read = |out: &Path| std::fs::read_to_string(out.join(&table)).unwrap();
        assert_eq!(read(&killed), read(&whole));
    }
    println!("{interrupted} of {kill} kills interrupted a study; no trial was lost");
}

fn is_complete(out: &Path, number: usize) -> bool {
    SittingLog::read(&log_of(out, u16::try_from(number).unwrap())).is_ok_and(|log| log.complete)
}

/// Somebody edits an answer by hand: `analyse` and `--resume` refuse, with file, line and reason.
#[test]
fn an_edited_log_is_refused_with_line_and_reason() {
    let scratch = Scratch::default();
    let out = scratch.path().join("data");
    let arguments: Vec<&str> = SMALL.into_iter().chain(["--subjects", "2", "--apparatus", "none"]).collect();
    assert_eq!(study(&arguments, &out).run().code, Some(exit_code::OK));
    let path = log_of(&out, 2);
    let text = std::fs::read_to_string(&path).unwrap();
    let forged: Vec<String> =
        text.lines()
            .enumerate()
            .map(|(index, line)| {
                if index == 4 { line.replace("\"response\":\"", "\"response\":\"x") } else { line.to_owned() }
            })
            .collect();
    std::fs::write(&path, forged.join("\n") + "\n").unwrap();
    let analysed = Flotor::with(["analyse", out.to_str().unwrap()]).run();
    let resumed: Vec<&str> = arguments.iter().copied().chain(["--resume"]).collect();
    for ran in [analysed, study(&resumed, &out).run()] {
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION));
        assert!(ran.error().contains("_log.jsonl:5: the hash chain is broken"), "{ran:?}");
    }
}

const PERSON: [&str; 15] = [
    "jnd",
    "--observer",
    "human",
    "--bases",
    "26",
    "--replications",
    "2",
    "--procedure",
    "questplus",
    "--trials",
    "3",
    "--noise=off",
    "--least-time=0s",
    "--least-movement-mm=0",
    "--screen",
];

/// A study with a person whose lines are these.
fn person(screen: &str, lines: &str, arguments: &[&str], out: &Path) -> Ran {
    let folder = Scratch::default();
    let scene = folder.patient_scene(flotor_session::scene::STUDY).display().to_string();
    let more = [screen, "--scene", &scene];
    let arguments: Vec<&str> = PERSON.into_iter().chain(more).chain(arguments.iter().copied()).collect();
    study(&arguments, out).reading(lines).run()
}

/// A person at a keyboard: breaks off, goes on, and the log says the same as the bare state machine with their answers.
#[test]
fn a_person_goes_through_the_same_sitting() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let scratch = Scratch::default();
    let out = scratch.path().join("data");
    // Ready, two springs, an answer that is none, a note, an answer; then enough for today.
    let first = person("terminal", "\n\n\n7\nn cold hands\n1\nq\n", &["--no-demo"], &out);
    assert_eq!(first.code, Some(exit_code::OK), "{first:?}");
    assert!(first.stdout.contains("type 1, 2 or 0") && first.stdout.contains("--resume"), "{first:?}");
    assert!(!first.stdout.contains("26"), "blinded: {}", first.stdout);
    assert!(!first.stdout.contains("condition") && !first.stdout.contains("object"), "{}", first.stdout);
    let log = SittingLog::read(&log_of(&out, 1)).unwrap();
    assert_eq!((log.trials.len(), log.complete), (1, false));
    assert!(log.notes.iter().any(|(_, text)| text == "cold hands"));

    let refused = person("terminal", "", &["--no-demo", "--subject", "1"], &out);
    assert_eq!(refused.code, Some(exit_code::CONFIGURATION));
    let rest = "\n".to_owned() + &"\n\n1\n".repeat(2) + "\n" + &"\n\n1\n".repeat(3);
    let second = person("terminal", &rest, &["--no-demo", "--subject", "1", "--resume"], &out);
    assert_eq!(second.code, Some(exit_code::OK), "{second:?}");
    let log = SittingLog::read(&log_of(&out, 1)).unwrap();
    assert_eq!((log.trials.len(), log.complete, log.resumed), (6, true, 1));

    let mut bare = Sitting::new(&log.begin.protocol, log.begin.seed, log.begin.subject);
    for record in &log.trials {
        assert_eq!(bare.next(), Some(record.event.trial));
        bare.answer(Response::First, &Exploration::default()).unwrap();
        assert_eq!(record.event.exploration.kinematics.len(), 2, "both springs were felt and measured");
        let file = format!("sub-01_task-jnd_trial-{:04}_motion.mcap", record.event.trial.number);
        let recording = Recording::open(&out.join("sourcedata/sub-01/motion").join(file)).unwrap();
        assert!(recording.count() > 100);
    }
    assert!(bare.is_over());
}

/// The same through a pipe, as a window would do it.
#[test]
fn screens_travel_as_json_lines() {
    let scratch = Scratch::default();
    let out = scratch.path().join("data");
    let go = r#"{"input":"continue"}"#;
    let answer = r#"{"input":"answer","response":"dont-know"}"#;
    let lines = [go, go, go, "nonsense", answer, r#"{"input":"stop"}"#].join("\n") + "\n";
    let ran = person("json", &lines, &["--no-demo"], &out);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let screens: Vec<serde_json::Value> =
        ran.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let names: Vec<&str> = screens.iter().filter_map(|screen| screen["screen"].as_str()).collect();
    assert_eq!(names, ["ready", "feel", "feel", "ask", "feel"]);
    let refused = screens.iter().find_map(|line| line["refused"].as_str()).expect("nonsense is answered");
    assert!(refused.starts_with("the line is not JSON: "), "{refused}");
    assert_eq!(SittingLog::read(&log_of(&out, 1)).unwrap().trials.len(), 1);
}

/// A mistyped answer is taken back once, before the next pair is felt; log, resume and analysis go on without it.
#[test]
fn an_answer_is_taken_back_in_a_sitting() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let scratch = Scratch::default();
    let out = scratch.path().join("data");
    let go = r#"{"input":"continue"}"#;
    let back = r#"{"input":"withdraw"}"#;
    let answer = |word: &str| format!(r#"{{"input":"answer","response":"{word}"}}"#);
    let [first, second] = ["first", "second"].map(answer);
    let lines = [go, go, go, &first, back, back, &second, back, r#"{"input":"stop"}"#].join("\n") + "\n";
    let arguments = ["--no-demo", "--subject", "1"];
    let ran = person("json", &lines, &arguments, &out);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let screens: Vec<serde_json::Value> =
        ran.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let names: Vec<&str> = screens.iter().filter_map(|screen| screen["screen"].as_str()).collect();
    assert_eq!(names, ["ready", "feel", "feel", "ask", "feel", "ask", "feel"]);
    assert_eq!(
        screens.iter().filter(|line| line["refused"].is_string()).count(),
        2,
        "once, and then no more"
    );
    let log = SittingLog::read(&log_of(&out, 1)).unwrap();
    let [trial] = log.trials.as_slice() else { panic!("{:?}", log.trials) };
    assert_eq!((trial.event.response, log.withdrawn[0].response), (Response::Second, Response::First));
    let ran = Flotor::with(["analyse", out.to_str().unwrap(), "--each"]).run();
    assert!(ran.stdout.contains("1 answers withdrawn and replaced"), "{ran:?}");
    // Taken back, and a break before the answer: it is not taken back a second time.
    let again: Vec<&str> = arguments.into_iter().chain(["--resume"]).collect();
    let stop = r#"{"input":"stop"}"#;
    let ran = person("json", &([go, go, go, &first, back, stop].join("\n") + "\n"), &again, &out);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let log = SittingLog::read(&log_of(&out, 1)).unwrap();
    assert_eq!((log.is_answered_anew(), log.trials.len(), log.withdrawn.len()), (true, 1, 2));
    let ran = person("json", &([go, go, go, &first, back, stop].join("\n") + "\n"), &again, &out);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    assert!(ran.stdout.contains("no answer can be taken back now"), "{ran:?}");
    let log = SittingLog::read(&log_of(&out, 1)).unwrap();
    assert_eq!((log.trials.len(), log.withdrawn.len()), (2, 2));
}

/// What a person types to have felt so many trials, practising first where that is offered; then enough for today.
fn typed_until(log: &SittingLog, trials: u32) -> String {
    let begin = &log.begin;
    let mut sitting = Sitting::new(&begin.protocol, begin.seed, begin.subject);
    for record in &log.trials {
        sitting.answer(record.event.response, &record.event.exploration).unwrap();
    }
    let mut person = ScreenStateMachine::new(sitting, &begin.protocol, 40);
    if !log.trials.is_empty() {
        person = person.with_practice_offered();
    }
    let mut lines = String::new();
    while person.presented() < trials {
        let (line, input) = match person.screen() {
            Screen::Ready { next, .. } if next.may.contains(&May::Practise) => ("p\n", Input::Practise),
            Screen::Ask { .. } => ("1\n", Input::Answer { response: Response::First }),
            _ => ("\n", Input::Continue),
        };
        lines += line;
        person.input(input, 0.0).unwrap();
    }
    lines + "q\n"
}

/// Who goes on after a break is offered practice: what is felt then is told in the log, has no recording and no number, and the sitting
/// goes on where it was.
#[test]
fn practice_is_offered_to_whoever_goes_on() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let scratch = Scratch::default();
    let out = scratch.path().join("data");
    let log = || SittingLog::read(&log_of(&out, 1)).unwrap();
    let first = person("terminal", "p\nq\n", &["--subject", "1"], &out);
    assert_eq!(first.code, Some(exit_code::OK), "{first:?}");
    assert!(
        first.stdout.contains("practice is not offered now") && !first.stdout.contains("p practises"),
        "{first:?}"
    );
    for (trials, practised) in [(7, 0), (8, 3)] {
        let ran = person("terminal", &typed_until(&log(), trials), &["--subject", "1", "--resume"], &out);
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
        assert_eq!(ran.stdout.contains("p practises first"), practised > 0, "{ran:?}");
        let log = log();
        // Ticks that a busy machine missed have a note of their own.
        let notes =
            log.notes.iter().filter(|(_, text)| text.starts_with("practice before going on: presented"));
        assert_eq!((notes.count(), log.trials.len()), (practised, trials as usize), "{:?}", log.notes);
    }
    let files = std::fs::read_dir(out.join("sourcedata/sub-01/motion")).unwrap();
    let names = files.map(|file| file.unwrap().file_name().into_string().unwrap());
    assert_eq!(names.filter(|name| name.contains("trial-0000")).count(), 0, "practice is not recorded");
}

/// Whoever presses the emergency stop in a sitting: what was felt ends at once, the log says so with the time of day, the exit code
/// is that of a stopped device, and what was recorded of the trial stays when the sitting goes on.
#[test]
fn an_emergency_stop_in_a_sitting_leaves_a_line_and_a_recording() {
    let scratch = Scratch::default();
    let out = scratch.path().join("data");
    let folder = Scratch::default();
    let scene = folder.patient_scene(flotor_session::scene::STUDY).display().to_string();
    let arguments = PERSON.into_iter().chain(["json", "--scene", &scene, "--no-demo", "--subject", "1"]);
    let sitting = || {
        let arguments: Vec<&str> = arguments.clone().collect();
        // Standard input stays open after the first screen.
        let script =
            r#"mkfifo lines && exec 3<>lines && printf '{"input":"continue"}\n' >&3 && exec "$@" <&3"#;
        study(&arguments, &out).through_shell(script).inside(scratch.path())
    };
    let motion = out.join("sourcedata/sub-01/motion");
    let first = motion.join("sub-01_task-jnd_trial-0001_motion.mcap");
    let running = sitting().start();
    let until = Instant::now() + Duration::from_secs(60);
    while !first.exists() {
        assert!(Instant::now() < until, "no trial begins");
        std::thread::sleep(Duration::from_millis(20));
    }
    let log = std::fs::read_to_string(log_of(&out, 1)).unwrap();
    assert!(log.lines().all(|line| line.contains(r#","time":"2"#)), "every line has its time of day: {log}");
    running.signal(Signal::USR1);
    let ran = running.wait();
    assert_eq!(ran.code, Some(exit_code::DEVICE_FAULT), "{ran:?}");
    let log = SittingLog::read(&log_of(&out, 1)).unwrap();
    let [(0, Some(_), Incident::EmergencyStop { source })] = log.incidents.as_slice() else {
        panic!("{:?}", log.incidents)
    };
    assert_eq!(source, "signal");
    let size = std::fs::metadata(&first).unwrap().len();

    let go = r#"{"input":"continue"}"#;
    let lines = [go, r#"{"input":"stop"}"#].join("\n") + "\n";
    let arguments: Vec<&str> = arguments.clone().chain(["--resume"]).collect();
    let ran = study(&arguments, &out).reading(lines).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    assert_eq!(std::fs::metadata(&first).unwrap().len(), size, "the recording of what was stopped is kept");
    assert!(motion.join("sub-01_task-jnd_trial-0001_run-2_motion.mcap").exists());
    let log = SittingLog::read(&log_of(&out, 1)).unwrap();
    assert_eq!(log.incidents.last().map(|(_, _, incident)| incident), Some(&Incident::Stopped));
}

/// What kill -9 or a power failure leaves: the last line of the log gives no reason. Whoever goes on finds the incident.
#[test]
fn a_sitting_that_broke_off_without_a_reason_has_an_incident() {
    let scratch = Scratch::default();
    let out = scratch.path().join("data");
    let begun = person("terminal", "\n\n\n1\nq\n", &["--no-demo", "--subject", "1"], &out);
    assert_eq!(begun.code, Some(exit_code::OK), "{begun:?}");
    let path = log_of(&out, 1);
    let text = std::fs::read_to_string(&path).unwrap();
    let kept: String = text.split_inclusive('\n').take_while(|line| !line.contains("\"stopped\"")).collect();
    assert!(kept.len() < text.len() && kept.contains("\"trial\""), "{text}");
    std::fs::write(&path, kept).unwrap();
    for killed in [1, 1] {
        let resumed = person("terminal", "q\n", &["--no-demo", "--subject", "1", "--resume"], &out);
        assert_eq!(resumed.code, Some(exit_code::OK), "{resumed:?}");
        let log = SittingLog::read(&path).unwrap();
        let found = log.incidents.iter().filter(|(.., incident)| *incident == Incident::Killed).count();
        assert_eq!(found, killed, "a sitting that was stopped has its reason");
    }
    let each = Flotor::with(["analyse", out.to_str().unwrap(), "--each"]).run();
    assert!(each.stdout.contains("ended without a line in the log: the process was killed"), "{each:?}");
}

/// A log that was copied into the folder of another subject would count twice.
#[test]
fn a_misplaced_log_is_refused() {
    let scratch = Scratch::default();
    let out = scratch.path().join("data");
    let small = ["jnd", "--apparatus", "none", "--subjects", "2", "--bases", "26", "--replications", "2"];
    assert_eq!(study(&small, &out).run().code, Some(exit_code::OK));
    std::fs::copy(log_of(&out, 1), log_of(&out, 2)).unwrap();
    let ran = Flotor::with(["analyse", out.to_str().unwrap()]).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(ran.error().contains("sub-02") && ran.error().contains("the log is of sub-01"), "{ran:?}");
}

/// What macOS puts beside each file that it copies to a stick or a share.
#[test]
fn files_of_a_system_are_no_logs() {
    let scratch = Scratch::default();
    let out = scratch.path().join("data");
    assert_eq!(
        study(&["jnd", "--apparatus", "none", "--subjects", "2"], &out).run().code,
        Some(exit_code::OK)
    );
    let analysed = || Flotor::with(["analyse", out.to_str().unwrap()]).run();
    let before = analysed();
    assert_eq!(before.code, Some(exit_code::OK), "{before:?}");
    let strewn = log_of(&out, 1).with_file_name("._sub-01_task-jnd_log.jsonl");
    std::fs::write(strewn, [0, 5, 22, 7, 0, 2, 0, 0]).unwrap();
    assert_eq!(analysed(), before);
}

/// Two terminals, one command: the first sitting keeps its log.
#[test]
fn a_sitting_that_runs_elsewhere_is_not_continued_here() {
    let scratch = Scratch::default();
    let out = scratch.path().join("data");
    let broken_off = person("terminal", "\n\n\n1\nq\n", &["--no-demo"], &out);
    assert_eq!(broken_off.code, Some(exit_code::OK), "{broken_off:?}");
    let path = log_of(&out, 1);
    let running = SittingLog::read(&path).unwrap().resume("elsewhere").unwrap();
    let written = std::fs::read(&path).unwrap();
    for more in [&["--no-demo", "--subject", "1"][..], &["--no-demo", "--subject", "1", "--resume"]] {
        let refused = person("terminal", "\n\n\n1\nq\n", more, &out);
        assert_eq!(refused.code, Some(exit_code::CONFIGURATION), "{refused:?}");
        assert!(refused.error().contains("another process is running this sitting"), "{refused:?}");
        assert_eq!(std::fs::read(&path).unwrap(), written);
    }
    drop(running);
    let resumed = person("terminal", "\n\n\n1\nq\n", &["--no-demo", "--subject", "1", "--resume"], &out);
    assert_eq!(resumed.code, Some(exit_code::OK), "{resumed:?}");
    assert_eq!(SittingLog::read(&path).unwrap().trials.len(), 2);
}

/// The same with two programs: the second start is refused in the middle of a trial of the first, which goes on to its end.
#[test]
fn a_second_program_is_refused_beside_a_running_sitting() {
    let scratch = Scratch::default();
    let out = scratch.path().join("data");
    let scene = scratch.patient_scene(flotor_session::scene::STUDY).display().to_string();
    let arguments = PERSON.into_iter().chain(["json", "--scene", &scene, "--no-demo", "--subject", "1"]);
    let arguments: Vec<&str> = arguments.collect();
    let script = "mkfifo lines && exec 3<>lines && exec \"$@\" <&3";
    let first = study(&arguments, &out).through_shell(script).inside(scratch.path()).start();
    let path = log_of(&out, 1);
    let until = Instant::now() + Duration::from_secs(60);
    let wait_for = |trials: usize| {
        while SittingLog::read(&path).map_or(0, |log| log.trials.len()) < trials {
            assert!(Instant::now() < until, "no trial {trials}");
            std::thread::sleep(Duration::from_millis(20));
        }
    };
    let lines = scratch.path().join("lines");
    while !path.exists() {
        assert!(Instant::now() < until, "no sitting begins");
        std::thread::sleep(Duration::from_millis(20));
    }
    let say = |words: &[&str]| {
        let mut pipe = std::fs::OpenOptions::new().write(true).open(&lines).unwrap();
        pipe.write_all((words.join("\n") + "\n").as_bytes()).unwrap();
    };
    let go = r#"{"input":"continue"}"#;
    let answer = r#"{"input":"answer","response":"first"}"#;
    say(&[go, go, go, answer, go]);
    wait_for(1);
    for more in [&[][..], &["--resume"]] {
        let arguments: Vec<&str> = arguments.iter().chain(more).copied().collect();
        let refused = study(&arguments, &out).reading([go, go, answer].join("\n")).run();
        assert_eq!(refused.code, Some(exit_code::CONFIGURATION), "{refused:?}");
        assert!(refused.error().contains("another process is running this sitting"), "{refused:?}");
    }
    say(&[go, answer]);
    wait_for(2);
    say(&[r#"{"input":"stop"}"#]);
    let ran = first.wait();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    assert_eq!(SittingLog::read(&path).unwrap().trials.len(), 2);
}

/// Another build of a plugin is another stimulus, also under the same version.
#[test]
fn a_sitting_does_not_go_on_with_another_build_of_a_plugin() {
    let scratch = Scratch::default();
    let (out, plugins) = (scratch.path().join("data"), scratch.path().join("plugins"));
    std::fs::create_dir(&plugins).unwrap();
    let built = plugin_file("flotor-spring");
    let copy = plugins.join(built.file_name().unwrap());
    std::fs::copy(&built, &copy).unwrap();
    let folder = plugins.display().to_string();
    let more = ["--no-demo", "--subject", "1", "--plugin-path", &folder];
    let first = person("terminal", "\n\n\n1\nq\n", &more, &out);
    assert_eq!(first.code, Some(exit_code::OK), "{first:?}");
    let resumed: Vec<&str> = more.into_iter().chain(["--resume"]).collect();
    // What a linker adds at the end changes nothing that is felt here, and cannot be known to.
    let mut bytes = std::fs::read(&copy).unwrap();
    bytes.push(0);
    std::fs::remove_file(&copy).unwrap();
    std::fs::write(&copy, bytes).unwrap();
    let refused = person("terminal", "\n\n\n1\nq\n", &resumed, &out);
    assert_eq!(refused.code, Some(exit_code::CONFIGURATION), "{refused:?}");
    assert!(refused.error().contains("(spring) is not the file of the start of the sitting"), "{refused:?}");
    std::fs::copy(&built, &copy).unwrap();
    let resumed = person("terminal", "\n\n\n1\nq\n", &resumed, &out);
    assert_eq!(resumed.code, Some(exit_code::OK), "{resumed:?}");
}

/// A library that sets the time of day back by an hour once the log of a sitting has its first line.
const JUMP: &str = "
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <time.h>
int clock_gettime(clockid_t clock, struct timespec *time) {
    static int (*real)(clockid_t, struct timespec *);
    struct stat log;
    if (!real) real = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, \"clock_gettime\");
    int result = real(clock, time);
    if (clock == CLOCK_REALTIME && stat(getenv(\"SITTING_LOG\"), &log) == 0 && log.st_size > 0) time->tv_sec -= 3600;
    return result;
}
";

/// Somebody, or the network, sets the time of day during a sitting: onsets go on, and the log says so.
#[test]
fn an_onset_is_no_difference_of_two_times_of_day() {
    if !required(Tool::Cc) {
        return;
    }
    let scratch = Scratch::default();
    let (source, library) = (scratch.file("jump.c", JUMP), scratch.path().join("jump.so"));
    let built =
        std::process::Command::new("cc").args(["-shared", "-fPIC", "-o"]).arg(&library).arg(source).status();
    assert!(built.unwrap().success());
    let (out, folder) = (scratch.path().join("data"), Scratch::default());
    let scene = folder.patient_scene(flotor_session::scene::STUDY).display().to_string();
    let arguments = PERSON.into_iter().chain(["terminal", "--scene", &scene, "--no-demo", "--subject", "1"]);
    let ran = study(&arguments.collect::<Vec<_>>(), &out)
        .env("LD_PRELOAD", library.to_str().unwrap())
        .env("SITTING_LOG", log_of(&out, 1).to_str().unwrap())
        .reading("\n\n\n1\n\n\n2\nq\n")
        .run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let log = SittingLog::read(&log_of(&out, 1)).unwrap();
    let began = log.began.expect("a person has times");
    let onsets: Vec<f64> =
        log.trials.iter().map(|trial| trial.event.exploration.onset.unwrap().since_s(began)).collect();
    assert!(
        onsets.len() == 2 && onsets[0] >= 0.0 && onsets[1] > onsets[0] && onsets[1] < 600.0,
        "{onsets:?}"
    );
    let set: Vec<String> = log.incidents.iter().map(|(.., incident)| incident.to_string()).collect();
    assert!(!set.is_empty() && set[0].contains("the time of day was set back by 3"), "{set:?}");
    assert_eq!(set.iter().filter(|incident| incident.contains("time of day")).count(), 1, "{set:?}");
}

/// By keyboard alone, from the consent to the analysis of a pilot: what was read is in the log, what was said of the person in the list
/// of participants, and nothing else of them.
#[test]
fn a_sitting_goes_from_consent_to_analysis_by_keyboard() {
    let scratch = Scratch::default();
    let out = scratch.path().join("data");
    let consent =
        scratch.file("consent.txt", "Einwilligung\nIch nehme freiwillig teil.").display().to_string();
    let instructions = scratch.file("how.txt", "Ablauf\nFedern vergleichen.").display().to_string();
    let more = ["--no-demo", "--consent", &consent, "--instructions", &instructions];
    let who = ["--age", "31", "--sex", "f", "--handedness", "right"];
    let arguments: Vec<&str> = more.into_iter().chain(who).collect();
    let ran = person("terminal", "\n\n\n\n\n1\nq\n", &arguments, &out);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let order = ["Einwilligung", "Ich nehme freiwillig teil.", "Ablauf", "Feel the first"];
    let places = order.map(|text| ran.stdout.find(text).unwrap_or_else(|| panic!("no `{text}` in {ran:?}")));
    assert!(places.is_sorted(), "{ran:?}");
    let log = SittingLog::read(&log_of(&out, 1)).unwrap();
    let read = |title: &str| {
        log.notes.iter().any(|(_, text)| text.starts_with(&format!("read and went on: {title} (SHA")))
    };
    assert!(read("Einwilligung") && read("Ablauf") && log.trials.len() == 1, "{:?}", log.notes);
    assert!(log.trials[0].event.exploration.onset >= log.began, "an onset has a time of day");
    let list = std::fs::read_to_string(out.join("participants.tsv")).unwrap();
    assert!(list.contains("\t31\tf\tright\n"), "{list}");
    let ran = Flotor::with(["analyse", out.to_str().unwrap(), "--each"]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    assert!(
        ran.stdout.contains("sub-01: 1 answers") && ran.stdout.contains("stopped at the keyboard"),
        "{ran:?}"
    );
    let refused = person("terminal", "", &["--sex", "two words"], &out);
    assert_eq!(refused.code, Some(exit_code::CONFIGURATION), "{refused:?}");
}

/// A key pressed by accident or ahead is no answer: a stimulus has to be felt for a time.
#[test]
fn what_was_not_felt_is_not_answered() {
    let scratch = Scratch::default();
    let out = scratch.path().join("data");
    let folder = Scratch::default();
    let scene = folder.patient_scene(flotor_session::scene::STUDY).display().to_string();
    let usual = PERSON.into_iter().filter(|argument| *argument != "--least-time=0s");
    let more = ["terminal", "--scene", &scene, "--no-demo", "--least-time=30s"];
    let ran = study(&usual.chain(more).collect::<Vec<_>>(), &out).reading("\n\n\n1\nq\n").run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    assert!(ran.stdout.contains("feel the stimulus a little longer"), "{ran:?}");
    let log = SittingLog::read(&log_of(&out, 1)).unwrap();
    assert_eq!(log.trials.len(), 0, "three keys in a row were a trial");
}

/// A measured spring with play, both strokes and coils that touch, as a test bench gives it.
fn measured_spring() -> String {
    let row = |step: u32| {
        let x_mm = f64::from(step) * 0.03;
        let straight_n = 0.8 * (x_mm - 0.3).max(0.0);
        let block_n = 0.9 * (x_mm - 9.0).max(0.0).powi(2);
        let friction_n = if step.is_multiple_of(2) { 0.05 } else { -0.05 };
        let friction_n = if x_mm > 0.5 { friction_n } else { 0.0 };
        format!("{},{}\n", 30.0 - x_mm, straight_n + block_n + friction_n)
    };
    let rows: String = (0..=400).map(row).collect();
    "# bench 3, spring 12\nlength_mm,force_n\n".to_owned() + &rows
}

/// A measured curve is fitted, drawn, and served as it is: through the program, what the model answers is the table, coils
/// that touch included, and a study takes it as a stimulus.
#[test]
fn a_measured_curve_is_a_stimulus_as_it_was_measured() {
    let scratch = Scratch::default();
    let path = |name: &str| scratch.path().join(name);
    std::fs::write(path("bench.csv"), measured_spring()).unwrap();
    let spring = ["study", "spring", "bench.csv", "--plot", "bench.svg", "--json", "fit.json"];
    let ran =
        Flotor::with(spring.into_iter().chain(["--curve-scene", "real.toml"])).inside(scratch.path()).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    assert!(std::fs::read_to_string(path("bench.svg")).unwrap().contains("rendered measured curve"));
    let fit: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(path("fit.json")).unwrap()).unwrap();
    // Play and block lie outside the fitted middle; friction of 0.05 N on either side is averaged out.
    assert!((fit["stiffness_n_per_m"].as_f64().unwrap() - 800.0).abs() < 8.0, "{fit}");

    // The curve and not the fit: 4.5 N more than a straight spring where coils touch, nothing within the play.
    let poses = "x_m,y_m,z_m,rx_rad,ry_rad,rz_rad\n0,0,-0.0002,0,0,0\n0,0,-0.006,0,0,0\n0,0,-0.0112,0,0,0\n";
    std::fs::write(path("poses.csv"), poses).unwrap();
    let eval = ["eval", "--model", "measured", "--set", "curve=real.csv", "--set", "free_length_mm=30"];
    let ran = Flotor::with(eval.into_iter().chain(["--poses", "poses.csv", "--out", "out.csv"]));
    let ran = ran.inside(scratch.path()).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let table = std::fs::read_to_string(path("out.csv")).unwrap();
    let column = table.lines().next().unwrap().split(',').position(|name| name == "fz_n").unwrap();
    let cell = |line: &str| line.split(',').nth(column).unwrap().parse::<f64>().unwrap();
    let forces: Vec<f64> = table.lines().skip(1).map(cell).collect();
    for (found, expected) in forces.iter().zip([0.0, 0.8 * 5.7, 0.8 * 10.9 + 0.9 * 2.2 * 2.2]) {
        // Knots 0.19 mm apart on a curve of 1.8 N/mm²: a hundredth of a newton between them, and friction's mean.
        assert!((found - expected).abs() < 0.06, "{forces:?}");
    }

    let jnd = ["jnd", "--scene", "real.toml", "--stimulus", "measured.stiffness_scale", "--bases", "1"];
    let rest = ["--replications", "2", "--subjects", "1", "--no-demo", "--feel", "100ms", "--out", "data"];
    let ran = Flotor::with(["study"].into_iter().chain(jnd).chain(rest)).inside(scratch.path()).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let ran =
        Flotor::with(["study", "spring", "real.csv", "--free-length-mm", "30", "--curve-scene", "real.toml"]);
    let ran = ran.inside(scratch.path()).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "a measurement is never overwritten: {ran:?}");
}

/// 0.68 N/mm on the bench are 0.68 N/mm at the hand.
#[test]
fn a_fitted_spring_is_felt_as_stiff_as_the_real_one() {
    let scratch = Scratch::default();
    let path = |name: &str| scratch.path().join(name);
    let rows: String = (0..=50)
        .map(|step| format!("{},{}\n", 25.0 - 0.2 * f64::from(step), 0.136 * f64::from(step)))
        .collect();
    std::fs::write(path("bench.csv"), "length_mm,force_n\n".to_owned() + &rows).unwrap();
    let ran =
        Flotor::with(["study", "spring", "bench.csv", "--scene", "real.toml"]).inside(scratch.path()).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let scene = Scene::load(&path("real.toml")).unwrap();
    let apparatus = Apparatus::check(scene, &magnitude_of("spring.gamma_n", [15.0, 17.0, 19.0])).unwrap();
    let mut rig =
        Rig::start(&apparatus, (3, subject(2)), Kinematics::Summary, None, 4.0, &StopSwitch::default())
            .unwrap();
    let felt = rig.present_watched(&one(1, 17.0), &mut Steepness::default()).unwrap();
    let found = felt.kinematics[0].felt_stiffness_n_per_m.unwrap();
    // As above: a tenth of what people can tell.
    assert!((found / 680.0 - 1.0).abs() < 0.01, "{found} N/m");
}

/// A table of compressions does not tell how long the spring is: its curve can be felt all the same, a fit by a law that
/// counts in lengths cannot.
#[test]
fn a_curve_of_compressions_needs_no_free_length() {
    let scratch = Scratch::default();
    let rows: String =
        (0..=60).map(|step| format!("{},{}\n", 0.5 * f64::from(step), 0.4 * f64::from(step))).collect();
    std::fs::write(scratch.path().join("bench.csv"), "compression_mm,force_n\n".to_owned() + &rows).unwrap();
    let spring = |option: &str| {
        Flotor::with(["study", "spring", "bench.csv", option, "real.toml"]).inside(scratch.path()).run()
    };
    let ran = spring("--scene");
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(ran.error().contains("--free-length-mm"), "{ran:?}");
    // Deeper than the 25 mm that the model draws by itself.
    let ran = spring("--curve-scene");
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let ran = Flotor::with(["run", "real.toml", "--clock", "virtual", "--duration", "200ms"]);
    let ran = ran.inside(scratch.path()).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
}

/// What is kept of a person's movements is up to `--kinematics`.
#[test]
fn nothing_is_kept_of_the_movements_if_so_asked() {
    let scratch = Scratch::default();
    for (kept, measures, files) in [("none", 0, false), ("summary", 2, false), ("full", 2, true)] {
        let out = scratch.path().join(kept);
        let ran = person("terminal", "\n\n\n1\nq\n", &["--no-demo", "--kinematics", kept], &out);
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
        let log = SittingLog::read(&log_of(&out, 1)).unwrap();
        assert_eq!(log.trials[0].event.exploration.kinematics.len(), measures, "{kept}");
        assert_eq!(out.join("sourcedata/sub-01/motion").exists(), files, "{kept}");
    }
}

/// Largest memory of a study, KiB.
fn peak_kib(subjects: &str, out: &Path) -> u64 {
    let together = ["--subjects", subjects, "--jobs", "2"]; // else as many as there are cores have a seat in memory
    let arguments: Vec<&str> = SMALL.into_iter().chain(together).collect();
    let (ran, peak_kib) = study(&arguments, out).run_with_peak_kib();
    assert_eq!(ran.code, Some(exit_code::OK));
    peak_kib
}

/// Eight times the subjects need no more memory: nothing is kept of what is on disk.
#[test]
fn memory_does_not_grow_with_the_subjects() {
    if TestSize::of_this_run().leaves_out_long_tests() || !required(Tool::Python) {
        return;
    }
    let scratch = Scratch::default();
    let (few, many) = (scratch.path().join("few"), scratch.path().join("many"));
    let (few, many) = (peak_kib("2", &few), peak_kib("16", &many));
    println!("peak memory of 2 subjects {few} KiB, of 16 subjects {many} KiB");
    assert!(few > 1000 && 100 * many < 115 * few, "{few} KiB for 2 subjects, {many} KiB for 16");
}

/// Any protocol: thresholds of a default study exist for each base and modality.
#[test]
fn the_default_protocol_fits_the_default_scene() {
    Apparatus::check(scene("spring", &[]), &Protocol::Jnd(JndProtocol::default()))
        .unwrap()
        .check_hand()
        .unwrap();
}
