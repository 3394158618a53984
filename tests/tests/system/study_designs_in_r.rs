//! Twenty designs, analysed by `flotor analyse` and by its script in R with all digits: within and between subjects, nested, unbalanced, with
//! one cell, with one subject, of every question and method. Every number of the analysis agrees to 1e-9, or the analysis says why it is
//! not there.

#![allow(clippy::unwrap_used)] // tests may panic

use flotor_tests::TestSize;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::tools::{Tool, required};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

/// What the project promises.
const RELATIVE_BOUND: f64 = 1.0e-9;

const DELAY: &str =
    "[[factor]]\nname = \"delay\"\nsetting = \"device.sensor_latency_ticks\"\nvalues = [0, 8, 32]\n";
const TWO: &str =
    "[[factor]]\nname = \"delay\"\nsetting = \"device.sensor_latency_ticks\"\nvalues = [0, 32]\n";
const BASE: &str = "[[factor]]\nname = \"base\"\nvalues = [17, 35]\n";
const HAND: &str = "[[factor]]\nname = \"hand\"\nsetting = \"device.hand_stiffness_n_per_m\"\nvalues = [1500, 3000]\nvary = \"between\"\n";
const FORCE: &str = "[[factor]]\nname = \"force\"\nsetting = \"spring.free_length_mm\"\nvalues = [20, 25, 30]\nvary = \"between\"\n";
const OF_BASE: &str = "[stimulus]\nsetting = \"spring.gamma_n\"\nstandard = \"base\"\n";
const OF_26: &str = "[stimulus]\nsetting = \"spring.gamma_n\"\nstandard = 26\n";
const CHOICE: &str = "[task]\nask = \"choice\"\n";
const UNSURE: &str = "[task]\nask = \"choice\"\nunsure = true\n";
const YES_NO: &str = "[task]\nask = \"detection\"\n";
const RATING: &str = "[task]\nask = \"rating\"\nscale = { least = 1, most = 9 }\n";
const MAGNITUDE: &str = "[task]\nask = \"magnitude\"\n";
const LEVELS: &str =
    "[method]\nkind = \"constant\"\nlevels = [-0.3, -0.2, -0.1, 0, 0.1, 0.2, 0.3]\nrepetitions = 8\n";
const ONE_LEVEL: &str = "[method]\nkind = \"constant\"\nlevels = [0.12]\nrepetitions = 10\n";
const OFTEN: &str = "[method]\nkind = \"constant\"\nrepetitions = 5\n";
const UP_DOWN: &str = "[method]\nkind = \"weighted-up-down\"\ntracks = 2\n";
const STAIRCASE: &str = "[method]\nkind = \"staircase\"\ntracks = 2\n";
const QUEST: &str = "[method]\nkind = \"quest-plus\"\nrule = { trials = 12 }\n";
const LIMITS: &str = "[method]\nkind = \"limits\"\nlevels = [0.05, 0.1, 0.15, 0.2, 0.25, 0.3]\nseries = 6\n";
const TARGET: &str = "[method]\nkind = \"target-rating\"\nrule = { target = 5, initial = 0.2, gain = 0.05, trials = 20, floor = 0.01, ceiling = 0.9 }\n";

