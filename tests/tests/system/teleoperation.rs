//! Several devices in one loop: alone they are as if alone, coupled they are stable in every hand, and no energy comes
//! out that no hand put in.

use flotor_core::limits::PassivityMode;
use flotor_core::trace::{Events, TickRecord};
use flotor_hal::{DVec3, Fault};
use flotor_record::Recording;
use flotor_servo::RunEnd;
use flotor_servo::{Clock, StopSwitch};
use flotor_session::registry::Registry;
use flotor_session::scene::Scene;
use flotor_session::{RunOptions, Session};
use flotor_tests::TestSize;
use flotor_tests::library::plugin_file;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::watched::{Watched, watch, watch_with};
use rayon::prelude::*;
use serde_json::Value;
use std::path::Path;

/// Every hand of the simulated flotor: what it does, and how it holds.
const HANDS: [&str; 5] = ["oscillate", "press", "release", "hold", "open"];
const SCRIPTS: [&str; 7] = flotor_simulated::hand::Script::NAMES;
const GRIPS: [&str; 2] = ["firm", "relaxed"];

fn device(name: &str, parameters: &str) -> String {
    format!("[[device]]\nname = \"{name}\"\nplugin = \"simulated\"\n[device.parameters]\n{parameters}\n")
}

const COUPLING: &str = "[[coupling]]\nend = [{ device = \"left\" }, { device = \"right\" }]\n";

fn of_device(run: &Watched, device: u16) -> Vec<TickRecord> {
    run.records.iter().copied().filter(|record| record.device == device).collect()
}

/// Energy that the hands have put into both ports so far less what has come out, at its lowest, J.
fn lowest_sum_of_ports_j(run: &Watched) -> f64 {
    let sums = run.records.chunks(2).map(|tick| tick.iter().map(|record| record.port_energy_j).sum::<f64>());
    sums.fold(0.0, f64::min)
}

#[test]
fn devices_that_nothing_holds_together_are_as_if_alone() {
    let spring = |on: &str| format!("[[model]]\nplugin = \"spring\"\n{on}");
    let (left, right) = ("hand = \"oscillate\"", "hand = \"press\"\nhand_grip = \"relaxed\"");
    let both = format!(
        "duration_s = 2\n{}{}{}",
        device("left", left),
        device("right", right),
        spring("device = [\"left\", \"right\"]")
    );
    let both = watch(&both);
    for (number, parameters) in [(0, left), (1, right)] {
        let alone = watch(&format!("duration_s = 2\n{}{}", device("device", parameters), spring("")));
        let together = of_device(&both, number);
        assert_eq!(alone.records.len(), together.len());
        for (alone, together) in alone.records.iter().zip(&together) {
            let same = TickRecord { device: 0, compute_ns: alone.compute_ns, ..*together };
            assert_eq!(*alone, same);
        }
    }
    let names: Vec<&str> = both.outcome.models.iter().map(|(name, ..)| name.as_str()).collect();
    assert_eq!(names, ["spring@left", "spring@right"]);
}

#[test]
fn a_change_reaches_a_model_on_all_its_devices_or_on_the_one_that_is_named() {
    let scene = |set: &str| {
        format!(
            "duration_s = 1\n{}{}[[model]]\nplugin = \"spring\"\ndevice = [\"left\", \"right\"]\n\
             [[change]]\nat_s = 0.5\nset = \"{set}\"\n",
            device("left", ""),
            device("right", "")
        )
    };
    let changed = |set: &str| {
        let run = watch(&scene(set));
        let force_n = |device| of_device(&run, device).last().expect("ticks").model.force().z;
        (run.changes.len(), force_n(0), force_n(1))
    };
    let (changes, left_n, right_n) = changed("spring.gamma_n=9");
    assert_eq!((changes, left_n), (2, right_n));
    let (changes, left_n, right_n) = changed("spring@right.gamma_n=9");
    assert_eq!(changes, 1);
    // Half as stiff, and a hand that goes a little further for it.
    assert!(left_n.abs() > 1.3 * right_n.abs(), "{left_n} N and {right_n} N");
}

