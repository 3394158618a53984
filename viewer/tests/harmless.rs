//! Whatever the viewer's process does, the run is the same: bit for bit with the virtual clock, with every count that a run says
//! of itself. It watches, is killed, stands still, or the host is flooded beside it.
//!
//! The window needs `Xvfb` and a software adapter (`libgl1-mesa-dri` with `libegl1`, or `mesa-vulkan-drivers`). Where they are
//! missing, the tests say so and pass, unless `FLOTOR_REQUIRE=display`.

mod support;

use flotor_live::{Ask, Client, Directory, SetValue};
use rustix::process::{Signal, setpriority_process};
use serde_json::Value;
use std::io::Write;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::LazyLock;
use std::thread::JoinHandle;
use std::time::Duration;
use support::display::{Display, alone, patiently};
use support::process::Owned;
use support::tools::{Tool, required};
use tempfile::TempDir;

/// What is read from the wall clock, and nothing else in a summary is: how fast the machine was.
const OF_THE_MACHINE: [&str; 3] = ["compute_ns", "stages_ns", "wall_s"];

/// Length of a run, ms of the virtual clock, and so its number of ticks.
fn ticks() -> u64 {
    if std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| size == "full") { 600_000 } else { 200_000 }
}

/// Starts the demo: on the wall a few seconds, of which a window has need of a tenth, on an idle machine, to find and draw it. On a
/// busy one the run yields: what keeps this test from stopping it in time keeps it from running, too.
fn start_run(folder: &Path) -> Owned {
    let mut run = alone("flotor", folder, None);
    run.args(["run", "--clock", "virtual", "--seed", "7", "--json", "-"]);
    run.arg("--duration").arg(format!("{}ms", ticks()));
    let run = Owned::start(run.stdout(Stdio::piped()).stderr(Stdio::piped()));
    setpriority_process(Some(run.host()), 19).expect("anybody may yield");
    run
}

fn goes_on(run: &mut Owned) -> bool {
    run.try_wait().expect("it is ours").is_none()
}

/// What a run says of itself in the end, without what the machine had to do with it.
fn summary(run: &mut Owned) -> Value {
    let (stdout, stderr) = (run.stdout.take(), run.stderr.take());
    let [said, errors] = [stdout.map(std::io::read_to_string), stderr.map(std::io::read_to_string)]
        .map(|text| text.expect("a pipe was requested").expect("it is text"));
    assert!(run.wait().expect("it is ours").success(), "{errors}");
    let mut summary: Value = serde_json::from_str(&said).expect("it is JSON");
    let all = summary.as_object_mut().expect("an object");
    OF_THE_MACHINE.iter().for_each(|name| assert!(all.remove(*name).is_some(), "{name}"));
    summary
}

/// The run that nobody watches, made once.
static UNWATCHED: LazyLock<Value> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("a scratch folder");
    let summary = summary(&mut start_run(folder.path()));
    assert_eq!((&summary["ticks"], &summary["end"]), (&Value::from(ticks()), &Value::from("finished")));
    assert!(
        summary["trace_digest"].as_str().is_some_and(|digest| digest.ends_with(&format!("-{}", ticks())))
    );
    summary
});

/// A run and a viewer that draws it.
struct Watched {
    run: Owned,
    viewer: Owned,
    display: Display,
    folder: TempDir,
}

impl Watched {
    /// Opens a window that waits, starts a run, and holds it once the window has drawn it moving. `None` where there are no windows.
    fn begin() -> Option<Self> {
        if !required(Tool::Display) {
            return None;
        }
        let folder = tempfile::tempdir().expect("a scratch folder");
        let display = Display::start(folder.path());
        let empty = display.picture();
        let mut viewer = alone("flotor-viewer", folder.path(), Some(&display));
        let mut viewer = Owned::start(viewer.stderr(Stdio::null()));
        let waiting = patiently("a window that waits for a run", || {
            assert!(goes_on(&mut viewer), "the viewer ended by itself");
            Some(display.picture_at_rest()).filter(|picture| *picture != empty)
        });
        let mut watched = Self { run: start_run(folder.path()), viewer, display, folder };
        watched.wait_until_drawn(waiting);
        Some(watched)
    }

    /// Waits for three pictures, each other than the one before: only a run that moves makes so many.
    fn wait_until_drawn(&mut self, mut last: Vec<u8>) {
        for _ in 0..3 {
            last = self.work_until("another picture", |watched| {
                Some(watched.display.picture()).filter(|picture| *picture != last)
            });
        }
    }

