//! `examples/`: every command of its page does what it is there for, and what the book also shows is the same there.

use flotor_session::scene::Scene;
use flotor_tests::program::Flotor;
use flotor_tests::scratch::Scratch;
use flotor_tests::tools::{Tool, required, skipped};
use flotor_tests::{TestSize, files_under, workspace_root};
use rayon::prelude::*;
use std::path::Path;
use std::process::Command;

/// Environment variable: a Python interpreter with the packages that the page names.
const PYTHON: &str = "FLOTOR_PYTHON";

fn text(path: &str) -> String {
    std::fs::read_to_string(workspace_root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Beginning of the line that names the command that failed.
const FAILED: &str = "failed: ";

/// The commands of the page, in order.
fn commands() -> Vec<String> {
    text("examples/README.md").lines().filter_map(|line| line.strip_prefix("$ ").map(str::to_owned)).collect()
}

/// Runs the commands in one shell, as a reader does, and returns what they print. The programs are those of this build.
fn run(commands: &[String]) -> String {
    let commands: String = commands
        .iter()
        .map(|command| format!("({command}) || {{ echo {FAILED}'{command}' >&2; exit 1; }}\n"))
        .collect();
    let scratch = Scratch::default();
    // An earlier run of the page left it, and recordings are not overwritten.
    let _ = std::fs::remove_file(workspace_root().join("target/examples/run.mcap"));
    let script = format!(
        "set -e\nexport PATH=\"${{1%/*}}:$PATH\" FLOTOR_PLUGIN_PATH=target/examples/debug\nunset CARGO_TARGET_DIR\n\
         cd '{}'\n{commands}",
        workspace_root().display()
    );
    let file = scratch.file("script", script);
    let ran =
        Flotor::with([&file]).through_shell("exec bash \"$2\" \"$1\"").env("CARGO_NET_OFFLINE", "true").run();
    let failed = ran.stderr.lines().find_map(|line| line.strip_prefix(FAILED));
    assert_eq!(failed, None, "{ran:#?}");
    assert_eq!(ran.code, Some(0), "{ran:#?}");
    ran.stdout
}

#[test]
fn every_command_of_the_examples_runs() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let (python, cxx) = (std::env::var(PYTHON).ok(), required(Tool::Cxx));
    // The solver of the gel is in Python, without any package.
    let solver = required(Tool::Python);
    let needs_solver = |text: &str| ["gel", "Gel", "slow-model"].iter().any(|word| text.contains(word));
    if python.is_none() {
        skipped(&format!("{PYTHON} names no Python with mcap: read_recording.py"));
    }
    let chosen: Vec<String> = commands()
        .into_iter()
        .filter(|command| !command.starts_with("export ") && (cxx || !command.contains("cpp")))
        .filter(|command| solver || !needs_solver(command))
        .filter_map(|command| match (&python, command.contains("python3")) {
            (_, false) => Some(command),
            (Some(python), true) => Some(command.replace("python3", python)),
            (None, true) => None,
        })
        .collect();
    let printed = run(&chosen);
    for title in [
        "A jelly",
        "A wall on a crank",
        "Honey",
        "A jelly in C++",
        "Gel, by a solver in another process",
        "A wall on a maker's knob",
        "Two hands, one spring",
    ] {
        let shown = printed.lines().any(|line| line == title);
        let is_left_out = (!cxx && title.contains("C++")) || (!solver && needs_solver(title));
        assert!(shown || is_left_out, "`{title}` did not run: {printed}");
    }
    let peaks = printed.lines().filter(|line| line.starts_with("  peak "));
    let without_force: Vec<&str> = peaks.filter(|line| line.contains("  0.000 N ")).collect();
    assert_eq!(without_force, Vec::<&str>::new(), "an example without force shows nothing: {printed}");
    assert!(printed.contains("cases passed"), "{printed}");
}

#[test]
fn the_workflow_of_the_examples_tests_the_files_beside_it() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let workflow = text("examples/ci/workflow.yml");
    let folder = workspace_root().join("examples/ci");
    let test = workflow.lines().find_map(|line| line.trim().strip_prefix("- run: flotor test "));
    let file = test.and_then(|test| test.split(' ').next()).expect("it has a test");
    let scratch = Scratch::default();
    let junit = scratch.path().join("results.xml");
    let ran = Flotor::with(["test".as_ref(), file.as_ref(), "--junit".as_ref(), junit.as_os_str()])
        .inside(&folder)
        .run();
    assert_eq!(ran.code, Some(0), "{ran:#?}");
    // The same without what makes the floor a floor fails.
    let test = text("examples/ci/floor.test.toml")
        .replace("[expect]", "[set]\nfloor.stiffness_n_per_m = [1]\n[expect]");
    let (_, _) =
        (scratch.file("soft.test.toml", test), scratch.file("scene.toml", text("examples/ci/scene.toml")));
    let ran = Flotor::with(["test", "soft.test.toml"]).inside(scratch.path()).run();
    assert_eq!(ran.code, Some(1), "{ran:#?}");
    assert!(ran.stdout.contains("peak_force_n"), "{ran:#?}");
}

