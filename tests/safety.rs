//! How a run ends when it must: every state of a run reached through real libraries, emergency stops from signal,
//! button and device, and a watchdog that stops the device when a plugin does not come back.

use flotor::servo::{Clock, EmergencySource};
use flotor::session::RunEnd;
use flotor::trace::{Events, TickRecord};
use flotor_hal::DVec3;
use flotor_tests::library::plugin_file;
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::watched::{watch, watch_on};
use std::path::Path;
use std::time::{Duration, Instant};

/// The faulty model on the faulty device, with their faults and further tables of the scene. At 1 kHz for 0.2 s.
fn scene(device: &str, model: &str, tables: &str) -> String {
    let (device_file, model_file) =
        (plugin_file("fixture-faulty-device"), plugin_file("fixture-faulty-model"));
    format!(
        "rate_hz = 1000\nduration_s = 0.2\n[device]\nplugin = \"{}\"\n[device.parameters]\n{device}\n\
         [[model]]\nplugin = \"{}\"\nname = \"block\"\n[model.parameters]\n{model}\n{tables}",
        device_file.display(),
        model_file.display()
    )
}

/// What the honest model asks for on the faulty device: 100 N/m times 1 mm, up.
const HONEST_N: f64 = 0.1;

fn height_of_force(record: &TickRecord) -> f64 {
    record.commanded.force().z
}

// ---------------------------------------------------------------- states, on the virtual clock

#[test]
fn a_named_button_of_the_device_is_an_emergency_stop() {
    let pressed = "fault = \"presses-button\"\nat_tick = 50";
    let run = watch(&scene(pressed, "", "[limits]\nramp_s = 0\nemergency_button = 2"));
    assert_eq!(run.outcome.end, RunEnd::EmergencyStop(EmergencySource::Button));
    let last = run.records.last().expect("there were ticks");
    assert_eq!((last.tick, last.commanded.force()), (50, DVec3::ZERO));
    assert!(last.events.intersects(Events::EMERGENCY_STOP));
}

#[test]
fn a_button_nobody_named_is_a_button() {
    let run = watch(&scene("fault = \"presses-button\"", "", "[limits]\nemergency_button = 1"));
    assert_eq!(run.outcome.end, RunEnd::Finished);
}

#[test]
fn the_devices_own_emergency_stop_is_one() {
    let run = watch(&scene("fault = \"emergency-stop\"\nat_tick = 50", "", ""));
    assert_eq!(run.outcome.end, RunEnd::EmergencyStop(EmergencySource::Device));
}

#[test]
fn without_samples_there_is_no_force_and_with_them_it_fades_in_again() {
    let lost = "fault = \"stale-samples\"\nat_tick = 50"; // for 20 ticks
    let run = watch(&scene(lost, "", "[limits]\nramp_s = 0.02"));
    assert_eq!(run.outcome.end, RunEnd::Finished);
    for record in &run.records {
        let force_n = height_of_force(record);
        let holding = record.events.intersects(Events::HOLDING);
        // Ten stale ticks are borne.
        assert_eq!(holding, (60..70).contains(&record.tick), "tick {}", record.tick);
        match record.tick {
            20..=59 | 90.. => assert_eq!(force_n, HONEST_N, "tick {}", record.tick),
            60..=70 => assert_eq!(force_n, 0.0, "tick {}", record.tick),
            80 => assert!((force_n - 0.5 * HONEST_N).abs() < 1.0e-12, "half of the ramp: {force_n}"),
            _ => assert!((0.0..HONEST_N).contains(&force_n), "tick {}: {force_n}", record.tick),
        }
    }
}

