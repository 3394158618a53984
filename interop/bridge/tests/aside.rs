//! A bridge changes nothing in the servo, whatever happens to it: real processes, one run without a bridge and one for each fate.
//!
//! Needs the program: `FLOTOR=target/release/flotor`, as `.ci/full` sets it; says so and does nothing without.

mod common;

use common::process::Owned;
use common::{free_port, is_full_size, program, wait_until};
use flotor_bridge::keys::Name;
use flotor_bridge::link::{End, Link, LinkOptions, open};
use flotor_bridge::remote::{Remote, RemoteEvent};
use flotor_bridge::request::{MAX_REQUEST_BYTES, NumberedRequest, Refusal, Request};
use flotor_live::SetValue;
use rustix::process::Signal;
use serde_json::Value;
use std::net::TcpStream;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;
use zenoh::Wait;

const NAME: &str = "far";

/// What becomes of a bridge once it has carried ticks of the run to a subscriber.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fate {
    /// It goes on carrying.
    Serves,
    /// SIGKILL: no farewell, and the kernel closes its sockets.
    Killed,
    /// SIGSTOP: its sockets stay open and fill up.
    Stalled,
    /// It gets requests that are malformed, huge, replayed, or refused by the host, as fast as the network takes them.
    Flooded,
}

const FATES: [Fate; 4] = [Fate::Serves, Fate::Killed, Fate::Stalled, Fate::Flooded];

/// What is left of a run.
struct Ran {
    summary: Value,
    /// How often the servo thread gave its processor away by itself; 0 on the virtual clock, which has no such thread.
    sleeps: u64,
}

impl Ran {
    fn count(&self, key: &str) -> u64 {
        self.summary[key].as_u64().unwrap_or_else(|| panic!("no count `{key}`: {}", self.summary))
    }
}

/// A bridge in a process of its own, which ends with this value.
struct Bridge {
    process: Owned,
    endpoint: String,
}

impl Bridge {
    fn start(runtime: &Path) -> Self {
        let port = free_port();
        let endpoint = format!("tcp/127.0.0.1:{port}");
        let mut command = Command::new(env!("CARGO_BIN_EXE_flotor-bridge"));
        command.args(["serve", "--name", NAME, "--allow", "operate", "--listen", &endpoint]);
        command.env("XDG_RUNTIME_DIR", runtime);
        let process = Owned::start(quiet(&mut command));
        wait_until("the bridge listens", || TcpStream::connect(("127.0.0.1", port)).is_ok());
        Self { process, endpoint }
    }

    fn session(&self) -> Link {
        let connect = vec![self.endpoint.clone()];
        open(&LinkOptions { connect, ..LinkOptions::default() }, End::Visiting).unwrap()
    }
}

fn quiet(command: &mut Command) -> &mut Command {
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null())
}

/// The demo scene, run by the program under test.
struct Run {
    process: Owned,
    file: std::path::PathBuf,
}

impl Run {
    fn start(program: &Path, runtime: &Path, clock: &str, duration_s: u64) -> Self {
        let file = runtime.join("run.json");
        let mut command = Command::new(program);
        command.args([
            "run",
            "--seed",
            "1",
            "--clock",
            clock,
            "--duration",
            &format!("{duration_s}s"),
            "--json",
        ]);
        command.arg(&file).env("XDG_RUNTIME_DIR", runtime);
        Self { process: Owned::start(quiet(&mut command)), file }
    }

    fn is_on(&mut self) -> bool {
        self.process.try_wait().unwrap().is_none()
    }

    /// Waits for the end, and looks at the servo's thread until then.
    fn finish(mut self) -> Ran {
        let (mut sleeps, host) = (0, self.process.host().as_raw_nonzero().get());
        while self.is_on() {
            sleeps = servo_sleeps(host).unwrap_or(sleeps);
            std::thread::sleep(Duration::from_millis(10));
        }
        assert!(self.process.wait().unwrap().success(), "a run that ends in order");
        let summary: Value = serde_json::from_slice(&std::fs::read(&self.file).unwrap()).unwrap();
        assert_eq!(summary["end"], "finished");
        Ran { summary, sleeps }
    }
}

/// How often the servo thread of a process has given its processor away by itself, if there is one.
fn servo_sleeps(process: i32) -> Option<u64> {
    let threads = std::fs::read_dir(format!("/proc/{process}/task")).ok()?;
    let of_servo = threads.flatten().map(|thread| thread.path()).find(|thread| {
        std::fs::read_to_string(thread.join("comm")).is_ok_and(|name| name.trim() == "flotor-servo")
    })?;
    let status = std::fs::read_to_string(of_servo.join("status")).ok()?;
    status.lines().find_map(|line| line.strip_prefix("voluntary_ctxt_switches:"))?.trim().parse().ok()
}

/// A run that nobody watches.
fn run_alone(program: &Path, clock: &str, duration_s: u64) -> Ran {
    let folder = tempfile::tempdir().unwrap();
    Run::start(program, folder.path(), clock, duration_s).finish()
}

