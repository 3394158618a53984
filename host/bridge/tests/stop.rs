//! An emergency stop from the network stops every run of the machine, whatever it is at, and is never answered "done" otherwise.
//!
//! Needs the program: `FLOTOR=target/release/flotor`, as `.ci/full` sets it; says so and does nothing without.

mod common;

use common::process::Owned;
use common::{free_port, is_full_size, program, wait_until};
use flotor_bridge::keys::Name;
use flotor_bridge::link::{End, LinkOptions, open};
use flotor_bridge::remote::{Errand, Remote};
use flotor_bridge::request::Request;
use flotor_live::Directory;
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

/// A machine with bridges: a folder in which its runs are found, and what runs there.
struct Machine {
    folder: tempfile::TempDir,
    program: PathBuf,
}

/// A bridge in a process of its own, and a way to it.
struct Bridge {
    process: Owned,
    errand: Errand,
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
        let link = LinkOptions { connect: vec![endpoint], ..LinkOptions::default() };
        let remote = Remote::listen(&open(&link, End::Visiting).unwrap(), &Name::new(name).unwrap()).unwrap();
        wait_until("the bridge is seen", || remote.status().unwrap().is_some());
        Bridge { process, errand: remote.errand(), remote }
    }
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
                assert_eq!(self.bridges[bridge].errand.run(Request::EmergencyStop), Ok(()))
            }
            Way::Killed(later) => {
                let errand = self.bridges[0].errand.clone();
                let asked = std::thread::spawn(move || errand.run(Request::EmergencyStop));
                std::thread::sleep(later);
                self.bridges[0].process.signal(rustix::process::Signal::KILL);
                // One that has died answers nobody: that is no "done", and a second press is.
                if asked.join().unwrap().is_err() {
                    self.unanswered += 1;
                    assert_eq!(self.bridges[1].errand.run(Request::EmergencyStop), Ok(()));
                }
                self.bridges[0] = self.machine.bridge(&format!("lab{}", self.starts + 1));
            }
        }
        for mut run in runs {
            assert_eq!(run.wait().unwrap().code(), STOPPED, "{count} runs, {after:?}, {way:?}");
        }
        for bridge in &self.bridges {
            let refused = bridge.errand.run(Request::Start).unwrap_err();
            assert!(refused.contains("its owner releases it first"), "{refused}");
        }
        assert_eq!(stopped(self.machine.run()), STOPPED, "whatever became of a bridge");
        assert_eq!(self.bridges[self.starts as usize % 2].errand.run(Request::Release), Ok(()));
    }
}

fn stopped(mut run: Owned) -> Option<i32> {
    run.wait().unwrap().code()
}

#[test]
fn a_stop_at_any_moment_of_a_start_stops_every_run() {
    let Some(program) = program() else { return };
    let step_ms = if is_full_size() { 1 } else { 125 };
    let mut trial = Trial::new(&program);
    for after_ms in (1..=500).step_by(step_ms) {
        let killed = Way::Killed(Duration::from_micros(500 * (after_ms % 80)));
        for (count, way) in [1, 2, 5].into_iter().zip([Way::Through(0), Way::Through(1), killed]) {
            // At full size each number of runs in each way.
            let ways = [Way::Through(0), Way::Through(1), killed];
            let ways = if is_full_size() { &ways[..] } else { &[way] };
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
    frozen.signal(rustix::process::Signal::STOP);
    let refused = bridge.errand.run(Request::EmergencyStop).unwrap_err();
    assert!(refused.contains(&format!("not confirmed by process {}", frozen.id())), "{refused}");
    assert_eq!(stopped(other), STOPPED);
    frozen.signal(rustix::process::Signal::CONT);
    assert_eq!(stopped(frozen), STOPPED, "it sees the latch when it comes back");
}
