//! A recording survives what ends the process, and the loop survives what ends a recording: SIGKILL, a full disk, a disk
//! that does not keep up (for the loop, that is an observer like any other).

use flotor_core::trace::TickRecord;
use flotor_record::{Ending, Recording};
use flotor_servo::RunEnd;
use flotor_servo::{Clock, StopSwitch};
use flotor_session::registry::Registry;
use flotor_session::scene::Scene;
use flotor_session::{Observer, RunOptions, Session};
use flotor_tests::library::compile_c_file;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::{TestSize, holds_ticks, workspace_root};
use rustix::process::Signal;
use std::ffi::OsStr;
use std::path::Path;
use std::time::{Duration, Instant};

/// Time of the last tick of a recording, s, and how the file ends.
fn last_tick_s(file: &Path) -> (f64, Ending) {
    let mut recording = Recording::open(file).expect("it can be read");
    let last = recording.by_ref().map(|record| record.expect("whole up to its last chunk")).last();
    let ending = recording.ending();
    let last_s = last.expect("there are ticks").time_ns as f64 * 1.0e-9;
    (last_s, ending)
}

#[test]
fn a_killed_process_loses_at_most_a_second_of_its_recording() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let scratch = Scratch::default();
    let file = scratch.path().join("run.mcap");
    let scene = scratch.patient_scene(flotor_session::scene::DEMO);
    let [run, duration, minute, record] = ["run", "--duration", "60s", "--record"].map(OsStr::new);
    let arguments = [run, scene.as_os_str(), duration, minute, record, file.as_os_str()];
    let running = Flotor::with(arguments).start();
    // The first ticks in the file: the loop has been running since at least now.
    let started = Instant::now();
    while !holds_ticks(&file) {
        assert!(started.elapsed() < Duration::from_secs(30), "there is no recording");
        std::thread::sleep(Duration::from_millis(5));
    }
    let seen = Instant::now();
    std::thread::sleep(Duration::from_millis(2300));
    let killed_s = seen.elapsed().as_secs_f64();
    running.signal_host(Signal::KILL);
    assert_eq!(running.wait().code, Some(exit_code::OTHER), "ended by a signal");
    let (last_s, ending) = last_tick_s(&file);
    assert_eq!(ending, Ending::CutOff);
    // A chunk closes every 250 ms; the rest is for a machine that holds the recorder's thread up.
    assert!(
        last_s >= killed_s - 1.0,
        "killed {killed_s} s after the first ticks, the last tick is of {last_s} s"
    );
}

#[test]
fn a_reader_that_has_gone_away_costs_neither_the_run_nor_its_recording() {
    let scratch = Scratch::default();
    let scene = scratch.file("scene.toml", flotor_session::scene::DEMO);
    let (file, picture) = (scratch.path().join("run.mcap"), scratch.path().join("run.svg"));
    let [run, clock, virtual_, duration, seconds] =
        ["run", "--clock", "virtual", "--duration", "2s"].map(OsStr::new);
    let [record, plot] = ["--record", "--plot"].map(OsStr::new);
    let arguments = [
        run,
        scene.as_os_str(),
        clock,
        virtual_,
        duration,
        seconds,
        record,
        file.as_os_str(),
        plot,
        picture.as_os_str(),
    ];
    // The reader is gone before there is anything to read.
    let to_nobody = "{ sleep 1; \"$@\"; echo \"code $?\" >&2; } | true";
    let ran = Flotor::with(arguments).through_shell(to_nobody).run();
    assert_eq!(ran.stderr, format!("code {}\n", exit_code::OK), "{ran:?}");
    let (last_s, ending) = last_tick_s(&file);
    assert_eq!(ending, Ending::Finished);
    assert!((last_s - 1.999).abs() < 1.0e-9, "the last of two thousand ticks: {last_s} s");
    assert!(picture.exists());
}

/// Bytes at which the disk is full. Plugins are copied when they are loaded, and the copy has to fit too: those in C take
/// some twenty kilobytes. A tick takes some three hundred bytes of a recording, a quarter of a second goes out at once.
const DISK_BYTES: u64 = 600_000;
/// Length of the run whose recording does not fit, s: the disk is full after less than half of it.
const TOO_LONG_S: u64 = 5;

