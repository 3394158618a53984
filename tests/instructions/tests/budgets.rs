//! What a tick, a law and a step cost, in instructions: the same on every machine of a kind, busy or not.
//!
//! Callgrind (valgrind) counts while `counted_workload` runs, and only within a function. Counts are of optimised programs;
//! `budgets.toml` has the budgets. To print what is counted now:
//!
//! ```text
//! cargo test --release -p flotor-instructions --features budgets -- --nocapture
//! ```

#[allow(unreachable_pub)] // shared with the other tests
#[path = "../../src/printed.rs"]
mod printed;
#[allow(dead_code, unreachable_pub)] // the other tests use the rest
#[path = "../../src/tools.rs"]
mod tools;

use printed::assert_chapter_prints;
use std::path::Path;
use std::process::Command;
use tools::Tool;

/// The function of `counted_workload` that is called for each part.
const PART: &str = "*::one_counted_part";

/// Instructions within each call of a function while a workload runs, in order; nothing where there is no valgrind, which
/// has been told then.
fn counts(workload: &str, function: &str) -> Option<Vec<f64>> {
    if !tools::required(Tool::Valgrind) {
        return None;
    }
    let scratch = tempfile::tempdir().expect("there is a place for temporary files");
    counts_in(scratch.path(), workload, function)
}

/// As [`counts`], with what models keep between runs in this folder.
fn counts_in(folder: &Path, workload: &str, function: &str) -> Option<Vec<f64>> {
    let file = folder.join("count");
    let counted = Command::new("valgrind")
        .env(CACHE, folder)
        .args(["--tool=callgrind", "--collect-atstart=no"])
        .args([format!("--toggle-collect={function}"), format!("--dump-after={function}")])
        .arg(format!("--callgrind-out-file={}", file.display()))
        .args([env!("CARGO_BIN_EXE_counted_workload"), workload])
        .output()
        .expect("valgrind is installed");
    let told = String::from_utf8_lossy(&counted.stderr);
    assert!(counted.status.success(), "{workload} does not run under valgrind: {told}");
    // Each call leaves a file of counts behind, from count.1 on.
    let total = |call: usize| {
        let text = std::fs::read_to_string(file.with_extension(call.to_string())).ok()?;
        text.lines().find_map(|line| line.strip_prefix("totals: "))?.trim().parse().ok()
    };
    Some((1..).map_while(total).collect())
}

/// Where the solid keeps what it has solved.
const CACHE: &str = "XDG_CACHE_HOME";

/// Counts of a workload whose parts are these.
fn parts<const N: usize>(workload: &str) -> Option<[f64; N]> {
    let counts = counts(workload, PART)?;
    Some(counts.try_into().unwrap_or_else(|counts: Vec<f64>| panic!("{workload}: {N} parts, not {counts:?}")))
}

/// Holds a count to its budget, with the margin of the file.
fn keep_budget(name: &str, counted: f64) {
    println!("{name} = {counted:.2}");
    if cfg!(not(target_arch = "x86_64")) {
        return tools::skipped("budgets are of x86-64");
    }
    let [budget, margin] = budgets([name, "margin"]);
    let most = budget * (1.0 + margin);
    assert!(counted <= most, "{name}: {counted:.2} counted, at most {most:.2}");
}

/// Holds a count to its share of the count at an earlier commit, where the compiler is the one of that count.
fn keep_baseline(name: &str, counted: f64) {
    let file = budget_file();
    let baseline = file["baseline"].as_table().expect("a table of counts");
    let compiler = baseline["compiler"].as_str().expect("a compiler and its version");
    if cfg!(not(target_arch = "x86_64")) || !this_compiler().starts_with(compiler) {
        return tools::skipped(&format!("the baseline of {name} is of {compiler} on x86-64"));
    }
    let [before, most] = [name, "most"].map(|key| baseline[key].as_float().expect("a number"));
    println!("{name}: {:.4} of the baseline", counted / before);
    assert!(counted <= most * before, "{name}: {counted:.2} counted, at most {:.2}", most * before);
}

/// Name, version and commit of the compiler in use.
fn this_compiler() -> String {
    let answer = Command::new("rustc").arg("--version").output().expect("there is a compiler");
    String::from_utf8_lossy(&answer.stdout).into_owned()
}

fn budget_file() -> toml::Table {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("budgets.toml");
    let text = std::fs::read_to_string(file).expect("the budgets are there");
    text.parse().expect("the budgets are TOML")
}

/// Numbers of `budgets.toml`.
fn budgets<const N: usize>(names: [&str; N]) -> [f64; N] {
    let budgets = budget_file();
    let number = |value: &toml::Value| value.as_float().or(value.as_integer().map(|whole| whole as f64));
    names.map(|name| budgets.get(name).and_then(number).unwrap_or_else(|| panic!("no budget `{name}`")))
}

