//! One emergency stop a machine: pressed anywhere it stops every run that is active, starts, or is started later, until it is released.

use flotor_live::{Ask, Client, Directory, Event};
use flotor_tests::TestSize;
use flotor_tests::program::{Flotor, Ran, Running, exit_code};
use flotor_tests::scratch::Scratch;
use rustix::process::Signal;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// A machine of its own: runs meet in a folder that nobody else has.
struct Machine {
    scratch: Scratch,
    scene: PathBuf,
}

impl Machine {
    fn new() -> Self {
        let scratch = Scratch::default();
        let scene = scratch.patient_scene(flotor_session::scene::DEMO);
        Self { scratch, scene }
    }

    fn directory(&self) -> Directory {
        Directory::at(self.scratch.path().join("flotor"))
    }

    fn flotor(&self, arguments: &[&str]) -> Flotor {
        Flotor::with(arguments).env("XDG_RUNTIME_DIR", &self.scratch.path().display().to_string())
    }

    fn start(&self) -> Running {
        self.flotor(&["run", &self.scene.display().to_string(), "--duration", "60s", "--json", "-"]).start()
    }

    /// Starts so many runs and waits until each has a device at work.
    fn running(&self, count: usize) -> Vec<Running> {
        let runs: Vec<Running> = (0..count).map(|_| self.start()).collect();
        let directory = self.directory();
        patiently("every run ticks", || runs.iter().all(|run| has_ticked(&directory, run.id())));
        runs
    }

    fn release(&self) -> Ran {
        self.flotor(&["release"]).run()
    }
}

/// A run can be watched before it looks at the latch, and ticks only after.
fn has_ticked(directory: &Directory, process: u32) -> bool {
    let Ok(mut client) = Client::of_process(directory, process) else { return false };
    let asked = client.request_client().ask(Ask::Watch { every: 1 });
    asked.is_ok() && (0..4).any(|_| matches!(client.next(PATIENCE), Ok(Some(Event::Ticks { .. }))))
}

/// No test waits longer than this for anything.
const PATIENCE: Duration = Duration::from_secs(60);

fn patiently(what: &str, mut is_so: impl FnMut() -> bool) {
    let started = Instant::now();
    while !is_so() {
        assert!(started.elapsed() < PATIENCE, "{what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Stopped by the latch while it ran, or refused before it began: in both cases the exit code of a stop for safety, and how to go on.
fn assert_stopped(ran: &Ran) {
    assert_eq!(ran.code, Some(exit_code::DEVICE_FAULT), "{ran:?}");
    let is_told = ran.stderr.contains("flotor release") || ran.stderr.contains("start the run again");
    assert!(is_told, "{ran:?}");
}

#[test]
fn an_emergency_stop_of_one_run_stops_all_and_stays_until_it_is_released() {
    let machine = Machine::new();
    let mut runs = machine.running(3);
    let first = runs.remove(0);
    let id = first.id();
    first.signal(Signal::USR1);
    let ran = first.wait();
    assert!(ran.stderr.lines().last().unwrap().starts_with("error: emergency stop (signal)"), "{ran:?}");
    assert_stopped(&ran);
    for other in runs {
        let ran = other.wait();
        assert!(ran.stderr.contains("pressed at another run"), "{ran:?}");
        assert_stopped(&ran);
    }
    let refused = machine.start().wait();
    assert_stopped(&refused);
    let error = refused.error();
    assert!(error.contains(&format!("emergency stop (signal) of process {id}")), "who: {error}");
    assert!(error.contains(" ago)"), "when: {error}");
    assert!(error.contains("`flotor release`"), "how to go on: {error}");
    // No hand is held on the virtual clock: it runs on, and it presses nothing.
    let scene = machine.scene.display().to_string();
    let apart = machine.flotor(&["run", &scene, "--clock", "virtual", "--duration", "10ms"]).run();
    assert_eq!(apart.code, Some(exit_code::OK), "{apart:?}");
    let released = machine.release();
    assert!(released.stdout.starts_with("released: emergency stop (signal)"), "{released:?}");
    assert!(machine.release().stdout.contains("not pressed"));
    let run = machine.running(1).remove(0);
    run.signal(Signal::INT);
    assert_eq!(run.wait().code, Some(exit_code::OK));
}

#[test]
fn a_stop_from_a_client_is_answered_when_the_latch_is_pressed() {
    let machine = Machine::new();
    let runs = machine.running(2);
    let mut client = Client::of_process(&machine.directory(), runs[0].id()).expect("it is on");
    client.request_client().ask(Ask::EmergencyStop).expect("it takes it");
    let answer = loop {
        match client.next(PATIENCE).expect("it answers") {
            Some(Event::Answer(answer)) => break answer,
            Some(_) => {}
            None => panic!("no answer"),
        }
    };
    assert_eq!(answer.refused, None);
    assert!(machine.directory().latch().state().pressed.is_some(), "done means: no other run goes on");
    runs.into_iter().for_each(|run| assert_stopped(&run.wait()));
}

/// Wherever in its start a run is: one that had begun before the stop never comes to force, even if the stop is released at once.
#[test]
fn a_stop_at_any_moment_of_a_start_stops_it() {
    let step_ms = TestSize::of_this_run().pick(100, 1);
    let mut refused = 0;
    for after_ms in (1..=500).step_by(step_ms) {
        let machine = Machine::new();
        let run = machine.start();
        std::thread::sleep(Duration::from_millis(after_ms));
        machine.directory().latch().press("a test").expect("the folder is private");
        if after_ms % 2 == 0 {
            // Released when the run has begun to look: it began before, and stays stopped.
            patiently("it is over", || machine.directory().runs().is_empty());
        }
        let ran = run.wait();
        assert_stopped(&ran);
        refused += usize::from(ran.stderr.contains("nothing is energised"));
        machine.directory().latch().release("a test").expect("the folder is private");
    }
    println!("{refused} runs were refused before they were energised");
}