#[test]
fn a_fault_of_one_device_ends_the_run_for_both() {
    let faulty = format!(
        "[[device]]\nname = \"right\"\nplugin = \"{}\"\n[device.parameters]\nfault = \"over-temperature\"\nat_tick = 100\n",
        plugin_file("fixture-faulty-device").display()
    );
    let run = watch(&format!("duration_s = 1\n{}{faulty}", device("left", "")));
    assert!(matches!(run.outcome.end, RunEnd::DeviceFault(_)), "{:?}", run.outcome.end);
    let faults: Vec<bool> = run.outcome.devices.iter().map(|device| device.fault.is_some()).collect();
    assert_eq!(faults, [false, true]);
    let left = of_device(&run, 0);
    assert_eq!(left.last().expect("ticks").commanded.force(), DVec3::ZERO);
}

/// What a pair of hands does to the example scene's coupling.
#[derive(Debug)]
struct Pair {
    left: String,
    right: String,
    lowest_tank_j: f64,
    lowest_ports_j: f64,
    fastest_late_m_per_s: f64,
    fastest_m_per_s: f64,
    farthest_m: f64,
}

/// The one hand that pushes with 5 N whatever is there: it throws a handle that nothing holds out of the sensor's range,
/// and the run ends, coupled or not.
fn throws_a_free_handle(hand: &str) -> bool {
    hand.contains("\"push\"")
}

/// Two hands on the coupling, for `duration_s`.
fn pair(registry: &Registry, left: &str, right: &str, duration_s: f64) -> Pair {
    let scene =
        format!("duration_s = {duration_s}\n{}{}{COUPLING}", device("left", left), device("right", right));
    let run = watch_with(registry, &scene);
    let thrown = RunEnd::DeviceFault(Fault::SensorOutOfRange);
    let throws = throws_a_free_handle(left) || throws_a_free_handle(right);
    assert!(run.outcome.end == RunEnd::Finished || throws && run.outcome.end == thrown, "{left} and {right}");
    let tanks = run.outcome.couplings.iter().flat_map(|coupling| coupling.tanks);
    let fastest = |records: &[TickRecord]| {
        records.iter().map(|record| record.twist.linear().length()).fold(0.0, f64::max)
    };
    let tail = run.records.len() * 9 / 10;
    Pair {
        left: left.to_owned(),
        right: right.to_owned(),
        lowest_tank_j: tanks.map(|tank| tank.lowest_j).fold(0.0, f64::min),
        lowest_ports_j: lowest_sum_of_ports_j(&run),
        fastest_late_m_per_s: fastest(&run.records[tail..]),
        fastest_m_per_s: fastest(&run.records),
        farthest_m: run.records.iter().map(|record| record.pose.position().length()).fold(0.0, f64::max),
    }
}

/// A hand as parameters of the simulated flotor.
fn hands() -> Vec<String> {
    let acts = HANDS.iter().map(|hand| format!("hand = \"{hand}\""));
    let acts = acts.chain(SCRIPTS.iter().map(|script| format!("hand_script = \"{script}\"")));
    acts.flat_map(|act| GRIPS.map(|grip| format!("{act}\nhand_grip = \"{grip}\""))).collect()
}

#[test]
fn a_pair_is_stable_in_every_pair_of_hands_and_gives_nothing_that_was_not_put_in() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let hands = hands();
    let registry = Registry::search(&[]);
    let full = TestSize::of_this_run() == TestSize::Full;
    let duration_s = if full { 10.0 } else { 3.0 };
    // All pairs; in the daily check every hand against those that lead and those that yield.
    let partners: Vec<&String> = hands.iter().filter(|hand| full || hand.starts_with("hand = ")).collect();
    let pairs: Vec<(&String, &String)> =
        hands.iter().flat_map(|left| partners.iter().map(move |right| (left, *right))).collect();
    let pairs: Vec<Pair> =
        pairs.par_iter().map(|(left, right)| pair(&registry, left, right, duration_s)).collect();
    let worst = |number: fn(&Pair) -> f64| pairs.iter().map(number).fold(f64::NEG_INFINITY, f64::max);
    for pair in pairs.iter().filter(|pair| pair.lowest_tank_j < 0.0) {
        println!("{} against {}: {:.3e} J", pair.left, pair.right, pair.lowest_tank_j);
    }
    println!(
        "{} pairs of hands: lowest tank {:.3e} J, lowest sum of ports {:.3e} J, fastest {:.3} m/s, farthest {:.2} mm",
        pairs.len(),
        -worst(|pair| -pair.lowest_tank_j),
        -worst(|pair| -pair.lowest_ports_j),
        worst(|pair| pair.fastest_m_per_s),
        worst(|pair| pair.farthest_m) * 1.0e3,
    );
    for pair in &pairs {
        // A hand swings with up to 0.1 m/s or so; what drives itself gets to the boundary and past it.
        assert!(pair.fastest_m_per_s < 0.5, "{pair:?}");
        assert!(pair.lowest_tank_j >= 0.0, "a tank was below zero: {pair:?}");
        // Sums of some thousand terms of up to 10 mJ.
        assert!(pair.lowest_ports_j >= -1.0e-12, "more came out than went in: {pair:?}");
    }
}

