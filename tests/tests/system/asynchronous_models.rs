//! An asynchronous model: the membrane at 200 Hz, its contact computed at 1 kHz. No pull, no step above the slew limit, an
//! error smaller than that of a force that is held, equal bits on the virtual clock, and what a thread of its own does when it
//! breaks.

use flotor_core::asynchronous::{ContactLimits, FieldTiming};
use flotor_core::mapping::{Mapping, MappingConfig};
use flotor_core::trace::Events;
use flotor_hal::LoopConfig;
use flotor_hal::abi::CallStatus;
use flotor_loader::Plugin;
use flotor_servo::engine::asynchronous::AsynchronousModel;
use flotor_servo::engine::process::{Worker, WorkerConfig};
use flotor_servo::{Clock, Engine, RunEnd};
use flotor_session::scene::Scene;
use flotor_tests::TestSize;
use flotor_tests::asynchronous_error::{AsynchronousError, Swing, asynchronous_error};
use flotor_tests::library::plugin_file;
use flotor_tests::printed::assert_chapter_prints;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::tables::{number, table};
use flotor_tests::watched::{watch, watch_on};
use flotor_tests::workspace_root;
use serde_json::Value;
use std::time::Duration;

/// Into the sheet and out again, once a second, at up to 9 mm/s.
const SLOW: Swing = Swing { frequency_hz: 1.0, amplitude_mm: 1.5 };
/// A hand at work: 3 Hz, 28 mm/s.
const FAST: Swing = Swing { frequency_hz: 3.0, amplitude_mm: 1.5 };
/// A limit that never acts.
const NO_LIMIT_N_PER_S: f64 = 1.0e6;

#[test]
fn a_contact_makes_no_step_that_a_slew_limit_would_have_to_cut() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    for swing in [SLOW, FAST] {
        // A limit that a force held from one set to the next would break with each of the larger steps.
        let plain = asynchronous_error(200.0, swing, NO_LIMIT_N_PER_S, 2.0);
        let step_n = 0.9 * plain.held_step_n;
        let seen = asynchronous_error(200.0, swing, step_n / 1.0e-3, 2.0);
        println!(
            "{swing:?}: largest step {:.4} N, of the membrane itself {:.4} N, held {:.4} N, limit {step_n:.4} N",
            seen.largest_step_n, seen.direct_step_n, seen.held_step_n
        );
        assert!(seen.peak_n > 0.1, "the hand was in the sheet: {} N", seen.peak_n);
        assert_eq!(seen.slewed_ticks, 0);
        assert!(seen.largest_step_n <= step_n);
        if swing == FAST {
            let [felt, sheet, held] = [seen.largest_step_n, seen.direct_step_n, seen.held_step_n]
                .map(|step_n| format!("{:.1} mN", 1.0e3 * step_n));
            assert_chapter_prints(
                "membrane.md",
                &format!(
                    "changes by at most {felt} from one tick to the next, the sheet itself by {sheet}, and a zero-order hold by {held}"
                ),
            );
        }
    }
}

#[test]
fn a_contact_is_nearer_to_the_membrane_than_a_force_that_is_held() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let errors: Vec<AsynchronousError> =
        [50.0, 100.0, 200.0].map(|rate_hz| asynchronous_error(rate_hz, FAST, NO_LIMIT_N_PER_S, 2.0)).to_vec();
    let shares = |of: fn(&AsynchronousError) -> f64| -> Vec<f64> {
        errors.iter().map(|seen| of(seen) / seen.peak_n).collect()
    };
    let (contact, held) = (shares(|seen| seen.rms_n), shares(|seen| seen.held_rms_n));
    for (row, shares) in [("contact", &contact), ("zero-order hold of the force", &held)] {
        let cells: Vec<String> = shares.iter().map(|share| format!("{:.1} %", 100.0 * share)).collect();
        assert_chapter_prints("membrane.md", &format!("| {row} | {} |", cells.join(" | ")));
    }
    assert!(contact.iter().zip(&held).all(|(contact, held)| contact < held), "{contact:?}, held {held:?}");
    assert!(contact[1] < contact[0] && contact[2] < contact[0], "{contact:?}");
    // With its stiffness the contact is not late by more than the period it was computed for.
    assert!(errors[2].delay_s <= 0.005, "{} s", errors[2].delay_s);
}

