//! What other programs make of the trials is what `analyse` prints: the scripts in Python and R beside the table repeat every line,
//! to the last digit.

#![allow(clippy::unwrap_used)] // tests may panic

mod degenerate;

use flotor_study::dataset::Dataset;
use flotor_tests::TestSize;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::tools::{Tool, lacks, required};
use std::path::Path;
use std::process::Command;

/// Not the thesis's bases and stimuli, so that nothing stands beside the numbers.
const JND: &[&str] = &["jnd", "--bases", "18,26,35", "--replications", "2"];
const STUDIES: [&[&str]; 6] = [
    JND,
    // Groups of another size, a single base, catch trials that do not count.
    &["jnd", "--bases", "26.5", "--replications", "2", "--subjects", "5", "--catch-trials", "1"],
    &["jnd", "--bases", "20,30", "--replications", "2", "--subjects", "4", "--first", "vh"],
    // A single degree of freedom is left to the residuals.
    &["jnd", "--bases", "18,26,35", "--replications", "2", "--subjects", "2"],
    &["jnd", "--bases", "18,26,35", "--replications", "2", "--subjects", "3"],
    &["magnitude", "--stimuli", "5", "--replications", "2", "--subjects", "5", "--repeat-checks", "1"],
];

/// Rules that take whole sittings and single tracks.
const WITH_RULES: &str = "task = \"jnd\"\n[options]\nout = \"ruled\"\nsubjects = 8\nbases = [26.5]\nreplications = 4\n\
                          feel = \"20ms\"\nno_demo = true\ncatch_trials = 1\n[exclusion]\nmost_false_alarms = 0.6\n\
                          least_movement_mm = 0.03\n";

/// The lines of a text that have a number, or the reason why there is none, with single spaces.
fn numbers(text: &str) -> Vec<String> {
    let plain = text.lines().map(|line| line.split_whitespace().collect::<Vec<_>>().join(" "));
    let has_number = |line: &String| line.contains(|one: char| one.is_ascii_digit());
    let is_result = |line: &String| has_number(line) || line.contains("not testable");
    plain.filter(is_result).filter(|line| !line.starts_with("Partial omega squared")).collect()
}

/// Studies in `folder`, each with its table of trials and what `analyse` printed.
fn studies(folder: &Path) -> Vec<Vec<String>> {
    let moved = !TestSize::of_this_run().leaves_out_long_tests();
    let analyse = |(number, arguments): (usize, &&[&str])| {
        let (out, table) = (format!("data{number}"), format!("trials{number}.csv"));
        let mut words = vec!["study"];
        words.extend(arguments.iter());
        let is_first = number == 0;
        words.extend(if is_first && moved { ["--feel", "50ms"] } else { ["--apparatus", "none"] });
        words.extend(["--no-demo"].iter().filter(|_| arguments[0] == "jnd"));
        words.extend(["--subjects", "6"].iter().filter(|_| is_first));
        words.extend(["--out", &out]);
        let ran = Flotor::with(words).inside(folder).run();
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
        numbers_of(folder, &out, &table)
    };
    let all = STUDIES.iter().enumerate().map(analyse);
    all.chain([study_with_rules(folder, &format!("trials{}.csv", STUDIES.len()))]).collect()
}

/// The numbers that `analyse` prints, with a table of the trials.
fn numbers_of(folder: &Path, data: &str, table: &str) -> Vec<String> {
    let ran = Flotor::with(["analyse", data, "--trials", table]).inside(folder).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    assert!(!ran.stderr.contains("the scripts beside"), "{ran:?}");
    // Checks and origin stand after the tables.
    let tables = ran.stdout.split("\n  Checks").next().unwrap().split("\n  Provenance").next().unwrap();
    numbers(tables.split("\n  Excluded").next().unwrap())
}

/// A study whose rules took sittings and tracks, which the table marks.
fn study_with_rules(folder: &Path, table: &str) -> Vec<String> {
    std::fs::write(folder.join("ruled.study.toml"), WITH_RULES).unwrap();
    let ran = Flotor::with(["study", "run", "ruled.study.toml"]).inside(folder).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let numbers = numbers_of(folder, "ruled", table);
    let trials = std::fs::read_to_string(folder.join(table)).unwrap();
    let marked = |rule: &str| trials.lines().filter(|line| line.ends_with(rule)).count();
    assert!(marked(",most_false_alarms") > 0 && marked(",least_movement_mm") > 0, "{trials}");
    numbers
}