/// A run with a bridge and a subscriber, which has heard ticks of it before the bridge meets its fate.
fn run_with_bridge(program: &Path, clock: &str, duration_s: u64, fate: Fate) -> Ran {
    let folder = tempfile::tempdir().unwrap();
    let bridge = Bridge::start(folder.path());
    let session = bridge.session();
    let remote = Remote::listen(&session, &Name::new(NAME).unwrap()).unwrap();
    let (heard, is_over) = (AtomicU64::new(0), AtomicBool::new(false));
    std::thread::scope(|scope| {
        let _over = OnDrop(|| is_over.store(true, Ordering::Relaxed));
        let mut run = Run::start(program, folder.path(), clock, duration_s);
        let (heard, is_over) = (&heard, &is_over);
        let listener = scope.spawn(move || {
            while !is_over.load(Ordering::Relaxed) {
                if let Some(RemoteEvent::Tick(_)) = remote.next(Duration::from_millis(20)) {
                    heard.fetch_add(1, Ordering::Relaxed);
                }
            }
            remote
        });
        wait_until("ticks of the run are heard", || heard.load(Ordering::Relaxed) > 0);
        match fate {
            Fate::Serves => {}
            Fate::Killed => bridge.process.signal(Signal::KILL),
            Fate::Stalled => bridge.process.signal(Signal::STOP),
            Fate::Flooded => {
                let (session, process) = (&session, run.process.id());
                scope.spawn(move || flood(session, process, is_over));
            }
        }
        assert!(run.is_on(), "{fate:?}: the run was over before it could be meant");
        let ran = run.finish();
        is_over.store(true, Ordering::Relaxed);
        if fate == Fate::Flooded {
            assert_flood_was_refused(&listener.join().unwrap());
        }
        ran
    })
}

/// Requests no bridge follows, and messages that are none, until it is over.
fn flood(session: &Link, run: u32, is_over: &AtomicBool) {
    /// How long a request is remembered here, and how many go out between two breaths.
    const FORGOTTEN: Duration = Duration::from_millis(500);
    const BURST: usize = 32;
    let key = |what: &str| Name::new(NAME).unwrap().key(what);
    let [plugin, parameter, value] = ["spring", "no_such_parameter", "1"].map(str::to_owned);
    let request = Request::Set { values: vec![SetValue { plugin, parameter, value }] };
    let remote = Remote::listen(session, &Name::new(NAME).unwrap()).unwrap();
    let ticket = remote.status().unwrap().expect("the bridge is there").ticket;
    let numbered = |number: u64, request: &Request| {
        NumberedRequest { session: "flood".to_owned(), number, run, ticket, request: request.clone() }
            .to_bytes()
    };
    let huge = vec![b'x'; 4 * MAX_REQUEST_BYTES];
    for number in 1.. {
        if is_over.load(Ordering::Relaxed) {
            return;
        }
        for _ in 0..BURST {
            // The same number again: a replay.
            for payload in [numbered(number, &request), b"{".to_vec(), vec![0xff; 300]] {
                let asked = session.get(key("ask/set/anyone")).payload(payload).timeout(FORGOTTEN);
                asked.callback(|_| {}).wait().unwrap();
            }
            for what in ["ask/set/anyone", "ask/emergency-stop/anyone", "tick", "end", "couple/pair"] {
                session.put(key(what), vec![0xff; 168]).wait().unwrap();
            }
        }
        session
            .get(key("ask/stop/anyone"))
            .payload(huge.clone())
            .timeout(FORGOTTEN)
            .callback(|_| {})
            .wait()
            .unwrap();
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn assert_flood_was_refused(remote: &Remote) {
    let mut refused = std::collections::BTreeMap::new();
    wait_until("the bridge tells what it refused", || {
        refused = remote.status().unwrap().map(|status| status.refused).unwrap_or_default();
        [Refusal::Malformed, Refusal::TooLong, Refusal::Replayed]
            .iter()
            .all(|kind| refused.contains_key(kind))
    });
    println!("refused: {refused:?}");
}

/// Does something when it goes, also when a test fails.
struct OnDrop<F: Fn()>(F);

impl<F: Fn()> Drop for OnDrop<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}

#[test]
fn no_bit_of_a_run_depends_on_what_becomes_of_a_bridge() {
    let Some(program) = program() else { return };
    // Long enough to be on when the bridge has found it, and the subscriber the bridge: some 0.5 s of a run at a million ticks/s.
    let duration_s = if is_full_size() { 20_000 } else { 2000 };
    let alone = run_alone(&program, "virtual", duration_s);
    assert_eq!(alone.count("ticks"), 1000 * duration_s);
    println!("alone: {}", alone.summary["trace_digest"]);
    for fate in FATES {
        let ran = run_with_bridge(&program, "virtual", duration_s, fate);
        assert_eq!(ran.summary["trace_digest"], alone.summary["trace_digest"], "{fate:?}");
    }
}

/// That no tick is late cannot be asserted on a machine that others use; that the servo waits for nobody can: it gives its
/// processor away once a tick, until the next one is due. How many ticks were late is printed, for both in turn.
#[test]
fn the_servo_waits_for_its_deadlines_and_for_no_bridge() {
    /// Sleeps before the first tick, by which the servo learns how late this machine wakes it; and for starting.
    const BEFORE_TICKS: u64 = 64 + 16;
    let Some(program) = program() else { return };
    let duration_s = if is_full_size() { 20 } else { 2 };
    for fate in [Fate::Serves, Fate::Stalled, Fate::Flooded] {
        let alone = run_alone(&program, "real", duration_s);
        let ran = run_with_bridge(&program, "real", duration_s, fate);
        for (what, ran) in [("alone".to_owned(), alone), (format!("{fate:?}"), ran)] {
            let [ticks, late, missed] = ["ticks", "late_ticks", "missed_ticks"].map(|key| ran.count(key));
            println!(
                "{what}: {ticks} ticks, {late} late, {missed} missed; the servo slept {} times",
                ran.sleeps
            );
            assert!(ran.sleeps > ticks / 10, "{what}: the servo was looked at");
            // One that waits in publishing sleeps twice a tick; page faults and the like are not one in fifty.
            assert!(ran.sleeps <= ticks + ticks / 50 + BEFORE_TICKS, "{what}: {} in {ticks}", ran.sleeps);
        }
    }
}
