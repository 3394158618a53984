//! Two hands on one object: a scene, its run, its recording and its replay.

use flotor_core::trace::TickRecord;
use flotor_record::Recording;
use flotor_session::scene::Scene;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::watched::{Watched, watch};
use serde_json::Value;
use std::path::{Path, PathBuf};

fn hands(seconds: u32) -> String {
    let hand = |name: &str, hertz: &str| {
        format!(
            "[[device]]\nname = \"{name}\"\nplugin = \"simulated\"\n[device.parameters]\nhand = \"oscillate\"\n\
             hand_centre_mm = -1\nhand_amplitude_mm = 1\nhand_frequency_hz = {hertz}\n"
        )
    };
    format!("duration_s = {seconds}\n{}{}", hand("left", "1"), hand("right", "1.5"))
}

/// One membrane between two hands 12 mm apart.
const SHARED: &str = "[[model]]\nplugin = \"membrane\"\ndevice = [\"left\", \"right\"]\nshared = true\n\
    [[model.port]]\ndevice = \"left\"\nmapping = { position_mm = [6, 0, 0] }\n\
    [[model.port]]\ndevice = \"right\"\nmapping = { position_mm = [-6, 0, 0] }\n";
/// A membrane for each hand, at the same places.
const APART: &str = "[[model]]\nname = \"one\"\nplugin = \"membrane\"\ndevice = \"left\"\n\
    mapping = { position_mm = [6, 0, 0] }\n[[model]]\nname = \"other\"\nplugin = \"membrane\"\ndevice = \"right\"\n\
    mapping = { position_mm = [-6, 0, 0] }\n";

fn of_device(run: &Watched, device: u16) -> Vec<TickRecord> {
    run.records.iter().copied().filter(|record| record.device == device).collect()
}

fn run(scene: &str, more: &[&str]) -> Value {
    let ran = Flotor::with([&["run", scene, "--clock", "virtual", "--json", "-"][..], more].concat()).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    serde_json::from_str(&ran.stdout).expect("the summary is JSON")
}

fn recorded(scratch: &Scratch, scene: &str) -> (PathBuf, Value, Value) {
    let scene = scratch.file("scene.toml", scene).display().to_string();
    let recording = scratch.path().join("run.mcap");
    let plain = run(&scene, &[]);
    let with = run(&scene, &["--record", &recording.display().to_string()]);
    (recording, plain, with)
}

/// Returns the largest difference of the force at a device between two runs, N.
fn difference_n(shared: &Watched, apart: &Watched, device: u16) -> f64 {
    let pairs = of_device(shared, device).into_iter().zip(of_device(apart, device));
    pairs.map(|(a, b)| (a.model.force() - b.model.force()).length()).fold(0.0, f64::max)
}

#[test]
fn one_hand_feels_the_other_on_a_shared_membrane_and_not_on_two() {
    let [shared, apart] = [SHARED, APART].map(|models| watch(&format!("{}{models}", hands(1))));
    for device in [0, 1] {
        let differs = difference_n(&shared, &apart, device);
        assert!(differs > 0.01, "device {device}: {differs} N");
    }
    let names: Vec<&str> = shared.outcome.models.iter().map(|(name, ..)| name.as_str()).collect();
    assert_eq!(names, ["membrane"]);
}

/// The membrane of [`SHARED`] and those of [`APART`], computed at 200 Hz.
fn asynchronously(models: &str) -> String {
    let field = "[model.field]\nrate_hz = 200\n";
    models
        .replace("shared = true\n", &format!("shared = true\n{field}"))
        .replace("0] }\n[[model]]", &format!("0] }}\n{field}[[model]]"))
        + if models == APART { field } else { "" }
}

