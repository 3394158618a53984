//! The claims of a study's report: who answered, what was planned, and that nothing of the text is missing on the page.

#![allow(clippy::unwrap_used)] // tests may panic

use flotor_study::dataset::Dataset;
use flotor_study::log::{Begin, Event, FORMAT, Incident};
use flotor_study::protocol::{JndProtocol, Protocol, SubjectNumber};
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use serde_json::Value;
use std::path::Path;

/// Words that every result of simulated observers carries.
const RESTRICTION: &str = "simulated observers, no person was tested";

const FILE: &str = "task = \"jnd\"\nanalysis = \"paired t-test\"\n[options]\nout = \"data\"\nsubjects = 5\n\
                    apparatus = \"none\"\nbases = [18, 26]\nreplications = 2\ncatch_trials = 1\nrepeat_checks = 1\n\
                    [analyse]\nestimator = \"procedure\"\n[exclusion]\nmost_dont_know = 0.9\n";

fn flotor(folder: &Path, arguments: &[&str]) -> Ran {
    Flotor::with(arguments).inside(folder).run()
}

fn succeeds(folder: &Path, arguments: &[&str]) -> Ran {
    let ran = flotor(folder, arguments);
    assert_eq!(ran.code, Some(exit_code::OK), "{arguments:?}: {ran:?}");
    ran
}