/// The scripts know the defaults alone: with anything else, `analyse` says that their tables differ.
#[test]
fn other_options_are_said_not_to_be_those_of_the_scripts() {
    let scratch = Scratch::default();
    for (study, options) in [
        (
            &["jnd", "--bases", "26", "--replications", "2"][..],
            &[("--type", "II"), ("--estimator", "map")][..],
        ),
        (&["magnitude", "--stimuli", "3", "--replications", "1"], &[("--ratings", "raw"), ("--type", "II")]),
    ] {
        let others = ["--subjects", "3", "--apparatus", "none", "--out", study[0]];
        let words = study.iter().chain(&others);
        let ran = Flotor::with(["study"].iter().chain(words)).inside(scratch.path()).run();
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
        for (option, value) in options {
            let words = ["analyse", study[0], "--trials", "t.csv", option, value];
            let ran = Flotor::with(words).inside(scratch.path()).run();
            assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
            assert!(ran.stderr.contains("note: the scripts beside t.csv use the defaults of "), "{ran:?}");
        }
    }
}

/// One statistic that cannot be computed takes no other away, in text, JSON, page and tables.
#[test]
fn studies_without_variation_are_analysed_to_the_end() {
    let scratch = Scratch::default();
    for study in &degenerate::STUDIES {
        study.write(scratch.path());
        let files = ["r.json", "p.html", "r.csv", "t.csv"];
        let words = [
            "analyse", study.name, "--json", files[0], "--html", files[1], "--csv", files[2], "--trials",
            files[3],
        ];
        let ran = Flotor::with(words).inside(scratch.path()).run();
        assert_eq!(ran.code, Some(exit_code::OK), "{}: {ran:?}", study.name);
        let [json, page, responses, _] =
            files.map(|file| std::fs::read_to_string(scratch.path().join(file)).unwrap());
        let ran = Flotor::with(["analyse", study.name]).inside(scratch.path()).run();
        let lines = numbers(&ran.stdout);
        assert!(lines.iter().any(|line| line == study.line), "{}: {lines:#?}", study.name);
        let (_, reason) = study.line.split_once("not testable: ").unwrap();
        assert!(json.contains(&format!("\"not_testable\": \"{reason}\"")), "{}: {json}", study.name);
        assert!(page.contains("not testable: "), "{}", study.name);
        let conditions = match study.task {
            degenerate::Task::Pairs => 6,
            degenerate::Task::Ratings => 8,
        };
        assert_eq!(responses.lines().count(), 1 + conditions * usize::from(study.subjects), "{}", study.name);
        // A family keeps its size: each comparison has its row.
        let comparisons = lines.iter().filter(|line| line.starts_with("h - vh, ")).count();
        assert_eq!(comparisons, conditions / 2, "{}: {lines:#?}", study.name);
    }
}

fn repeats_every_line(program: &str, extension: &str) {
    let scratch = Scratch::default();
    let mut all = studies(scratch.path());
    for study in &degenerate::STUDIES {
        study.write(scratch.path());
        all.push(numbers_of(scratch.path(), study.name, &format!("trials{}.csv", all.len())));
    }
    for (number, expected) in all.into_iter().enumerate() {
        let script = format!("trials{number}.{extension}");
        let ran = Command::new(program).arg(&script).current_dir(scratch.path()).output().unwrap();
        let said = String::from_utf8(ran.stdout).unwrap();
        assert!(ran.status.success(), "{script}: {said} {}", String::from_utf8_lossy(&ran.stderr));
        assert_eq!(numbers(&said), expected, "{script}");
        assert!(expected.len() > 8, "{expected:?}");
    }
}

