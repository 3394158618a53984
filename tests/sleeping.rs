//! What ten thousand objects that sleep cost a tick, in instructions: the same on every machine, busy or not.
//!
//! Callgrind (valgrind) counts while this test runs itself once more. The count of a tick is the difference between
//! a long and a short run, so that loading and creating does not matter. Without valgrind the test says so and passes.
//!
//! ```text
//! FLOTOR_TEST_SIZE=full cargo test --release -p flotor-tests --test sleeping -- --nocapture
//! ```

use flotor::servo::{Clock, StopSwitch};
use flotor::session::Observer;
use flotor::trace::TickRecord;
use flotor_tests::TestSize;
use flotor_tests::watched::prepared;
use std::process::Command;

/// Which scene a process is to run, and for how many ticks.
const WORKLOAD: &str = "FLOTOR_COUNTED_WORKLOAD";
/// Ticks of the short and of the long run.
const TICKS: [u32; 2] = [1000, 4000];

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
    let ticks: f64 = ticks.parse().expect("a number");
    let asleep = if name == "among" { ASLEEP } else { "" };
    let scene = format!("duration_s = {}\n{ALONE}{asleep}", ticks * 1.0e-3);
    let run = prepared(Clock::Virtual, &scene).run(&mut Nobody, &StopSwitch::default());
    assert!(run.is_ok());
}

/// Instructions a tick, or nothing where there is no valgrind.
fn instructions(name: &str) -> Option<f64> {
    let count = |ticks: u32| {
        let counted = Command::new("valgrind")
            .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
            .arg(std::env::current_exe().expect("a running test has a file"))
            .args(["--exact", "workload", "--test-threads=1"])
            .env(WORKLOAD, format!("{name} {ticks}"))
            .output()
            .ok()?;
        let told = String::from_utf8_lossy(&counted.stderr).into_owned();
        let total = told.lines().find_map(|line| line.split("Collected : ").nth(1))?;
        total.trim().parse::<f64>().ok()
    };
    let [short, long] = TICKS;
    Some((count(long)? - count(short)?) / f64::from(long - short))
}

#[test]
fn ten_thousand_sleeping_objects_cost_a_tick_next_to_nothing() {
    if TestSize::of_this_run() == TestSize::Quick {
        eprintln!("skipped: half a minute under valgrind; FLOTOR_TEST_SIZE=full counts");
        return;
    }
    let (Some(alone), Some(among)) = (instructions("alone"), instructions("among")) else {
        eprintln!("skipped: there is no valgrind to count instructions with");
        return;
    };
    println!("a tick with one active object: {alone:.0} instructions");
    println!("among 10 000 that sleep:       {among:.0} instructions, {:.4} times", among / alone);
    assert!(among <= 1.1 * alone, "{among:.0} against {alone:.0}");
}