#[test]
fn a_handle_that_is_too_fast_is_driven_no_further() {
    // The demo's hand moves at up to some 0.1 m/s; half of it is too fast here.
    let demo = flotor::scene::DEMO.replace("duration_s = 10", "duration_s = 2");
    let run = watch(&format!("{demo}\n[limits]\nvelocity_m_per_s = 0.02\n"));
    let limited: Vec<&TickRecord> =
        run.records.iter().filter(|record| record.events.intersects(Events::VELOCITY_LIMITED)).collect();
    assert!(limited.len() > 10, "{} ticks were too fast", limited.len());
    for record in limited {
        let (velocity, force) = (record.twist.linear(), record.commanded.force());
        let excess = velocity.abs().max_element() / 0.02;
        if excess >= 2.0 {
            assert!(force.dot(velocity) <= 1.0e-12, "tick {}: {force} drives {velocity}", record.tick);
        }
    }
}

// ---------------------------------------------------------------- signals and the watchdog, in real time

/// Runs a scene in real time, for longer than any test waits; `meanwhile` gets the process id once it runs.
fn run_in_real_time(scratch: &Scratch, scene: &str, meanwhile: impl FnOnce(u32)) -> Ran {
    let file = scratch.file("scene.toml", scene);
    let recording = scratch.path().join("run.mcap");
    let stop_file = scratch.path().join("stopped");
    let arguments: [&std::ffi::OsStr; 8] = [
        "run".as_ref(),
        file.as_ref(),
        "--duration".as_ref(),
        "60s".as_ref(),
        "--record".as_ref(),
        recording.as_ref(),
        "--json".as_ref(),
        "-".as_ref(),
    ];
    let running = Flotor::with(arguments).env("FIXTURE_STOP_FILE", &stop_file.display().to_string()).start();
    wait_for(&recording);
    meanwhile(running.id());
    running.wait()
}

