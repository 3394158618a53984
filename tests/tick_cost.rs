//! What a tick costs, in instructions: the same on every machine of a kind, busy or not.
//!
//! Callgrind (valgrind) counts while this test runs itself once more, and only within the loop: what is made before it
//! takes time that depends on the machine. The count of a tick is the difference between a long and a short run. Without
//! valgrind the tests say so and pass.
//!
//! ```text
//! FLOTOR_TEST_SIZE=full cargo test --release -p flotor-tests --test tick_cost -- --nocapture
//! ```

use flotor::bench::{BenchDevice, WholeTick};
use flotor::servo::{Clock, StopSwitch};
use flotor::session::Observer;
use flotor::trace::TickRecord;
use flotor_tests::TestSize;
use flotor_tests::scratch::Scratch;
use flotor_tests::watched::prepared;
use std::process::{Command, Output};

/// Which workload a process is to run, and for how many ticks.
const WORKLOAD: &str = "FLOTOR_COUNTED_WORKLOAD";
/// Ticks of the short and of the long run: both whole batches of a whole tick's bench.
const TICKS: [u32; 2] = [1024, 4096];

const ALONE: &str = "[device]\nplugin = \"simulated\"\n[[model]]\nplugin = \"spring\"\n";
/// Balls of 1 mm, 3 mm apart, far from where the handle goes.
const ASLEEP: &str = "[[model]]\nplugin = \"wall\"\n[model.parameters]\nshape = \"sphere\"\nsize_mm = 1\n\
    [model.mapping]\nposition_mm = [0, 0, 100]\ngrid = { count = [20, 25, 20], spacing_mm = 3 }\n";

struct Nobody;

impl Observer for Nobody {
    fn observe(&mut self, _: &TickRecord) {}
}

/// Not a test by itself: what the counted processes run.
#[test]
fn workload() {
    let Ok(workload) = std::env::var(WORKLOAD) else { return };
    let (name, ticks) = workload.split_once(' ').expect("a name and a number");
    let ticks: u32 = ticks.parse().expect("a number");
    let whole_ticks = |device| {
        WholeTick::prepare(device, "spring").expect("the spring is built").run(ticks as usize);
    };
    let scene = |asleep: &str| {
        let scene = format!("duration_s = {}\n{ALONE}{asleep}", f64::from(ticks) * 1.0e-3);
        let run = prepared(Clock::Virtual, &scene).run(&mut Nobody, &StopSwitch::default());
        assert!(run.is_ok());
    };
    match name {
        "scripted" => whole_ticks(BenchDevice::Scripted),
        "simulated" => whole_ticks(BenchDevice::Simulated),
        "alone" => scene(""),
        "among" => scene(ASLEEP),
        "replacing" => scene(&replacements(ticks)),
        other => panic!("no workload {other}"),
    }
}

/// Another model every 100 ms, in turns, and a change of a parameter of the one between.
fn replacements(ticks: u32) -> String {
    let change = |number: u32| {
        let (plugin, set) =
            if number.is_multiple_of(2) { ("spring", "gamma_n=9") } else { ("wall", "friction=0.1") };
        let at_s = f64::from(number) * 0.1;
        let set_at_s = at_s + 0.06;
        format!(
            "[[change]]\nat_s = {at_s}\nswap = \"spring\"\nplugin = \"{plugin}\"\n\
             [[change]]\nat_s = {set_at_s}\nset = \"spring.{set}\"\n"
        )
    };
    let blend = "[model.blend]\nfade_s = 0.05\n";
    let changes = (1..ticks / 100).map(change);
    blend.to_owned() + &changes.collect::<String>()
}

/// This program under callgrind with a workload.
fn callgrind(arguments: &[&str], workload: &str) -> Option<Output> {
    let counted = Command::new("valgrind")
        .arg("--tool=callgrind")
        .args(arguments)
        .arg(std::env::current_exe().expect("a running test has a file"))
        .args(["--exact", "workload", "--test-threads=1"])
        .env(WORKLOAD, workload)
        .output()
        .ok()?;
    let told = String::from_utf8_lossy(&counted.stderr);
    assert!(counted.status.success(), "{workload} does not run under valgrind: {told}");
    Some(counted)
}

/// The loops whose instructions are counted: of a whole tick's bench, and of a scene.
const BENCH_LOOP: &str = "flotor::bench::whole_tick::WholeTick::batch";
const SCENE_LOOP: &str = "flotor::session::Session::run";

