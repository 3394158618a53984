//! `flotor new` as a newcomer meets it: what it makes builds with the commands it prints, validates, and runs in
//! its scene; a wrong name costs one line, and nothing is ever overwritten.

use flotor_tests::library::build_folder;
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::tools::{Tool, lacks};
use flotor_tests::{TestSize, workspace_root};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;

fn new(folder: &Path, arguments: &[&str]) -> Ran {
    Flotor::with(["new"].iter().chain(arguments)).inside(folder).run()
}

/// Makes a plugin in an empty folder and builds it as told. Its build output is kept from one test run to the next:
/// the dependencies of the contract are compiled once.
fn made(scratch: &Scratch, kind: &[&str], name: &str, language: &str) -> PathBuf {
    let ran = new(scratch.path(), &[kind, &[name, "--language", language]].concat());
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(exit_code::OK), ""), "{ran:?}");
    let folder = scratch.path().join(name);
    let output = build_folder().join("scaffold");
    std::fs::create_dir_all(&output).expect("a build folder can be written to");
    symlink(&output, folder.join("target")).expect("a new plugin has no output yet");
    let told = |program: &str| {
        let line = ran.stdout.lines().map(str::trim).find(|line| line.starts_with(program));
        line.unwrap_or_else(|| panic!("it does not say how to build it: {ran:?}"))
    };
    let commands = match language {
        "rust" => {
            vec![format!("{} --offline", told("cargo build ")), "cargo test --release --offline".to_owned()]
        }
        _ => vec![format!("{} -Werror -pedantic", told("cc "))],
    };
    for command in commands {
        let mut process = Command::new("sh");
        process.args(["-c", &command]).current_dir(&folder).env_remove("CARGO_TARGET_DIR");
        // The product is the same; its dependencies compile in a third of the time.
        process.env("CARGO_PROFILE_RELEASE_OPT_LEVEL", "0").env("CARGO_INCREMENTAL", "0");
        let output = process.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
        assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    }
    folder
}

/// Where the library of a plugin comes to lie, in its folder.
fn built_in(language: &str) -> &'static str {
    if language == "rust" { "target/release" } else { "." }
}

/// Validates it, runs its scene on the virtual clock and its test, and returns the peak force on the hand, N.
fn peak_force_n(folder: &Path, name: &str, language: &str) -> f64 {
    let library = format!("{}/lib{}.so", built_in(language), name.replace('-', "_"));
    let ran = Flotor::with(["validate", &library]).inside(folder).run();
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(exit_code::OK), ""), "{ran:?}");
    let ran =
        Flotor::with(["run", "scene.toml", "--clock", "virtual", "--duration", "2s", "--json", "run.json"]);
    let ran = ran.inside(folder).run();
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(exit_code::OK), ""), "{ran:?}");
    let ran = Flotor::with(["test", &format!("{name}.test.toml")]).inside(folder).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let json = std::fs::read_to_string(folder.join("run.json")).expect("the summary was requested");
    let json: serde_json::Value = serde_json::from_str(&json).expect("a summary is JSON");
    json["peak_force_n"].as_f64().expect("the summary has the peak force")
}

#[test]
fn a_new_model_builds_validates_and_pushes() {
    for language in ["rust", "c"] {
        let (scratch, name) = (Scratch::default(), format!("jelly-in-{language}"));
        let folder = made(&scratch, &["model"], &name, language);
        // The intended position of the hand is 4 mm down, against 800 N/m, and the hand is soft: more than nothing,
        // less than 3.2 N.
        let peak = peak_force_n(&folder, &name, language);
        assert!(peak > 0.5 && peak < 3.2, "{language}: {peak} N");
        let poses = scratch
            .file("poses.csv", "id,x_m,y_m,z_m,rx_rad,ry_rad,rz_rad\nq,0,0,-0.001,0,0,0\nn,nan,0,0,0,0,0\n");
        let ran = Flotor::with(
            ["eval", "--model", &name, "--out", "-", "--poses"]
                .iter()
                .map(AsRef::as_ref)
                .chain([poses.as_os_str()]),
        );
        let ran = ran.searching(&[&folder.join(built_in(language))]).run();
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
        assert!(ran.stdout.contains("q,0.0,0.0,0.5,0.0,0.0,0.0,,ok"), "{}", ran.stdout); // 500 N/m times 1 mm
        assert!(ran.stdout.contains("n,0.0,0.0,0.0,0.0,0.0,0.0,,invalid_input"), "{}", ran.stdout);
    }
}

