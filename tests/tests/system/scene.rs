//! An error of a scene is reported in one line: file, line, key, and the closest valid one.

use flotor_core::limits::Bound;
use flotor_session::scene::Scene;
use flotor_tests::library::plugin_file;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use std::path::Path;

/// A scene that is right; tests spoil it.
const RIGHT: &str = r#"title = "A spring"
rate_hz = 1000

[device]
plugin = "simulated"

[[model]]
plugin = "spring"

[model.mapping]
motion_scale = 1.6666666666666667

[limits]
force_n = [30, 30, 60]

[boundary]
margin_mm = 0.5
"#;

/// The complaint about a scene.
fn complaint(scene: &str) -> String {
    Scene::parse(Path::new("scene.toml"), scene).expect_err("something is wrong with it").to_string()
}

/// The complaint about [`RIGHT`] with one piece of text replaced.
fn spoiled(piece: &str, wrong: &str) -> String {
    assert!(RIGHT.contains(piece), "{piece}");
    complaint(&RIGHT.replace(piece, wrong))
}

#[test]
fn the_right_scene_is_read_whole() {
    let scene = Scene::parse(Path::new("scene.toml"), RIGHT).expect("nothing is wrong with it");
    assert_eq!(scene.title, "A spring");
    assert_eq!(scene.limits.force_n, Bound::box_of([30.0, 30.0, 60.0]));
    assert_eq!(scene.models.len(), 1);
    assert!((scene.boundary.margin_m - 0.5e-3).abs() < 1.0e-18);
}

#[test]
fn one_number_is_a_norm_three_are_axes_and_a_table_is_both() {
    for (written, bound) in [
        ("5", Bound::ball(5.0)),
        ("[5, 6, 7]", Bound::box_of([5.0, 6.0, 7.0])),
        ("{ norm = 5, axes = [9, 9, 3] }", Bound::ball(5.0).and(Bound::box_of([9.0, 9.0, 3.0]))),
        ("inf", Bound::NONE),
    ] {
        for key in ["force_n", "torque_nm", "velocity_m_per_s", "angular_velocity_rad_per_s"] {
            let text = RIGHT.replace("force_n = [30, 30, 60]", &format!("{key} = {written}"));
            let limits = Scene::parse(Path::new("scene.toml"), &text).expect("it is legal").limits;
            let read = match key {
                "force_n" => limits.force_n,
                "torque_nm" => limits.torque_nm,
                "velocity_m_per_s" => limits.velocity_m_per_s,
                _ => limits.angular_velocity_rad_per_s,
            };
            assert_eq!(read, bound, "{key} = {written}");
        }
    }
}

#[test]
fn the_built_in_demo_is_right() {
    assert!(Scene::demo().is_ok());
}

#[test]
fn an_unknown_key_is_named_with_its_line_and_the_closest_valid_one() {
    for (piece, wrong, expected) in [
        ("rate_hz", "rate_hs", "scene.toml:2: unknown key `rate_hs`; did you mean `rate_hz`?"),
        (
            "plugin = \"simulated\"",
            "plugin = \"simulated\"\npreset = \"plain\"",
            "scene.toml:6: unknown key `device.preset`",
        ),
        (
            "motion_scale",
            "motion_scael",
            "unknown key `model.mapping.motion_scael`; did you mean `motion_scale`?",
        ),
        ("force_n", "forcen", "unknown key `limits.forcen`; did you mean `force_n`?"),
        ("margin_mm", "margin_m", "unknown key `boundary.margin_m`; did you mean `margin_mm`?"),
        ("[limits]", "[limit]", "unknown key `limit`; did you mean `limits`?"),
    ] {
        let complaint = spoiled(piece, wrong);
        assert!(complaint.contains(expected), "{complaint}");
    }
}