/// Instructions a tick, or nothing where there is no valgrind.
fn instructions(name: &str, within: &str) -> Option<f64> {
    let count = |ticks: u32| {
        let arguments = ["--callgrind-out-file=/dev/null", &format!("--toggle-collect={within}")];
        let counted = callgrind(&arguments, &format!("{name} {ticks}"))?;
        let told = String::from_utf8_lossy(&counted.stderr).into_owned();
        let total = told.lines().find_map(|line| line.split("Collected : ").nth(1))?;
        total.trim().parse::<f64>().ok()
    };
    let [short, long] = TICKS;
    let counted = (count(long)? - count(short)?) / f64::from(long - short);
    assert!(counted > 100.0, "{name}: a tick does something");
    Some(counted)
}

/// A whole tick with the spring: device, mapping, model, envelope, record into the trace ring. What was counted on x86-64
/// (2495 and 3756) and a tenth, for other versions of compiler and libraries.
const MOST_INSTRUCTIONS: [(&str, f64); 2] = [("scripted", 2745.0), ("simulated", 4130.0)];

#[test]
fn a_whole_tick_stays_within_its_instructions() {
    if cfg!(debug_assertions) || cfg!(not(target_arch = "x86_64")) {
        eprintln!("skipped: counted for optimised builds on x86-64; `cargo test --release` checks it");
        return;
    }
    for (name, most) in MOST_INSTRUCTIONS {
        let Some(counted) = instructions(name, BENCH_LOOP) else {
            eprintln!("skipped: there is no valgrind to count instructions with");
            return;
        };
        println!("a whole tick, {name}: {counted:.0} instructions, at most {most}");
        assert!(counted <= most, "{name}: {counted:.0}");
    }
}

/// Most a tick may do to take a model in, hand one back or change a parameter, the model's own part of that included: at one
/// instruction a clock of 2 GHz, the microsecond that is allowed.
const MOST_FOR_CHANGES: u64 = 2000;

#[test]
fn a_tick_that_replaces_a_model_does_next_to_nothing_for_it() {
    if cfg!(debug_assertions) {
        eprintln!("skipped: a promise of optimised builds; `cargo test --release` checks it");
        return;
    }
    let scratch = Scratch::default();
    let counts = scratch.path().join("count");
    // Nine replacements and nine changes of a parameter: each call of the function makes a file of counts.
    let ticks = 1_000;
    // Only what a tick does about changes is counted, and each time on its own.
    let arguments = [
        "--toggle-collect=flotor::servo::Servo::apply_changes",
        "--dump-before=flotor::servo::Servo::apply_changes",
        &format!("--callgrind-out-file={}", counts.display()),
    ];
    if callgrind(&arguments, &format!("replacing {ticks}")).is_none() {
        eprintln!("skipped: there is no valgrind to count instructions with");
        return;
    }
    let parts = scratch.path().read_dir().expect("our own folder").map(|part| {
        let text = std::fs::read_to_string(part.expect("a part").path()).expect("text");
        let total = text.lines().find_map(|line| line.strip_prefix("totals: ").map(str::to_owned));
        total.expect("a total").trim().parse::<u64>().expect("a number")
    });
    let parts: Vec<u64> = parts.collect();
    let (worst, busy) = (parts.iter().max().expect("parts"), parts.iter().filter(|part| **part > 0).count());
    println!("{busy} ticks with something to change or to hand back: {worst} instructions at most");
    assert!(busy >= ticks / 50, "each replacement and each change is one: {busy}");
    assert!(*worst <= MOST_FOR_CHANGES, "{worst}");
}

#[test]
fn ten_thousand_sleeping_objects_cost_a_tick_next_to_nothing() {
    if TestSize::of_this_run() == TestSize::Quick {
        eprintln!("skipped: half a minute under valgrind; FLOTOR_TEST_SIZE=full counts");
        return;
    }
    let (Some(alone), Some(among)) = (instructions("alone", SCENE_LOOP), instructions("among", SCENE_LOOP))
    else {
        eprintln!("skipped: there is no valgrind to count instructions with");
        return;
    };
    println!("a tick with one active object: {alone:.0} instructions");
    println!("among 10 000 that sleep:       {among:.0} instructions, {:.4} times", among / alone);
    assert!(among <= 1.1 * alone, "{among:.0} against {alone:.0}");
}
