//! Every plugin of the tree is found without being opened.

use flotor_tests::library::{patched, plugin_file};
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::{crate_name_of, plugin_folders};
use serde_json::Value;

#[test]
fn every_plugin_is_listed_without_being_opened() {
    // A library that the linker would refuse: whoever opened it would not get far.
    let scratch = Scratch::default();
    for folder in plugin_folders() {
        let library = plugin_file(&crate_name_of(&folder));
        let bytes = std::fs::read(&library).expect("it is built");
        let bytes = patched(bytes, b"\0libc.so.6\0", b"\0libX.so.6\0");
        let _ = scratch.file(&library.file_name().expect("a file has a name").to_string_lossy(), &bytes);
    }
    let ran = Flotor::with(["plugins", "--json"]).searching(&[scratch.path()]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let listed: Vec<Value> = serde_json::from_str(&ran.stdout).expect("the list is JSON");
    for folder in plugin_folders() {
        let id = folder.rsplit('/').next().expect("a folder has a name");
        let plugin = listed.iter().find(|plugin| plugin["id"] == id);
        let plugin = plugin.unwrap_or_else(|| panic!("`{id}` is not listed: {}", ran.stdout));
        let file = plugin["file"].as_str().expect("a file is text");
        assert!(file.starts_with(&*scratch.path().to_string_lossy()), "{file} is not the unloadable one");
    }
}

#[test]
fn every_command_searches_the_folders_of_plugin_path_first() {
    // Whoever finds this spring, and not the one of the installation, cannot load it.
    let scratch = Scratch::default();
    let library = plugin_file("flotor-spring");
    let bytes = patched(std::fs::read(&library).expect("it is built"), b"\0libc.so.6\0", b"\0libX.so.6\0");
    let _ = scratch.file("libother.so", &bytes);
    let folder = scratch.path().display().to_string();
    let out = scratch.path().join("data").display().to_string();
    for command in [
        &["run", "--clock", "virtual"][..],
        &["plugins", "spring"],
        &["eval", "--model", "spring", "--poses", "-"],
        &["stress", "--model", "spring"],
        &["bench"],
        &["jitter"],
        &["study", "jnd", "--out", &out],
        &["study", "explore"],
    ] {
        let ran = Flotor::with([command, &["--plugin-path", &folder]].concat()).run();
        assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{command:?}: {ran:?}");
        assert!(ran.error().contains(&folder), "{command:?}: {ran:?}");
    }
    let ran = Flotor::with(["plugins", "--plugin-path", "nosuch"]).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(ran.stderr.contains("no such folder"), "{ran:?}");
}

#[test]
fn every_command_takes_an_id_a_path_or_a_file_of_this_folder() {
    let scratch = Scratch::default();
    let library = plugin_file("flotor-wall");
    let bare = library.file_name().expect("a file has a name").to_string_lossy().into_owned();
    let _ = scratch.file(&bare, std::fs::read(&library).expect("it is built"));
    // An id wins over a file.
    let _ = scratch.file("wall", "I am no library.\n");
    let _ = scratch.file("poses.csv", "x_m,y_m,z_m,rx_rad,ry_rad,rz_rad\n0,0,-0.005,0,0,0\n");
    let scene = |plugin: &str| {
        let models = format!("[[model]]\nname = \"wall\"\nplugin = \"{plugin}\"\n");
        let _ = scratch.file("scene.toml", format!("[device]\nplugin = \"simulated\"\n{models}"));
    };
    let ran = |command: &str, name: &str| {
        let arguments = command.split(' ').map(|word| word.replace("NAME", name));
        Flotor::with(arguments).inside(scratch.path()).run()
    };
    scene("wall");
    let recorded = ran("run scene.toml --clock virtual --duration 10ms --record run.mcap", "wall");
    assert_eq!(recorded.code, Some(exit_code::OK), "{recorded:#?}");
    let whole = library.display().to_string();
    for name in ["wall", &format!("./{bare}"), &whole, &bare] {
        scene(name);
        for command in [
            "run scene.toml --clock virtual --duration 10ms",
            "replay run.mcap --model wall=NAME",
            "plugins NAME",
            "validate NAME --only metadata",
            "eval NAME --poses poses.csv",
            "eval --model NAME --poses poses.csv",
            "stress NAME --only M0",
            "stress --model NAME --only M0",
            "bench NAME",
            "bench --model NAME",
        ] {
            let ran = ran(command, name);
            assert_eq!(ran.code, Some(exit_code::OK), "{command}, {name}: {ran:#?}");
        }
        let ran = ran("doctor --device NAME", name);
        assert!(ran.error().contains("is a model"), "{name}: {ran:#?}");
    }
}

#[test]
fn json_goes_to_standard_output_or_to_a_file_but_never_over_the_next_argument() {
    let scratch = Scratch::default();
    let at = |arguments: &[&str]| Flotor::with(arguments).inside(scratch.path()).run();
    let all = at(&["plugins", "wall", "--json"]);
    assert_eq!((all.code, at(&["plugins", "wall", "--json", "-"])), (Some(exit_code::OK), all.clone()));
    let both = at(&["plugins", "wall", "--json", "wall.json"]);
    assert!(both.stdout.starts_with("wall "), "{both:?}");
    let written = std::fs::read_to_string(scratch.path().join("wall.json")).expect("it was written");
    assert_eq!(written, all.stdout);
    let scene = scratch.file("scene.toml", "[device]\nplugin = \"simulated\"\n");
    let ran = at(&["run", "--json", "scene.toml"]);
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(std::fs::read_to_string(scene).expect("it is there").starts_with("[device]"));
}

/// A model that estimates its own error is believed aloud: before a run and after it.
#[test]
fn a_model_tells_its_estimate_of_its_own_error() {
    let settings = ["--set", "tool=punch-square", "--set", "body=half-space"];
    let ran = Flotor::with(["plugins", "solid"].into_iter().chain(settings)).run();
    let line =
        ran.stdout.lines().find(|line| line.trim_start().starts_with("mesh_error")).unwrap_or_default();
    let told: f64 = line.split_whitespace().nth(1).and_then(|word| word.parse().ok()).unwrap_or_default();
    assert!(told > 0.0 && told < 0.1 && ran.stdout.contains("a tick at home"), "{ran:?}");
    let scratch = Scratch::default();
    let scene = "[device]\nplugin = \"simulated\"\n[[model]]\nplugin = \"solid\"\n[model.parameters]\n\
                 tool = \"punch-square\"\nbody = \"half-space\"\n";
    let scene = scratch.file("solid.toml", scene.as_bytes()).display().to_string();
    let ran = Flotor::with(["run", &scene, "--clock", "virtual", "--duration", "10ms", "--json", "-"]).run();
    let summary: Value = serde_json::from_str(&ran.stdout).expect("the summary is JSON");
    let plugins = summary["plugins"].as_array().cloned().unwrap_or_default();
    let solid = plugins.iter().find(|plugin| plugin["id"] == "solid").expect("the solid");
    let estimate = solid["estimates"]["mesh_error"].as_f64().expect("an estimate");
    assert!((estimate / told - 1.0).abs() < 0.1, "{estimate} {told}");
    let ran = Flotor::with(["plugins", "simulated", "--set", "preset=full"]).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
}

#[test]
fn completions_end_in_order_where_their_reader_has_gone() {
    let ran = Flotor::with(["completions", "bash"]).through_shell("\"$1\" completions bash | true").run();
    assert_eq!(ran.stderr, "", "{ran:#?}");
    let whole = Flotor::with(["completions", "bash"]).run();
    assert!(whole.stdout.starts_with("_flotor()") && whole.stderr.is_empty(), "{}", whole.stderr);
}