#[test]
fn every_scene_of_the_examples_is_one() {
    let mut found = 0;
    for file in files_under("examples", "toml").expect("there are examples") {
        let file = workspace_root().join(file);
        let text = std::fs::read_to_string(&file).expect("a text");
        if text.lines().any(|line| line == "[device]") {
            let _ = Scene::load(&file).unwrap_or_else(|error| panic!("{error}"));
            found += 1;
        }
    }
    assert!(found >= 8, "{found} scenes");
}

#[test]
fn a_scene_runs_in_a_program_of_ones_own() {
    let ran = Command::new(env!("CARGO_BIN_EXE_embed")).output().expect("it is built with the tests");
    let printed = String::from_utf8_lossy(&ran.stdout);
    assert!(ran.status.success(), "{ran:?}");
    assert!(printed.contains("after 2000 ticks; largest force "), "{printed}");
}

#[test]
fn the_gallery_has_every_scene_and_its_picture() {
    let gallery = text("docs/src/gallery.md");
    let scenes = files_under("host/scenes", "toml").expect("there are scenes");
    let names = scenes.iter().filter_map(|file| file.file_name()?.to_str()?.strip_suffix(".toml"));
    for name in names.filter(|name| !name.ends_with(".test")) {
        let command = format!("$ flotor run {name} --clock virtual ");
        let needs_more = gallery.contains(&format!("\n- `{name}.toml`: "));
        assert_ne!(gallery.contains(&command), needs_more, "{name} is shown, or the reason why not is told");
        if needs_more {
            continue;
        }
        // The title of the scene; the book's test compares the numbers beside it with what the command prints.
        let title =
            Scene::load(&workspace_root().join(format!("host/scenes/{name}.toml"))).expect("a scene").title;
        let picture = text(&format!("docs/src/images/scenes/{name}.svg"));
        assert!(picture.contains(&format!("<title>{title}</title>")), "{name}: another picture");
    }
}

#[test]
fn the_pictures_of_the_readme_and_the_gallery_are_what_their_commands_draw() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let (readme, gallery) = (text("README.md"), text("docs/src/gallery.md"));
    let of_readme = readme.split('`').filter_map(|quoted| quoted.strip_prefix("cargo run --release -- "));
    let of_readme: Vec<(&str, &str)> = of_readme.map(|command| (command, "docs/src/images")).collect();
    assert_eq!(of_readme.len(), 1, "{of_readme:?}");
    let of_gallery = gallery.lines().filter_map(|line| line.strip_prefix("$ flotor "));
    let of_gallery: Vec<(&str, &str)> =
        of_gallery.map(|command| (command, "docs/src/images/scenes")).collect();
    assert!(of_gallery.len() >= 8, "{of_gallery:?}");
    let scratch = Scratch::default();
    let commands = [of_readme, of_gallery].concat();
    let another = commands.into_par_iter().filter_map(|(command, pictures)| {
        let words = command.split(' ').map(|word| match word.strip_suffix(".svg") {
            Some(_) => scratch.path().join(word).display().to_string(),
            None => word.to_owned(),
        });
        let words: Vec<String> = words.collect();
        let ran = Flotor::with(&words).inside(&workspace_root()).run();
        assert_eq!(ran.code, Some(0), "{command}: {ran:#?}");
        let drawn = Path::new(words.last().expect("it has words"));
        let name = drawn.file_name()?.to_str()?;
        let kept = text(&format!("{pictures}/{name}"));
        (std::fs::read_to_string(drawn).ok() != Some(kept)).then_some(command)
    });
    assert_eq!(another.collect::<Vec<_>>(), Vec::<&str>::new(), "they draw another picture");
}

#[test]
fn what_the_book_shows_of_an_example_is_its_file() {
    for (file, shown_in) in [
        ("examples/model/src/lib.rs", "README.md"),
        ("examples/device/src/lib.rs", "docs/src/write-a-device.md"),
        ("examples/read_recording.py", "docs/src/recording.md"),
        ("examples/slow-model/src/lib.rs", "docs/src/slow-model.md"),
        ("examples/slow-model/src/solver.py", "docs/src/slow-model.md"),
        ("examples/cable/src/lib.rs", "docs/src/cable.md"),
        ("examples/cable/src/reader.rs", "docs/src/cable.md"),
    ] {
        // The chapters show a model or a device without its test, where the page of the examples runs the test.
        let whole = text(file);
        let shown = match shown_in.contains("slow-model") || shown_in.contains("cable") {
            true => whole.split("\n#[cfg(test)]\nmod tests").next().unwrap_or_default().to_owned() + "\n",
            false => whole.clone(),
        };
        let block = format!("\n{}\n```\n", shown.trim_end());
        assert!(text(shown_in).contains(&block), "{file} is not what {shown_in} shows");
    }
    let lines = text("examples/model/src/lib.rs").lines().count();
    assert!(lines <= 25, "a model in {lines} lines");
    let device = text("examples/device/src/lib.rs");
    let code = device.lines().take_while(|line| *line != "#[cfg(test)]").map(str::trim);
    let lines = code.filter(|line| !line.is_empty() && !line.starts_with("//")).count();
    assert!(lines <= 40, "a device in {lines} lines of code");
}