#[test]
fn a_full_disk_ends_the_recording_and_not_the_run() {
    let scratch = Scratch::default();
    let plugin = |name: &str| {
        let library = scratch.path().join(format!("lib{name}.so"));
        compile_c_file(&workspace_root().join(format!("tests/c/{name}.c")), &[], &library);
        assert!(std::fs::metadata(&library).is_ok_and(|file| file.len() < DISK_BYTES / 4));
        library
    };
    let scene = format!(
        "duration_s = {TOO_LONG_S}\n[device]\nplugin = \"{}\"\n[[model]]\nplugin = \"{}\"\n",
        plugin("post").display(),
        plugin("wall").display()
    );
    let scene = scratch.file("scene.toml", scene);
    let (file, summary) = (scratch.path().join("run.mcap"), scratch.path().join("run.json"));
    // A limit on the size of files stands for a disk that is full; sh counts in blocks of 512 bytes.
    let limited = format!("ulimit -f {}; exec \"$@\"", DISK_BYTES / 512);
    let arguments: [&OsStr; 8] = [
        "run".as_ref(),
        scene.as_ref(),
        "--clock".as_ref(),
        "virtual".as_ref(),
        "--record".as_ref(),
        file.as_ref(),
        "--json".as_ref(),
        summary.as_ref(),
    ];
    let ran = Flotor::with(arguments).through_shell(&limited).run();
    assert_eq!(ran.code, Some(exit_code::OTHER), "{ran:?}");
    assert!(ran.error().contains("cannot write the recording"), "{ran:?}");
    let summary = std::fs::read_to_string(summary).expect("the run has its report");
    let summary: serde_json::Value = serde_json::from_str(&summary).expect("JSON");
    assert_eq!(summary["end"].as_str(), Some("finished"));
    assert_eq!(summary["ticks"].to_string(), (TOO_LONG_S * 1000).to_string());
    let (last_s, _) = last_tick_s(&file);
    assert!(
        last_s > 0.2 && last_s < TOO_LONG_S as f64 / 2.0,
        "what was written before can be read: {last_s} s"
    );
}

/// A recorder whose disk does not answer for longer than the ring between loop and recorder lasts.
struct Stuck {
    stays: Duration,
    seen: u64,
    /// Time of the last tick it saw, ns.
    last_ns: u64,
}

impl Observer for Stuck {
    fn observe(&mut self, record: &TickRecord) {
        std::thread::sleep(std::mem::take(&mut self.stays));
        self.seen += 1;
        self.last_ns = record.time_ns;
    }
}

#[test]
fn an_observer_that_does_not_keep_up_never_holds_up_the_loop_and_what_is_lost_is_counted() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let scene = flotor_session::scene::DEMO
        .replace("rate_hz = 1000", "rate_hz = 10000")
        .replace("duration_s = 10", "duration_s = 3")
        + "\n[limits]\nwatchdog_ms = 60000\n";
    let scene = Scene::parse(Path::new("scene.toml"), &scene).expect("the demo is right");
    let options = RunOptions { clock: Clock::Real, seed: 1 };
    let session = Session::prepare(&scene, &Registry::search(&[]), &options).expect("the demo starts");
    let mut stuck = Stuck { stays: Duration::from_millis(2500), seen: 0, last_ns: 0 };
    let outcome = session.run(&mut stuck, &StopSwitch::default()).expect("it runs");
    // Ticks that this machine missed are counted too: together they are all there were to be until the last one, which may come
    // after the end if the machine holds it up.
    let periods = outcome.timing.ticks + outcome.timing.missed;
    assert_eq!((outcome.end, periods), (RunEnd::Finished, stuck.last_ns / 100_000 + 1));
    assert!(periods >= 30_000, "{periods}");
    // 25 000 ticks in 2.5 s, of which the ring holds 4096; a loaded machine misses some before they are dropped.
    assert!(outcome.dropped_records > 1000, "{} dropped", outcome.dropped_records);
    assert_eq!(stuck.seen + outcome.dropped_records, outcome.timing.ticks);
}
