//! Wrenches by the million, from the devices' own logs: whatever models ask, whoever dies, whatever samples say, nothing is over a
//! limit, nothing jumps, and there is no force after a stop.
//!
//! `FLOTOR_TEST_SIZE=full cargo test --release -p flotor-tests campaign -- --nocapture` prints how many.

pub(super) mod log;
mod scenes;

use flotor_tests::TestSize;
use flotor_tests::library::compile_c_file;
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::workspace_root;
use log::{Allowed, Seen, check, read};
use rayon::prelude::*;
use rustix::process::Signal;
use scenes::{Deaths, Dice, Drawn, Plugins, draw};
use std::time::{Duration, Instant};

fn plugins(scratch: &Scratch) -> Plugins {
    let compiled = |name: &str, macros: &[&str]| {
        let library = scratch.path().join(format!("lib{name}{}.so", macros.concat()));
        let source = workspace_root().join("tests/c/campaign").join(name).with_extension("c");
        compile_c_file(&source, macros, &library);
        library
    };
    Plugins {
        devices: [compiled("device", &[]), compiled("device", &["SIMULATED"])],
        wild: compiled("model", &[]),
    }
}

/// What was seen in one run, all its devices together.
#[derive(Default)]
struct Sum {
    commands: usize,
    felt: usize,
    /// Runs that began, those that ended by themselves in another way than in order, and those of devices that would have
    /// exceeded nine tenths of what they may.
    runs: usize,
    ended: usize,
    close: usize,
}

impl Sum {
    fn and(self, other: Self) -> Self {
        Self {
            commands: self.commands + other.commands,
            felt: self.felt + other.felt,
            runs: self.runs + other.runs,
            ended: self.ended + other.ended,
            close: self.close + other.close,
        }
    }
}

/// Holds the logs of a run against what is allowed; fails with the scene.
fn sum(seed: u64, drawn: &Drawn, ran: &Ran) -> Sum {
    let mut sum = Sum { runs: 1, ended: usize::from(ran.code != Some(exit_code::OK)), ..Sum::default() };
    for (file, allowed) in &drawn.logs {
        let log = read(file);
        let Seen { commands, felt, violations } = check(&log, allowed);
        let around =
            violations.first().map(|(entry, _)| &log[entry.saturating_sub(2)..log.len().min(entry + 3)]);
        let told = violations.first();
        assert!(
            violations.is_empty(),
            "seed {seed}: {told:?}: {around:?}\n{allowed:?}\n{ran:?}\n{}",
            drawn.text
        );
        let nine_tenths = Allowed {
            norm: allowed.norm.map(|most| 0.9 * most),
            axes: allowed.axes.map(|part| part.map(|most| 0.9 * most)),
            slew_per_s: allowed.slew_per_s.map(|most| 0.9 * most),
            rise_per_s: allowed.rise_per_s.map(|most| 0.9 * most),
        };
        sum.close += usize::from(!check(&log, &nine_tenths).violations.is_empty());
        (sum.commands, sum.felt) = (sum.commands + commands, sum.felt + felt);
    }
    sum
}

fn started(scratch: &Scratch, drawn: &Drawn, clock: &str) -> Flotor {
    let scene = scratch.file("scene.toml", &drawn.text).display().to_string();
    let strong = if drawn.is_strong { "1" } else { "0" };
    Flotor::with(["run", &scene, "--clock", clock]).env("FLOTOR_ALLOW_STRONG", strong)
}

/// One scene in three has a model that dies.
fn deaths(seed: u64) -> Deaths {
    if seed.is_multiple_of(3) { Deaths::Some } else { Deaths::None }
}

#[test]
fn no_wrench_of_a_million_is_over_a_limit_jumps_or_comes_after_a_stop() {
    let scratch = Scratch::default();
    let plugins = plugins(&scratch);
    let (scenes, ticks) = match TestSize::of_this_run() {
        TestSize::Quick => (12, 2000),
        TestSize::Daily => (24, 3000),
        // Nine runs of ten end early: wild models swing the force between its limits.
        TestSize::Full => (1600, 20_000),
    };
    let rates = [100.0, 250.0, 500.0, 1000.0, 1000.0, 2000.0, 5000.0, 10_000.0];
    let run = |seed: u64| {
        let scratch = Scratch::default();
        let mut dice = Dice::new(seed);
        let drawn = draw(&mut dice, &plugins, scratch.path(), ticks, &rates, deaths(seed));
        let ran = started(&scratch, &drawn, "virtual").run();
        let is_wrong = [Some(exit_code::CONFIGURATION), Some(exit_code::OTHER)].contains(&ran.code);
        assert!(!is_wrong, "seed {seed}: {ran:?}\n{}", drawn.text);
        sum(seed, &drawn, &ran)
    };
    let all = (0..scenes).into_par_iter().map(run).reduce(Sum::default, Sum::and);
    println!(
        "{} runs, {} of them ended by a fault or a death: {} commands, {} with force; {} devices within a tenth of a limit",
        all.runs, all.ended, all.commands, all.felt, all.close
    );
    let most = TestSize::of_this_run().pick(0, 10_000_000);
    assert!(all.commands >= most, "more scenes are needed for {most} commands: {}", all.commands);
    assert!(all.felt > all.commands / 4, "there was force");
    assert!(all.close > all.runs / 2, "which came close to what is allowed");
    assert!(all.ended > all.runs / 10);
}

#[test]
fn no_wrench_in_real_time_is_over_a_limit_jumps_or_comes_after_a_stop() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let scratch = Scratch::default();
    let plugins = plugins(&scratch);
    let runs = TestSize::of_this_run().pick(8, 200);
    let run = |seed: u64| {
        let scratch = Scratch::default();
        let mut dice = Dice::new(seed);
        // They wait for most of their time.
        let drawn = draw(&mut dice, &plugins, scratch.path(), 400, &[1000.0], deaths(seed));
        let running = started(&scratch, &drawn, "real").start();
        let signals = [Signal::INT, Signal::TERM, Signal::USR1, Signal::USR2, Signal::ALARM];
        if dice.is(0.7) {
            let (first, begun) = (&drawn.logs[0].0, Instant::now());
            while read(first).len() < 10 && begun.elapsed() < Duration::from_secs(5) {
                std::thread::sleep(Duration::from_millis(2));
            }
            std::thread::sleep(Duration::from_secs_f64(0.3 * dice.share()));
            // It may have ended already.
            let _ = rustix::process::kill_process(running.pid(), dice.of(&signals));
        }
        let ran = running.wait();
        assert_ne!(ran.code, Some(exit_code::CONFIGURATION), "seed {seed}: {ran:?}\n{}", drawn.text);
        sum(seed, &drawn, &ran)
    };
    let all = (1000..1000 + runs as u64).into_par_iter().map(run).reduce(Sum::default, Sum::and);
    println!(
        "{} runs, {} of them ended early: {} commands, {} with force",
        all.runs, all.ended, all.commands, all.felt
    );
    assert!(all.felt > 0);
}