#[test]
fn hands_that_come_to_rest_leave_both_handles_at_rest() {
    let registry = Registry::search(&[]);
    for (left, right) in [("hold", "hold"), ("press", "hold"), ("press", "press"), ("hold", "press")] {
        for grip in GRIPS {
            let hand = |hand: &str| format!("hand = \"{hand}\"\nhand_grip = \"{grip}\"");
            let pair = pair(&registry, &hand(left), &hand(right), 4.0);
            assert!(pair.fastest_late_m_per_s < 1.0e-4, "{pair:?}");
        }
    }
}

#[test]
fn what_one_hand_does_the_other_feels() {
    let scene = format!(
        "duration_s = 5\n{}{}{COUPLING}",
        device("left", "hand = \"press\""),
        device("right", "hand = \"hold\"\nhand_grip = \"relaxed\"")
    );
    let run = watch(&scene);
    let [left, right] = [0, 1].map(|device| *of_device(&run, device).last().expect("ticks"));
    let down_m = [left, right].map(|record| -record.pose.position().z);
    assert!(down_m[0] > 2.0e-3 && down_m[1] > 1.0e-3, "the left draws the right along: {down_m:?}");
    // At rest the spring pulls both alike, 600 N/m.
    let apart_m = left.pose.position() - right.pose.position();
    let [pull_left, pull_right] = [left, right].map(|record| record.commanded.force());
    assert!((pull_left + pull_right).length() < 1.0e-3, "{pull_left} and {pull_right}");
    assert!((pull_right - apart_m * 600.0).length() < 1.0e-2, "{pull_right} for {apart_m}");
}

/// A force that was given up for want of energy and came back in the next tick went on and off, up to 0.73 N, 15 times.
#[test]
fn a_force_that_was_held_back_comes_back_without_a_rattle() {
    let (left, right) = ("hand = \"oscillate\"", "hand = \"hold\"\nhand_grip = \"relaxed\"");
    let run = watch(&format!("duration_s = 3\n{}{}{COUPLING}", device("left", left), device("right", right)));
    for hand in [0, 1] {
        let records = of_device(&run, hand);
        assert!(records.iter().any(|record| record.events.intersects(Events::PASSIVITY_DAMPED)));
        let forces = records.iter().map(|record| record.commanded.force());
        let step_n = forces.clone().zip(forces.skip(1)).map(|(before, after)| (after - before).length());
        let steps: Vec<f64> = step_n.filter(|step_n| *step_n > 0.1).collect();
        assert!(steps.is_empty(), "device {hand}: steps in N: {steps:?}");
    }
}

#[test]
fn without_the_controller_a_long_way_generates_energy_and_with_it_none() {
    let scene = |passivity: &str| {
        format!(
            "duration_s = 4\n{}{}[[coupling]]\ndelay_ticks = 60\npassivity = \"{passivity}\"\n\
             end = [{{ device = \"left\" }}, {{ device = \"right\" }}]\n",
            device("left", "hand = \"oscillate\"\nhand_grip = \"relaxed\""),
            device("right", "hand = \"hold\"\nhand_grip = \"relaxed\"")
        )
    };
    let (free, kept) = (watch(&scene("observe")), watch(&scene("control")));
    assert!(lowest_sum_of_ports_j(&free) < -1.0e-3, "{} J", lowest_sum_of_ports_j(&free));
    assert!(lowest_sum_of_ports_j(&kept) >= -1.0e-12, "{} J", lowest_sum_of_ports_j(&kept));
    assert!(kept.records.iter().any(|record| record.events.intersects(Events::PASSIVITY_DAMPED)));
}

