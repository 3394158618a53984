//! The card of the judges: which of them finds which defect of a law, and that none is found where there is none.
//!
//! `tests/fixtures/defective-model` has each defect as small as a reviewer once hid it; the book's page prints the table.

use flotor_tests::library::plugin_file;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::{TestSize, workspace_root};
use serde_json::Value;

/// Who finds a defect.
#[derive(Clone, Copy)]
enum Judge {
    /// This measure of `flotor stress`.
    Stress(&'static str),
    /// The measure of symmetry, of a model declared to have that one.
    Symmetry(&'static str),
    /// This rule of `flotor validate`.
    Validate(&'static str),
    /// Nobody but by chance.
    Chance,
}

use Judge::{Chance, Stress, Symmetry, Validate};

/// A defect, in words, and the first judge that finds it.
const CARD: [(&str, &str, Judge); 20] = [
    ("force-step", "step of 1 mN at one plane", Stress("M1")),
    ("torque-step", "step of 0.01 N·mm at one plane", Stress("M1")),
    ("curl", "swirl of 1e-4 of the stiffness", Stress("M3")),
    ("small-curl", "swirl of 1e-5 of the stiffness", Stress("M3")),
    ("leak", "memory leak in each step", Validate("no-system-calls")),
    ("allocation", "allocation in each step", Validate("no-system-calls")),
    ("nan-ball", "NaN in a ball of 0.1 mm", Chance),
    ("panic-ball", "panic in a ball of 1 mm", Stress("M0")),
    ("nan-at-rest", "NaN at exact rest", Stress("M0")),
    ("nan-on-nan", "NaN for a pose that is none", Stress("M0")),
    ("not-a-rotation", "NaN for a quaternion of another length", Stress("M0")),
    ("lopsided", "1 % stiffer on one side, conservative", Symmetry("mirror-x")),
    ("wrong-energy", "energy wrong by 1 %", Stress("M4")),
    ("wrong-torque", "torque of the wrong sign", Stress("M4")),
    ("noise", "noise of a micronewton", Stress("M8")),
    ("hysteresis", "hysteresis in a model that declares no memory", Stress("M4")),
    ("creep", "creep in a model that declares no memory", Stress("M4")),
    ("slow-slab", "5 ms in a slab of 0.2 mm", Stress("M7")),
    ("cliff", "10 kN beyond 10.5 mm", Stress("M1")),
    ("endless-slab", "endless loop in a slab of 0.1 mm", Stress("M0")),
];

fn library() -> String {
    plugin_file("fixture-defective-model").display().to_string()
}

/// What `flotor stress` says of a model, with these further arguments.
fn measures(model: &str, further: &[&str]) -> Vec<Value> {
    let arguments = ["stress", "--model", model, "--json", "-"];
    let ran = Flotor::with(arguments.iter().chain(further)).run();
    let report: Value = serde_json::from_str(&ran.stdout).unwrap_or_else(|_| panic!("{further:?}: {ran:#?}"));
    report["measures"].as_array().expect("measures").clone()
}

/// The measures that do not pass; of those that passed or were noted only the first can be a defect.
fn found_by(model: &str, defect: &str, further: &[&str]) -> Vec<String> {
    let set = format!("defect={defect}");
    let mut arguments = vec!["--set", &set];
    arguments.extend(further);
    let found = measures(model, &arguments).into_iter().filter(|measure| measure["verdict"] != "pass");
    found.map(|measure| measure["id"].as_str().expect("a name").to_owned()).collect()
}

fn is_found(judge: Judge, model: &str, defect: &str) -> bool {
    match judge {
        // A call that does not return is told sooner than usual.
        Stress(measure) => !found_by(model, defect, &["--only", measure, "--timeout", "2s"]).is_empty(),
        Symmetry(symmetry) => !found_by(model, defect, &["--only", "M10", "--symmetry", symmetry]).is_empty(),
        Validate(rule) => {
            let set = format!("defect={defect}");
            let ran = Flotor::with(["validate", model, "--only", rule, "--set", &set, "--json"]).run();
            let findings: Vec<Value> = serde_json::from_str(&ran.stdout).expect("a list");
            findings.iter().any(|finding| finding["rule"] == rule && !finding["violation"].is_null())
        }
        Chance => false,
    }
}

#[test]
fn every_defect_is_found_by_the_judge_that_the_card_names() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let model = library();
    let missed: Vec<&str> = CARD
        .iter()
        .filter(|(.., judge)| !matches!(judge, Chance))
        .filter(|(defect, _, judge)| !is_found(*judge, &model, defect))
        .map(|(defect, ..)| *defect)
        .collect();
    assert_eq!(missed, Vec::<&str>::new());
}

#[test]
fn where_there_is_no_defect_none_is_found() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let model = library();
    // Cost is the machine's as well: a loaded one may note it.
    let found = found_by(&model, "none", &["--symmetry", "mirror-x"]);
    assert_eq!(found.iter().filter(|measure| *measure != "M7").count(), 0, "{found:?}");
    for (_, _, judge) in CARD.iter().filter(|(.., judge)| matches!(judge, Validate(_))) {
        assert!(!is_found(*judge, &model, "none"));
    }
}

/// The pose and the time are told, and the measures after it are made.
#[test]
fn a_call_that_does_not_return_is_named_and_the_score_goes_on() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let measures = measures(
        &library(),
        &["--set", "defect=endless-slab", "--timeout", "1s", "--only", "M0", "--only", "M8"],
    );
    let stuck = &measures[0];
    assert_eq!(stuck["verdict"], "fail");
    let remark = stuck["remark"].as_str().expect("a text");
    assert!(remark.starts_with("`step` did not return in tick "), "{remark}");
    assert!(remark.contains(" within 1 s of processor time"), "{remark}");
    let x_m = stuck["pose"]["position_m"][0].as_f64().expect("a pose");
    assert!((7.0e-3..7.1e-3).contains(&x_m), "{x_m}");
    assert_eq!(measures.len(), 2);
}

