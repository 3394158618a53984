//! A study that is a file: its options, its checks, and its exclusion rules up to the analysis.

#![allow(clippy::unwrap_used)] // tests may panic

use flotor_study::log::SittingLog;
use flotor_study::trial::Phase;
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use serde_json::Value;
use std::path::Path;

const FILE: &str = "task = \"jnd\"\n[options]\nout = \"data\"\nsubjects = 6\napparatus = \"none\"\nbases = [17, 26]\n\
                    replications = 2\ncatch_trials = 1\nrepeat_checks = 2\n";

fn flotor(folder: &Path, arguments: &[&str]) -> Ran {
    Flotor::with(arguments).inside(folder).run()
}

fn log(folder: &Path, subject: u16) -> SittingLog {
    SittingLog::read(
        &folder.join(format!("data/sourcedata/sub-{subject:02}/sub-{subject:02}_task-jnd_log.jsonl")),
    )
    .unwrap()
}

/// Checks are in the log and in the table and do not count; what the rules of the file exclude is left out of the analysis, listed
/// with its rule, and marked in the table of trials.
#[test]
fn checks_and_exclusion_rules_of_a_study_file_reach_the_analysis() {
    let scratch = Scratch::default();
    let folder = scratch.path();
    // Who names one of two equal springs in more than a quarter of the catch trials, or is mostly unsure.
    let rules = "[exclusion]\nmost_false_alarms = 0.25\nresponse_time_s = [0.2, 20]\n";
    let _ = scratch.file("a.study.toml", format!("{FILE}{rules}"));
    let ran = flotor(folder, &["study", "run", "a.study.toml"]);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let first = log(folder, 1);
    let count = |phase| first.trials.iter().filter(|record| record.event.trial.phase == phase).count();
    assert_eq!((count(Phase::Catch), count(Phase::RepeatCheck)), (4, 8));

    let analyse =
        ["analyse", "data", "--json", "result.json", "--trials", "trials.csv", "--html", "page.html"];
    let ran = flotor(folder, &analyse);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    assert!(ran.stdout.contains("catch trials named one of two equal stimuli"), "{ran:?}");
    assert!(ran.stdout.contains("most_false_alarms = 0.25"), "{ran:?}");
    assert!(ran.stdout.contains("response_time_s: not measured for simulated observers"), "{ran:?}");
    let result: Value =
        serde_json::from_str(&std::fs::read_to_string(folder.join("result.json")).unwrap()).unwrap();
    let alarms = result["checks"].as_array().unwrap();
    let out: Vec<&str> = alarms
        .iter()
        .filter(|one| one["false_alarms"].as_f64().unwrap() > 1.0)
        .map(|one| one["subject"].as_str().unwrap())
        .collect();
    assert!(!out.is_empty() && out.len() < 5, "{alarms:?}");
    let excluded = result["excluded"].as_array().unwrap();
    assert_eq!((excluded.len(), alarms.len()), (out.len(), 6), "{excluded:?}");
    assert!(excluded.iter().all(|one| one["rule"] == "most_false_alarms" && one["scope"] == "sitting"));
    assert_eq!(result["subjects"].as_u64(), Some(6 - out.len() as u64));
    let unknown = &result["not_applied"][0];
    assert_eq!(
        (unknown["rule"].as_str(), unknown["subjects"][5].as_u64()),
        (Some("response_time_s"), Some(6))
    );

    let page = std::fs::read_to_string(folder.join("page.html")).unwrap();
    assert!(page.contains("<p>Not applied: response_time_s: not measured for simulated observers (sub-01, "));
    assert!(page.contains("<h2>Exclusions</h2>") && page.contains("<td>most_false_alarms = 0.25</td>"));

    let table = std::fs::read_to_string(folder.join("trials.csv")).unwrap();
    for line in table.lines().skip(1) {
        let is_out = out.iter().any(|subject| line.starts_with(subject)) && line.contains(",main,");
        assert_eq!(line.ends_with(",most_false_alarms"), is_out, "{line}");
    }
    assert!(table.contains(",catch,") && table.contains(",repeat_check,"));
    let ran = flotor(folder, &["analyse", "data", "--each"]);
    assert!(ran.stdout.contains("! excluded: sitting, most_false_alarms = 0.25 (0."), "{ran:?}");
}