/// The table is of a program of its own, `tests/generators/scenes.py`: sheet, hand, planes and withheld depth, with the same steps.
#[test]
fn errors_and_steps_of_the_contact_are_those_of_an_independent_simulation() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let rows = table("asynchronous_membrane.csv");
    assert_eq!(rows.len(), 3);
    for row in rows {
        let rate_hz = number(&row, "rate_hz");
        let seen = asynchronous_error(rate_hz, FAST, NO_LIMIT_N_PER_S, 2.0);
        for (column, found) in [
            ("contact_rms", seen.rms_n / seen.peak_n),
            ("held_rms", seen.held_rms_n / seen.peak_n),
            ("contact_step_n", seen.largest_step_n),
            ("sheet_step_n", seen.direct_step_n),
            ("held_step_n", seen.held_step_n),
        ] {
            // The simulated hand draws its intention straight over a tick: 5e-6 of the way. A mass that comes into contact a tick earlier or
            // later moves a difference of forces by more than that, and none of the three digits that are printed.
            let expected = number(&row, column);
            assert!(
                (found / expected - 1.0).abs() < 1.0e-3,
                "{column} at {rate_hz} Hz: {found}, not {expected}"
            );
        }
    }
}

/// A local linear model of the same sheet pulled in 729 of 4000 ticks at 50 Hz.
#[test]
fn an_asynchronous_membrane_never_pulls() {
    for rate_hz in [50.0, 200.0] {
        for frequency_hz in [3.0, 5.0] {
            let swing = Swing { frequency_hz, amplitude_mm: 1.5 };
            let seen = asynchronous_error(rate_hz, swing, NO_LIMIT_N_PER_S, 4.0);
            let pulling = seen.records.iter().filter(|record| record.model.force().z < 0.0).count();
            assert!(seen.peak_n > 0.1, "the hand was in the sheet: {} N", seen.peak_n);
            assert_eq!(pulling, 0, "{swing:?} at {rate_hz} Hz");
        }
    }
}

#[test]
fn equal_runs_give_equal_bits_and_a_recording_replays() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let scratch = Scratch::default();
    let scene = workspace_root().join("host/scenes/membrane-200hz.toml").display().to_string();
    let recording = scratch.path().join("run.mcap").display().to_string();
    let run = |arguments: &[&str]| {
        let all = ["run", &scene, "--clock", "virtual", "--duration", "1s", "--json", "-"];
        let ran = Flotor::with(all.iter().chain(arguments)).run();
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
        let report: Value = serde_json::from_str(&ran.stdout).expect("the summary is JSON");
        report["trace_digest"].clone()
    };
    assert_eq!(run(&["--record", &recording]), run(&[]));
    let ran = Flotor::with(["replay", &recording, "--json", "-"]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let report: Value = serde_json::from_str(&ran.stdout).expect("the summary is JSON");
    assert_eq!(report["bit_exact"], Value::from(true), "{report}");
}

#[test]
fn on_a_real_clock_a_thread_computes_and_the_loop_never_waits() {
    let run = watch_on(
        Clock::Real,
        "duration_s = 1\n[limits]\nramp_s = 0\nwatchdog_ms = 60000\n[device]\nplugin = \"simulated\"\n[device.parameters]\n\
         hand = \"oscillate\"\nhand_centre_mm = -2\nhand_amplitude_mm = 0.5\nhand_frequency_hz = 1\n\
         [[model]]\nplugin = \"membrane\"\n[model.field]\nrate_hz = 200\n",
    );
    assert_eq!(run.outcome.end, RunEnd::Finished);
    // However busy the machine is: some contact came, and force was felt.
    assert!(run.records.iter().any(|record| record.model.force().z > 0.05));
}

