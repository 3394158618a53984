//! Studies of one's own design: from the file to the analysis, and Flotor's own studies as files.

#![allow(clippy::unwrap_used)] // tests may panic

use crate::study_scripts::science_python;
use flotor_study::log::SittingLog;
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::tools::{Tool, required};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

fn flotor(folder: &Path, arguments: &[&str]) -> Ran {
    Flotor::with(arguments).inside(folder).run()
}

/// Detection of a seat that is free or fixed, felt on the scene, with a factor between subjects; fewer than 40 lines.
const DETECTION: &str = "study = \"seat\"\n\
    [[factor]]\nname = \"hand\"\nsetting = \"device.hand_stiffness_n_per_m\"\nvalues = [1500, 3000]\nvary = \"between\"\n\
    [stimulus]\nsetting = \"spring.seat\"\npresent = \"free\"\nabsent = \"fixed\"\n\
    [task]\nask = \"detection\"\nquestion = \"Did it give way?\"\n\
    [method]\nkind = \"constant\"\nrepetitions = 3\n\
    [options]\nout = \"data\"\nsubjects = 2\nfeel = \"0.1s\"\n";

/// A choice of the scene is a stimulus: both seats are felt, and the log says which.
#[test]
fn a_choice_of_the_scene_is_detected() {
    let scratch = Scratch::default();
    let _ = scratch.file("seat.study.toml", DETECTION);
    let ran = flotor(scratch.path(), &["study", "run", "seat.study.toml"]);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let table =
        std::fs::read_to_string(scratch.path().join("data/sub-01/beh/sub-01_task-seat_beh.tsv")).unwrap();
    let rows: Vec<&str> = table.lines().skip(1).collect();
    let of = |seat: &str| rows.iter().filter(|row| row.split('\t').any(|cell| cell == seat)).count();
    assert_eq!((rows.len(), of("free"), of("fixed")), (6, 3, 3), "{table}");
    let ran = flotor(scratch.path(), &["analyse", "data", "--json", "-"]);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let result: Value = serde_json::from_str(&ran.stdout).unwrap();
    assert_eq!(result["measure"], "sensitivity");
    assert_eq!(result["cells"].as_array().unwrap().len(), 2);
}

/// The scripts print every row of the analysis again.
#[test]
fn scripts_print_the_same_rows() {
    let scratch = Scratch::default();
    let book = include_str!("../../../docs/src/experiments.md");
    let start = book.find("study = \"delay\"").unwrap();
    let text = &book[start..start + book[start..].find("```").unwrap()];
    assert!(text.lines().count() <= 40, "{} lines", text.lines().count());
    let _ = scratch.file("delay.study.toml", text);
    let ran = flotor(scratch.path(), &["study", "run", "delay.study.toml", "--subjects", "8"]);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let ran = flotor(scratch.path(), &["analyse", "delayed", "--trials", "delayed.csv"]);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let rows = |text: &str| -> Vec<String> {
        let row = |line: &str| line.split(" (HF ").next().unwrap_or_default().trim().to_owned();
        let mut rows: Vec<String> =
            text.lines().filter(|line| line.contains(" = ") && line.starts_with("  ")).map(row).collect();
        rows.sort();
        rows
    };
    let expected = rows(&ran.stdout);
    assert!(expected.len() > 15, "{expected:?}");
    let of_r = required(Tool::R).then(|| ("Rscript".to_owned(), "delayed.R"));
    let of_python = science_python().map(|python| (python, "delayed.py"));
    for (program, script) in of_r.into_iter().chain(of_python) {
        let printed = Command::new(&program).arg(script).current_dir(scratch.path()).output().unwrap();
        let text = String::from_utf8_lossy(&printed.stdout).into_owned();
        assert_eq!(rows(&text), expected, "{program}: {}", String::from_utf8_lossy(&printed.stderr));
    }
}

/// Flotor's own studies as files give the trials and answers of the commands, bit by bit.
#[test]
fn own_studies_are_those_of_the_commands() {
    for task in ["jnd", "magnitude", "force"] {
        let scratch = Scratch::default();
        for (arguments, out) in [(&["study", "run", task][..], "file"), (&["study", task], "command")] {
            let more = ["--out", out, "--subjects", "2", "--apparatus", "none", "--seed", "7"];
            let ran = flotor(scratch.path(), &[arguments, &more].concat());
            assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
        }
        let protocol = if task == "magnitude" { "magnitude" } else { "jnd" };
        let log = |out: &str| {
            let path = format!("{out}/sourcedata/sub-02/sub-02_task-{protocol}_log.jsonl");
            SittingLog::read(&scratch.path().join(path)).unwrap()
        };
        let table = |out: &str| {
            let path = format!("{out}/sub-02/beh/sub-02_task-{protocol}_beh.tsv");
            std::fs::read(scratch.path().join(path)).unwrap()
        };
        let (file, command) = (log("file"), log("command"));
        assert_eq!(file.begin.protocol, command.begin.protocol);
        assert_eq!(file.trials, command.trials);
        assert_eq!(table("file"), table("command"));
    }
}

/// What a file does is shown without anybody, and what is wrong with it is said with file and key.
#[test]
fn a_file_is_checked_without_a_person() {
    let scratch = Scratch::default();
    let _ = scratch.file("seat.study.toml", DETECTION);
    let ran = flotor(
        scratch.path(),
        &["study", "check", "seat.study.toml", "--runs", "10", "--json", "check.json", "--plot", "plan.svg"],
    );
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    assert!(ran.stdout.contains("Did it give way?"), "{ran:?}");
    let check: Value =
        serde_json::from_str(&std::fs::read_to_string(scratch.path().join("check.json")).unwrap()).unwrap();
    assert_eq!(check["sessions"].as_array().unwrap().len(), 2);
    assert_eq!(check["balance"]["subjects_in_each_group"], serde_json::json!([1, 1]));
    assert!(std::fs::read_to_string(scratch.path().join("plan.svg")).unwrap().contains("</svg>"));
    for (from, to, expected) in [
        ("kind = \"constant\"", "kind = \"staircase\"", "unknown field `repetitions`"),
        (
            "present = \"free\"",
            "present = \"fixed\"",
            "seat.study.toml: stimulus.present: present is `fixed`",
        ),
        ("vary = \"between\"", "vary = \"betwen\"", "seat.study.toml:6: "),
        ("spring.seat", "sprng.seat", "sprng"),
        (
            "feel = \"0.1s\"",
            "fel = \"0.1s\"",
            "options.fel: `flotor study run` has no such option; did you mean `feel`?",
        ),
    ] {
        let changed = DETECTION.replace(from, to);
        assert_ne!(changed, DETECTION);
        let _ = scratch.file("seat.study.toml", changed);
        let ran = flotor(scratch.path(), &["study", "run", "seat.study.toml", "--out", "other"]);
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{to}: {ran:?}");
        assert!(ran.stderr.contains(expected), "{to}: {ran:?}");
    }
}
