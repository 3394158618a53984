//! Pictures: memory while they are made, and what programs that draw SVG have to know.

use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::{TestSize, workspace_root};
use std::path::{Path, PathBuf};

/// Most resident memory of a run of an hour with a picture, KiB.
const HOUR_KIB: u64 = 64 * 1024;

/// Most memory that nine times the ticks may add, KiB: less than nine bytes a tick of the shortest run.
const GROWTH_KIB: u64 = 6 * 1024;

/// Largest memory of a command that draws, KiB.
fn peak_kib(arguments: &[&str], folder: &Path) -> u64 {
    let (ran, peak_kib) = Flotor::with(arguments).inside(folder).start().wait_with_peak_kib();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let picture = arguments.last().map(|name| folder.join(name)).expect("a picture is asked for");
    assert!(std::fs::read_to_string(picture).expect("the picture is there").starts_with("<svg"));
    peak_kib
}

#[test]
fn memory_of_a_picture_does_not_grow_with_the_run() {
    let size = TestSize::of_this_run();
    if size.leaves_out_long_tests() {
        return;
    }
    let scratch = Scratch::default();
    // The hour is the bound's own; shorter runs grow by 94 MB if every tick is kept, as records of 520 bytes.
    let [short_s, long_s] = [20, size.pick(200, 3600)].map(|length: usize| length.to_string());
    let run = |length_s: &str| {
        let (length, recording) = (format!("{length_s}s"), format!("{length_s}.mcap"));
        let drawn = ["run", "--clock", "virtual", "--duration", &length, "--plot", "run.svg"];
        let recorded = ["run", "--clock", "virtual", "--duration", &length, "--record", &recording];
        let replayed = ["replay", &recording, "--plot", "replay.svg"];
        let drawn = peak_kib(&drawn, scratch.path());
        assert_eq!(Flotor::with(recorded).inside(scratch.path()).run().code, Some(exit_code::OK));
        [drawn, peak_kib(&replayed, scratch.path())]
    };
    let (short, long) = (run(&short_s), run(&long_s));
    for (name, short, long) in [("run", short[0], long[0]), ("replay", short[1], long[1])] {
        println!("{name} --plot: {short} KiB for {short_s} s, {long} KiB for {long_s} s");
        assert!(short > 1000, "{name}: {short} KiB is no measurement");
        assert!(long <= short + GROWTH_KIB && long <= HOUR_KIB, "{name}: {short} KiB, then {long} KiB");
    }
}

/// The pictures of the book that Flotor draws.
fn pictures_of_the_book() -> Vec<PathBuf> {
    let images = workspace_root().join("docs/src/images");
    let folders = [images.join("scenes"), images];
    let files = folders.iter().flat_map(|folder| std::fs::read_dir(folder).expect("it is there"));
    let files = files.map(|file| file.expect("it can be read").path());
    files.filter(|file| file.extension().is_some_and(|ending| ending == "svg")).collect()
}

/// CairoSVG draws nothing if the root has a height of its own in its style, svglib no colour but a plain one and nothing in a nested
/// document. What else a picture may hold is tested where it is drawn, in `flotor-plot`.
#[test]
fn every_picture_of_the_book_is_drawn_by_every_program() {
    let pictures = pictures_of_the_book();
    assert!(pictures.len() >= 15, "{pictures:?}");
    for picture in pictures {
        let svg = std::fs::read_to_string(&picture).expect("it is text");
        assert_eq!(svg.matches("<svg").count(), 1, "{}: a nested document", picture.display());
        for unknown in ["currentColor", "height:auto", "var(", "<clipPath"] {
            assert!(!svg.contains(unknown), "{}: {unknown}", picture.display());
        }
    }
}