#[test]
fn one_hand_feels_the_other_on_a_shared_asynchronous_membrane_and_nothing_pulls() {
    let here = [SHARED, APART].map(|models| watch(&format!("{}{models}", hands(1))));
    let [shared, apart] =
        [SHARED, APART].map(|models| watch(&format!("{}{}", hands(1), asynchronously(models))));
    for device in [0, 1] {
        let [differs, in_the_loop] =
            [difference_n(&shared, &apart, device), difference_n(&here[0], &here[1], device)];
        println!("device {device}: {differs} N, in the loop {in_the_loop} N");
        assert!(differs > 0.5 * in_the_loop, "device {device}: {differs} N, in the loop {in_the_loop} N");
        let lowest_n =
            of_device(&shared, device).iter().map(|record| record.model.force().z).fold(0.0, f64::min);
        assert!(lowest_n >= 0.0, "device {device} is pulled with {lowest_n} N");
    }
    assert_eq!(shared.outcome.models.len(), 1);
    assert!(shared.outcome.models.iter().all(|(_, health, _)| health.is_good()));
}

#[test]
fn a_shared_asynchronous_membrane_has_one_digest_and_replays() {
    let scratch = Scratch::default();
    let swap = "[[change]]\nat_s = 0.4\nswap = \"membrane\"\nparameters = { stretch = 1.5 }\n";
    let (recording, plain, with) =
        recorded(&scratch, &format!("{}{}{swap}", hands(1), asynchronously(SHARED)));
    assert_eq!(plain["trace_digest"], with["trace_digest"]);
    let path = recording.display().to_string();
    let replayed = Flotor::with(["replay", &path, "--json", "-"]).run();
    assert_eq!(replayed.code, Some(exit_code::OK), "{replayed:?}");
    let report: Value = serde_json::from_str(&replayed.stdout).expect("JSON");
    assert_eq!(report["differing_ticks"], 0, "{report}");
}

#[test]
fn a_recording_changes_no_bit_has_one_model_on_two_devices_and_replays() {
    let scratch = Scratch::default();
    let swap = "[[change]]\nat_s = 0.4\nswap = \"membrane\"\nparameters = { stretch = 1.5 }\n\
        [[change]]\nat_s = 0.7\nset = \"membrane.damping_per_s=20\"\n";
    let (recording, plain, with) = recorded(&scratch, &format!("{}{SHARED}{swap}", hands(1)));
    assert_eq!(plain["trace_digest"], with["trace_digest"]);
    let models: Vec<&Value> = plain["plugins"]
        .as_array()
        .expect("a list")
        .iter()
        .filter(|plugin| plugin["kind"] == "model")
        .collect();
    assert_eq!(models.len(), 1, "{models:?}");
    let run = Recording::open(&recording).expect("it was just recorded").run().clone();
    let [.., model] = run.plugins.as_slice() else { panic!("{run:?}") };
    assert_eq!((model.device, model.places_m.as_slice()), (0, &[[0.006, 0.0, 0.0]][..]));
    let [port] = model.shared_with.as_slice() else { panic!("{model:?}") };
    assert_eq!((port.device, port.place_m), (1, [-0.006, 0.0, 0.0]));

    let path = recording.display().to_string();
    let replayed = Flotor::with(["replay", &path, "--json", "-"]).run();
    assert_eq!(replayed.code, Some(exit_code::OK), "{replayed:?}");
    let report: Value = serde_json::from_str(&replayed.stdout).expect("JSON");
    assert_eq!(report["differing_ticks"], 0, "{report}");
}

#[test]
fn a_swap_reaches_both_hands_in_the_same_tick() {
    let swap = "[[change]]\nat_s = 0.5\nswap = \"wall\"\nparameters = { stiffness_n_per_m = 3000 }\n";
    let wall = "[[model]]\nplugin = \"wall\"\ndevice = [\"left\", \"right\"]\nshared = true\n\
        [model.parameters]\nheight_mm = 5\nstiffness_n_per_m = 500\n";
    let [plain, swapped] =
        [wall.to_owned(), format!("{wall}{swap}")].map(|models| watch(&format!("{}{models}", hands(1))));
    assert_eq!(swapped.changes.len(), 1, "{:?}", swapped.changes);
    for device in [0, 1] {
        let [plain, swapped] = [&plain, &swapped].map(|run| of_device(run, device));
        let first = plain.iter().zip(&swapped).position(|(a, b)| a.model != b.model);
        // At tick 500 its weight is still 0.
        assert_eq!(first, Some(501), "device {device}");
    }
}