/// Parts of the study file, and number of subjects.
const DESIGNS: [(&[&str], u16); 20] = [
    (&[TWO, OF_26, CHOICE, LEVELS], 12),
    (&[DELAY, BASE, OF_BASE, CHOICE, LEVELS], 8),
    (&[DELAY, HAND, OF_26, CHOICE, LEVELS], 8),
    // Unbalanced: groups of 4 and 3, and of 3, 3 and 2.
    (&[TWO, HAND, OF_26, UNSURE, LEVELS], 7),
    (&[TWO, FORCE, OF_26, CHOICE, ONE_LEVEL], 8),
    // One cell, one subject, and both.
    (&[OF_26, CHOICE, LEVELS], 6),
    (&[DELAY, OF_26, CHOICE, LEVELS], 1),
    (&[OF_26, CHOICE, LEVELS], 1),
    (&[DELAY, OF_26, YES_NO, ONE_LEVEL], 9),
    // Two factors between subjects: 2 x 3 groups of unequal size.
    (&[HAND, FORCE, OF_26, YES_NO, ONE_LEVEL], 15),
    (&[TWO, OF_26, YES_NO, ONE_LEVEL], 2),
    (&[DELAY, RATING, OFTEN], 12),
    (&[DELAY, HAND, FORCE, RATING, OFTEN], 13),
    (&[HAND, RATING, OFTEN], 5),
    (&[DELAY, MAGNITUDE, OFTEN], 10),
    (&[TWO, OF_26, UNSURE, UP_DOWN], 8),
    (&[HAND, OF_26, YES_NO, STAIRCASE], 9),
    (&[DELAY, HAND, OF_26, UNSURE, QUEST], 10),
    (&[TWO, OF_26, YES_NO, LIMITS], 8),
    (&[DELAY, OF_26, RATING, TARGET], 8),
];

/// Numbers of a row, by its name and kind.
type Rows = BTreeMap<String, Vec<f64>>;

#[test]
fn twenty_designs_agree_with_r() {
    if TestSize::of_this_run().leaves_out_long_tests() || !required(Tool::R) {
        return;
    }
    let scratch = Scratch::default();
    let (mut compared, mut refused) = (0, 0);
    for (index, (parts, subjects)) in DESIGNS.iter().enumerate() {
        let study = format!("d{index:02}");
        let simulated = if parts.contains(&OF_26) || parts.contains(&OF_BASE) {
            "[simulated]\nthreshold = 0.12\n"
        } else {
            ""
        };
        let text = format!(
            "study = \"{study}\"\n{}{simulated}[options]\nout = \"{study}\"\nsubjects = {subjects}\napparatus = \"none\"\n",
            parts.concat()
        );
        let _ = scratch.file(&format!("{study}.study.toml"), text);
        let (expected, absent) = of_the_analysis(scratch.path(), &study);
        let found = of_the_script(scratch.path(), &study);
        assert_eq!(
            found.keys().collect::<Vec<_>>(),
            expected.keys().collect::<Vec<_>>(),
            "design {index}; not there: {absent:?}"
        );
        for (name, numbers) in &expected {
            let of_r = &found[name];
            assert_eq!(of_r.len(), numbers.len(), "design {index}, {name}: {of_r:?} for {numbers:?}");
            for (own, r) in numbers.iter().zip(of_r) {
                let scale = r.abs().max(1.0e-6);
                assert!((own - r).abs() <= RELATIVE_BOUND * scale, "design {index}, {name}: {own} for {r}");
                compared += 1;
            }
        }
        refused += absent.len();
    }
    println!("{compared} numbers of 20 designs agree with R, {refused} results are refused with a reason");
    assert!(compared > 400, "{compared}");
}

