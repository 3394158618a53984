//! Studies of one's own design with a person at a keyboard: broken off, killed, continued, analysed.

#![allow(clippy::unwrap_used)] // tests may panic

use flotor_study::designed::screen::{Input, Screen};
use flotor_study::designed::{AttendedCourse, DesignedLog, Effect};
use flotor_study::log::Incident;
use flotor_study_design::answer::{Answer, Position};
use flotor_study_design::course::{Course, Signal as Presence, Step, Trial};
use flotor_study_design::form::Item;
use flotor_study_design::value::Value as Cell;
use flotor_tests::TestSize;
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use rustix::process::Signal;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// A person at the keyboard of a scene whose device waits for a busy machine, with a hand that stays in its range.
struct Keyboard<'a> {
    folder: &'a Scratch,
    scene: String,
    file: &'a str,
}

impl<'a> Keyboard<'a> {
    fn new(folder: &'a Scratch, file: &'a str, text: &str) -> Self {
        let _ = folder.file(file, text);
        let scene = folder.patient_scene(flotor_session::scene::STUDY).display().to_string();
        Self { folder, scene, file }
    }

    fn program(&self, subject: u16) -> Flotor {
        let subject = subject.to_string();
        let arguments = [
            "study",
            "run",
            self.file,
            "--observer=human",
            "--screen=terminal",
            "--noise=off",
            "--least-time=0s",
            "--least-movement-mm=0",
            "--scene",
            &self.scene,
            "--set",
            "device.hand_amplitude_mm=3",
            "--set",
            "device.hand_centre_mm=-2",
            "--subject",
            &subject,
        ];
        Flotor::with(arguments).inside(self.folder.path())
    }

    fn types(&self, subject: u16, lines: &str) -> Ran {
        let ran = self.program(subject).reading(lines).run();
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
        ran
    }

    fn log_path(&self, data: &str, study: &str, subject: u16) -> PathBuf {
        let subject = format!("sub-{subject:02}");
        self.folder.path().join(format!("{data}/sourcedata/{subject}/{subject}_task-{study}_log.jsonl"))
    }
}

/// Returns the lines that a person types at the screens until `steps` more steps are answered, or to the end.
fn lines_of(course: &Course, steps: usize) -> String {
    let mut person = AttendedCourse::new(course.clone());
    let (mut lines, mut answered) = (String::new(), 0);
    while answered < steps && person.screen() != Screen::Over {
        let (line, input) = typed(&person);
        lines += &(line + "\n");
        answered += usize::from(matches!(person.input(input, 0.0).unwrap(), Effect::Answered(_)));
    }
    lines
}

/// Returns the line at a screen, and what it means.
fn typed(person: &AttendedCourse) -> (String, Input) {
    match person.screen() {
        Screen::Ask { .. } => {
            let Some(Step::Trial(trial)) = person.course().next() else { panic!("no trial is open") };
            let answer = answer(&trial);
            let key = match answer {
                Answer::First | Answer::Present => "1",
                Answer::Second => "2",
                _ => "0",
            };
            (key.to_owned(), Input::Answer(answer))
        }
        Screen::Item { item: Item::Scale { scale, .. }, number, .. } => {
            let point = scale.nearest(scale.least + 10.0 * number as f64);
            (point.to_string(), Input::Item(Cell::Number(point)))
        }
        _ => (String::new(), Input::Continue),
    }
}

/// Returns the answer of a person who is wrong in every fourth trial.
fn answer(trial: &Trial) -> Answer {
    let is_right = !trial.number.is_multiple_of(4);
    match (trial.comparison_at, trial.signal, trial.level) {
        (Some(position), _, level) => {
            let is_more = level.is_some_and(|level| level > 0.0);
            match (position, is_more == is_right) {
                (Position::First, true) | (Position::Second, false) => Answer::First,
                _ => Answer::Second,
            }
        }
        (None, Some(signal), _) if (signal == Presence::Present) == is_right => Answer::Present,
        _ => Answer::Absent,
    }
}

fn delay_study() -> String {
    let book = include_str!("../../../docs/src/experiments.md");
    let start = book.find("study = \"delay\"").unwrap();
    let text = &book[start..start + book[start..].find("```").unwrap()];
    assert!(text.lines().count() <= 40, "{} lines", text.lines().count());
    // As few presentations as a test has time for.
    text.replace("repetitions = 6", "repetitions = 1").replace("practice = 4", "practice = 1")
}

fn analysed(folder: &Path, data: &str) -> Value {
    let ran = Flotor::with(["analyse", data, "--json", "-"]).inside(folder).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    serde_json::from_str(&ran.stdout).unwrap()
}

