//! An emergency stop from the network stops every run of the machine, whatever it is at, and is never answered "done" otherwise.
//!
//! Needs the program: `FLOTOR=target/release/flotor`, as `.ci/full` sets it; says so and does nothing without.

mod common;

use common::process::Owned;
use common::{free_port, is_full_size, program, wait_until};
use flotor_bridge::keys::Name;
use flotor_bridge::link::{End, LinkOptions, open};
use flotor_bridge::remote::{Remote, RequestClient};
use flotor_bridge::request::Request;
use flotor_live::{Directory, SetValue};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// A machine with bridges: a folder in which its runs are found, and what runs there.
struct Machine {
    folder: tempfile::TempDir,
    program: PathBuf,
}

/// A bridge in a process of its own, and a way to it.
struct Bridge {
    process: Owned,
    endpoint: String,
    requests: RequestClient,
    remote: Remote,
}

impl Machine {
    fn new(program: &Path) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let scene = "duration_s = 60\n[device]\nplugin = \"simulated\"\n[limits]\nwatchdog_ms = 60000\n";
        std::fs::write(folder.path().join("scene.toml"), scene).unwrap();
        Self { folder, program: program.to_path_buf() }
    }

    fn directory(&self) -> Directory {
        Directory::at(self.folder.path().join("flotor"))
    }

    fn quiet<'c>(&self, command: &'c mut Command) -> &'c mut Command {
        command.env("XDG_RUNTIME_DIR", self.folder.path());
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null())
    }

    fn run(&self) -> Owned {
        let mut command = Command::new(&self.program);
        Owned::start(self.quiet(command.arg("run").arg(self.folder.path().join("scene.toml"))))
    }

    fn bridge(&self, name: &str) -> Bridge {
        let port = free_port();
        let endpoint = format!("tcp/127.0.0.1:{port}");
        let mut command = Command::new(env!("CARGO_BIN_EXE_flotor-bridge"));
        command.args(["serve", "--name", name, "--allow", "own", "--listen", &endpoint]);
        let process = Owned::start(self.quiet(&mut command));
        wait_until("the bridge listens", || TcpStream::connect(("127.0.0.1", port)).is_ok());
        let remote = visit(&endpoint, name);
        wait_until("the bridge is seen", || remote.status().unwrap().is_some());
        Bridge { process, endpoint, requests: remote.requests(), remote }
    }
}

/// By a session of its own.
fn visit(endpoint: &str, name: &str) -> Remote {
    let link = LinkOptions { connect: vec![endpoint.to_owned()], ..LinkOptions::default() };
    Remote::listen(&open(&link, End::Visiting).unwrap(), &Name::new(name).unwrap()).unwrap()
}

/// Exit code of a run that was stopped for safety, or refused because of it.
const STOPPED: Option<i32> = Some(4);

/// Through which bridge the stop goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    /// One of two.
    Through(usize),
    /// The first, which is killed so long after.
    Killed(Duration),
}

/// A machine with two bridges at which scenes start, and what became of the stops.
struct Trial {
    machine: Machine,
    bridges: [Bridge; 2],
    starts: u32,
    unanswered: u32,
}

impl Trial {
    fn new(program: &Path) -> Self {
        let machine = Machine::new(program);
        let bridges = [machine.bridge("lab0"), machine.bridge("lab1")];
        Self { machine, bridges, starts: 0, unanswered: 0 }
    }

    /// Starts runs, presses so long after, and says whether "done" was the answer.
    fn stops(&mut self, count: usize, after: Duration, way: Way) {
        self.starts += 1;
        let runs: Vec<Owned> = (0..count).map(|_| self.machine.run()).collect();
        std::thread::sleep(after);
        match way {
            Way::Through(bridge) => {
                assert_eq!(self.bridges[bridge].requests.run(Request::EmergencyStop), Ok(()))
            }
            Way::Killed(later) => {
                let requests = self.bridges[0].requests.clone();
                let asked = std::thread::spawn(move || requests.run(Request::EmergencyStop));
                std::thread::sleep(later);
                self.bridges[0].process.signal(rustix::process::Signal::KILL);
                // One that has died answers nobody: that is no "done", and a second press is.
                if asked.join().unwrap().is_err() {
                    self.unanswered += 1;
                    assert_eq!(self.bridges[1].requests.run(Request::EmergencyStop), Ok(()));
                }
                self.bridges[0] = self.machine.bridge(&format!("lab{}", self.starts + 1));
            }
        }
        for mut run in runs {
            assert_eq!(run.wait().unwrap().code(), STOPPED, "{count} runs, {after:?}, {way:?}");
        }
        for bridge in &self.bridges {
            let refused = bridge.requests.run(Request::Start).unwrap_err();
            assert!(refused.contains("release the emergency stop first"), "{refused}");
        }
        assert_eq!(stopped(self.machine.run()), STOPPED, "whatever became of a bridge");
        assert_eq!(self.bridges[self.starts as usize % 2].requests.run(Request::Release), Ok(()));
    }
}

fn stopped(mut run: Owned) -> Option<i32> {
    run.wait().unwrap().code()
}

/// Machines at which scenes start at the same time: each waits most of the time.
const LANES: usize = 4;