#[test]
fn wrong_types_and_ranges_say_what_would_be_right() {
    for (piece, wrong, expected) in [
        ("rate_hz = 1000", "rate_hz = \"fast\"", "scene.toml:2: `rate_hz` must be a number"),
        ("rate_hz = 1000", "rate_hz = 5", "`rate_hz` = 5: must be 100 to 10000"),
        ("rate_hz = 1000", "rate_hz = nan", "`rate_hz` = NaN: must be 100 to 10000"),
        (
            "[30, 30, 60]",
            "[30, 30]",
            "scene.toml:14: `limits.force_n` must be one number (the largest norm), three numbers",
        ),
        (
            "[30, 30, 60]",
            "\"10 N\"",
            "scene.toml:14: `limits.force_n` must be one number (the largest norm), three numbers",
        ),
        ("[30, 30, 60]", "-1", "scene.toml:14: `limits.force_n` = -1: must be 0 or more"),
        ("[30, 30, 60]", "[30, nan, 60]", "`limits.force_n` = NaN: must be 0 or more"),
        ("[30, 30, 60]", "{ norm = 5 }", "scene.toml:14: `limits.force_n.axes` is missing"),
        ("[30, 30, 60]", "{ norm = -5, axes = [1, 1, 1] }", "`limits.force_n.norm` = -5: must be 0 or more"),
        ("[30, 30, 60]", "{ norm = 5, axis = [1, 1, 1] }", "`limits.force_n.axis`; did you mean `axes`?"),
        (
            "force_n = [30, 30, 60]",
            "velocity_m_per_s = 0",
            "`limits.velocity_m_per_s` = 0: must be 0.000001 or more",
        ),
        ("[device]\nplugin = \"simulated\"", "", "scene.toml:1: `device` is missing"),
        ("plugin = \"spring\"", "", "`model.plugin` is missing"),
        ("plugin = \"spring\"", "plugin = 3", "`model.plugin` must be text in quotes"),
        (
            "motion_scale = 1.6666666666666667",
            "rotation_xyzw = [0, 0, 0, 2]",
            "a rotation must be a unit quaternion",
        ),
        ("motion_scale = 1.6666666666666667", "motion_scale = 0", "`model.mapping.motion_scale` = 0"),
        ("title = ", "title ", "scene.toml:1: not valid TOML"),
        (
            "rate_hz = 1000",
            "rate_hz = 1000,5",
            "scene.toml:2: not valid TOML: `rate_hz = 1000,5`: use a point",
        ),
        (
            "\"spring\"",
            "\"C:\\path.dll\"",
            "put text with a backslash in single quotes: `plugin = 'C:\\path.dll'`",
        ),
        (
            "[device]\nplugin",
            "device",
            "scene.toml:4: `device` is a table: write [device] and below it plugin = \"sim",
        ),
        (
            "[model.mapping]\nmotion_scale",
            "mapping",
            "`model.mapping` is a table: write [model.mapping] and below it",
        ),
        (
            "plugin = \"spring\"",
            "plugin = \"spring\"\ndevice = []",
            "scene.toml:9: `model.device` names no device; name at least one",
        ),
        (
            "force_n = [30, 30, 60]",
            "emergency_button = 1.7",
            "scene.toml:14: `limits.emergency_button` must be a whole number from 0 to 31",
        ),
        ("force_n = [30, 30, 60]", "emergency_button = 32", "must be a whole number from 0 to 31"),
    ] {
        let complaint = spoiled(piece, wrong);
        assert!(complaint.contains(expected), "{complaint}");
        assert_eq!(complaint.lines().count(), 1, "{complaint}");
    }
}

#[test]
fn a_watchdog_waits_for_three_periods_at_least() {
    let with = |rate_hz: u32, watchdog_ms: &str| {
        RIGHT
            .replace("rate_hz = 1000", &format!("rate_hz = {rate_hz}"))
            .replace("force_n = [30, 30, 60]", &format!("watchdog_ms = {watchdog_ms}"))
    };
    for (rate_hz, shortest) in [(1000, "3"), (100, "30"), (700, "4.29"), (10_000, "1")] {
        let scene = Scene::parse(Path::new("scene.toml"), &with(rate_hz, shortest));
        assert!(scene.is_ok(), "{rate_hz} Hz: {scene:?}");
    }
    for (rate_hz, short, legal) in
        [(1000, "2.9", "3 to 60000"), (100, "20", "30 to 60000"), (700, "4", "4.29 to 60000")]
    {
        let expected = format!(
            "scene.toml:14: `limits.watchdog_ms` = {short}: at {rate_hz} Hz it must be {legal}, \
             at least three periods of the loop"
        );
        assert_eq!(complaint(&with(rate_hz, short)), expected);
    }
    // Another rate on the command line makes another limit.
    let scratch = Scratch::default();
    let scene = scratch.file("scene.toml", with(1000, "10"));
    let at = |rate_hz: &str| {
        let scene = scene.display().to_string();
        Flotor::with(["run", &scene, "--clock", "virtual", "--duration", "10ms", "--rate", rate_hz]).run()
    };
    assert_eq!(at("300").code, Some(exit_code::OK));
    let ran = at("200");
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(
        ran.error().starts_with("--rate: `limits.watchdog_ms` = 10: at 200 Hz it must be 15 to"),
        "{ran:?}"
    );
}

#[test]
fn parameters_are_checked_against_the_plugin_and_complain_with_file_and_line() {
    let scratch = Scratch::default();
    let with_parameters = |text: &str| format!("{RIGHT}\n[device.parameters]\n{text}\n");
    for (parameters, expected) in [
        ("mass_gk = 1", "scene.toml:20: [device] no parameter `mass_gk`; did you mean `mass_kg`?"),
        ("mass_kg = -1", "scene.toml:20: [device] `mass_kg` = -1: must be 0.01 to 10 kg"),
        ("hand = \"squeeze\"", "must be oscillate | press | release | hold | open"),
        ("mass_kg = true", "`mass_kg` must be a number in kg, not `true`"),
        ("mass_kg = \"heavy\"", "`mass_kg` must be a number in kg, not `heavy`"),
    ] {
        let scene = scratch.file("scene.toml", with_parameters(parameters));
        let ran = Flotor::with(["run", "--clock", "virtual", &scene.display().to_string()]).run();
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
        assert!(ran.error().contains(expected), "{ran:?}");
    }
}