/// A scene of a hand that moves and a relaxed one, the second end scaled.
fn scaled_pair(motion_scale: f64, force_scale: f64, key: &str) -> String {
    format!(
        "duration_s = 3\n{}{}[[coupling]]\n{key}\ndelay_ticks = 20\nend = [{{ device = \"left\" }}, {{ device = \"right\", \
         mapping = {{ motion_scale = {motion_scale}, force_scale = {force_scale} }} }}]\n",
        device("left", "hand = \"oscillate\"\nhand_grip = \"firm\""),
        device("right", "hand = \"hold\"\nhand_grip = \"relaxed\"")
    )
}

#[test]
fn a_coupling_that_amplifies_needs_consent_and_reports_its_gain() {
    const CONSENT: &str = "allow_amplification = true";
    for (motion_scale, force_scale, gain) in [(0.5, 2.0, 4.0), (2.0, 0.5, 4.0), (0.1, 10.0, 100.0)] {
        let without = scaled_pair(motion_scale, force_scale, "");
        let refused = Scene::parse(Path::new("scene.toml"), &without).expect_err("no consent").to_string();
        let expected = format!("one hand may get {gain:.4} times the energy that the other puts in");
        assert!(refused.contains(&expected) && refused.contains(CONSENT), "{refused}");

        let run = watch(&scaled_pair(motion_scale, force_scale, CONSENT));
        assert!(run.outcome.warnings.iter().any(|warning| warning.contains(&expected)), "{motion_scale}");
        // Both hands together get energy that neither has put in, which is why it needs consent; in the frame of the coupling none is
        // generated.
        assert!(lowest_sum_of_ports_j(&run) < -1.0e-4, "{} J", lowest_sum_of_ports_j(&run));
        let scale = [1.0, motion_scale / force_scale];
        let shared = run.records.chunks(2).map(|tick| -> f64 {
            tick.iter().zip(scale).map(|(record, scale)| record.port_energy_j * scale).sum()
        });
        let lowest_j = shared.fold(0.0, f64::min);
        assert!(lowest_j >= -1.0e-12, "{motion_scale}, {force_scale}: {lowest_j} J in the shared frame");
    }
    let needless = scaled_pair(0.5, 0.5, CONSENT);
    let refused = Scene::parse(Path::new("scene.toml"), &needless).expect_err("no effect").to_string();
    assert!(refused.contains("`allow_amplification = true` has no effect"), "{refused}");
    assert!(Scene::parse(Path::new("scene.toml"), &scaled_pair(0.5, 0.5, "")).is_ok());
    let apart = "[[device]]\nname = \"left\"\nplugin = \"simulated\"\n[[coupling]]\nname = \"pair\"\npartner = \"elsewhere\"\n\
                 end = [{ device = \"left\", mapping = { motion_scale = 0.5, force_scale = 2 } }]\n";
    let refused = Scene::parse(Path::new("scene.toml"), apart).expect_err("no consent").to_string();
    assert!(refused.contains("4.0000 times"), "{refused}");
}

