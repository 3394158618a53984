//! What other programs make of the trials is what `analyse` prints: the scripts in Python and R beside the table repeat every line,
//! to the last digit.

#![allow(clippy::unwrap_used)] // tests may panic

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

/// The lines of a text that have a number, with single spaces.
fn numbers(text: &str) -> Vec<String> {
    let plain = text.lines().map(|line| line.split_whitespace().collect::<Vec<_>>().join(" "));
    let has_number = |line: &String| line.contains(|one: char| one.is_ascii_digit());
    plain.filter(has_number).filter(|line| !line.starts_with("Partial eta squared")).collect()
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
        let ran = Flotor::with(["analyse", &out, "--trials", &table]).inside(folder).run();
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
        // The checks stand after the tables.
        numbers(ran.stdout.split("\n  Checks").next().unwrap())
    };
    STUDIES.iter().enumerate().map(analyse).collect()
}

fn repeats_every_line(program: &str, extension: &str) {
    let scratch = Scratch::default();
    for (number, expected) in studies(scratch.path()).into_iter().enumerate() {
        let script = format!("trials{number}.{extension}");
        let ran = Command::new(program).arg(&script).current_dir(scratch.path()).output().unwrap();
        let said = String::from_utf8(ran.stdout).unwrap();
        assert!(ran.status.success(), "{script}: {said} {}", String::from_utf8_lossy(&ran.stderr));
        assert_eq!(numbers(&said), expected, "{script}");
        assert!(expected.len() > 8, "{expected:?}");
    }
}

#[test]
fn the_script_in_python_repeats_every_line() {
    let python = std::env::var("FLOTOR_SCIENCE_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let has = Command::new(&python).args(["-c", "import numpy, pandas, scipy"]).output();
    if !has.is_ok_and(|ran| ran.status.success()) {
        lacks(
            Tool::SciencePython,
            "numpy, pandas and scipy are missing (FLOTOR_SCIENCE_PYTHON names a Python that has them)",
        );
        return;
    }
    repeats_every_line(&python, "py");
}

#[test]
fn the_script_in_r_repeats_every_line() {
    if required(Tool::R) {
        repeats_every_line("Rscript", "R");
    }
}