/// Waits until a recording holds ticks: the loop runs then.
fn wait_for(recording: &Path) {
    const BEGINNING_BYTES: u64 = 20_000; // description and schemas take less, a quarter of a second of ticks more
    let started = Instant::now();
    while !std::fs::metadata(recording).is_ok_and(|file| file.len() > BEGINNING_BYTES) {
        if started.elapsed() > Duration::from_secs(20) {
            return; // a run that ends at once has its own message
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn signal(name: &str, process: u32) {
    let sent = std::process::Command::new("kill").args([format!("-{name}"), process.to_string()]).status();
    assert!(sent.expect("there is a kill command").success());
}

fn last_line(ran: &Ran) -> &str {
    ran.stderr.lines().last().unwrap_or_default()
}

fn end(ran: &Ran) -> String {
    let summary: serde_json::Value = serde_json::from_str(&ran.stdout).expect("a summary is JSON");
    summary["end"].as_str().unwrap_or_default().to_owned()
}

#[test]
fn sigusr1_is_an_emergency_stop() {
    let scratch = Scratch::default();
    let ran = run_in_real_time(&scratch, &scene("", "", ""), |process| signal("USR1", process));
    assert_eq!((ran.code, end(&ran).as_str()), (Some(exit_code::DEVICE_FAULT), "emergency_stop"), "{ran:?}");
    assert!(last_line(&ran).starts_with("error: emergency stop (signal)"), "{ran:?}");
    assert!(scratch.path().join("stopped").exists(), "the device was told to stop");
}

#[test]
fn sigint_ends_a_run_in_order() {
    let scratch = Scratch::default();
    let ran = run_in_real_time(&scratch, &scene("", "", ""), |process| signal("INT", process));
    assert_eq!((ran.code, end(&ran).as_str()), (Some(exit_code::OK), "stopped"), "{ran:?}");
    let recording = flotor::record::Recording::open(&scratch.path().join("run.mcap")).expect("a recording");
    let records: Vec<TickRecord> = recording.map(|record| record.expect("whole")).collect();
    let releasing = records.iter().filter(|record| record.events.intersects(Events::RELEASING)).count();
    assert!(releasing > 100, "the force fades out over 0.2 s, not at once: {releasing} ticks");
    assert_eq!(height_of_force(records.last().expect("ticks")), 0.0);
    assert!(scratch.path().join("stopped").exists(), "the device was told to stop");
}

#[test]
fn a_model_that_hangs_costs_the_run_and_is_named_and_the_device_is_stopped() {
    let scratch = Scratch::default();
    let hangs = scene("", "fault = \"hangs\"\nat_tick = 400", "[limits]\nwatchdog_ms = 50");
    let ran = run_in_real_time(&scratch, &hangs, |_| ());
    assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{ran:?}");
    let told = "error: `block` did not come back from `step` in tick 400; the watchdog stopped the device after 50 ms";
    // A tick that was missed earlier moves the number of the tick.
    assert!(
        last_line(&ran).starts_with("error: `block` did not come back from `step` in tick 4"),
        "{told}: {ran:?}"
    );
    assert!(scratch.path().join("stopped").exists(), "the device was told to stop");
}

#[test]
fn a_device_that_hangs_is_a_device_fault() {
    let scratch = Scratch::default();
    let hangs = scene("fault = \"hangs-in-read\"\nat_tick = 400", "", "[limits]\nwatchdog_ms = 50");
    let ran = run_in_real_time(&scratch, &hangs, |_| ());
    assert_eq!(ran.code, Some(exit_code::DEVICE_FAULT), "{ran:?}");
    assert!(last_line(&ran).starts_with("error: `device` did not come back from `read`"), "{ran:?}");
}

#[test]
fn a_model_that_comes_back_late_leaves_a_whole_report_and_the_run_is_over_all_the_same() {
    let scratch = Scratch::default();
    let late = scene("", "fault = \"hangs-once\"\nat_tick = 400", "[limits]\nwatchdog_ms = 50"); // for 300 ms
    let ran = run_in_real_time(&scratch, &late, |_| ());
    assert_eq!((ran.code, end(&ran).as_str()), (Some(exit_code::DEVICE_FAULT), "watchdog"), "{ran:?}");
}

// ---------------------------------------------------------------- a device that sets the pace

/// The demo for half a second in real time, paced by its device.
fn paced(rate_hz: u32, model: &str) -> String {
    format!(
        "rate_hz = {rate_hz}\nduration_s = 0.5\npacing = \"device\"\n[device]\nplugin = \"simulated\"\n\
         [[model]]\nplugin = \"{}\"\n[model.parameters]\n{model}\n",
        plugin_file("fixture-faulty-model").display()
    )
}

#[test]
fn a_device_sets_the_pace_from_100_hz_to_10_khz_and_every_sample_is_a_tick_or_missed() {
    for rate_hz in [100, 1000, 10_000] {
        let run = watch_on(Clock::Real, &paced(rate_hz, ""));
        assert_eq!(run.outcome.end, RunEnd::Finished);
        let timing = &run.outcome.timing;
        let periods = u64::from(rate_hz) / 2;
        // The last wait may find several samples at once.
        let seen = timing.ticks + timing.missed;
        let last = run.records.last().expect("ticks");
        assert_eq!(seen, last.time_ns / (1_000_000_000 / u64::from(rate_hz)) + 1);
        assert!(seen >= periods, "{rate_hz} Hz: {seen} of {periods}");
        assert!(timing.ticks > 10, "{rate_hz} Hz: {} ticks", timing.ticks);
    }
}

#[test]
fn samples_that_come_while_a_model_dawdles_are_missed_and_counted() {
    let run = watch_on(Clock::Real, &paced(1000, "fault = \"overruns\"")); // 2 ms each
    assert_eq!(run.outcome.end, RunEnd::Finished);
    let timing = &run.outcome.timing;
    assert!(timing.missed >= timing.ticks / 2, "{} ticks, {} missed", timing.ticks, timing.missed);
}

#[test]
fn a_device_that_cannot_pace_is_a_mismatch_before_anything_moves() {
    let scratch = Scratch::default();
    let scene = format!("pacing = \"device\"\n{}", scene("", "", ""));
    let file = scratch.file("scene.toml", scene);
    let ran = Flotor::with(["run".as_ref(), file.as_os_str()]).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(ran.error().contains("cannot set the pace"), "{ran:?}");
}