#[test]
fn a_shared_free_ball_gives_the_hands_what_it_loses() {
    // From below and from above, with the ball between them.
    let load = "[[model]]\nplugin = \"load\"\ndevice = [\"left\", \"right\"]\nshared = true\n\
        [model.parameters]\nkind = \"free\"\nmass_g = 100\nradius_mm = 10\n\
        [[model.port]]\ndevice = \"right\"\nmapping = { position_mm = [0, 0, 18] }\n";
    let run = watch(&format!("{}{load}", hands(1)));
    assert!(run.outcome.models.iter().all(|(_, health, _)| health.is_good()));
    let peaks = [0, 1].map(|device| {
        of_device(&run, device).iter().map(|record| record.model.force().length()).fold(0.0, f64::max)
    });
    assert!(peaks.iter().all(|peak_n| *peak_n > 0.01), "{peaks:?}");
}

#[test]
fn what_cannot_be_shared_is_refused_in_one_line() {
    let parse = |models: &str| Scene::parse(Path::new("scene.toml"), &format!("{}{models}", hands(1)));
    let model = |keys: &str| format!("[[model]]\nplugin = \"wall\"\n{keys}\n");
    let both = "device = [\"left\", \"right\"]\nshared = true\n";
    for (keys, expected) in [
        ("device = \"left\"\nshared = true".to_owned(), "`model.shared` needs 2 to 4 different devices"),
        (
            "device = [\"left\", \"left\"]\nshared = true".to_owned(),
            "`model.shared` needs 2 to 4 different devices",
        ),
        (format!("{both}isolation = \"process\""), "a shared model runs in the host process"),
        (
            format!("{both}mapping = {{ positions_mm = [[0, 0, 0], [1, 0, 0]] }}"),
            "one position on each device",
        ),
        (format!("{both}[[model.port]]\ndevice = \"left\""), "`model.port.mapping` is missing"),
        (format!("{both}[[model.port]]\ndevice = \"lft\"\nmapping = {{}}"), "did you mean `left`?"),
        (
            format!(
                "{both}[[model.port]]\ndevice = \"left\"\nmapping = {{}}\n[[model.port]]\ndevice = \"left\"\nmapping = {{}}"
            ),
            "needs a different device of the model",
        ),
        (
            "device = \"left\"\n[[model.port]]\ndevice = \"left\"\nmapping = {}".to_owned(),
            "set `shared = true`",
        ),
    ] {
        let problem = parse(&model(&keys)).expect_err(&keys).to_string();
        assert!(problem.contains(expected) && problem.lines().count() == 1, "{problem}");
    }
    let scratch = Scratch::default();
    let spring = format!("{}[[model]]\nplugin = \"spring\"\n{both}", hands(1));
    let scene = scratch.file("scene.toml", spring).display().to_string();
    let ran = Flotor::with(["run", &scene, "--clock", "virtual"]).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(ran.error().contains("it does not offer `flotor.world/1`"), "{ran:?}");
    // The wall has no state between its hands, so it offers no contacts for several of them.
    let wall = format!("{}[[model]]\nplugin = \"wall\"\n{both}[model.field]\nrate_hz = 200\n", hands(1));
    let scene = scratch.file("slow.toml", wall).display().to_string();
    let ran = Flotor::with(["run", &scene, "--clock", "virtual"]).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(ran.error().contains("it does not offer `flotor.world-contacts/1`"), "{ran:?}");
}