#[test]
fn a_new_asynchronous_model_builds_validates_and_pushes() {
    for language in ["rust", "c"] {
        let (scratch, name) = (Scratch::default(), format!("gel-in-{language}"));
        let folder = made(&scratch, &["model", "--beside"], &name, language);
        // The hand goes less than 4 mm down, where the layers give way by 4 mm under 3.5 N.
        let peak = peak_force_n(&folder, &name, language);
        assert!(peak > 1.5 && peak < 3.5, "{language}: {peak} N");
    }
}

#[test]
fn a_device_is_never_asynchronous() {
    let scratch = Scratch::default();
    let ran = new(scratch.path(), &["device", "crank", "--beside"]);
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(ran.error().contains("`--beside` is for models"), "{ran:?}");
    assert!(!scratch.path().join("crank").exists());
}

#[test]
fn the_model_a_newcomer_starts_from_is_forty_lines_at_most() {
    for kind in [&["model", "jelly"][..], &["model", "jelly", "--beside"]] {
        let scratch = Scratch::default();
        let ran = new(scratch.path(), kind);
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
        let source = std::fs::read_to_string(scratch.path().join("jelly/src/lib.rs")).expect("it was made");
        let model = source.split("#[cfg(test)]").next().unwrap_or_default();
        let lines =
            model.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with("//")).count();
        println!("{lines} lines, without comments and its test");
        assert!((10..=40).contains(&lines), "{kind:?}: {lines}");
    }
}

#[test]
fn the_asynchronous_model_a_newcomer_starts_from_is_that_of_the_book() {
    let scratch = Scratch::default();
    let ran = new(scratch.path(), &["model", "jelly", "--beside"]);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let source = std::fs::read_to_string(scratch.path().join("jelly/src/lib.rs")).expect("it was made");
    let chapter = workspace_root().join("docs/src/bring-your-solver.md");
    let chapter = std::fs::read_to_string(chapter).expect("it is there");
    assert!(chapter.contains(&source), "docs/src/bring-your-solver.md does not have this file:\n{source}");
}

#[test]
fn the_device_a_newcomer_starts_from_is_that_of_the_book() {
    let scratch = Scratch::default();
    let ran = new(scratch.path(), &["device", "crank"]);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let source = std::fs::read_to_string(scratch.path().join("crank/src/lib.rs")).expect("it was made");
    let example = workspace_root().join("examples/device/src/lib.rs");
    assert_eq!(source, std::fs::read_to_string(example).expect("it is there"));
}

#[test]
fn a_new_device_builds_validates_and_moves() {
    for language in ["rust", "c"] {
        let (scratch, name) = (Scratch::default(), format!("crank-in-{language}"));
        let folder = made(&scratch, &["device"], &name, language);
        // Spring 1 at 4 mm: k_hand is gamma / L0 = 679 N/m without the demo's scale; the energy form adds little.
        let peak = peak_force_n(&folder, &name, language);
        assert!((peak - 2.7).abs() < 0.3, "{language}: {peak} N");
    }
}

#[test]
fn a_new_plugin_in_rust_is_formatted_whatever_its_name() {
    let installed = Command::new("rustfmt").arg("--version").output();
    if !installed.is_ok_and(|output| output.status.success()) {
        return lacks(Tool::Rustfmt, "rustfmt is not installed");
    }
    for name in ["j", "jelly", "jelly-with-a-name-of-32-letters"] {
        for kind in [&["model"][..], &["model", "--beside"], &["device"]] {
            let scratch = Scratch::default();
            let ran = new(scratch.path(), &[kind, &[name]].concat());
            assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
            let mut format = Command::new("rustfmt");
            format
                .args(["--edition", "2024", "--check", "src/lib.rs"])
                .current_dir(scratch.path().join(name));
            let checked = format.output().expect("it is installed");
            assert!(
                checked.status.success(),
                "{kind:?} {name}: {}",
                String::from_utf8_lossy(&checked.stdout)
            );
        }
    }
}