/// Returns the rows of the analysis, and the reasons of those that are not there.
fn of_the_analysis(folder: &Path, study: &str) -> (Rows, Vec<String>) {
    let flotor = |arguments: &[&str]| {
        let ran = Flotor::with(arguments).inside(folder).run();
        assert_eq!(ran.code, Some(exit_code::OK), "{study}: {ran:?}");
        ran
    };
    flotor(&["study", "run", &format!("{study}.study.toml")]);
    let ran = flotor(&["analyse", study, "--trials", &format!("{study}.csv"), "--json", "-"]);
    let result: Value = serde_json::from_str(&ran.stdout).unwrap();
    let (mut rows, mut absent) = (Rows::new(), Vec::new());
    let mut add = |kind: &str, name: &str, value: &Value, numbers: &[&str]| {
        let numbers: Option<Vec<f64>> =
            numbers.iter().map(|pointer| value.pointer(pointer)?.as_f64()).collect();
        match numbers {
            Some(numbers) => drop(rows.insert(format!("{kind} {name}"), numbers)),
            None => absent.push(format!("{kind} {name}: {value}")),
        }
    };
    for mean in result["means"].as_array().unwrap() {
        let condition = mean["condition"].as_object().unwrap().iter();
        let parts: Vec<String> = condition.map(|(name, value)| format!("{name} {}", text(value))).collect();
        let name = if parts.is_empty() { "all".to_owned() } else { parts.join(", ") };
        add("mean", &name, &mean["mean"], &["/mean", "/interval/0", "/interval/1"]);
    }
    let effects = &result["effects"];
    match effects["anova"].as_array() {
        Some(all) => all.iter().for_each(|one| {
            add("F", one["effect"].as_str().unwrap(), one, &["/df", "/error_df", "/f", "/p"]);
        }),
        None => add("F", "anova", &effects["anova"], &["/f"]),
    }
    for one in effects["ranks"].as_array().unwrap() {
        add("chi", one["factor"].as_str().unwrap(), &one["test"], &["/df", "/chi_square", "/p"]);
    }
    for one in effects["pairs"].as_array().unwrap() {
        let name = one["comparison"].as_str().unwrap();
        let mut test = one["test"].clone();
        if let Some(test) = test.as_object_mut() {
            test.insert("holm".to_owned(), one["p_holm"].clone());
        }
        add("V", name, &test, &["/v", "/p", "/holm"]);
    }
    (rows, absent)
}

/// Formats a level as the program does: a whole number without a fraction.
fn text(value: &Value) -> String {
    value.as_f64().map_or_else(|| value.as_str().unwrap_or_default().to_owned(), |number| number.to_string())
}

/// Returns the rows that the script prints with all digits.
fn of_the_script(folder: &Path, study: &str) -> Rows {
    let path = folder.join(format!("{study}.R"));
    let script = std::fs::read_to_string(&path).unwrap();
    let exact = script
        .replace("sprintf(\"%.4f\", x)", "sprintf(\"%.17g\", x)")
        .replace("ifelse(p < 0.001, \"p < 0.001\", sprintf(\"p = %.3f\", p))", "sprintf(\"p = %.17g\", p)")
        .replace("= %.2f, %s\"", "= %.17g, %s\"")
        .replace("\"V = %g,", "\"V = %.17g,");
    assert_ne!(exact, script);
    // As many iterations as the digits allow.
    let exact = exact.replace("epsilon = 1e-14", "epsilon = 1e-30");
    std::fs::write(&path, exact).unwrap();
    let printed = Command::new("Rscript").arg(&path).current_dir(folder).output().unwrap();
    let (out, error) = (String::from_utf8_lossy(&printed.stdout), String::from_utf8_lossy(&printed.stderr));
    assert!(printed.status.success(), "{study}: {out}{error}");
    out.lines().filter(|line| line.starts_with("  ")).map(row).collect()
}

/// Parses a row: its name is up to the first two spaces, or to the kind of its result.
fn row(line: &str) -> (String, Vec<f64>) {
    let line = line.trim();
    let kinds = [("F", "F("), ("chi", "chi-square("), ("V", "V = ")];
    let found = kinds.into_iter().find_map(|(kind, start)| Some((kind, line.find(start)?)));
    let (kind, at) = found.unwrap_or_else(|| ("mean", line.find("  ").unwrap()));
    let (name, rest) = line.split_at(at);
    // The level of the interval and the number of subjects are no results.
    let rest = rest.replace("(95 %:", "");
    let rest = rest.split(", n = ").next().unwrap_or_default();
    let is_of_number = |one: char| one.is_ascii_digit() || ".-+e".contains(one);
    let numbers = rest.split(|one: char| !is_of_number(one)).filter_map(|word| word.parse::<f64>().ok());
    (format!("{kind} {}", name.trim()), numbers.collect())
}
