//! What a limit says is what a hand feels: one number is a norm, three are axes, and a device that may push a hand has a ceiling
//! that no scene raises.

use flotor_core::limits::CEILING;
use flotor_servo::Clock;
use flotor_session::registry::Registry;
use flotor_session::scene::Scene;
use flotor_session::{RunOptions, Session, Strength};
use flotor_study::apparatus::{Apparatus, ApparatusError};
use flotor_study::protocol::{MagnitudeProtocol, Protocol, Stimulus};
use flotor_tests::library::plugin_file;
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::watched::{Watched, prepared, watch};
use std::path::Path;

/// A model that answers anything at all on a device of so many N along each axis, and a twentieth of it in N·m.
fn wild(most_n: f64, limits: &str) -> String {
    format!(
        "rate_hz = 1000\nduration_s = 5\n[device]\nplugin = \"{}\"\n[device.parameters]\nmax_force_n = {most_n}\n\
         [[model]]\nplugin = \"{}\"\n[model.parameters]\nfault = \"wild\"\n[limits]\nramp_s = 0\n{limits}\n",
        plugin_file("fixture-faulty-device").display(),
        plugin_file("fixture-faulty-model").display()
    )
}

/// A constant pull on that device.
fn pull(most_n: f64, force_n: f64, limits: &str) -> String {
    format!(
        "rate_hz = 1000\nduration_s = 0.5\n[device]\nplugin = \"{}\"\n[device.parameters]\nmax_force_n = {most_n}\n\
         [[model]]\nplugin = \"load\"\n[model.parameters]\nforce_n = {force_n}\n[limits]\nramp_s = 0\n{limits}\n",
        plugin_file("fixture-faulty-device").display()
    )
}

/// Largest norms of force and torque.
fn peaks(run: &Watched) -> [f64; 2] {
    let largest = |norms: &mut dyn Iterator<Item = f64>| norms.fold(0.0, f64::max);
    [
        largest(&mut run.records.iter().map(|record| record.commanded.force().length())),
        largest(&mut run.records.iter().map(|record| record.commanded.torque().length())),
    ]
}

/// The program on the text of a scene, on the virtual clock, with `FLOTOR_ALLOW_STRONG` as given.
fn run_where(strong: &str, scene: &str, arguments: &[&str]) -> Ran {
    let folder = Scratch::default();
    let file = folder.path().join("scene.toml");
    std::fs::write(&file, scene).expect("a scratch folder takes files");
    let file = file.to_str().expect("a scratch folder has a plain name");
    let program = Flotor::with(["run", file, "--clock", "virtual", "--json", "-"].iter().chain(arguments));
    program.env("FLOTOR_ALLOW_STRONG", strong).run()
}

fn run(scene: &str, arguments: &[&str]) -> Ran {
    run_where("", scene, arguments)
}

fn peak_force_n(ran: &Ran) -> f64 {
    let summary: serde_json::Value = serde_json::from_str(&ran.stdout).expect("the summary is JSON");
    summary["peak_force_n"].as_f64().expect("there was a force")
}

/// A few roundings of the largest number involved.
const SLACK: f64 = 1.0 + 8.0 * f64::EPSILON;

#[test]
fn one_number_is_the_largest_force_in_any_direction_and_three_are_those_along_the_axes() {
    let [ball_n, ball_nm] = peaks(&watch(&wild(10.0, "force_n = 5\ntorque_nm = 0.2")));
    assert!((4.999..=5.0 * SLACK).contains(&ball_n), "{ball_n} N");
    assert!((0.1999..=0.2 * SLACK).contains(&ball_nm), "{ball_nm} N·m");
    let [box_n, _] = peaks(&watch(&wild(10.0, "force_n = [5, 5, 5]")));
    assert!((7.0..=75.0_f64.sqrt() * SLACK).contains(&box_n), "{box_n} N");
    let [both_n, _] = peaks(&watch(&wild(4.0, "force_n = { norm = 5, axes = [5, 5, 1] }")));
    // A force of any direction in every tick is an oscillation, and is damped after some twenty of them.
    assert!((4.01..=5.0 * SLACK).contains(&both_n), "{both_n} N of 4 N along each axis, 1 N along z");
}

#[test]
fn a_scene_whose_limit_means_less_is_told_once_what_to_write_for_the_old_meaning() {
    let told = |limits: &str| {
        let ran = run(&pull(10.0, 1.0, limits), &[]);
        assert_eq!(ran.code, Some(exit_code::OK), "{}", ran.stderr);
        ran.stderr.lines().filter(|line| line.contains("limits the norm")).map(str::to_owned).collect()
    };
    let lines: Vec<String> = told("force_n = 5");
    let [line] = &lines[..] else { panic!("one line: {lines:?}") };
    assert!(line.contains("8.66 N") && line.contains("`[5, 5, 5]`"), "{line}");
    assert_eq!(told("force_n = [5, 5, 5]"), [""; 0]);
    assert_eq!(told("force_n = 18"), [""; 0], "the device itself gives no more than 17.3 N");
}