/// A Python with numpy, scipy and pandas.
pub(crate) fn science_python() -> Option<String> {
    let python = std::env::var("FLOTOR_SCIENCE_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let has = Command::new(&python).args(["-c", "import numpy, pandas, scipy"]).output();
    if has.is_ok_and(|ran| ran.status.success()) {
        return Some(python);
    }
    lacks(
        Tool::SciencePython,
        "numpy, pandas and scipy are missing (FLOTOR_SCIENCE_PYTHON names a Python that has them)",
    );
    None
}

#[test]
fn the_script_in_python_repeats_every_line() {
    if let Some(python) = science_python() {
        repeats_every_line(&python, "py");
    }
}

/// Runs a script that prints each number that is off, and at the end how many it compared.
fn compares(python: &str, script: &str, folder: &Path, words: &[&str], least: u32) {
    let ran = Command::new(python).args(["-c", script]).args(words).current_dir(folder).output().unwrap();
    let said = String::from_utf8_lossy(&ran.stdout).into_owned();
    let counted = said.trim().strip_prefix("compared ").and_then(|count| count.parse::<u32>().ok());
    let errors = String::from_utf8_lossy(&ran.stderr);
    assert!(counted.is_some_and(|count| count >= least), "{words:?}: {said} {errors}");
}

/// Every number of a report, by numpy and scipy: 1e-9 of F, t, means and sizes, 1e-6 of p, epsilons and limits.
#[test]
fn every_number_of_a_report_is_that_of_scipy() {
    let Some(python) = science_python() else { return };
    let scratch = Scratch::default();
    let mut data: Vec<String> = (0..STUDIES.len()).map(|number| format!("data{number}")).collect();
    studies(scratch.path());
    for study in &degenerate::STUDIES {
        study.write(scratch.path());
        data.push(study.name.to_owned());
    }
    for data in &data {
        let words = ["analyse", data, "--trials", "t.csv", "--json", "r.json"];
        let ran = Flotor::with(words).inside(scratch.path()).run();
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
        let script = include_str!("study_scripts/recompute.py");
        compares(&python, script, scratch.path(), &["r.json", "t.csv"], 8);
    }
}

/// Thresholds, lapses, their limits and the ends that answers do not bound, by scipy on a fine grid: 1e-6.
#[test]
fn psychometric_functions_are_those_of_a_fine_grid() {
    let Some(python) = science_python() else { return };
    let scratch = Scratch::default();
    let conditions = if TestSize::of_this_run().leaves_out_long_tests() { "1" } else { "6" };
    let words = ["study", "jnd", "--subjects", "2", "--apparatus", "none", "--out", "simulated"];
    assert_eq!(Flotor::with(words).inside(scratch.path()).run().code, Some(exit_code::OK));
    let mut data = vec!["simulated"];
    for study in degenerate::STUDIES.iter().filter(|study| matches!(study.task, degenerate::Task::Pairs)) {
        study.write(scratch.path());
        Dataset::at(&scratch.path().join(study.name)).write_tables().unwrap();
        data.push(study.name);
    }
    for data in data {
        let words = ["analyse", data, "--each", "--json", "each.json"];
        assert_eq!(Flotor::with(words).inside(scratch.path()).run().code, Some(exit_code::OK));
        let script = include_str!("study_scripts/refit.py");
        compares(&python, script, scratch.path(), &["each.json", data, conditions], 8);
    }
}

/// Ways to start the script in a folder `Meine Daten (Übung)`, each with the folder in which R works.
const STARTS_OF_R: [(&str, &str); 9] = [
    ("Rscript trials.R", "Meine Daten (Übung)"),
    ("Rscript 'Meine Daten (Übung)/trials.R'", "."),
    ("Rscript \"$PWD/Meine Daten (Übung)/trials.R\" 'Meine Daten (Übung)/trials.csv'", "."),
    ("R --no-echo --no-save -f 'Meine Daten (Übung)/trials.R'", "."),
    ("Rscript -e 'source(\"Meine Daten (Übung)/trials.R\")'", "."),
    ("Rscript -e 'source(\"Meine Daten (Übung)/trials.R\", chdir = TRUE)'", "."),
    ("Rscript -e 'setwd(\"Meine Daten (Übung)\"); source(\"trials.R\")' of another script", "."),
    ("R --no-echo --no-save < trials.R", "Meine Daten (Übung)"),
    ("cp trials.R renamed.R && Rscript renamed.R", "Meine Daten (Übung)"),
];

#[test]
fn the_script_in_r_finds_its_table_however_it_is_started() {
    if !required(Tool::R) {
        return;
    }
    let scratch = Scratch::default();
    let ran = Flotor::with(
        ["study", "jnd", "--bases", "26.5", "--replications", "2", "--subjects", "3"].iter().chain(&[
            "--apparatus",
            "none",
            "--no-demo",
            "--out",
            "data",
        ]),
    );
    assert_eq!(ran.inside(scratch.path()).run().code, Some(exit_code::OK));
    let data = scratch.path().join("Meine Daten (Übung)");
    std::fs::create_dir(&data).unwrap();
    let expected = numbers_of(scratch.path(), "data", "Meine Daten (Übung)/trials.csv");
    assert!(expected.len() > 8, "{expected:?}");
    for (command, folder) in STARTS_OF_R {
        let folder = scratch.path().join(folder);
        let ran = Command::new("sh").args(["-c", command]).current_dir(&folder).output().unwrap();
        let said = String::from_utf8(ran.stdout).unwrap();
        assert!(ran.status.success(), "{command}: {said} {}", String::from_utf8_lossy(&ran.stderr));
        assert_eq!(numbers(&said), expected, "{command}");
    }
}

#[test]
fn the_script_in_r_repeats_every_line() {
    if required(Tool::R) {
        repeats_every_line("Rscript", "R");
    }
}