/// A score of no measures is no score.
#[test]
fn the_measure_of_a_symmetry_needs_its_name() {
    for only in [&["--only", "M10"][..], &["--only", "M0", "--only", "M10"]] {
        let ran = Flotor::with(["stress", "--model", "wall"].iter().chain(only)).run();
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
        assert!(ran.stderr.contains("--symmetry <"), "{ran:#?}");
    }
}

/// A hole in a flat field is found by chance alone. The page states the smallest one that a short run finds.
#[test]
fn the_smallest_hole_that_is_found_is_as_large_as_the_page_says() {
    let model = library();
    let finds = |radius: f64| {
        let radius = format!("radius_mm={radius}");
        !found_by(&model, "nan-ball", &["--set", &radius, "--only", "M0"]).is_empty()
    };
    let smallest = RADII_MM.into_iter().find(|radius| finds(*radius));
    assert_eq!(smallest, Some(SMALLEST_MM));
    assert!(
        page()
            .contains(&format!("The smallest ball that a short run finds has a radius of {SMALLEST_MM} mm"))
    );
}

const RADII_MM: [f64; 7] = [0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5];
const SMALLEST_MM: f64 = 0.7;

fn page() -> String {
    std::fs::read_to_string(workspace_root().join("docs/src/stress.md")).expect("the page is text")
}

#[test]
fn the_page_has_the_card() {
    let page = page();
    for (_, words, judge) in CARD {
        let who = match judge {
            Stress(measure) => format!("`stress`, {measure}"),
            Symmetry(symmetry) => format!("`stress --symmetry {symmetry}`, M10"),
            Validate(rule) => format!("`validate`, `{rule}`"),
            Chance => "nobody, see below".to_owned(),
        };
        let row = format!("| {words} | {who} |");
        assert!(page.contains(&row), "{row}");
    }
}

/// Shipped models have no defect: nothing may be said of them that is not so. The membrane alone is stiffer than a device renders: near
/// its fixed border, in a fifth of the workspace, with a damping of 2 N·s/m (M2, M5).
#[test]
fn shipped_models_pass() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let models: &[(&[&str], &[&str])] = match TestSize::of_this_run() {
        // `flotor test` judges the spring and the wall each day: `host/scenes` has a file for each.
        TestSize::Quick | TestSize::Daily => &[(&["load"], &[])],
        TestSize::Full => &[
            (&["spring"], &[]),
            (&["spring", "--set", "preset=thesis-2"], &[]),
            (&["spring", "--set", "preset=thesis-3"], &[]),
            (&["spring", "--set", "preset=slender"], &[]),
            (&["wall"], &[]),
            (&["load"], &[]),
            (&["measured"], &[]),
            (&["membrane"], &["M2", "M5"]),
            (&["surface"], &[]),
            (&["surface", "--set", "file=torus"], &[]),
        ],
    };
    for (arguments, expected) in models {
        let [model, further @ ..] = arguments else { continue };
        let failed = failed(model, further);
        let ids: Vec<&str> = failed.iter().filter_map(|measure| measure["id"].as_str()).collect();
        assert_eq!(ids, *expected, "{arguments:?}: {failed:#?}");
    }
}

/// The measures that fail, without cost (M7), which is the machine's too.
fn failed(model: &str, further: &[&str]) -> Vec<Value> {
    let is_failure = |measure: &Value| measure["verdict"] == "fail" && measure["id"] != "M7";
    measures(model, further).into_iter().filter(is_failure).collect()
}

/// The spring with nothing and with each of its options, both laws with an energy, all presets.
#[test]
fn the_springs_options_pass() {
    let presets = ["thesis-1", "thesis-2", "thesis-3", "slender"];
    let options = ["seat=fixed", "seat=free", "coil_contact=on", "wire=on"];
    let cells = presets
        .iter()
        .flat_map(|preset| options.iter().map(move |option| (*preset, *option)))
        .flat_map(|(preset, option)| ["energy", "rod"].map(|law| (preset, option, law)));
    // Each day reciprocity alone, which needs the most digits, of three cells that remember.
    let (cells, only): (Vec<_>, &[&str]) = match TestSize::of_this_run() {
        TestSize::Quick | TestSize::Daily => {
            let daily = [
                ("thesis-1", "seat=fixed", "rod"),
                ("thesis-1", "coil_contact=on", "energy"),
                ("thesis-2", "wire=on", "rod"),
            ];
            (cells.filter(|cell| daily.contains(cell)).collect(), &["--only", "M3"])
        }
        TestSize::Full => (cells.collect(), &[]),
    };
    let failures = |cells: &[(&str, &str, &str)]| -> Vec<(String, Vec<Value>)> {
        let failures = cells.iter().map(|(preset, option, law)| {
            let [preset, law] = [format!("preset={preset}"), format!("variant={law}")];
            let settings = ["--set", &preset, "--set", option, "--set", &law];
            let further: Vec<&str> = settings.iter().chain(only).copied().collect();
            (settings.join(" "), failed("spring", &further))
        });
        failures.filter(|(_, failed)| !failed.is_empty()).collect()
    };
    // On both processors of a small machine.
    let (first, second) = cells.split_at(cells.len() / 2);
    let [first, second] = std::thread::scope(|scope| {
        [first, second]
            .map(|cells| scope.spawn(move || failures(cells)))
            .map(|half| half.join().expect("no panic"))
    });
    assert_eq!([first, second], [const { Vec::new() }; 2]);
}
