//! Pictures: what they show of a run, memory while they are made, and what programs that draw SVG have to know.

use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::tools::{Tool, required};
use flotor_tests::{TestSize, workspace_root};
use std::path::{Path, PathBuf};

/// Most resident memory of a run of an hour with a picture, KiB.
const HOUR_KIB: u64 = 64 * 1024;

/// Most memory that nine times the ticks may add, KiB: less than nine bytes a tick of the shortest run.
const GROWTH_KIB: u64 = 6 * 1024;

/// Largest memory of a command that draws, KiB.
fn peak_kib(arguments: &[&str], folder: &Path) -> u64 {
    let (ran, peak_kib) = Flotor::with(arguments).inside(folder).run_with_peak_kib();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let picture = arguments.last().map(|name| folder.join(name)).expect("a picture is asked for");
    assert!(std::fs::read_to_string(picture).expect("the picture is there").starts_with("<svg"));
    peak_kib
}

#[test]
fn memory_of_a_picture_does_not_grow_with_the_run() {
    let size = TestSize::of_this_run();
    if size.leaves_out_long_tests() || !required(Tool::Python) {
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

/// Runs a command that draws, and returns its picture without the style sheet.
fn body_of(arguments: &[&str], folder: &Path) -> String {
    let ran = Flotor::with(arguments).inside(folder).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    let picture = arguments.last().expect("a picture is asked for");
    let svg = std::fs::read_to_string(folder.join(picture)).expect("the picture is there");
    svg.split_once("</style>").expect("a style sheet").1.to_owned()
}

/// The hand of the membrane does not turn: rotations of 1e-18 degrees filled a panel.
#[test]
fn rounding_errors_and_what_is_zero_have_no_panel() {
    let scratch = Scratch::default();
    let run =
        ["run", "membrane", "--clock", "virtual", "--seed", "1", "--duration", "500ms", "--plot", "m.svg"];
    let body = body_of(&run, scratch.path());
    assert!(body.contains(">Not drawn: rotation ("), "{body}");
    assert!(body.contains(">Position <") && body.contains(">Force <"), "{body}");
    for absent in [">Rotation <", ">Torque <", "10⁻¹"] {
        assert!(!body.contains(absent), "{absent}");
    }
}

#[test]
fn limits_and_changed_parameters_are_marked() {
    let scratch = Scratch::default();
    let scene = "title = \"A wall\"\n[device]\nplugin = \"simulated\"\n[[model]]\nplugin = \"wall\"\n\
                 [limits]\nforce_n = 0.5\n[[change]]\nat_s = 0.25\nset = \"wall.stiffness_n_per_m=900\"\n";
    let _ = scratch.file("wall.toml", scene);
    let run = ["run", "wall.toml", "--clock", "virtual", "--duration", "2s", "--plot", "run.svg"];
    let body = body_of(&run, scratch.path());
    assert_eq!(body.matches(">wall.stiffness_n_per_m = 900<").count(), 1, "named in the first panel: {body}");
    assert_eq!(body.matches(">force limited<").count(), 1, "{body}");
    assert!(body.contains("<path class=\"limited\""), "{body}");
    assert!(!body.contains("<path class=\"fault\""), "nothing failed");
}

#[test]
fn a_picture_of_a_replay_says_what_was_replayed_in_the_colours_of_the_axes() {
    let scratch = Scratch::default();
    let record = ["run", "wall", "--clock", "virtual", "--duration", "2s", "--record", "wall.mcap"];
    assert_eq!(Flotor::with(record).inside(scratch.path()).run().code, Some(exit_code::OK));
    let set = "wall.stiffness_n_per_m=900";
    let body = body_of(&["replay", "wall.mcap", "--set", set, "--plot", "changed.svg"], scratch.path());
    let subtitle = format!(">wall.mcap, --set {set}; difference: replayed − recorded<");
    assert!(body.contains(&subtitle), "{body}");
    // s8, s9 and s10 are x, y and z in every picture; s7 is grey.
    for (class, what) in [("s10", "z"), ("s7", "what was recorded")] {
        assert!(body.contains(&format!(" {class}\"")), "{what}: {body}");
    }
    let blue_or_orange = [" s0\"", " s1\"", " s2\""].into_iter().find(|class| body.contains(class));
    assert_eq!(blue_or_orange, None, "colours of the axes only");

    let body = body_of(&["replay", "wall.mcap", "--plot", "same.svg"], scratch.path());
    assert!(body.contains("difference of force (0 throughout)"), "{body}");
    assert!(body.contains("under1 s7"), "the recorded force is seen under the replayed one: {body}");
}