#[test]
fn a_recording_of_a_pair_replays_bit_for_bit_and_keeps_both_handles() {
    let scratch = Scratch::default();
    let recording = scratch.path().join("run.mcap");
    let scene = flotor_tests::workspace_root().join("host/scenes/teleoperation.toml");
    let arguments: [&std::ffi::OsStr; 8] = [
        "run".as_ref(),
        scene.as_ref(),
        "--clock".as_ref(),
        "virtual".as_ref(),
        "--duration".as_ref(),
        "3s".as_ref(),
        "--record".as_ref(),
        recording.as_ref(),
    ];
    let ran = Flotor::with(arguments).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let records: Vec<TickRecord> =
        Recording::open(&recording).expect("a recording").map(|record| record.expect("whole")).collect();
    assert_eq!(records.len(), 2 * 3000);
    assert!(records.chunks(2).all(|tick| tick[0].tick == tick[1].tick && tick[1].device == 1));
    let ran = Flotor::with(["replay".as_ref(), recording.as_os_str(), "--json".as_ref(), "-".as_ref()]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let report: Value = serde_json::from_str(&ran.stdout).expect("the summary is JSON");
    assert_eq!(
        (&report["bit_exact"], &report["ticks"]),
        (&Value::from(true), &Value::from(6000)),
        "{report}"
    );
}

#[test]
fn the_example_scene_is_the_coupling_that_is_measured_here() {
    let scene = Scene::load(&flotor_tests::workspace_root().join("host/scenes/teleoperation.toml"));
    let scene = scene.expect("it is right");
    let measured = Scene::parse(
        Path::new("scene.toml"),
        &format!("{}{}{COUPLING}", device("left", ""), device("right", "")),
    );
    assert_eq!(scene.couplings, measured.expect("it is right").couplings);
    let [coupling] = scene.couplings.as_slice() else { panic!("one coupling") };
    assert_eq!((coupling.config.delay_ticks, coupling.config.passivity), (1, PassivityMode::Control));
    let options = RunOptions { clock: Clock::Virtual, seed: 1 };
    let session = Session::prepare(&scene, &Registry::search(&[]), &options).expect("it starts");
    let mut nobody = flotor_session::summary::Tally::default();
    assert!(session.run(&mut nobody, &StopSwitch::default()).is_ok());
}

#[test]
fn what_is_wrong_with_devices_and_couplings_is_said() {
    let complaint =
        |text: &str| Scene::parse(Path::new("scene.toml"), text).expect_err("it is wrong").to_string();
    let two = "[[device]]\nname = \"left\"\nplugin = \"simulated\"\n[[device]]\nname = \"right\"\nplugin = \"simulated\"\n";
    for (wrong, expected) in [
        ("[[device]]\nplugin = \"a\"\n[[device]]\nplugin = \"b\"\n".to_owned(), "`device.name` is missing"),
        (two.replace("right", "left"), "two devices are called `left`; give each a different `name`"),
        (format!("{two}[[model]]\nplugin = \"spring\"\n"), "the scene has several devices: name the device"),
        (
            format!("{two}[[model]]\nplugin = \"spring\"\ndevice = \"rigth\"\n"),
            "there is no device `rigth`; did you mean `right`? (devices: left, right)",
        ),
        (
            "[device]\nplugin = \"a\"\n[[model]]\nplugin = \"wall\"\n[[model]]\nplugin = \"wall\"\n"
                .to_owned(),
            "two models are called `wall`; give each a different `name`",
        ),
        (
            format!("{two}[[model]]\nplugin = \"spring\"\ndevice = \"left\"\nname = \"a@b\"\n"),
            "a name must not contain `@`, which separates a model from its device",
        ),
        (format!("{two}[[coupling]]\nend = [{{ device = \"left\" }}]\n"), "a coupling has exactly two ends"),
        (
            format!("{two}[[coupling]]\nend = [{{ device = \"left\" }}, {{ device = \"left\" }}]\n"),
            "both ends of the coupling are on the same device",
        ),
        (
            format!("{two}{COUPLING}partner = \"elsewhere\"\nname = \"pair\"\n"),
            "has exactly one end on this host",
        ),
        (
            format!(
                "{two}[[coupling]]\nname = \"Pair\"\npartner = \"elsewhere\"\nend = [{{ device = \"left\" }}]\n"
            ),
            "`name` is missing or invalid; it identifies the coupling on both hosts",
        ),
        (
            format!("{two}[[coupling]]\npartner = \"far\"\nend = [{{ device = \"left\" }}]\n"),
            "here, elsewhere",
        ),
        (
            format!(
                "{two}[[coupling]]\nname = \"pair\"\npartner = \"elsewhere\"\ndelay_ticks = 3\nend = [{{ device = \"left\" }}]\n"
            ),
            "remove `delay_ticks`",
        ),
        (
            format!("{two}{COUPLING}[limits]\npassivity = \"control\"\n"),
            "a coupling has an energy controller of its own",
        ),
        (
            format!(
                "{two}[[coupling]]\ndelay_ticks = 0\nend = [{{ device = \"left\" }}, {{ device = \"right\" }}]\n"
            ),
            "`coupling.delay_ticks` must be a whole number from 1 to 4096",
        ),
    ] {
        let told = complaint(&wrong);
        assert!(told.contains(expected), "{told}\nfor\n{wrong}");
    }
}