#[test]
fn a_device_that_may_push_a_hand_gets_no_more_than_the_ceiling() {
    let scene = wild(55.0, "");
    let [force_n, torque_nm] = peaks(&watch(&scene));
    assert!((19.9..=CEILING.force_n * SLACK).contains(&force_n), "{force_n} N");
    assert!((0.99..=CEILING.torque_nm * SLACK).contains(&torque_nm), "{torque_nm} N·m");

    // The control: the same with more allowed.
    let options = RunOptions { clock: Clock::Virtual, seed: 1 };
    let read = Scene::parse(Path::new("scene.toml"), &scene).expect("the scene is right");
    let session = Session::prepare(&read, &Registry::search(&[]), &options).expect("it starts");
    assert_eq!(session.held_back().len(), 1);
    let session = session.with_strength(Strength::Strong);
    assert!(
        session.held_back().is_empty() && session.notices()[0].contains("lifted"),
        "{:?}",
        session.notices()
    );
    assert_eq!(session.limits().force_n, [Some(55.0); 3]);
    // A simulated device pushes nobody.
    let simulated = prepared(Clock::Virtual, flotor_session::scene::DEMO);
    assert!(simulated.held_back().is_empty() && simulated.notices().is_empty(), "{:?}", simulated.notices());
    assert_eq!(simulated.limits().force_n, [Some(55.0), Some(55.0), Some(140.0)]);
}

#[test]
fn the_ceiling_is_told_and_only_a_person_lifts_it() {
    let scene = pull(55.0, 30.0, "");
    let ran = run(&scene, &[]);
    assert_eq!(ran.code, Some(exit_code::OK), "{}", ran.stderr);
    assert!((peak_force_n(&ran) - 20.0).abs() < 1.0e-9, "{}", peak_force_n(&ran));
    let told = |ran: &Ran| ran.stderr.lines().filter(|line| line.contains("20 N and 1 N·m")).count();
    assert_eq!(told(&ran), 1, "{}", ran.stderr);
    assert!(ran.stderr.contains("95.3 N") && ran.stderr.contains("--allow-strong"), "{}", ran.stderr);

    for strong in [run(&scene, &["--allow-strong"]), run_where("1", &scene, &[])] {
        assert!((peak_force_n(&strong) - 30.0).abs() < 1.0e-9, "{}", peak_force_n(&strong));
        assert!(told(&strong) == 1 && strong.stderr.contains("lifted"), "{}", strong.stderr);
    }
    assert!((peak_force_n(&run_where("0", &scene, &[])) - 20.0).abs() < 1.0e-9);
    // A scene of a number above the ceiling raises nothing, one below is not told.
    assert!((peak_force_n(&run(&pull(55.0, 30.0, "force_n = 30"), &[])) - 20.0).abs() < 1.0e-9);
    let low = run(&pull(55.0, 30.0, "force_n = 12\ntorque_nm = 1"), &[]);
    assert!(peak_force_n(&low) <= 12.0 && told(&low) == 0, "{}", low.stderr);
    let key = run(&pull(55.0, 30.0, "allow_strong = true"), &[]);
    assert_eq!(key.code, Some(exit_code::CONFIGURATION));
    assert!(key.stderr.contains("unknown key `limits.allow_strong`"), "{}", key.stderr);
}

#[test]
fn an_experiment_that_could_exceed_the_ceiling_is_refused_before_the_first_trial() {
    let stimulus = Stimulus { model: "load".to_owned(), parameter: "force_n".to_owned() };
    let protocol = Protocol::Magnitude(MagnitudeProtocol {
        stimulus,
        values: vec![3.0, 6.0, 9.0],
        ..MagnitudeProtocol::default()
    });
    let check = |limits: &str, strength| {
        let scene = Scene::parse(Path::new("scene.toml"), &pull(55.0, 1.0, limits)).expect("it is right");
        Apparatus::check_with(scene, &protocol, strength)
    };
    let refused = check("", Strength::UnderCeiling).err().expect("55 N along each axis");
    assert!(matches!(refused, ApparatusError::ExceedsForceCeiling { .. }), "{refused}");
    let said = refused.to_string();
    assert!(said.contains("95.3 N") && said.contains("20 N and 1 N·m"), "{said}");
    assert!(said.contains("`[limits] force_n`") && said.contains("--allow-strong"), "{said}");
    assert!(check("force_n = 20\ntorque_nm = 1", Strength::UnderCeiling).is_ok());
    assert!(check("", Strength::Strong).is_ok());

    // Through the program: exit code 2, and nothing of a subject is there.
    let folder = Scratch::default();
    let (file, data) = (folder.path().join("scene.toml"), folder.path().join("data"));
    std::fs::write(&file, pull(55.0, 1.0, "")).expect("a scratch folder takes files");
    let arguments = ["study", "force", "--observer", "human", "--scene"].map(Path::new);
    let ran =
        Flotor::with(arguments.into_iter().chain([file.as_path(), Path::new("--out"), data.as_path()])).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{}", ran.stderr);
    assert!(ran.stderr.contains("20 N and 1 N·m") && !data.exists(), "{}", ran.stderr);
}

/// The coils of a spring 18 mm above the handle touch above it: the wall there would push at home.
#[test]
fn a_model_whose_end_would_push_at_home_is_refused() {
    let scene = |place: &str| format!("{}\n[model.mapping]\nposition_mm = {place}\n", SPRING);
    let options = RunOptions { clock: Clock::Virtual, seed: 1 };
    let prepared = |place| {
        let scene = Scene::parse(Path::new("scene.toml"), &scene(place)).expect("it is right");
        Session::prepare(&scene, &Registry::search(&[]), &options).map(|_| ())
    };
    let refused = prepared("[0, 0, 18]").expect_err("the coils touch").to_string();
    assert!(refused.contains("scene.toml:4") && refused.contains("position_mm"), "{refused}");
    assert!(prepared("[0, 0, 1]").is_ok());
}

const SPRING: &str = "[device]\nplugin = \"simulated\"\n[[model]]\nplugin = \"spring\"";