#[test]
fn a_stop_at_any_moment_of_a_start_stops_every_run() {
    let Some(program) = program() else { return };
    let step_ms = if is_full_size() { 1 } else { 125 };
    let moments: Vec<u64> = (1..=500).step_by(step_ms).collect();
    std::thread::scope(|scope| {
        for lane in 0..LANES {
            let (program, moments) = (&program, moments.iter().skip(lane).step_by(LANES));
            scope.spawn(move || stop_at(program, moments.copied()));
        }
    });
}

/// Presses so many milliseconds after starts, at a machine of its own.
fn stop_at(program: &Path, moments: impl Iterator<Item = u64>) {
    let mut trial = Trial::new(program);
    for after_ms in moments {
        let killed = Way::Killed(Duration::from_micros(500 * (after_ms % 80)));
        let ways = [Way::Through(0), Way::Through(1), killed];
        for (at, count) in [1, 2, 5].into_iter().enumerate() {
            // At full size each number of runs in each way.
            let ways = if is_full_size() { &ways[..] } else { &ways[at..=at] };
            ways.iter().for_each(|way| trial.stops(count, Duration::from_millis(after_ms), *way));
        }
    }
    println!("{} stops, {} of them not answered by a bridge that was killed", trial.starts, trial.unanswered);
    let state = trial.bridges[1].remote.status().unwrap().expect("it is there").state;
    assert_ne!(state, flotor_bridge::status::State::EmergencyStopped);
    let run = trial.machine.run();
    wait_until("a run starts again", || !trial.machine.directory().runs().is_empty());
    run.signal(rustix::process::Signal::INT);
    let _ = stopped(run);
}

#[test]
fn a_host_that_does_not_confirm_makes_no_done() {
    let Some(program) = program() else { return };
    let machine = Machine::new(&program);
    let bridge = machine.bridge("lab");
    let [frozen, other] = [machine.run(), machine.run()];
    wait_until("both run", || machine.directory().runs().len() == 2);
    frozen.signal_host(rustix::process::Signal::STOP);
    let refused = bridge.requests.run(Request::EmergencyStop).unwrap_err();
    assert!(refused.contains(&format!("not confirmed by process {}", frozen.id())), "{refused}");
    assert_eq!(stopped(other), STOPPED);
    frozen.signal_host(rustix::process::Signal::CONT);
    assert_eq!(stopped(frozen), STOPPED, "it sees the latch when it comes back");
}

/// A host that takes nothing in, and a member that sends it more than fits on the way: the stop of all others waits for neither.
#[test]
fn a_frozen_host_and_a_flood_for_it_delay_no_stop() {
    let Some(program) = program() else { return };
    let machine = Machine::new(&program);
    let bridge = machine.bridge("lab");
    let frozen = machine.run();
    let carried = || bridge.remote.status().unwrap().expect("it is there").run;
    wait_until("the bridge carries it", || carried() == frozen.id());
    let other = machine.run();
    wait_until("both run", || machine.directory().runs().len() == 2);
    frozen.signal_host(rustix::process::Signal::STOP);
    let is_over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let values =
            vec![SetValue { plugin: "x".repeat(60_000), parameter: String::new(), value: String::new() }];
        for _ in 0..8 {
            let (requests, values, is_over) = (bridge.remote.requests(), values.clone(), &is_over);
            scope.spawn(move || {
                while !is_over.load(Ordering::Relaxed) {
                    let _ = requests.run(Request::Set { values: values.clone() });
                }
            });
        }
        // Until the socket of the frozen host is full.
        std::thread::sleep(Duration::from_millis(1000));
        let refused = visit(&bridge.endpoint, "lab").requests().run(Request::EmergencyStop).unwrap_err();
        is_over.store(true, Ordering::Relaxed);
        assert!(refused.contains(&format!("not confirmed by process {}", frozen.id())), "{refused}");
    });
    assert_eq!(stopped(other), STOPPED);
    frozen.signal_host(rustix::process::Signal::CONT);
    assert_eq!(stopped(frozen), STOPPED);
}

/// Bridges on two machines may have one name: one "done" is not that of both.
#[test]
fn of_two_bridges_of_one_name_both_have_to_confirm() {
    let Some(program) = program() else { return };
    let machines = [Machine::new(&program), Machine::new(&program)];
    let bridges = machines.each_ref().map(|machine| machine.bridge("lab"));
    let [frozen, other] = machines.each_ref().map(Machine::run);
    wait_until("both run", || machines.iter().all(|machine| !machine.directory().runs().is_empty()));
    frozen.signal_host(rustix::process::Signal::STOP);
    let connect = bridges.iter().map(|bridge| bridge.endpoint.clone()).collect();
    let link = open(&LinkOptions { connect, ..LinkOptions::default() }, End::Visiting).unwrap();
    let remote = Remote::listen(&link, &Name::new("lab").unwrap()).unwrap();
    let seen = || zenoh::Wait::wait(link.info().peers_zid()).count() == 2;
    wait_until("both are seen", seen);
    assert!(remote.requests().run(Request::EmergencyStop).is_err());
    assert_eq!(stopped(other), STOPPED);
    frozen.signal_host(rustix::process::Signal::CONT);
    assert_eq!(stopped(frozen), STOPPED);
}