/// The chapter on speed prints the counts of `budgets.toml`, and shares that follow from them.
#[test]
fn the_book_prints_these_counts() {
    let prints = |text: &str| assert_chapter_prints("bench.md", text);
    let [printed, closed, energy, blending, closed_batch, energy_batch, rod_mean, rod_worst] = budgets([
        "law_printed",
        "law_closed_form",
        "law_energy",
        "blending_where_there_is_nothing_to",
        "law_closed_form_batch",
        "law_energy_batch",
        "rod_mean",
        "rod_worst",
    ]);
    for (row, count) in [
        ("`closed-form`", closed),
        ("`energy`", energy),
        ("`energy`, with the check for blending", energy + blending),
        ("`closed-form`, batch with AVX2", closed_batch),
        ("`energy`, batch with AVX2", energy_batch),
    ] {
        prints(&format!("| {row} | {count} | {:.2} |", count / printed));
    }
    prints(&format!("| printed law (`thesis`, double) | {printed} | 1 |"));
    prints(&format!(
        "| `rod`, servo, mean of a smooth hand's ticks | {rod_mean} | {:.1} |",
        rod_mean / printed
    ));
    prints(&format!("| `rod`, servo, worst of them | {rod_worst} | {:.0} |", rod_worst / printed));
    for name in ["flotor_plain", "flotor_full"] {
        let [steps] = budgets([name]);
        assert_chapter_prints("simulated-flotor.md", &format!("{name} = {steps:.2}"));
    }
    let (times, thousands) = (rod_worst / rod_mean, rod_mean * 1.0e-3);
    assert_chapter_prints(
        "models/spring/rod.md",
        &format!("worst tick of a smooth hand is {times:.1} times the mean of {thousands:.1} thousand"),
    );
    let [scripted, simulated] = budgets(["tick_scripted", "tick_simulated"]);
    prints(&format!(
        "`tests/instructions/budgets.toml`: {scripted} on the scripted device, {energy} of them the law of the spring, and {simulated} on"
    ));
}

#[test]
fn a_whole_tick_keeps_its_budget() {
    for (name, workload) in [("tick_scripted", "tick-scripted"), ("tick_simulated", "tick-simulated")] {
        let Some([_, ticks]) = parts(workload) else { return };
        keep_budget(name, ticks / 3072.0);
        keep_baseline(name, ticks / 3072.0);
    }
}

/// Most a tick may do to take a model in, hand one back or change a parameter, the model's own part of that included: at one
/// instruction a clock of 2 GHz, the microsecond that is allowed.
const MOST_FOR_CHANGES: f64 = 2000.0;

#[test]
fn a_tick_that_replaces_a_model_does_next_to_nothing_for_it() {
    // Nine replacements and nine changes of a parameter, and what is handed back.
    let Some(counts) = counts("scene-replacing", "*::Servo::apply_changes") else { return };
    let worst = counts.iter().copied().fold(0.0, f64::max);
    println!("{} ticks with something to change or to hand back: {worst} instructions at most", counts.len());
    assert!(counts.len() >= 20, "each replacement and each change is one: {}", counts.len());
    assert!(worst <= MOST_FOR_CHANGES, "{worst}");
}

#[test]
fn ten_thousand_inactive_objects_cost_a_tick_next_to_nothing() {
    let per_tick = |workload: &str| parts(workload).map(|[_, short, long]: [f64; 3]| (long - short) / 3072.0);
    let (Some(alone), Some(among)) = (per_tick("scene-alone"), per_tick("scene-among-inactive")) else {
        return;
    };
    println!("a tick with one active object: {alone:.0} instructions");
    println!("among 10 000 inactive ones:    {among:.0} instructions, {:.4} times", among / alone);
    assert!(among <= 1.1 * alone, "{among:.0} against {alone:.0}");
}

#[test]
fn laws_cost_their_share_of_the_printed_one() {
    let Some(counts) = parts::<14>("laws") else { return };
    let [printed, closed, energy, without_rod, blending, closed_batch, energy_batch] =
        std::array::from_fn(|law| counts[2 * law + 1] / 1024.0);
    let laws = [
        ("law_printed", printed),
        ("law_closed_form", closed),
        ("law_energy", energy),
        ("law_closed_form_batch", closed_batch),
        ("law_energy_batch", energy_batch),
    ];
    laws.into_iter().for_each(|(name, counted)| keep_budget(name, counted));
    // To estimate the error first and find nothing to blend, with the answer handed on.
    keep_budget("blending_where_there_is_nothing_to", blending - without_rod);
    assert!(closed <= 0.6 * printed, "closed-form: {:.2} of the printed law", closed / printed);
    assert!(energy <= 1.5 * printed, "energy: {:.2} of the printed law", energy / printed);
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        // Four lanes an instruction, less what a single step gains by working on two components at once and what it takes
        // to turn poses over. In time it is more or less of that: `examples/spring_throughput.rs` measures it.
        assert!(closed_batch <= closed / 2.5, "closed-form, batch: {:.2} times", closed / closed_batch);
        assert!(energy_batch <= energy / 2.0, "energy, batch: {:.2} times", energy / energy_batch);
    }
}

