//! Designed studies: kills and resumptions, changed logs, one program on one session, tables.

use super::*;
use crate::conduct::{ApparatusOrFrontEndError, NoApparatus};
use crate::dataset::{DatasetError, ExistingLogPolicy};
use crate::exclusion::ExclusionRules;
use crate::log::{LogProblem, Plan, digest};
use flotor_study_design::course::Session;
use flotor_study_design::design::Design;
use flotor_study_design::observer::Population;
use flotor_study_design::random::{Purpose, Stream};
use flotor_study_design::subject::SubjectNumber;
use serde_json::json;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

/// A folder that goes away with the test.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("flotor-designed-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn data(&self) -> DesignedData {
        DesignedData::at(&self.0)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Designs of each kind of method, small.
fn designs() -> Vec<Design> {
    let levels = json!([0.1, 0.2, 0.3]);
    let target =
        json!({ "target": 4, "initial": 0.2, "gain": 0.1, "trials": 5, "floor": 0.05, "ceiling": 0.9 });
    let methods = [
        (json!({ "ask": "choice" }), json!({ "kind": "constant", "levels": levels, "repetitions": 2 })),
        (json!({ "ask": "detection" }), json!({ "kind": "limits", "levels": levels, "series": 3 })),
        (json!({ "ask": "choice", "unsure": true }), json!({ "kind": "weighted-up-down", "tracks": 2 })),
        (json!({ "ask": "detection" }), json!({ "kind": "staircase", "rule": { "stop_after": 6 } })),
        (
            json!({ "ask": "choice", "unsure": true }),
            json!({ "kind": "quest-plus", "rule": { "trials": 4 } }),
        ),
        (
            json!({ "ask": "rating", "scale": { "least": 1, "most": 7 }, "confidence": { "least": 1, "most": 5 } }),
            json!({ "kind": "target-rating", "rule": target }),
        ),
    ];
    let design = |(index, (task, method)): (usize, (serde_json::Value, serde_json::Value))| {
        serde_json::from_value(json!({
            "study": format!("small{index}"),
            "factor": [{ "name": "delay", "setting": "device.delay", "values": [0, 20] }],
            "stimulus": { "setting": "spring.gamma_n", "standard": 26 },
            "task": task,
            "method": method,
            "blocks": { "by": ["delay"], "practice": 1, "rest_every": 5, "sessions": 2 },
            "questionnaire": [{ "at": "end", "form": "nasa-tlx" }],
        }))
        .unwrap()
    };
    methods.into_iter().enumerate().map(design).collect()
}

fn cohort(design: Design, subjects: u16) -> DesignedCohort {
    let text = format!("study = \"{}\"", design.study());
    let plan = Plan {
        file: "a.study.toml".to_owned(),
        sha256: digest(&text),
        text,
        exclusion: ExclusionRules::default(),
    };
    DesignedCohort {
        design,
        seed: 3,
        subjects: (1..=subjects).filter_map(SubjectNumber::new).collect(),
        population: Population::default(),
        apparatus: serde_json::Value::Null,
        inputs: Vec::new(),
        version: "0.0.0".to_owned(),
        plan,
        existing_log: ExistingLogPolicy::Resume,
    }
}

/// Runs a cohort until `steps` steps are on disk.
fn run(cohort: &DesignedCohort, data: &DesignedData, steps: u32) -> Result<(), DesignedError> {
    let (stop, done) = (AtomicBool::new(steps == 0), AtomicU32::new(0));
    let watch = || {
        if done.fetch_add(1, Ordering::Relaxed) + 1 >= steps {
            stop.store(true, Ordering::Relaxed);
        }
    };
    let presenter = |_: Session| -> Result<Option<Box<dyn DesignedPresenter>>, ApparatusOrFrontEndError> {
        Ok(Some(Box::new(NoApparatus)))
    };
    cohort.run(data, NonZeroUsize::MIN, &presenter, &watch, &stop)
}

fn steps(data: &DesignedData) -> Vec<Vec<StepEvent>> {
    data.logs().unwrap().into_iter().map(|log| log.steps).collect()
}

/// 240 kills at random bytes over all methods: whatever a killed process leaves, at most the step under way is lost, and the rest is that
/// of a study that was never broken off.
#[test]
fn kills_lose_at_most_the_step_under_way() {
    let mut stream = Stream::new(5, Purpose::Answer, 1, 1);
    for design in designs() {
        let whole = Folder::new(&format!("whole-{}", design.study()));
        let cohort = cohort(design, 1);
        run(&cohort, &whole.data(), u32::MAX).unwrap();
        let expected = steps(&whole.data());
        assert_eq!(expected.len(), 2, "two sessions");
        let session = Session { seed: 3, subject: cohort.subjects[0], session: 1 };
        let complete = std::fs::read(whole.data().log_path(&cohort.design, session)).unwrap();
        for kill in 0..40 {
            let folder = Folder::new(&format!("killed-{}-{kill}", cohort.design.study()));
            let path = folder.data().log_path(&cohort.design, session);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            let bytes = 1 + stream.below(complete.len() - 1);
            std::fs::write(&path, &complete[..bytes]).unwrap();
            let before = DesignedLog::read(&path).map_or(0, |log| log.steps.len());
            let lines = complete[..bytes].iter().filter(|byte| **byte == b'\n').count();
            // The first line is `begin`, and the last of a complete log `end`.
            assert!(before + 2 >= lines, "{before} steps in {lines} lines");
            run(&cohort, &folder.data(), u32::MAX).unwrap();
            assert_eq!(steps(&folder.data()), expected, "killed after {bytes} bytes");
        }
    }
}