    /// The run works a millisecond at a time until something has come about, and is held then: the virtual clock does not know how
    /// busy the machine is, and a window does.
    fn work_until<T>(&mut self, what: &str, come_about: impl Fn(&Self) -> Option<T>) -> T {
        patiently(what, || {
            self.run.signal_host(Signal::CONT);
            std::thread::sleep(Duration::from_millis(1));
            self.run.signal_host(Signal::STOP);
            assert!(goes_on(&mut self.run), "the run was over before there was {what}");
            come_about(self)
        })
    }

    /// Lets the run, which was held in its midst, go on to its end; gives its summary.
    fn end(&mut self) -> Value {
        self.run.signal_host(Signal::CONT);
        summary(&mut self.run)
    }
}

#[test]
fn a_viewer_that_watches_changes_nothing() {
    let Some(mut watched) = Watched::begin() else { return };
    assert_eq!(watched.end(), *UNWATCHED);
    assert!(goes_on(&mut watched.viewer), "it was there to the end");
}

#[test]
fn a_viewer_that_is_killed_changes_nothing() {
    let Some(mut watched) = Watched::begin() else { return };
    watched.viewer.signal(Signal::KILL);
    assert!(!watched.viewer.wait().expect("it is ours").success());
    assert_eq!(watched.end(), *UNWATCHED);
}

#[test]
fn a_viewer_that_is_frozen_changes_nothing() {
    let Some(mut watched) = Watched::begin() else { return };
    watched.viewer.signal(Signal::STOP);
    let frozen = watched.display.picture_at_rest(); // what it had drawn has reached the display
    assert_eq!(watched.end(), *UNWATCHED);
    assert!(watched.display.picture() == frozen, "it stood still to the end of the run");
    watched.viewer.signal(Signal::CONT);
    patiently("thawed, it draws again", || Some(()).filter(|()| watched.display.picture() != frozen));
}

#[test]
fn a_viewer_and_a_flood_of_requests_and_malformed_data_change_nothing() {
    let Some(mut watched) = Watched::begin() else { return };
    let directory = Directory::at(watched.folder.path().join("flotor"));
    // On a busy machine a window may draw three pictures of its own before the run, which works a millisecond at a time, has a socket.
    let path = watched.work_until("the socket of the run", |_| directory.runs().pop()).path;
    // A run that is held most of the time may let a greeting wait too long.
    let finding = std::thread::spawn(move || patiently("a client", || Client::find(&directory).ok()));
    watched.work_until("a client", |_| finding.is_finished().then_some(()));
    let client = finding.join().expect("it only looks");
    let floods = flood(client, path);
    assert_eq!(watched.end(), *UNWATCHED);
    let sent = floods.map(|flood| flood.join().expect("it only sends"));
    assert!(sent.iter().all(|sent| *sent > 100), "a flood: {sent:?}");
    assert!(goes_on(&mut watched.viewer), "it was there to the end");
}

/// Sends what changes nothing, as fast as it is taken, until the run is over, without ever reading an answer: requests that ask for
/// no parameter or for one that is not there; and bytes that mean nothing, on connections of their own. Gives how much was sent.
fn flood(client: Client, path: PathBuf) -> [JoinHandle<u32>; 2] {
    let requests = move || {
        let nothing = || Ask::Set { values: Vec::new() };
        let [plugin, parameter, value] = ["spring", "no_such_parameter", "1"].map(str::to_owned);
        let unknown = Ask::Set { values: vec![SetValue { plugin, parameter, value }] };
        let asks = (0_u32..).map(|number| if number % 2 == 0 { nothing() } else { unknown.clone() });
        let request_client = client.request_client();
        let sent = asks.take_while(|ask| request_client.ask(ask.clone()).is_ok()).count();
        u32::try_from(sent).expect("of a few seconds")
    };
    let malformed_data = move || {
        let mut sent = 0;
        // A frame of 4 GiB: the host hangs up, and there is a next connection.
        while let Ok(mut nonsense) = UnixStream::connect(&path) {
            nonsense.set_write_timeout(Some(Duration::from_millis(10))).expect("a time-out is legal");
            while nonsense.write_all(&[0xff; 4096]).is_ok() {
                sent += 1;
            }
        }
        sent
    };
    [std::thread::spawn(requests), std::thread::spawn(malformed_data)]
}