/// The files of a new plugin that git would track, by their paths in its folder.
fn tracked(folder: &Path) -> Vec<PathBuf> {
    fn search(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in
            std::fs::read_dir(folder).expect("it was made").map(|entry| entry.expect("it is ours").path())
        {
            if entry.is_dir() { search(&entry, found) } else { found.push(entry) }
        }
    }
    let ignored = std::fs::read_to_string(folder.join(".gitignore")).expect("it was made");
    let mut found = Vec::new();
    search(folder, &mut found);
    found.retain(|file| {
        let path = format!("/{}", file.strip_prefix(folder).expect("it lies in the folder").display());
        !ignored.lines().any(|line| line == path)
    });
    found
}

#[test]
fn no_tracked_file_has_a_path_of_this_machine() {
    let root = workspace_root().display().to_string();
    for (language, option) in [("rust", "--language=rust"), ("c", "--language=c"), ("rust", "--vendor")] {
        let scratch = Scratch::default();
        let ran = new(scratch.path(), &["model", "jelly", option]);
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
        let folder = scratch.path().join("jelly");
        let files = tracked(&folder);
        assert!(files.len() >= 6, "{files:?}");
        for file in files {
            let text = std::fs::read_to_string(&file).expect("text");
            assert!(!text.contains(&root) && !text.contains("/hal\""), "{language}: {}", file.display());
        }
    }
}

#[test]
fn a_crate_with_a_copy_of_the_contract_builds_after_a_move() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let scratch = Scratch::default();
    let ran = new(scratch.path(), &["model", "jelly", "--vendor"]);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let moved = scratch.folder("elsewhere").join("jelly");
    std::fs::rename(scratch.path().join("jelly"), &moved).expect("it can be moved");
    for licence in ["LICENSE-MIT", "LICENSE-APACHE"] {
        assert!(moved.join("flotor-hal").join(licence).is_file(), "a copy has its {licence}");
    }
    let mut cargo = Command::new("cargo");
    cargo
        .args(["check", "--offline", "--target-dir"])
        .arg(build_folder().join("scaffold"))
        .current_dir(&moved);
    let checked = cargo.output().expect("cargo starts");
    assert!(checked.status.success(), "{}", String::from_utf8_lossy(&checked.stderr));
    assert!(!moved.join(".cargo").exists());
}

#[test]
fn nothing_is_overwritten() {
    let scratch = Scratch::default();
    let own = scratch.folder("jelly");
    std::fs::write(own.join("notes.txt"), "mine").expect("a scratch folder can be written to");
    let ran = new(scratch.path(), &["model", "jelly"]);
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION));
    assert!(ran.error().contains("jelly exists; move it or choose another name"), "{ran:?}");
    let left: Vec<_> = std::fs::read_dir(&own).expect("it is still there").collect();
    assert_eq!(left.len(), 1);
}

#[test]
fn a_name_that_cannot_be_costs_one_line_with_one_that_can() {
    let scratch = Scratch::default();
    for (name, says) in [
        ("SoftWall", "use `soft-wall`"),
        ("../wall", "use `wall`"),
        ("fn", "reserved by the compiler"),
        ("test", "reserved by cargo"),
        ("flotor-hal", "reserved by Flotor, for its own crates"),
        ("wrench", "clashes with a name that the template uses"),
        ("spring", "is already the id of"),
    ] {
        let ran = new(scratch.path(), &["model", name]);
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{name}: {ran:?}");
        assert!(ran.error().contains(says), "{name}: {ran:?}");
        assert_eq!(ran.stderr.lines().count(), 1, "{name}: {ran:?}");
    }
    let left = std::fs::read_dir(scratch.path()).expect("it is still there");
    assert_eq!(left.count(), 0, "a refused name leaves nothing behind");
}

#[test]
fn without_the_contract_there_is_no_plugin() {
    let scratch = Scratch::default();
    let ran = new(scratch.path(), &["model", "jelly", "--hal", "/nowhere"]);
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION));
    assert!(ran.error().contains("not at /nowhere") && ran.error().contains("--hal PATH"), "{ran:?}");
    assert!(!scratch.path().join("jelly").exists());
}
