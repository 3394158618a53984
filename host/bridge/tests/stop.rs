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

#[test]
fn a_stop_at_any_moment_of_a_start_stops_every_run() {
    let Some(program) = program() else { return };
    let step_ms = if is_full_size() { 3 } else { 83 };
    let stopped = |mut run: Owned| run.wait().unwrap().code();
    // In turns: at full size every millisecond has its stop.
    for (offset_ms, count, through) in [(1, 1, 0), (2, 2, 1), (3, 5, 0)] {
        let machine = Machine::new(&program);
        let bridges = [machine.bridge("lab"), machine.bridge("lab2")];
        for after_ms in (offset_ms..=500).step_by(step_ms) {
            let runs: Vec<Owned> = (0..count).map(|_| machine.run()).collect();
            std::thread::sleep(Duration::from_millis(after_ms));
            assert_eq!(bridges[through].errand.run(Request::EmergencyStop), Ok(()));
            for run in runs {
                assert_eq!(stopped(run), STOPPED, "{count} runs, after {after_ms} ms");
            }
            for bridge in &bridges {
                let refused = bridge.errand.run(Request::Start).unwrap_err();
                assert!(refused.contains("its owner releases it first"), "{refused}");
            }
            assert_eq!(bridges[1 - through].errand.run(Request::Release), Ok(()));
        }
        // Whatever becomes of a bridge: nothing starts before it is released.
        let [first, second] = bridges;
        assert_eq!(first.errand.run(Request::EmergencyStop), Ok(()));
        first.process.signal(rustix::process::Signal::KILL);
        let again = machine.bridge("lab3");
        assert_eq!(stopped(machine.run()), STOPPED);
        assert!(again.errand.run(Request::Start).unwrap_err().contains("its owner releases it first"));
        assert_eq!(again.errand.run(Request::Release), Ok(()));
        let state = second.remote.status().unwrap().expect("it is there").state;
        assert_ne!(state, flotor_bridge::status::State::EmergencyStopped);
        let run = machine.run();
        wait_until("a run starts again", || !machine.directory().runs().is_empty());
        run.signal(rustix::process::Signal::INT);
        let _ = stopped(run);
    }
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
    let stopped = |mut run: Owned| run.wait().unwrap().code();
    assert_eq!(stopped(other), STOPPED);
    frozen.signal(rustix::process::Signal::CONT);
    assert_eq!(stopped(frozen), STOPPED, "it sees the latch when it comes back");
}