#[test]
fn what_the_command_line_gets_wrong_is_said_there() {
    for (arguments, expected) in [
        (
            &["run", "--set", "sprng.gamma_n=17"][..],
            "the scene has no plugin `sprng`; did you mean `spring`?",
        ),
        (&["run", "--set", "spring.gama_n=17"], "no parameter `gama_n`; did you mean `gamma_n`?"),
        (&["run", "--set", "spring.alpha_n_mm2=170"], "set `mode` to `alpha` as well"),
        (&["run", "--clock", "virtual", "--core", "0"], "--core needs the real clock"),
        (&["run", "no-such-scene.toml"], "no-such-scene.toml: cannot read the scene"),
    ] {
        let ran = Flotor::with(arguments).run();
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
        assert!(ran.error().contains(expected), "{ran:?}");
    }
    for arguments in
        [&["run", "--rate", "5"][..], &["run", "--duration", "long"], &["run", "--set", "novalue"], &["rum"]]
    {
        assert_eq!(Flotor::with(arguments).run().code, Some(exit_code::CONFIGURATION), "{arguments:?}");
    }
    let recording = Flotor::with(["run", "--record", "out.bag"]).run();
    assert_eq!(recording.code, Some(exit_code::CONFIGURATION), "{recording:?}");
    assert!(recording.stderr.contains("name it FILE.mcap"), "{recording:?}");
}

#[test]
fn an_unknown_plugin_is_named_with_the_nearest_one() {
    let scratch = Scratch::default();
    let scene = scratch.file("scene.toml", RIGHT.replace("\"spring\"", "\"sprnig\""));
    let ran = Flotor::with(["run", &scene.display().to_string()]).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(
        ran.error().contains("scene.toml:8: no model plugin `sprnig`; did you mean `spring`?"),
        "{ran:?}"
    );
}

#[test]
fn a_plugin_that_is_not_built_is_named_with_the_folder_in_which_it_is_missing() {
    let scratch = Scratch::default();
    let scene = RIGHT.replace("\"spring\"", "\"jelly\"");
    let scene = scratch.file("scene.toml", format!("plugin_folders = [\"target/release\"]\n{scene}"));
    let error = || Flotor::with(["run", &scene.display().to_string()]).run().error().to_owned();
    let hint = "target/release` contains no plugin: build it first";
    assert!(error().contains(hint), "{}", error());
    let _ = scratch.folder("target");
    let folder = scratch.folder("target/release");
    std::fs::copy(plugin_file("flotor-wall"), folder.join("libflotor_wall.so")).expect("it is built");
    assert!(!error().contains(hint), "{}", error());
}

#[test]
fn a_file_that_is_no_text_is_told_with_its_line() {
    let scratch = Scratch::default();
    let wrong = |name: &str| {
        let bytes = [b"# one\n# two\n# ".to_vec(), vec![0xff], b"\n".to_vec()].concat();
        scratch.file(name, bytes).display().to_string()
    };
    let scene = |name: &str, tables: String| {
        let text = format!("duration_s = 0.01\n[device]\nplugin = \"simulated\"\n{tables}");
        scratch.file(name, text).display().to_string()
    };
    let curve = "[[model]]\nplugin = \"measured\"\n[model.parameters]\ncurve";
    let mesh = "[[model]]\nplugin = \"membrane\"\n[model.parameters]\nfile";
    let scenes = [
        ("scene.toml", wrong("scene.toml")),
        (
            "hand.toml",
            scene("a.toml", format!("[device.parameters]\nhand_script = {:?}\n", wrong("hand.toml"))),
        ),
        ("unit.toml", scene("b.toml", format!("calibration = {:?}\n", wrong("unit.toml")))),
        ("curve.csv", scene("c.toml", format!("{curve} = {:?}\n", wrong("curve.csv")))),
        ("mesh.obj", scene("d.toml", format!("{mesh} = {:?}\n", wrong("mesh.obj")))),
    ];
    for (name, scene) in scenes {
        let ran = Flotor::with(["run", &scene, "--clock", "virtual"]).run();
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
        assert!(ran.error().contains(&format!("{name}:3: the file is not UTF-8")), "{ran:?}");
    }
}

#[test]
fn a_scene_writes_no_control_characters_to_a_terminal() {
    let title = spoiled("A spring", "\\u001b[2J");
    let remedy = "remove the character, or, if a backslash was meant, put the text in single quotes";
    assert_eq!(title, format!("scene.toml:1: `title` contains the control character \\u{{1b}}; {remedy}"));
    let scratch = Scratch::default();
    let scene = scratch.file("scene.toml", "title = \"\x1b[2J\"\n").display().to_string();
    let ran = Flotor::with(["run", &scene]).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(ran.stderr.contains("\\u{1b}[2J") && !ran.stderr.contains('\x1b'), "{ran:?}");
}
