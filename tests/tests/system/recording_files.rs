//! A recording is the only copy of what a hand felt: no command overwrites, shares or loses one without an error.

use flotor_record::{Ending, Recording};
use flotor_tests::holds_ticks;
use flotor_tests::library::plugin_file;
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use std::path::Path;
use std::time::{Duration, Instant};

/// Runs the demo on the virtual clock inside a folder.
fn run(scratch: &Scratch, arguments: &[&str]) -> Ran {
    let run = ["run", "--clock", "virtual", "--duration", "100ms"];
    Flotor::with(run.iter().chain(arguments)).inside(scratch.path()).run()
}

/// Number of ticks of a recording that has its end.
fn whole_ticks(path: &Path) -> usize {
    let mut recording = Recording::open(path).expect("it is a recording");
    let ticks: Vec<_> = recording.by_ref().collect::<Result<_, _>>().expect("it is undamaged");
    assert_eq!(recording.ending(), Ending::Finished);
    ticks.len()
}

#[test]
fn a_second_run_under_the_same_name_is_refused_before_it_begins() {
    let scratch = Scratch::default();
    let file = scratch.path().join("run.mcap");
    assert_eq!(run(&scratch, &["--record", "run.mcap"]).code, Some(exit_code::OK));
    let first = std::fs::read(&file).expect("it was recorded");
    let second = run(&scratch, &["--record", "run.mcap"]);
    assert_eq!(second.code, Some(exit_code::CONFIGURATION), "{second:?}");
    assert!(second.stderr.contains("`run.mcap` exists already"), "{}", second.stderr);
    assert_eq!(std::fs::read(&file).expect("it is still there"), first);
    // The trajectory that a hand follows is an input: its name as that of the output loses neither.
    let replayed = run(&scratch, &["--set", "device.hand_recording=run.mcap", "--record", "run.mcap"]);
    assert_eq!(replayed.code, Some(exit_code::CONFIGURATION), "{replayed:?}");
    assert_eq!(std::fs::read(&file).expect("it is still there"), first);
}

#[test]
fn of_two_runs_with_one_name_one_records_and_the_other_is_refused() {
    let scratch = Scratch::default();
    let start = || {
        let run = ["run", "--clock", "virtual", "--duration", "1s", "--record", "run.mcap"];
        Flotor::with(run).inside(scratch.path()).start()
    };
    let mut codes = [start(), start()].map(|running| running.wait().code);
    codes.sort_unstable();
    assert_eq!(codes, [Some(exit_code::OK), Some(exit_code::CONFIGURATION)]);
    assert_eq!(whole_ticks(&scratch.path().join("run.mcap")), 1000);
}

#[test]
fn a_run_that_is_refused_leaves_no_file_behind_and_takes_none_away() {
    let scratch = Scratch::default();
    let device = plugin_file("fixture-faulty-device");
    let scene = format!(
        "duration_s = 0.1\n[device]\nplugin = {device:?}\n[device.parameters]\nfault = \"refuses-to-activate\"\n\
         [[model]]\nplugin = \"spring\"\n"
    );
    let _ = scratch.file("scene.toml", scene);
    let refused = run(&scratch, &["scene.toml", "--record", "run.mcap"]);
    assert_eq!(refused.code, Some(exit_code::PLUGIN_REFUSED), "{refused:?}");
    assert!(!scratch.path().join("run.mcap").exists());
    assert_eq!(run(&scratch, &["--record", "run.mcap"]).code, Some(exit_code::OK));
    let refused = run(&scratch, &["scene.toml", "--record", "run.mcap"]);
    assert_eq!(refused.code, Some(exit_code::CONFIGURATION), "{refused:?}");
    assert_eq!(whole_ticks(&scratch.path().join("run.mcap")), 100);
}

#[test]
fn a_recording_that_vanishes_during_the_run_is_an_error() {
    let scratch = Scratch::default();
    let file = scratch.path().join("run.mcap");
    let run = ["run", "--duration", "2s", "--record", "run.mcap"];
    let running = Flotor::with(run).inside(scratch.path()).start();
    let started = Instant::now();
    while !holds_ticks(&file) && started.elapsed() < Duration::from_secs(20) {
        std::thread::sleep(Duration::from_millis(5));
    }
    std::fs::remove_file(&file).expect("it was begun");
    let ran = running.wait();
    assert_eq!(ran.code, Some(exit_code::OTHER), "{ran:?}");
    assert!(ran.stderr.contains("`run.mcap` is lost or damaged"), "{}", ran.stderr);
    assert!(ran.stdout.contains("digest"), "the run itself is whole: {}", ran.stdout);
}

#[test]
fn a_pipe_a_device_file_and_a_dangling_link_are_refused_at_once() {
    let scratch = Scratch::default();
    let [pipe, device, link] = ["pipe.mcap", "null.mcap", "link.mcap"].map(|name| scratch.path().join(name));
    rustix::fs::mkfifoat(rustix::fs::CWD, &pipe, rustix::fs::Mode::RUSR).expect("a scratch folder");
    std::os::unix::fs::symlink("/dev/null", &device).expect("a scratch folder");
    std::os::unix::fs::symlink("nowhere/run.mcap", &link).expect("a scratch folder");
    for name in ["pipe.mcap", "null.mcap", "link.mcap"] {
        let ran = run(&scratch, &["--record", name]);
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{name}: {ran:?}");
        assert!(ran.stderr.contains("exists already"), "{name}: {}", ran.stderr);
    }
}