#[test]
fn a_parameter_changes_in_the_contact_too() {
    let scene = |change: &str| {
        format!(
            "duration_s = 0.6\n[device]\nplugin = \"simulated\"\n[device.parameters]\nhand = \"oscillate\"\n\
             hand_centre_mm = -2\nhand_amplitude_mm = 1\nhand_frequency_hz = 5\n\
             [[model]]\nplugin = \"membrane\"\n[model.field]\nrate_hz = 200\n{change}"
        )
    };
    let plain = watch(&scene(""));
    let damped = watch(&scene("[[change]]\nat_s = 0.2\nset = \"membrane.damping_per_s=2000\"\n"));
    let differs = plain.records.iter().zip(&damped.records).position(|(a, b)| a.model != b.model);
    // The contact after the change is held back for a period, and its force changes from nothing in its first tick.
    let first = differs.expect("the change shows");
    assert!((205..=212).contains(&first), "{first}");
}

/// A model in the loop gave the present value, one in a process or a thread of its own the initial one.
#[test]
fn the_value_of_a_parameter_is_the_present_one_wherever_the_model_runs() {
    let plugin = Plugin::in_process(&flotor_membrane::FLOTOR_ENTRY).expect("it is a plugin");
    let index = plugin.parameters().iter().position(|parameter| parameter.id() == "damping_per_s");
    let (index, count) = (index.expect("it is live"), plugin.parameters().len());
    let config = LoopConfig { period_ns: 1_000_000, seed: 0 };
    let here = || Engine::Here(plugin.create_model(&[]).expect("the defaults are right"));
    let asynchronous = |clock| {
        let timing = FieldTiming { rate_hz: 200.0, latency_s: 0.005, contacts: ContactLimits::UNKNOWN };
        let mapping = Mapping::new(&MappingConfig::default());
        let model = AsynchronousModel::start(
            here(),
            count,
            (&timing, &[(&mapping, &timing.contacts)]),
            &config,
            clock,
        );
        Engine::Asynchronous(Box::new(model.expect("it starts")))
    };
    let worker = Worker::start(&WorkerConfig {
        plugin: &plugin_file("flotor-membrane"),
        sets: Vec::new(),
        config,
        timeout_ns: 10_000_000_000,
        create_timeout: Duration::from_secs(60),
    });
    let worker = Engine::Process(worker.expect("it starts"));
    for mut engine in [here(), asynchronous(Clock::Virtual), asynchronous(Clock::Real), worker] {
        assert_eq!(engine.parameter(index), 50.0);
        assert_eq!(engine.set_parameter(index, 80.0), CallStatus::Ok);
        assert_eq!(engine.parameter(index), 80.0);
    }
}

#[test]
fn what_cannot_be_is_told_with_file_and_line() {
    let scratch = Scratch::default();
    let error = |model: &str| {
        let text = format!("duration_s = 0.1\n[device]\nplugin = \"simulated\"\n[[model]]\n{model}");
        let scene = scratch.file("scene.toml", text).display().to_string();
        let ran = Flotor::with(["run", &scene, "--clock", "virtual"]).run();
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
        ran.error().to_owned()
    };
    let no_field = error("plugin = \"spring\"\n[model.field]\nrate_hz = 200\n");
    assert!(no_field.contains("scene.toml:5") && no_field.contains("no local linear model"), "{no_field}");
    let late = error("plugin = \"membrane\"\n[model.field]\nrate_hz = 200\nlatency_ms = 6\n");
    assert!(late.contains("latency_ms"), "{late}");
}

