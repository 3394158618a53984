//! One set of bits (ADR 0012): what runs, replays and tables come to, against the digests in `data/golden.txt`.
//!
//! A run has two digests: that of its summary, over what the hand gets, and one over everything, from a recording, which asks
//! the models for all outputs.
//!
//! They are the same on every machine with IEEE doubles, debug or optimised. After a change that means to change numbers:
//! `FLOTOR_WRITE_GOLDEN=1 cargo test -p flotor-tests golden`. Another processor or system has them through `FLOTOR_RUNNER`
//! (`flotor_tests::program`).

use flotor_record::{Coverage, Recording, TraceDigest};
use flotor_tests::TestSize;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::tables::POSE_HEADER;
use flotor_tests::workspace_root;
use rayon::prelude::*;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;
use xxhash_rust::xxh3::xxh3_64;

/// Scenes that need a device or another host.
pub(crate) const NOT_VIRTUAL: [&str; 7] =
    ["falcon", "force-dimension", "haply", "inverse3", "openhaptics", "spacemouse", "teleoperation-apart"];
/// Models by setting, of the spring unless they are named.
const TABLES: [(&str, &str); 10] = [
    ("spring", "preset=thesis-1"),
    ("spring", "preset=thesis-2"),
    ("spring", "preset=thesis-3"),
    ("spring", "variant=thesis"),
    ("spring", "variant=closed-form"),
    ("spring", "variant=current-length"),
    ("spring", "variant=rod"),
    ("spring", "preset=slender"),
    ("wall", "friction=0.3"),
    ("load", "force_n=2"),
];

/// What the program says; it must end well.
fn output(arguments: &[&str], input: &str) -> String {
    let ran = Flotor::with(arguments).reading(input).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{arguments:?} {ran:#?}");
    ran.stdout
}

/// Runs on the virtual clock into a recording: the digest of its summary.
fn recorded_run(arguments: &[&str], recording: &Path) -> String {
    let recording = recording.display().to_string();
    let always = ["run", "--clock", "virtual", "--seed", "1", "--json", "-", "--record", &recording];
    let summary: Value =
        serde_json::from_str(&output(&[&always, arguments].concat(), "")).expect("it is JSON");
    summary["trace_digest"].as_str().expect("a digest is text").to_owned()
}

/// The two digests of a run on the virtual clock.
fn run(arguments: &[&str]) -> String {
    let scratch = Scratch::default();
    let file = scratch.path().join("run.mcap");
    let of_the_hand = recorded_run(arguments, &file);
    let digests = [Coverage::Hand, Coverage::Everything].map(|coverage| {
        let mut digest = TraceDigest::covering(coverage);
        let records = Recording::open(&file).expect("it was recorded");
        records.for_each(|record| digest.update(&record.expect("it is whole")));
        digest.finish()
    });
    let [of_the_recorded_hand, of_everything] = digests;
    assert_eq!(of_the_recorded_hand, of_the_hand, "{arguments:?}");
    format!("{of_the_hand} {of_everything}")
}

fn digest_of(text: &str) -> String {
    format!("xxh3:{:016x}", xxh3_64(text.as_bytes()))
}

/// A walk through the workspace of spring 1 and somewhat out of it, as a table of poses.
fn poses() -> String {
    let mut text = format!("{POSE_HEADER}\n");
    // A linear congruential generator: Numerical Recipes.
    let mut state = 1_u32;
    let mut unit = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state) / f64::from(u32::MAX) - 0.5
    };
    for id in 0..500 {
        let [x, y, z] = [0.008, 0.008, 0.02].map(|width| unit() * width);
        let [rx, ry, rz] = [0.5; 3].map(|width| unit() * width);
        writeln!(text, "{id},{x:?},{y:?},{:?},{rx:?},{ry:?},{rz:?}", z - 0.004).expect("text grows");
    }
    text
}

/// A replay by another law: its numbers, but the time it took.
fn replay() -> String {
    let scratch = Scratch::default();
    let recording = scratch.path().join("run.mcap");
    let _ = recorded_run(&["--duration", "2s"], &recording);
    let recording = recording.display().to_string();
    let report = output(&["replay", &recording, "--set", "spring.variant=current-length", "--json", "-"], "");
    digest_of(&report.lines().filter(|line| !line.contains("wall_s")).collect::<String>())
}

/// What there is to compare, by name.
fn all() -> BTreeMap<String, String> {
    let entry = |name: String, digest: String| (name, digest);
    let mut work: Vec<Box<dyn Fn() -> (String, String) + Send + Sync>> = Vec::new();
    let folder = |name: &str| {
        let folder = std::fs::read_dir(workspace_root().join(name)).expect("it is there");
        folder
            .map(|file| file.expect("it can be read").path())
            .filter(|file| file.extension() == Some("toml".as_ref()))
            .filter(|file| !file.to_string_lossy().ends_with(".test.toml"))
    };
    let stem = |file: &Path| file.file_stem().expect("it has a name").display().to_string();
    for file in folder("host/scenes").filter(|file| !NOT_VIRTUAL.contains(&stem(file).as_str())) {
        work.push(Box::new(move || {
            entry(format!("scene {}", stem(&file)), run(&[&file.display().to_string()]))
        }));
    }
    for file in folder("devices/simulated/scripts") {
        let hand = format!("device.hand_script={}", stem(&file));
        work.push(Box::new(move || {
            entry(format!("full plant, {hand}"), run(&["--set", &hand, "--set", "device.preset=full"]))
        }));
    }
    for preset in ["thesis-1", "thesis-2", "thesis-3"] {
        let set = format!("spring.preset={preset}");
        work.push(Box::new(move || entry(format!("demo, {set}"), run(&["--set", &set]))));
    }
    for set in ["device.preset=full", "spring.variant=rod"] {
        work.push(Box::new(move || entry(format!("demo, {set}"), run(&["--set", set]))));
    }
    for (model, set) in TABLES {
        let arguments = ["eval", "--model", model, "--set", set, "--poses", "-"];
        work.push(Box::new(move || {
            entry(format!("table {model}, {set}"), digest_of(&output(&arguments, &poses())))
        }));
    }
    work.push(Box::new(move || entry("replay by another law".to_owned(), replay())));
    work.par_iter().map(|work| work()).collect()
}

#[test]
fn every_machine_has_these_bits() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let file = workspace_root().join("tests/data/golden.txt");
    let found = all();
    if std::env::var_os("FLOTOR_WRITE_GOLDEN").is_some() {
        let lines: String = found.iter().map(|(name, digest)| format!("{name} = {digest}\n")).collect();
        std::fs::write(&file, lines).expect("the file can be written");
        return;
    }
    let text = std::fs::read_to_string(&file).expect("the file is there");
    let mut expected: BTreeMap<&str, &str> =
        text.lines().filter_map(|line| line.rsplit_once(" = ")).collect();
    let mut wrong = String::new();
    for (name, digest) in &found {
        println!("{name:<40} {digest}");
        let golden = expected.remove(name.as_str()).unwrap_or("nothing");
        if golden != digest {
            writeln!(wrong, "{name}: {digest} instead of {golden}").expect("text grows");
        }
    }
    assert!(wrong.is_empty() && expected.is_empty(), "{wrong}not found any more: {expected:?}");
}