#[test]
fn no_tick_of_the_rod_costs_ten_times_the_mean() {
    let Some(counts) = parts::<400>("rod") else { return };
    let mean = counts.iter().sum::<f64>() / 400.0;
    let worst = counts.iter().copied().fold(0.0, f64::max);
    keep_budget("rod_mean", mean);
    keep_budget("rod_worst", worst);
    assert!(worst <= 10.0 * mean, "{worst:.0} against {mean:.0}");
}

#[test]
fn a_tick_of_the_flotor_costs_no_more_than_so_many_steps_of_a_rigid_body() {
    let per_tick = |workload: &str| parts(workload).map(|[_, ticks]: [f64; 2]| ticks / 2000.0);
    let Some(step) = per_tick("rigid-body") else { return };
    for (name, workload) in [("flotor_plain", "flotor-plain"), ("flotor_full", "flotor-full")] {
        let Some(tick) = per_tick(workload) else { return };
        println!("{workload}: {tick:.0} instructions a tick, a step of a rigid body {step:.0}");
        keep_budget(name, tick / step);
    }
}

/// Settings of the models and the instructions of a step by demand: the names of `[demand]` in `budgets.toml`, in the order of
/// the workload, each with the ticks of a part.
const DEMANDS: [(&str, f64); 19] = [
    ("spring, `energy`", 500.0),
    ("spring, `energy`, `hand_over = \"off\"`", 500.0),
    ("spring, `energy`, `wire = \"on\"`", 500.0),
    ("spring, `thesis`", 500.0),
    ("spring, `closed-form`", 500.0),
    ("spring, `current-length`", 500.0),
    ("spring, `rod`", 200.0),
    ("spring, `seat = \"free\"`", 200.0),
    ("spring, `coil_contact = \"on\"`", 100.0),
    ("load, `felt`", 500.0),
    ("load, `exerted`", 500.0),
    ("measured", 500.0),
    ("wall, `plane`", 500.0),
    ("wall, `sphere`", 500.0),
    ("wall, `box`", 500.0),
    ("solid, half-space under a sphere", 500.0),
    ("solid, half-space under a punch", 500.0),
    ("solid, block under a sphere", 500.0),
    ("membrane", 20.0),
];

/// Instructions of a step by demand (force; force and torque; all) of a setting.
fn demand_budget(name: &str) -> [f64; 3] {
    let budgets = budget_file();
    let counts = budgets.get("demand").and_then(|all| all.get(name)?.as_array());
    let counts = counts.unwrap_or_else(|| panic!("no demand `{name}`"));
    std::array::from_fn(|demand| counts[demand].as_integer().expect("a count") as f64)
}

/// The share of all instructions that a step for force alone saves, %.
fn saved_percent([force, _, all]: [f64; 3]) -> f64 {
    // Not -0 where the same step takes a few instructions more or less.
    (100.0 * (1.0 - force / all)).max(0.0)
}

#[test]
fn a_step_for_force_alone_saves_what_only_torque_and_energy_need() {
    if !tools::required(Tool::Valgrind) {
        return;
    }
    // What is solved before the loop is solved once, without a counter.
    let scratch = tempfile::tempdir().expect("there is a place for temporary files");
    let solving = Command::new(env!("CARGO_BIN_EXE_counted_workload"))
        .arg("demands")
        .env(CACHE, scratch.path())
        .status();
    assert!(solving.expect("it was built").success());
    let Some(counts) = counts_in(scratch.path(), "demands", PART) else { return };
    assert_eq!(counts.len(), 3 * DEMANDS.len(), "a part for each demand of each setting");
    let [margin] = budgets(["margin"]);
    let mut wrong = Vec::new();
    for ((name, ticks), counts) in DEMANDS.iter().zip(counts.chunks_exact(3)) {
        let counted: [f64; 3] = std::array::from_fn(|demand| counts[demand] / ticks);
        let [force, wrench, all] = counted.map(f64::round);
        println!("'{name}' = [{force}, {wrench}, {all}] # {:.0} %", saved_percent(counted));
        let budget = demand_budget(name);
        let above = counted.iter().zip(budget).any(|(counted, budget)| *counted > budget * (1.0 + margin));
        let saves_less = saved_percent(counted) < saved_percent(budget) - 2.0;
        if above || saves_less {
            wrong.push(format!("{name}: {counted:?}, not {budget:?}"));
        }
    }
    assert!(wrong.is_empty() || cfg!(not(target_arch = "x86_64")), "{}", wrong.join("\n"));
}

/// The chapter on demand prints the counts of `budgets.toml`, and the share that is saved.
#[test]
fn the_book_prints_what_a_demand_saves() {
    for (name, _) in DEMANDS {
        let counts = demand_budget(name);
        let [force, wrench, all] = counts;
        let row = format!("| {name} | {force} | {wrench} | {all} | {:.0} % |", saved_percent(counts));
        assert_chapter_prints("bench.md", &row);
    }
}