#[test]
fn a_set_nobody_has_renewed_for_long_says_nothing_any_more() {
    // A second is the longest period: none comes within the run but the first, which is to be had after that.
    let run = watch(
        "duration_s = 0.5\n[device]\nplugin = \"simulated\"\n[[model]]\nplugin = \"membrane\"\n\
         [model.field]\nrate_hz = 1\n",
    );
    assert!(run.records.iter().all(|record| record.model.force().length() == 0.0));
    assert!(run.records.iter().all(|record| !record.events.intersects(Events::MODEL_FAULT)));
}

#[test]
fn the_scene_of_the_book_is_read() {
    let scene = Scene::load(&workspace_root().join("host/scenes/membrane-200hz.toml")).expect("it is right");
    assert_eq!(scene.models[0].field.map(|field| (field.rate_hz, field.latency_s)), Some((200.0, 0.005)));
}

/// A hand that swings through the surface of a wall computed at 200 Hz.
fn wall(model: &str) -> String {
    format!(
        "duration_s = 1\n[device]\nplugin = \"simulated\"\n[device.parameters]\nhand = \"oscillate\"\nhand_centre_mm = 0\n\
         hand_amplitude_mm = 1.5\nhand_frequency_hz = 3\n[[model]]\nplugin = \"wall\"\n{model}[model.field]\nrate_hz = 200\n"
    )
}

#[test]
fn contacts_of_a_process_of_its_own_have_the_same_bits() {
    let forces = |scene: &str| -> Vec<_> {
        watch(scene).records.iter().map(|record| record.model.force().to_array().map(f64::to_bits)).collect()
    };
    let here = forces(&wall(""));
    assert!(here.iter().any(|force| force[2] != 0));
    assert_eq!(here, forces(&wall("isolation = \"process\"\n")));
}

#[test]
fn contacts_replay_to_the_bit_with_the_limits_of_their_device() {
    let scratch = Scratch::default();
    let scene = scratch.file("scene.toml", wall("[model.parameters]\ndamping_ns_per_m = 1\n"));
    let (scene, recording) =
        (scene.display().to_string(), scratch.path().join("run.mcap").display().to_string());
    let ran = Flotor::with(["run", &scene, "--clock", "virtual", "--record", &recording]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    // 2000 N/m with 1 N s/m are 4 times what half a period allows: half of b / 2 over 0.5 ms.
    let told = format!("{}{}", ran.stdout, ran.stderr);
    assert!(told.contains("the contacts of `wall` have 500 N/m instead of 2000"), "{told}");
    let ran = Flotor::with(["replay", &recording, "--json", "-"]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let report: Value = serde_json::from_str(&ran.stdout).expect("the summary is JSON");
    assert_eq!(report["bit_exact"], Value::from(true), "{report}");
}

#[test]
fn a_scene_switches_the_cap_off() {
    let damped = wall("[model.parameters]\ndamping_ns_per_m = 1\n");
    let told = |scene: &str| watch(scene).outcome.warnings.join("\n");
    assert!(told(&damped).contains("have 500 N/m instead of 2000"));
    assert!(!told(&format!("{damped}cap = false\n")).contains("instead of 2000"));
    assert!(told(&wall("")).contains("have no damping up to 2000 N/m"));
}

#[test]
fn a_scene_states_the_damping_of_its_device_and_limits_contacts_by_it() {
    let stated = |model: &str| {
        let scene = wall(model).replace("[device]\n", "[device]\ndamping_ns_per_m = 0.25\n");
        watch(&scene).outcome.warnings.join("\n")
    };
    // Half of b over half a period; and half of B / 2 over half a period more for the wall's own damping.
    let told = stated("");
    assert!(told.contains("have 250 N/m instead of 2000") && !told.contains("no damping"), "{told}");
    let told = stated("[model.parameters]\ndamping_ns_per_m = 1\n");
    assert!(told.contains("have 750 N/m instead of 2000"), "{told}");
}