fn read(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn json(folder: &Path, name: &str) -> Value {
    serde_json::from_str(&read(folder, name)).unwrap()
}

/// A folder with the data of the study file.
fn studied() -> Scratch {
    let scratch = Scratch::default();
    let _ = scratch.file("a.study.toml", FILE);
    succeeds(scratch.path(), &["study", "run", "a.study.toml"]);
    scratch
}

/// The column `observer` of a table says in every row that the subject was simulated.
fn has_observer_in_every_row(table: &str, separator: char) {
    let mut lines = table.lines().map(|line| line.split(separator).collect::<Vec<_>>());
    let head = lines.next().unwrap();
    let column = head.iter().position(|name| *name == "observer").unwrap_or_else(|| panic!("{head:?}"));
    let cells: Vec<&str> = lines.map(|line| line[column]).collect();
    assert!(!cells.is_empty() && cells.iter().all(|cell| *cell == "simulated"), "{table}");
}

/// A warning on standard error alone is lost with `> result.txt`.
#[test]
fn every_output_of_simulated_observers_says_that_nobody_was_tested() {
    let scratch = studied();
    let folder = scratch.path();
    let files =
        ["--csv", "rows.csv", "--trials", "trials.csv", "--html", "page.html", "--json", "result.json"];
    let ran = succeeds(folder, &[&["analyse", "data"][..], &files].concat());
    let first = ran.stdout.lines().next().unwrap_or_default();
    assert!(first.contains(RESTRICTION), "{first}");
    let page = read(folder, "page.html");
    assert!(
        page.contains(&format!(": {RESTRICTION}</title>")) && page.contains(&format!(": {RESTRICTION}</h1>"))
    );
    let watermarks = page.matches(&format!(">{RESTRICTION}</text>")).count();
    assert!(watermarks > 2 && watermarks == page.matches("<svg").count(), "{watermarks}");
    let result = json(folder, "result.json");
    assert_eq!(result["observer"], "simulated");
    let provenance = &result["provenance"];
    assert_eq!((&provenance["seed"], &provenance["options"]["estimator"]), (&1.into(), &"procedure".into()));
    assert!(provenance["threshold_rule"]["weighted-up-down"]["averaging"].is_string(), "{provenance}");
    for key in ["version", "configuration", "exclusion_sha256"] {
        assert!(provenance[key].as_str().is_some_and(|text| !text.is_empty()), "{key}: {provenance}");
    }
    has_observer_in_every_row(&read(folder, "rows.csv"), ',');
    has_observer_in_every_row(&read(folder, "trials.csv"), ',');
    has_observer_in_every_row(&read(folder, "data/participants.tsv"), '\t');
    has_observer_in_every_row(&read(folder, "data/sub-01/beh/sub-01_task-jnd_beh.tsv"), '\t');

    let ran = succeeds(folder, &["analyse", "data", "--blind", "--json", "blind.json", "--csv", "blind.csv"]);
    assert!(ran.stdout.lines().next().unwrap().contains(RESTRICTION), "{ran:?}");
    let blind = json(folder, "blind.json");
    assert_eq!(blind["observer"], "simulated");
    assert!(blind["provenance"].is_null(), "the seed tells the codes: {blind}");
    has_observer_in_every_row(&read(folder, "blind.csv"), ',');
    let ran = succeeds(folder, &["analyse", "data", "--each", "--json", "each.json"]);
    assert!(ran.stdout.lines().next().unwrap().contains(RESTRICTION), "{ran:?}");
    let each = json(folder, "each.json");
    assert!(each.as_array().unwrap().iter().all(|one| one["observer"] == "simulated"), "{each}");
}

/// Returns the words of a text of the page, without its markup.
fn words_of(page: &str) -> String {
    let mut words = String::new();
    for part in page.split('<') {
        let text = part.split_once('>').map_or(part, |(_, text)| text);
        words += " ";
        words += text;
    }
    words.split_whitespace().collect::<Vec<_>>().join(" ").replace("&quot;", "\"")
}

/// Every number of the text stands on the page.
#[test]
fn the_page_has_every_number_of_the_text() {
    let scratch = studied();
    let folder = scratch.path();
    succeeds(
        folder,
        &[
            "study",
            "magnitude",
            "--subjects",
            "4",
            "--stimuli",
            "4",
            "--apparatus",
            "none",
            "--out",
            "ratings",
        ],
    );
    for data in ["data", "ratings"] {
        let ran = succeeds(folder, &["analyse", data, "--html", "page.html"]);
        let words = words_of(&read(folder, "page.html"));
        let is_number = |word: &&str| word.chars().any(|one| one.is_ascii_digit());
        let plain = |word: &str| {
            word.trim_matches(|one: char| !one.is_alphanumeric() && !"-.)%".contains(one)).to_owned()
        };
        let numbers: Vec<String> = ran.stdout.split_whitespace().filter(is_number).map(plain).collect();
        assert!(numbers.len() > 60, "{}", ran.stdout);
        for number in numbers {
            let bare = number.trim_matches(|one| "()".contains(one));
            assert!(words.contains(bare), "{data}: {number} of the text is not on the page\n{words}");
        }
    }
}

/// What was planned and what was done stand side by side.
#[test]
fn an_analysis_says_whether_it_was_planned() {
    let scratch = studied();
    let folder = scratch.path();
    let analysed = |options: &[&str]| {
        let files = ["analyse", "data", "--html", "page.html", "--json", "result.json"];
        let ran = succeeds(folder, &[&files[..], options].concat());
        (ran.stdout, words_of(&read(folder, "page.html")), json(folder, "result.json"))
    };
    let (text, page, result) = analysed(&[]);
    assert!(text.contains(" as planned") && !text.contains("not as planned"), "{text}");
    assert_eq!(result["provenance"]["plan"], "as-planned");
    let hash = result["provenance"]["study_file"]["sha256"].as_str().unwrap();
    for wanted in ["a.study.toml", hash, "paired t-test", "as planned", "most_dont_know = 0.9"] {
        assert!(text.contains(wanted) && page.contains(wanted), "{wanted}\n{text}\n{page}");
    }
    assert!(page.contains("bases = [18, 26]"), "the text of the study file: {page}");
    let said = "not as planned: --estimator map, planned procedure; --type II, planned III";
    let (text, page, result) = analysed(&["--estimator", "map", "--type", "II"]);
    assert!(text.contains(said) && page.contains(said), "{text}");
    assert_eq!(result["provenance"]["plan"]["not-as-planned"].as_array().unwrap().len(), 2);
    // One sitting fewer than planned.
    std::fs::remove_dir_all(folder.join("data/sourcedata/sub-03")).unwrap();
    let (text, ..) = analysed(&[]);
    assert!(text.contains("not as planned: complete sittings: 4, planned 5"), "{text}");
    // Without a study file there is nothing to agree with.
    succeeds(
        folder,
        &[
            "study",
            "jnd",
            "--bases",
            "26",
            "--replications",
            "2",
            "--subjects",
            "2",
            "--apparatus",
            "none",
            "--out",
            "free",
        ],
    );
    let ran = succeeds(folder, &["analyse", "free"]);
    assert!(ran.stdout.contains("without a plan"), "{ran:?}");
    // A plan that `analyse` cannot carry out is refused before the first trial.
    let _ = scratch.file("b.study.toml", FILE.replace("\"procedure\"", "\"mean\""));
    let ran = flotor(folder, &["study", "run", "b.study.toml"]);
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(
        ran.error()
            .contains("b.study.toml: analyse.estimator: `mean` is not valid; use one of procedure, map"),
        "{ran:?}"
    );
}

/// The folder of the data is no part of a study: whoever renames it goes on with the study.
#[test]
fn a_study_goes_on_in_a_renamed_folder() {
    let scratch = studied();
    let folder = scratch.path();
    std::fs::rename(folder.join("data"), folder.join("renamed")).unwrap();
    let _ = scratch.file(
        "a.study.toml",
        FILE.replace("\"data\"", "\"renamed\"").replace("subjects = 5", "subjects = 6"),
    );
    let ran = succeeds(folder, &["study", "run", "a.study.toml"]);
    assert!(ran.stdout.contains("6 of 6 subjects complete"), "{ran:?}");
}

#[test]
fn options_may_stand_before_the_study_file() {
    let scratch = Scratch::default();
    let _ = scratch.file("a.study.toml", FILE);
    let ran = succeeds(
        scratch.path(),
        &["study", "run", "--observer", "simulated", "a.study.toml", "--subjects", "2"],
    );
    assert!(ran.stdout.contains("2 of 2 subjects complete"), "{ran:?}");
}

/// Cuts the log of a subject after so many lines.
fn cut(folder: &Path, subject: &str, lines: usize) {
    let path = folder.join(format!("data/sourcedata/{subject}/{subject}_task-jnd_log.jsonl"));
    let text = std::fs::read_to_string(&path).unwrap();
    let kept: String = text.split_inclusive('\n').take(lines).collect();
    assert!(kept.len() < text.len());
    std::fs::write(path, kept).unwrap();
}

/// The answers of a sitting that broke off are no result, however few sittings there are.
#[test]
fn an_unfinished_sitting_is_named_and_is_no_data() {
    let scratch = Scratch::default();
    let folder = scratch.path();
    let two =
        ["study", "jnd", "--bases", "26", "--replications", "2", "--subjects", "2", "--apparatus", "none"];
    succeeds(folder, &[&two[..], &["--no-demo", "--out", "data"]].concat());
    cut(folder, "sub-02", 12);
    let ran = succeeds(folder, &["analyse", "data", "--json", "result.json"]);
    assert!(ran.stderr.contains("note: sub-02: incomplete after 11 trials, omitted"), "{ran:?}");
    assert!(ran.stdout.contains("sub-01: ") && !ran.stdout.contains("sub-02"), "{ran:?}");
    let result = json(folder, "result.json");
    assert_eq!(result.as_array().unwrap().len(), 1, "{result}");
    // Requested by name, it is shown with its state.
    let ran = succeeds(folder, &["analyse", "data", "--each", "--json", "each.json"]);
    assert!(ran.stdout.contains("! incomplete after 11 trials: not part of the data"), "{ran:?}");
    let each = json(folder, "each.json");
    assert_eq!((&each[0]["complete"], &each[1]["complete"]), (&true.into(), &false.into()));
    cut(folder, "sub-01", 8);
    let ran = flotor(folder, &["analyse", "data"]);
    assert_eq!((ran.code, ran.stdout.as_str()), (Some(exit_code::CONFIGURATION), ""), "{ran:?}");
    assert!(
        ran.error().contains("no sitting is complete (sub-01: incomplete after 7 trials, sub-02: "),
        "{ran:?}"
    );
}

/// Runs a study of simulated observers without apparatus, and returns the mean Weber fractions of its analysis.
fn weber(folder: &Path, study: &[&str], out: &str) -> [f64; 2] {
    let common = ["--apparatus", "none", "--no-demo", "--subjects", "8", "--seed", "7", "--out", out];
    succeeds(folder, &[&["study"][..], study, &common].concat());
    succeeds(folder, &["analyse", out, "--json", "result.json"]);
    let weber = json(folder, "result.json")["weber"].clone();
    ["vh", "h"].map(|modality| weber[modality].as_f64().unwrap())
}

/// One observer for everything gave springs, walls, weights and resistances the same Weber fractions to 17 digits.
#[test]
fn each_quality_has_weber_fractions_of_its_own() {
    let scratch = Scratch::default();
    let folder = scratch.path();
    let spring = weber(folder, &["jnd"], "spring");
    let wall =
        weber(folder, &["jnd", "--stimulus", "wall.stiffness_n_per_m", "--bases", "500,1000,1500"], "wall");
    let felt = weber(folder, &["force", "--way", "felt"], "felt");
    let exerted = weber(folder, &["force", "--way", "exerted"], "exerted");
    let all = [spring, wall, felt, exerted];
    for (index, one) in all.iter().enumerate() {
        assert!(all[index + 1..].iter().all(|other| one != other), "{all:?}");
    }
    // The published fractions of stiffness are twice those of force and more.
    for force in [felt, exerted] {
        assert!(force[0] < 0.8 * spring[0] && force[1] < 0.8 * spring[1], "{all:?}");
    }
    let length = ["jnd", "--stimulus", "spring.free_length_mm", "--bases", "25", "--ceiling", "0.5"];
    let refused =
        flotor(folder, &[&["study"][..], &length, &["--apparatus", "none", "--out", "length"]].concat());
    assert_eq!(refused.code, Some(exit_code::CONFIGURATION), "{refused:?}");
    assert!(refused.error().contains("--weber 0.14,0.17") && !folder.join("length").exists(), "{refused:?}");
    let given = weber(folder, &[&length[..], &["--weber", "0.03,0.3"]].concat(), "length");
    assert!(given[0] < 0.1 && given[1] > 0.2, "{given:?}");
}

/// A person's rating of 0 or less is refused, and nobody simulated gives one: the usual scale takes the default data.
#[test]
fn ratings_of_simulated_observers_are_those_that_people_can_give() {
    let scratch = Scratch::default();
    let folder = scratch.path();
    succeeds(folder, &["study", "magnitude", "--seed", "7", "--apparatus", "none", "--out", "data"]);
    succeeds(folder, &["analyse", "data", "--ratings", "geometric-mean", "--trials", "trials.csv"]);
    let table = read(folder, "trials.csv");
    let head: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    let column = head.iter().position(|name| *name == "rating").unwrap();
    let ratings: Vec<f64> =
        table.lines().skip(1).filter_map(|line| line.split(',').nth(column).unwrap().parse().ok()).collect();
    assert!(ratings.len() == 16 * 72 && ratings.iter().all(|rating| *rating > 0.0), "{}", ratings.len());
}

/// The direction of an effect stands beside that of the thesis.
#[test]
fn the_direction_of_movement_stands_beside_that_of_the_thesis() {
    let scratch = Scratch::default();
    let folder = scratch.path();
    let short = ["--subjects", "3", "--replications", "1", "--demo", "0", "--feel", "700ms", "--out", "data"];
    succeeds(folder, &[&["study", "magnitude"][..], &short].concat());
    let ran = succeeds(folder, &["analyse", "data", "--html", "page.html"]);
    let lines: Vec<&str> =
        ran.stdout.lines().filter(|line| line.contains("exponent of the stimulus")).collect();
    let ways = ["rises", "rises", "falls"].map(|way| format!("{way} (section 5): not reproduced"));
    assert!(lines.len() == 3 && lines.iter().zip(&ways).all(|(line, way)| line.ends_with(way)), "{lines:?}");
    let exponent = |line: &str| -> f64 { line.split_whitespace().nth(4).unwrap().parse().unwrap() };
    assert!(exponent(lines[0]) < 0.0 && exponent(lines[1]) < 0.0 && exponent(lines[2]) > 0.0, "{lines:?}");
    let page = words_of(&read(folder, "page.html"));
    assert!(ways.iter().all(|way| page.contains(way)), "{page}");
}

/// Thirteen lines about one missed tick each hid everything else.
#[test]
fn missed_ticks_are_one_line() {
    let scratch = Scratch::default();
    let protocol = Protocol::Jnd(JndProtocol::default());
    let begin = Begin {
        format: FORMAT,
        version: "0.1.0".to_owned(),
        subject: SubjectNumber::new(1).unwrap(),
        seed: 1,
        plan: None,
        protocol,
        person: None,
        observer: Value::from("human"),
        apparatus: Value::Null,
        inputs: Vec::new(),
    };
    let (_, mut log) = Dataset::at(&scratch.path().join("data")).begin(begin).unwrap();
    for incident in [
        Incident::MissedTicks { ticks: 1 },
        Incident::OutOfRange,
        Incident::MissedTicks { ticks: 12 },
        Incident::Stopped,
    ] {
        log.write(&Event::Incident(incident)).unwrap();
    }
    let ran = succeeds(scratch.path(), &["analyse", "data", "--each"]);
    let about: Vec<&str> = ran.stdout.lines().filter(|line| line.contains("were missed")).collect();
    assert_eq!(about, ["  while 2 stimuli were felt: 13 ticks were missed"], "{ran:?}");
    assert!(
        ran.stdout.contains("the handle left its range") && ran.stdout.contains("stopped at the keyboard")
    );
}