/// Where the rules leave too little, the analysis says how much is left and what took the rest.
#[test]
fn rules_that_leave_nothing_say_what_they_took() {
    let scratch = Scratch::default();
    let rules = "[exclusion]\nmost_dont_know = 0\n";
    let _ = scratch.file("a.study.toml", format!("{FILE}{rules}"));
    assert_eq!(flotor(scratch.path(), &["study", "run"]).code, Some(exit_code::OK));
    let ran = flotor(scratch.path(), &["analyse", "data"]);
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    let last = ran.stderr.lines().last().unwrap_or_default();
    assert!(
        last.starts_with("error: ")
            && last.contains("2 or more complete sittings after exclusions, and the study has 0;"),
        "{ran:?}"
    );
    let lines =
        ran.stderr.lines().filter(|line| line.starts_with("  sub-0") && line.contains("most_dont_know = 0"));
    assert_eq!(lines.count(), 6, "{ran:?}");
}

/// A rule that cannot be applied is refused before the first trial.
#[test]
fn a_rule_without_what_it_needs_is_refused() {
    let scratch = Scratch::default();
    for (rules, reason) in [
        ("most_retest_deviation = 0.5", "repeat_checks of an experiment with ratings"),
        ("most_dont_know = 20", "most_dont_know is 20; write a share from 0 to 1"),
        ("most_unsure = 0.2", "a.study.toml:11: unknown field `most_unsure`"),
    ] {
        let _ = scratch.file("a.study.toml", format!("{FILE}[exclusion]\n{rules}\n"));
        let ran = flotor(scratch.path(), &["study", "run", "a.study.toml"]);
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
        assert!(ran.error().contains(reason) && ran.error().contains("a.study.toml"), "{rules}: {ran:?}");
        assert!(!scratch.path().join("data").exists());
    }
}

/// Who goes on with another version of the file is told which lines changed; what is no study file, where.
#[test]
fn a_changed_study_file_is_refused_with_the_lines_that_changed() {
    let scratch = Scratch::default();
    let _ = scratch.file("a.study.toml", FILE);
    let go = || flotor(scratch.path(), &["study", "run"]);
    assert_eq!(go().code, Some(exit_code::OK));
    assert_eq!(go().code, Some(exit_code::OK), "nothing is left to do");
    let _ = scratch.file("a.study.toml", FILE.replace("[17, 26]", "[17]"));
    let ran = go();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    let said = "another version of a.study.toml: from line 6 on: `bases = [17, 26]`, now `bases = [17]`";
    assert!(ran.error().contains(said), "{ran:?}");
    for (text, reason) in [
        ("task = \"jnd\"\n[options]\nbases = [17\n", "a.study.toml:3: "),
        ("task = \"jnd\"\n[options]\nhelp = true\n", "options.help: `flotor study jnd` has no such option"),
    ] {
        let _ = scratch.file("a.study.toml", text);
        let ran = go();
        assert_eq!((ran.code, ran.stdout.as_str()), (Some(exit_code::CONFIGURATION), ""), "{ran:?}");
        assert!(ran.error().contains(reason) && ran.stderr.lines().count() == 1, "{ran:?}");
    }
}