/// A study that is stopped after any step continues as if it had not been.
#[test]
fn a_stopped_study_continues() {
    let design = designs().remove(0);
    let whole = Folder::new("not-stopped");
    let cohort = cohort(design, 2);
    run(&cohort, &whole.data(), u32::MAX).unwrap();
    let expected = steps(&whole.data());
    let folder = Folder::new("stopped");
    for _ in 0..expected.iter().map(Vec::len).sum::<usize>() {
        run(&cohort, &folder.data(), 1).unwrap();
    }
    run(&cohort, &folder.data(), u32::MAX).unwrap();
    assert_eq!(steps(&folder.data()), expected);
    let logs = folder.data().logs().unwrap();
    assert!(logs.iter().all(|log| log.complete && log.resumed > 3));
    // The same again does nothing: everybody is complete.
    let texts = || logs.iter().map(|log| std::fs::read(log.path()).unwrap()).collect::<Vec<_>>();
    let before = texts();
    run(&cohort, &folder.data(), u32::MAX).unwrap();
    assert_eq!(texts(), before);
}

/// A changed answer, another seed, another design and a second program are refused.
#[test]
fn what_does_not_belong_together_is_refused() {
    let design = designs().remove(0);
    let folder = Folder::new("refused");
    let first = cohort(design, 1);
    run(&first, &folder.data(), 4).unwrap();
    let log = folder.data().logs().unwrap().remove(0);
    let path = log.path().to_path_buf();
    let text = std::fs::read_to_string(&path).unwrap();

    let other = DesignedCohort { seed: 4, ..first.clone() };
    let error = run(&other, &folder.data(), u32::MAX).unwrap_err().to_string();
    assert!(error.contains("begun with --seed 3, not 4"), "{error}");
    let mut table = serde_json::to_value(&first.design).unwrap();
    table["method"]["repetitions"] = json!(3);
    let other = DesignedCohort { design: serde_json::from_value(table).unwrap(), ..first.clone() };
    let error = run(&other, &folder.data(), u32::MAX).unwrap_err().to_string();
    assert!(error.contains("another design: method.repetitions 2, not 3"), "{error}");

    let (_, writer) = log.resume("0.0.0").unwrap();
    let error = run(&first, &folder.data(), u32::MAX).unwrap_err();
    let in_use = |error: &DesignedError| matches!(error, DesignedError::Dataset(DatasetError::Log(log)) if matches!(log.problem, LogProblem::InUse));
    assert!(in_use(&error), "{error}");
    drop(writer);

    let changed = text.replacen("\"number\":2", "\"number\":3", 1);
    assert_ne!(changed, text);
    std::fs::write(&path, changed).unwrap();
    let error = DesignedLog::read(&path).err().unwrap();
    assert!(matches!(error.problem, LogProblem::Chain) && error.line > 1, "{error}");
}

/// Tables have a row for each trial and each questionnaire, and as many cells as columns.
#[test]
fn tables_are_rectangular_and_complete() {
    for design in designs() {
        let folder = Folder::new(&format!("tables-{}", design.study()));
        let cohort = cohort(design, 2);
        run(&cohort, &folder.data(), u32::MAX).unwrap();
        let logs = folder.data().logs().unwrap();
        assert!(folder.data().is_here());
        for table in [trials_tsv(&logs), forms_tsv(&logs)] {
            let mut lines = table.lines().map(|line| line.split('\t').count());
            let columns = lines.next().unwrap();
            assert!(columns > 8 && lines.all(|cells| cells == columns), "{table}");
        }
        let trials: u32 = logs.iter().map(|log| log.course().presented()).sum();
        assert_eq!(trials_tsv(&logs).lines().count(), 1 + trials as usize);
        assert_eq!(forms_tsv(&logs).lines().count(), 1 + 4);
        let study = cohort.design.study();
        let paths = [
            format!("sub-01/ses-02/beh/sub-01_ses-02_task-{study}_beh.tsv"),
            format!("sub-02/ses-01/beh/sub-02_ses-01_task-{study}forms_beh.tsv"),
            format!("task-{study}_beh.json"),
            format!("task-{study}forms_beh.json"),
            "participants.tsv".to_owned(),
            "dataset_description.json".to_owned(),
        ];
        for path in paths {
            assert!(folder.0.join(&path).exists(), "{path}");
        }
    }
}