/// A study of delay and stiffness from one file, by keyboard alone: stopped, killed, continued, analysed. At full size with twelve people.
#[test]
fn a_person_goes_through_a_study_of_delay_and_stiffness() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let people = if TestSize::of_this_run() == TestSize::Full { 12 } else { 1 };
    let scratch = Scratch::default();
    let keyboard = Keyboard::new(&scratch, "delay.study.toml", &delay_study());
    for subject in 1..=people {
        let path = keyboard.log_path("delayed", "delay", subject);
        let log = || DesignedLog::read(&path).unwrap();
        // Everything that is typed before the first screen is a start and a stop.
        let first = keyboard.types(subject, "\nn cold hands\nq\n");
        assert!(first.stdout.contains("Practice") || first.stdout.contains("Ready"), "{first:?}");
        assert!(first.stdout.contains(&format!("--subject {subject}")), "{first:?}");
        for condition in ["delay", "17", "35", "latency"] {
            assert!(!first.stdout.contains(condition), "blinded: {}", first.stdout);
        }
        let stopped = keyboard.types(subject, &(lines_of(log().course(), 12) + "q\n"));
        assert!(stopped.stdout.contains("Which one was stiffer?"), "{stopped:?}");
        assert_eq!(log().steps.len(), 12);

        // Killed while the next trial waits for an answer: standard input stays open.
        let _ = scratch.file("typed", lines_of(log().course(), 3));
        let script = r#"rm -f lines && mkfifo lines && exec 3<>lines && cat typed >&3 && exec "$@" <&3"#;
        let running = keyboard.program(subject).through_shell(script).start();
        let until = Instant::now() + Duration::from_secs(120);
        while DesignedLog::read(&path).is_ok_and(|log| log.steps.len() < 15) {
            assert!(Instant::now() < until, "no step is answered");
            std::thread::sleep(Duration::from_millis(20));
        }
        running.signal_host(Signal::KILL);
        let _ = running.wait();
        assert_eq!(log().steps.len(), 15, "the steps that were answered");

        let last = keyboard.types(subject, &lines_of(log().course(), usize::MAX));
        assert!(last.stdout.contains("flotor analyse delayed"), "{last:?}");
        let log = log();
        assert!(log.complete && log.resumed == 3, "{}", log.resumed);
        assert!(log.notes.iter().any(|(_, text)| text == "cold hands"));
        let incidents: Vec<&Incident> = log.incidents.iter().map(|(_, incident)| incident).collect();
        let count = |wanted: &Incident| incidents.iter().filter(|incident| **incident == wanted).count();
        assert_eq!((count(&Incident::Stopped), count(&Incident::Killed)), (2, 1), "{incidents:?}");
        for event in &log.steps {
            let Some(exploration) = &event.exploration else { continue };
            assert_eq!(exploration.kinematics.len(), 2, "both intervals were felt and measured");
        }
    }
    let result = analysed(scratch.path(), "delayed");
    assert_eq!(result["cells"].as_array().map(Vec::len), Some(8), "{result}");
    let noted =
        Flotor::with(["study", "note", "delayed", "1", "wrote down later"]).inside(scratch.path()).run();
    assert_eq!(noted.code, Some(exit_code::OK), "{noted:?}");
    let log = DesignedLog::read(&keyboard.log_path("delayed", "delay", 1)).unwrap();
    assert!(log.complete && log.notes.iter().any(|(_, text)| text == "wrote down later"), "{:?}", log.notes);
    // A complete sitting is not begun again.
    let again = keyboard.program(1).reading("").run();
    assert_eq!(again.code, Some(exit_code::CONFIGURATION), "{again:?}");
}

/// A detection study of buckling, from one file, by keyboard alone: the energy law alone does not buckle, blended with the rod it does.
#[test]
fn a_person_detects_buckling() {
    const BUCKLING: &str = "study = \"buckling\"\n\
        [[factor]]\nname = \"wire\"\nsetting = \"spring.wire_diameter_mm\"\nvalues = [0.55, 0.6]\n\
        [stimulus]\nsetting = \"spring.hand_over\"\npresent = \"on\"\nabsent = \"off\"\n\
        [task]\nask = \"detection\"\nquestion = \"Did it buckle?\"\n\
        [method]\nkind = \"constant\"\nrepetitions = 4\n\
        [[questionnaire]]\nat = \"end\"\nform = \"nasa-tlx\"\n\
        [options]\nout = \"felt\"\nset = [\"spring.preset=slender\", \"spring.mode=physical\"]\n";
    let scratch = Scratch::default();
    let keyboard = Keyboard::new(&scratch, "buckling.study.toml", BUCKLING);
    let path = keyboard.log_path("felt", "buckling", 1);
    keyboard.types(1, "q\n");
    let log = || DesignedLog::read(&path).unwrap();
    let last = keyboard.types(1, &lines_of(log().course(), usize::MAX));
    assert!(last.stdout.contains("Did it buckle?") && last.stdout.contains("1 yes, 0 no"), "{last:?}");
    assert!(!last.stdout.contains("hand_over"), "blinded: {}", last.stdout);
    assert!(log().complete);
    let result = analysed(scratch.path(), "felt");
    assert_eq!(result["measure"], "sensitivity");
    assert_eq!(result["cells"].as_array().map(Vec::len), Some(2), "{result}");
}

/// A setting of a device within a block, and a screen without these questions, are refused before a person sits.
#[test]
fn what_no_person_can_sit_through_is_refused_at_once() {
    let scratch = Scratch::default();
    let text = delay_study().replace("by = [\"delay\"]\norder = \"williams\"\n", "");
    let keyboard = Keyboard::new(&scratch, "delay.study.toml", &text);
    let ran = keyboard.program(1).reading("").run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(ran.stderr.contains("device.sensor_latency_ticks is a setting of a device"), "{ran:?}");
    let ran = Flotor::with(["study", "run", "delay.study.toml", "--observer", "human"])
        .inside(scratch.path())
        .run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(ran.stderr.contains("--screen terminal"), "{ran:?}");
    assert!(!scratch.path().join("delayed").exists());
}