/// BIDS asks people to complete these files; a study that goes on leaves what they wrote.
#[test]
fn what_people_add_to_the_files_of_a_study_stays() {
    let scratch = Scratch::default();
    let folder = scratch.path();
    let _ = scratch.file("a.study.toml", FILE);
    assert_eq!(flotor(folder, &["study", "run", "a.study.toml"]).code, Some(exit_code::OK));
    let data = folder.join("data");
    let read = |name: &str| std::fs::read_to_string(data.join(name)).unwrap();
    // As a spreadsheet writes it: another order of columns, a typed age, a column of the laboratory.
    let list = read("participants.tsv");
    let with_group = list.lines().enumerate().map(|(row, line)| match row {
        0 => format!("{line}\tgroup\r\n"),
        _ => format!("{}\tpatients\r\n", line.replacen("\tn/a", "\t61", 1)),
    });
    std::fs::write(data.join("participants.tsv"), with_group.collect::<String>()).unwrap();
    let edit = |name: &str, edits: &[(&str, Value)]| {
        let mut object: Value = serde_json::from_str(&read(name)).unwrap();
        edits.iter().for_each(|(key, value)| object[*key] = value.clone());
        std::fs::write(data.join(name), object.to_string()).unwrap();
    };
    edit("dataset_description.json", &[("Name", "Federn".into()), ("Authors", vec!["A. B."].into())]);
    edit("participants.json", &[("group", serde_json::json!({ "Description": "Gruppe" }))]);
    edit("task-jnd_beh.json", &[("InstitutionName", "Labor".into())]);

    // With one subject more, for the files to be written again.
    let _ = scratch.file("a.study.toml", FILE.replace("subjects = 6", "subjects = 7"));
    let ran = flotor(folder, &["study", "run", "a.study.toml", "--resume"]);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let list = read("participants.tsv");
    let rows: Vec<Vec<&str>> = list.lines().map(|line| line.split('\t').collect()).collect();
    let column = |name: &str| rows[0].iter().position(|column| *column == name).unwrap();
    let cells = |name: &str| rows[1..].iter().map(|row| row[column(name)]).collect::<Vec<_>>();
    assert_eq!(cells("participant_id").len(), 7, "{list}");
    assert_eq!(cells("group"), [["patients"; 6].as_slice(), &["n/a"]].concat());
    assert_eq!(cells("age"), [["61"; 6].as_slice(), &["n/a"]].concat());
    let object = |name: &str| -> Value { serde_json::from_str(&read(name)).unwrap() };
    let description = object("dataset_description.json");
    assert_eq!((&description["Name"], &description["Authors"][0]), (&"Federn".into(), &"A. B.".into()));
    assert_eq!(object("participants.json")["group"]["Description"], "Gruppe");
    assert_eq!(object("task-jnd_beh.json")["InstitutionName"], "Labor");

    // What cannot be read is not replaced.
    let damaged = "participant_id;group\nsub-01;patients\n";
    std::fs::write(data.join("participants.tsv"), damaged).unwrap();
    let ran = flotor(folder, &["study", "run", "a.study.toml", "--resume"]);
    assert_ne!(ran.code, Some(exit_code::OK));
    assert!(ran.stderr.contains("participants.tsv: the first column is not `participant_id`"), "{ran:?}");
    assert_eq!(read("participants.tsv"), damaged);
}

#[test]
fn printed_commands_are_quoted() {
    let scratch = Scratch::default();
    let _ = scratch.file("a.study.toml", FILE.replace("\"data\"", "\"Daten Müller\""));
    let ran = flotor(scratch.path(), &["study", "run", "a.study.toml"]);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let command = ran.stdout.lines().find_map(|line| line.trim().strip_prefix("flotor ")).expect("a command");
    let again = Flotor::with(Vec::<&str>::new()).through_shell(&format!("exec \"$@\" {command}"));
    let again = again.inside(scratch.path()).run();
    assert_eq!(again.code, Some(exit_code::OK), "{command}: {again:?}");
}

/// A file is what is in it: a study does not go on with another one of the same name.
#[test]
fn a_study_does_not_go_on_with_a_changed_file() {
    let scratch = Scratch::default();
    let curve = |force_n: f64| format!("compression_mm,force_n\n0,0\n5,{force_n}\n10,9\n");
    let _ = scratch.file("curve.csv", curve(3.0));
    let scene = "title = \"Measured\"\nrate_hz = 1000\n[device]\nplugin = \"simulated\"\n[[model]]\nplugin = \"measured\"\n\
                 [model.parameters]\ncurve = \"curve.csv\"\n";
    let _ = scratch.file("scene.toml", scene);
    let study = |subjects: &str| {
        let task = ["study", "jnd", "--scene", "scene.toml", "--stimulus", "measured.stiffness_scale"];
        let more =
            ["--bases", "1", "--replications", "2", "--feel", "20ms", "--no-demo", "--subjects", subjects];
        let words: Vec<&str> = task.into_iter().chain(more).chain(["--out", "data", "--resume"]).collect();
        flotor(scratch.path(), &words)
    };
    let begun = study("1");
    assert_eq!(begun.code, Some(exit_code::OK), "{begun:?}");
    let inputs = log(scratch.path(), 1).begin.inputs;
    assert_eq!((inputs.len(), inputs[0].used_as.as_str()), (1, "measured.curve"), "{inputs:?}");
    let _ = scratch.file("curve.csv", curve(4.0));
    let changed = study("2");
    assert_eq!(changed.code, Some(exit_code::CONFIGURATION), "{changed:?}");
    assert!(
        changed.error().contains("`curve.csv` (measured.curve) is not the file of the start of the sitting"),
        "{changed:?}"
    );
    let _ = scratch.file("curve.csv", curve(3.0));
    let goes_on = study("2");
    assert_eq!(goes_on.code, Some(exit_code::OK), "{goes_on:?}");
}
