//! How a run ends when it must: every state of a run reached through real libraries, emergency stops from signal,
//! button and device, and a watchdog that stops the device when a plugin does not come back.

use flotor_core::health::ModelHealth;
use flotor_core::trace::{Events, TickRecord};
use flotor_hal::DVec3;
use flotor_record::{Ending, Recording, Severity};
use flotor_servo::RunEnd;
use flotor_servo::{Clock, EmergencySource};
use flotor_tests::library::{compile_c_file, plugin_file};
use flotor_tests::program::{Flotor, Ran, Running, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::watched::{Watched, watch, watch_on};
use flotor_tests::{TestSize, holds_ticks, workspace_root};
use rustix::process::{Signal, kill_process_group};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::{PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};
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

/// Limits of a run in real time that is not about the watchdog: it bears a machine on which nothing moves for a while.
const PATIENT: &str = "[limits]\nwatchdog_ms = 60000";

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
    let demo = flotor_session::scene::DEMO.replace("duration_s = 10", "duration_s = 2");
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

/// Who runs in real time: many that wait, or one that does not.
static IN_REAL_TIME: RwLock<()> = RwLock::new(());

/// For a plugin that hangs or is late: it takes a core at real-time priority from all others.
fn alone() -> RwLockWriteGuard<'static, ()> {
    IN_REAL_TIME.write().unwrap_or_else(PoisonError::into_inner)
}

/// For plugins that return at once.
fn beside_others() -> RwLockReadGuard<'static, ()> {
    IN_REAL_TIME.read().unwrap_or_else(PoisonError::into_inner)
}

/// Runs a scene in real time in this process.
fn watch_in_real_time(scene: &str) -> Watched {
    let _alone = alone();
    watch_on(Clock::Real, scene)
}

/// Where the runs of a test are recorded.
fn recording_in(scratch: &Scratch) -> PathBuf {
    scratch.path().join("run.mcap")
}

/// A run of a scene in real time, for longer than any test waits, with its report for machines in `json`.
fn in_real_time(scratch: &Scratch, scene: &str, json: &OsStr) -> Flotor {
    let file = scratch.file("scene.toml", scene);
    let recording = recording_in(scratch);
    let arguments: [&OsStr; 8] = [
        "run".as_ref(),
        file.as_ref(),
        "--duration".as_ref(),
        "60s".as_ref(),
        "--record".as_ref(),
        recording.as_ref(),
        "--json".as_ref(),
        json,
    ];
    let stop_file = scratch.path().join("stopped");
    Flotor::with(arguments).env("FIXTURE_STOP_FILE", &stop_file.display().to_string())
}

/// Runs it to its end; `meanwhile` gets it once the loop runs.
fn run_meanwhile(scratch: &Scratch, flotor: Flotor, meanwhile: impl FnOnce(&Running)) -> Ran {
    let _beside_others = beside_others();
    let running = flotor.start();
    wait_for(&recording_in(scratch));
    meanwhile(&running);
    running.wait()
}

/// Runs a scene in real time, for longer than any test waits; `meanwhile` gets it once it runs.
fn run_in_real_time(scratch: &Scratch, scene: &str, meanwhile: impl FnOnce(&Running)) -> Ran {
    run_meanwhile(scratch, in_real_time(scratch, scene, "-".as_ref()), meanwhile)
}

/// Runs a scene whose plugin hangs, to its end.
fn run_alone(scratch: &Scratch, scene: &str) -> Ran {
    let _alone = alone();
    in_real_time(scratch, scene, "-".as_ref()).run()
}

/// Waits until a recording holds ticks: the loop runs then.
fn wait_for(recording: &Path) {
    let started = Instant::now();
    while !holds_ticks(recording) {
        if started.elapsed() > Duration::from_secs(20) {
            return; // a run that ends at once has its own message
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn last_line(ran: &Ran) -> &str {
    ran.stderr.lines().last().unwrap_or_default()
}

fn end(ran: &Ran) -> String {
    let summary: serde_json::Value = serde_json::from_str(&ran.stdout).expect("a summary is JSON");
    summary["end"].as_str().unwrap_or_default().to_owned()
}

/// Every tick of a recording that is whole.
fn recorded(scratch: &Scratch) -> Vec<TickRecord> {
    let recording = Recording::open(&recording_in(scratch)).expect("a recording");
    assert_eq!(recording.ending(), Ending::Finished);
    recording.map(|record| record.expect("whole")).collect()
}

#[test]
fn sigusr1_is_an_emergency_stop() {
    let scratch = Scratch::default();
    let ran = run_in_real_time(&scratch, &scene("", "", PATIENT), |running| running.signal(Signal::USR1));
    assert_eq!((ran.code, end(&ran).as_str()), (Some(exit_code::DEVICE_FAULT), "emergency_stop"), "{ran:?}");
    assert!(last_line(&ran).starts_with("error: emergency stop (signal)"), "{ran:?}");
    assert!(scratch.path().join("stopped").exists(), "the device was told to stop");
}

#[test]
fn sigint_ends_a_run_in_order() {
    let scratch = Scratch::default();
    let slowly = format!("{PATIENT}\nramp_s = 1");
    let ran = run_in_real_time(&scratch, &scene("", "", &slowly), |running| running.signal(Signal::INT));
    assert_eq!((ran.code, end(&ran).as_str()), (Some(exit_code::OK), "stopped"), "{ran:?}");
    let records = recorded(&scratch);
    let is_releasing = |record: &&TickRecord| record.events.intersects(Events::RELEASING);
    let (first, last) =
        (records.iter().find(is_releasing).expect("it fades out"), records.last().expect("ticks"));
    let took_ns = last.time_ns - first.time_ns;
    assert!(took_ns >= 1_000_000_000, "the force fades out over a second, not at once: {took_ns} ns");
    let is_part = |record: &TickRecord| (0.1..0.9).contains(&(height_of_force(record) / HONEST_N));
    assert!(records.iter().filter(is_releasing).any(is_part), "there is something between all and nothing");
    assert!(
        records.iter().filter(is_releasing).is_sorted_by(|a, b| height_of_force(a) >= height_of_force(b))
    );
    assert_eq!(height_of_force(last), 0.0);
    assert!(scratch.path().join("stopped").exists(), "the device was told to stop");
}

#[test]
fn whatever_a_terminal_sends_ends_a_run_in_order_and_nothing_suspends_it() {
    for signal in [Signal::TERM, Signal::HUP, Signal::QUIT, Signal::TSTP] {
        let scratch = Scratch::default();
        // Whatever the tests were started with: a signal may be ignored, as by `nohup`.
        let flotor = in_real_time(&scratch, &scene("", "", PATIENT), "-".as_ref());
        let flotor = flotor.through_shell("exec env --default-signal=HUP \"$@\"");
        let ran = run_meanwhile(&scratch, flotor, |running| {
            running.signal(signal);
            // A run that is suspended all the same fails this test instead of holding it up.
            std::thread::sleep(Duration::from_millis(500));
            running.signal(Signal::CONT);
        });
        assert_eq!((ran.code, end(&ran).as_str()), (Some(exit_code::OK), "stopped"), "{signal:?}: {ran:?}");
        let records = recorded(&scratch);
        assert!(records.iter().any(|record| record.events.intersects(Events::RELEASING)), "{signal:?}");
        assert_eq!(records.last().map(height_of_force), Some(0.0), "{signal:?}");
        assert!(scratch.path().join("stopped").exists(), "{signal:?}: the device was told to stop");
    }
}

/// Longer than signals may lie apart that are taken for one request.
const ANOTHER_REQUEST: Duration = Duration::from_millis(500);

#[test]
fn a_second_signal_is_an_emergency_stop() {
    let scratch = Scratch::default();
    let slowly = format!("{PATIENT}\nramp_s = 20");
    let ran = run_in_real_time(&scratch, &scene("", "", &slowly), |running| {
        running.signal(Signal::INT);
        std::thread::sleep(ANOTHER_REQUEST);
        running.signal(Signal::TERM);
    });
    assert_eq!((ran.code, end(&ran).as_str()), (Some(exit_code::DEVICE_FAULT), "emergency_stop"), "{ran:?}");
    assert!(last_line(&ran).starts_with("error: emergency stop (signal)"), "{ran:?}");
    let records = recorded(&scratch);
    assert!(
        records.iter().any(|record| record.events.intersects(Events::RELEASING)),
        "the first was orderly"
    );
    assert!(scratch.path().join("stopped").exists(), "the device was told to stop");
}

#[test]
fn a_third_signal_ends_a_process_whatever_holds_it_up() {
    let scratch = Scratch::default();
    // It hangs in its first tick; a second after the first signal the run would end by itself, with the name of the plugin.
    let hangs = scene("", "fault = \"hangs\"", "");
    let flotor = in_real_time(&scratch, &hangs, "-".as_ref()).through_shell("exec \"$@\" --clock virtual");
    let _alone = alone();
    let running = flotor.start();
    let started = Instant::now();
    while !recording_in(&scratch).exists() {
        assert!(started.elapsed() < Duration::from_secs(20), "it does not come to its first tick");
        std::thread::sleep(Duration::from_millis(10));
    }
    for _ in 0..3 {
        std::thread::sleep(ANOTHER_REQUEST);
        running.signal(Signal::INT);
    }
    let ran = running.wait();
    let named =
        ran.code == Some(exit_code::PLUGIN_REFUSED) && ran.stderr.contains("did not return from `step`");
    assert!(ran.code == Some(130) || named, "{ran:#?}");
}

#[test]
fn a_run_that_is_to_outlive_its_terminal_does() {
    let scratch = Scratch::default();
    let flotor = in_real_time(&scratch, &scene("", "", PATIENT), "-".as_ref());
    let mut seen_ns = 0;
    // As `nohup` does.
    let ran = run_meanwhile(&scratch, flotor.through_shell("trap '' HUP; exec \"$@\""), |running| {
        let recording = Recording::open(&recording_in(&scratch)).expect("it holds ticks");
        seen_ns = recording.map_while(Result::ok).last().expect("it holds ticks").time_ns;
        running.signal(Signal::HUP);
        std::thread::sleep(Duration::from_secs(2));
        running.signal(Signal::INT);
    });
    assert_eq!((ran.code, end(&ran).as_str()), (Some(exit_code::OK), "stopped"), "{ran:?}");
    let records = recorded(&scratch);
    let released = records.iter().find(|record| record.events.intersects(Events::RELEASING));
    let went_on_ns = released.expect("it fades out").time_ns - seen_ns;
    assert!(went_on_ns > 1_500_000_000, "it let go {went_on_ns} ns after it was last seen");
}

#[test]
fn an_emergency_stop_has_its_exit_code_also_where_the_summary_cannot_be_written() {
    let scratch = Scratch::default();
    let json = scratch.path().join("run.json");
    std::os::unix::fs::symlink("/dev/full", &json).expect("a link to a disk that is full");
    let flotor = in_real_time(&scratch, &scene("", "", PATIENT), json.as_ref());
    let ran = run_meanwhile(&scratch, flotor, |running| running.signal(Signal::USR1));
    assert_eq!(ran.code, Some(exit_code::DEVICE_FAULT), "{ran:?}");
    let full = format!("error: {}: cannot write the JSON: ", json.display());
    assert!(ran.stderr.lines().any(|line| line.starts_with(&full)), "{ran:?}");
    assert!(last_line(&ran).starts_with("error: emergency stop (signal)"), "{ran:?}");
    // Whoever opens the recording learns of it, too.
    let mut recording = Recording::open(&recording_in(&scratch)).expect("a recording");
    assert!(recording.by_ref().all(|record| record.is_ok()));
    let told = recording.notes().last().expect("there is a note");
    assert_eq!((told.severity, told.source.as_str()), (Severity::Error, "flotor"));
    assert!(told.text.starts_with("emergency stop (signal)"), "{told:?}");
}

#[test]
fn an_emergency_stop_has_its_exit_code_also_where_nobody_reads_the_summary() {
    let scratch = Scratch::default();
    let stops = scene("fault = \"emergency-stop\"\nat_tick = 50", "", "");
    for json in ["-", "/dev/null"] {
        let flotor = in_real_time(&scratch, &stops, json.as_ref());
        // The reader is gone before there is anything to read.
        let to_nobody = "{ sleep 1; \"$@\" --clock virtual; echo \"code $?\" >&2; } | true";
        let ran = flotor.through_shell(to_nobody).run();
        assert_eq!(last_line(&ran), format!("code {}", exit_code::DEVICE_FAULT), "{ran:?}");
        assert!(ran.stderr.contains("error: emergency stop (raised by the device)"), "{ran:?}");
        assert_eq!(recorded(&scratch).len(), 51);
        std::fs::remove_file(recording_in(&scratch)).expect("it was recorded");
    }
}

#[test]
fn a_model_that_hangs_costs_the_run_and_is_named_and_the_device_is_stopped() {
    let scratch = Scratch::default();
    let hangs = scene("", "fault = \"hangs\"\nat_tick = 400", "[limits]\nwatchdog_ms = 500");
    let ran = run_alone(&scratch, &hangs);
    assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{ran:?}");
    let told = "error: `block` did not return from `step` in tick 400; the watchdog stopped all devices after 500 ms (`[limits] watchdog_ms` sets the limit)";
    // A tick that was missed earlier moves the number of the tick.
    assert!(
        last_line(&ran).starts_with("error: `block` did not return from `step` in tick 4"),
        "{told}: {ran:?}"
    );
    assert!(scratch.path().join("stopped").exists(), "the device was told to stop");
}

#[test]
fn a_device_that_hangs_is_a_device_fault() {
    let scratch = Scratch::default();
    let hangs = scene("fault = \"hangs-in-read\"\nat_tick = 400", "", "[limits]\nwatchdog_ms = 500");
    let ran = run_alone(&scratch, &hangs);
    assert_eq!(ran.code, Some(exit_code::DEVICE_FAULT), "{ran:?}");
    assert!(last_line(&ran).starts_with("error: `device` did not return from `read`"), "{ran:?}");
}

#[test]
fn a_model_that_comes_back_late_leaves_a_whole_report_and_the_run_is_over_all_the_same() {
    let scratch = Scratch::default();
    let late = scene("", "fault = \"hangs-once\"\nat_tick = 400", "[limits]\nwatchdog_ms = 50"); // for 300 ms
    let ran = run_alone(&scratch, &late);
    assert_eq!((ran.code, end(&ran).as_str()), (Some(exit_code::DEVICE_FAULT), "watchdog"), "{ran:?}");
}

// ---------------------------------------------------------------- a device that sets the pace

/// The demo for half a second in real time, paced by its device.
fn paced(rate_hz: u32, model: &str) -> String {
    format!(
        "rate_hz = {rate_hz}\nduration_s = 0.5\npacing = \"device\"\n[device]\nplugin = \"simulated\"\n\
         [[model]]\nplugin = \"{}\"\nbudget_us = 1e6\n[model.parameters]\n{model}\n\
         [limits]\nwatchdog_ms = 1000\n",
        plugin_file("fixture-faulty-model").display()
    )
}

#[test]
fn a_device_sets_the_pace_from_100_hz_to_10_khz_and_every_sample_is_a_tick_or_missed() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    for rate_hz in [100, 1000, 10_000] {
        let run = watch_in_real_time(&paced(rate_hz, ""));
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
    let run = watch_in_real_time(&paced(1000, "fault = \"overruns\"")); // 2 ms each
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

// ---------------------------------------------------------------- models that take too long

#[test]
fn a_model_that_overruns_its_budget_again_and_again_is_faded_out_and_named() {
    let slow = scene("", "fault = \"overruns\"\nat_tick = 20", "[limits]\nramp_s = 0");
    // 2 ms a step against 0.5 ms. The budget of a model is looked at on the virtual clock only if the scene asks.
    let unwatched = watch(&slow);
    assert_eq!(the_model(&unwatched).overrun, None);
    let run = watch(&slow.replace("name = \"block\"", "name = \"block\"\nbudget_us = 500"));
    assert_eq!(run.outcome.end, RunEnd::Finished, "the run goes on without it");
    let overrun = the_model(&run).overrun.expect("it was too slow");
    assert_eq!(overrun.limit_ns, 500_000);
    assert!(overrun.longest_ns >= 2_000_000, "{overrun:?}");
    assert!(
        (20..=24).contains(&overrun.tick),
        "five ticks in a row, one of which may have been the machine's"
    );
    let out = usize::try_from(overrun.tick).expect("a small number");
    let forces: Vec<f64> = run.records.iter().map(height_of_force).collect();
    assert_eq!(forces[out], HONEST_N);
    assert!(forces[out..].is_sorted_by(|earlier, later| later <= earlier), "it fades");
    assert!((forces[out + 25] - 0.5 * HONEST_N).abs() < 1.0e-12, "half of it after half of 50 ms");
    assert_eq!(forces[out + 50..].iter().sum::<f64>(), 0.0, "and is out");
}

fn the_model(run: &Watched) -> ModelHealth {
    let [(_, health, _)] = &run.outcome.models[..] else { panic!("one model") };
    *health
}

// ---------------------------------------------------------------- models in a process of their own

/// The scene with its model in a process of its own.
fn isolated(device: &str, model: &str, tables: &str) -> String {
    scene(device, model, tables).replace("name = \"block\"", "name = \"block\"\nisolation = \"process\"")
}

#[test]
fn a_model_in_a_process_of_its_own_answers_bit_for_bit_the_same() {
    let [here, there] = [scene("", "", ""), isolated("", "", "")].map(|scene| watch(&scene).records);
    let answers = |records: &[TickRecord]| records.iter().map(|record| record.commanded).collect::<Vec<_>>();
    assert_eq!(answers(&there), answers(&here));
    assert_eq!(there.len(), 200);
}

#[test]
fn a_model_that_ends_its_process_is_out_and_the_loop_goes_on() {
    let run = watch(&isolated("", "fault = \"aborts\"\nat_tick = 50", "[limits]\nramp_s = 0"));
    assert_eq!((run.outcome.end, run.records.len()), (RunEnd::Finished, 200));
    let [(name, health, words)] = &run.outcome.models[..] else { panic!("one model") };
    let lost = health.lost_at.expect("it is gone");
    assert!((50..=52).contains(&lost), "{lost}");
    assert_eq!((name.as_str(), words.as_str()), ("block", "the worker process was ended by signal 6"));
    assert_force_ends_within_two_ticks(&run, 50);
}

/// A null pointer: what no boundary can catch in the host's own process.
#[test]
fn a_model_that_crashes_its_process_is_out_and_the_loop_goes_on() {
    let scratch = Scratch::default();
    let library = scratch.path().join("libwall.so");
    compile_c_file(&workspace_root().join("tests/c/wall.c"), &["CRASHES"], &library);
    let honest = plugin_file("fixture-faulty-model").display().to_string();
    let crashing = isolated("", "", "[limits]\nramp_s = 0").replace(&honest, &library.display().to_string());
    let run = watch(&crashing);
    assert_eq!((run.outcome.end, run.records.len()), (RunEnd::Finished, 200));
    let [(_, _, words)] = &run.outcome.models[..] else { panic!("one model") };
    assert_eq!(words, "the worker process was ended by signal 11");
    assert!(the_model(&run).lost_at.is_some());
    assert_force_ends_within_two_ticks(&run, 50);
}

#[test]
fn a_model_that_hangs_in_a_process_of_its_own_costs_two_ticks_of_force() {
    // In real time: the loop waits half a period for it once, and not at all while it is behind. For a second: a machine
    // that holds the loop up costs it ticks.
    let hangs = isolated("", "fault = \"hangs\"\nat_tick = 50", "[limits]\nramp_s = 0\nwatchdog_ms = 1000");
    let scene = hangs.replace("duration_s = 0.2", "duration_s = 1");
    let overrun = |run: &Watched| the_model(run).overrun.expect("it is late in every tick from then on");
    // Run again if the machine delays the process of the model before it hangs.
    let mut runs = std::iter::repeat_with(|| watch_in_real_time(&scene)).take(3);
    let run = runs.find(|run| {
        let is_begun = overrun(run).tick >= 50;
        if !is_begun {
            eprintln!("the model was late before it hung; run again: {:?}", the_model(run));
        }
        is_begun
    });
    let run = run.expect("one of three runs reaches tick 50");
    assert_eq!(run.outcome.end, RunEnd::Finished);
    assert!(overrun(&run).tick >= 54, "five ticks more than in time: {:?}", the_model(&run));
    assert_force_ends_within_two_ticks(&run, 50);
    let waited = run.records.iter().filter(|record| record.tick > 52 && record.compute_ns > 400_000).count();
    assert!(waited < run.records.len() / 10, "{waited} ticks took as long as the wait for an answer");
}

#[test]
fn a_model_in_a_process_of_its_own_says_no_like_any_other() {
    let scratch = Scratch::default();
    for (fault, words) in [
        ("refuses-to-create", "the table of forces is on another machine"),
        ("panics-in-create", "create gave up"),
    ] {
        let file = scratch.file("scene.toml", isolated("", &format!("fault = \"{fault}\""), ""));
        let ran =
            Flotor::with(["run".as_ref(), file.as_os_str(), "--clock".as_ref(), "virtual".as_ref()]).run();
        assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{ran:?}");
        assert!(ran.error().contains(words), "{ran:?}");
    }
}

/// A terminal signals the whole group of processes.
#[test]
fn a_model_in_a_process_of_its_own_is_felt_until_the_run_has_ended_in_order() {
    let patiently = format!("{PATIENT}\nramp_s = 1");
    let scene = isolated("", "", &patiently).replace("name = \"block\"", "name = \"block\"\nbudget_us = 1e6");
    for signal in [Signal::INT, Signal::TSTP] {
        let scratch = Scratch::default();
        let flotor = in_real_time(&scratch, &scene, "-".as_ref()).through_shell("exec setsid \"$@\"");
        let ran = run_meanwhile(&scratch, flotor, |running| {
            kill_process_group(running.pid(), signal).expect("it is ours");
        });
        assert_eq!((ran.code, end(&ran).as_str()), (Some(exit_code::OK), "stopped"), "{signal:?}: {ran:?}");
    }
}

/// The last force is held for one tick, then there is none: the device is safe two ticks after the model failed.
fn assert_force_ends_within_two_ticks(run: &Watched, failed_at: u64) {
    for record in &run.records {
        if record.tick < failed_at && record.events.intersects(Events::MODEL_OVERRUN) {
            continue; // a busy machine
        }
        match record.tick {
            tick if tick < failed_at => assert!(height_of_force(record) > 0.0, "tick {tick}"),
            tick if tick < failed_at + 2 => {}
            tick => assert_eq!(record.commanded.force(), DVec3::ZERO, "tick {tick}"),
        }
    }
}

// ---------------------------------------------------------------- energy at the port

/// The demo with a model that pumps: negative damping of 40 N s/m against a hand that has 5.
fn pump(limits: &str) -> String {
    format!(
        "rate_hz = 1000\nduration_s = 3\n[device]\nplugin = \"simulated\"\n[[model]]\nplugin = \"{}\"\n\
         [model.parameters]\nfault = \"pumps\"\n[limits]\nforce_n = 5\n{limits}\n",
        plugin_file("fixture-faulty-model").display()
    )
}

/// Energy of a spring over the way of one period from rest with 50 m/s², J: the most that a port may give beyond what it received.
fn reserve_j(stiffness_n_per_m: f64, rate_hz: f64) -> f64 {
    stiffness_n_per_m * 2500.0 / (8.0 * rate_hz.powi(4))
}

fn lowest_port_energy_j(run: &Watched) -> f64 {
    run.records.iter().map(|record| record.port_energy_j).fold(0.0, f64::min)
}

#[test]
fn a_model_that_creates_energy_is_seen_and_with_the_controller_gets_none_out() {
    let watched = watch(&pump(""));
    let lowest_j = lowest_port_energy_j(&watched);
    assert!(lowest_j < -0.01, "it pumps: {lowest_j} J");
    let guarded = watch(&pump("passivity = \"control\""));
    assert_eq!(guarded.outcome.end, RunEnd::Finished);
    let damped =
        guarded.records.iter().filter(|record| record.events.intersects(Events::PASSIVITY_DAMPED)).count();
    assert!(damped > 100, "{damped} ticks");
    let lowest_j = lowest_port_energy_j(&guarded);
    assert!(lowest_j >= -reserve_j(2000.0, 1000.0), "no more than the reserve: {lowest_j} J");
}

#[test]
fn a_spring_that_is_too_stiff_for_its_rate_is_seen_and_kept_passive() {
    // Twice the stiffest spring at 100 Hz: 2 (b + B) / T, with next to no damping in plant and hand.
    let stiff = |limits: &str| {
        let demo = flotor_session::scene::DEMO.replace("rate_hz = 1000", "rate_hz = 100");
        watch(&format!("{}\n[limits]\n{limits}\n", demo.replace("force_scale = 1.0", "force_scale = 8.0")))
    };
    let free = lowest_port_energy_j(&stiff("ramp_s = 0"));
    let guarded = lowest_port_energy_j(&stiff("ramp_s = 0\npassivity = \"control\""));
    assert!(free < -1.0e-3, "sampling creates energy: {free} J");
    // Eight times the 1.13 N/mm of the demo.
    assert!(guarded >= -reserve_j(8.0 * 1130.0, 100.0), "no more than the reserve: {guarded} J");
}

// ---------------------------------------------------------------- wild models

/// Ticks of a model that answers anything at all, and the limits it meets.
fn wild(ticks: usize, fault: &str, tables: &str) -> Watched {
    let limits = "[limits]\nforce_n = [4.0, 5.0, 6.0]\ntorque_nm = 0.5\nforce_slew_n_per_s = 3000.0\n\
                  torque_slew_nm_per_s = 200.0\nramp_s = 0.1";
    let scene = scene("", fault, limits).replace("name = \"block\"", "name = \"block\"\nbudget_us = 20");
    let scene = scene.replace("duration_s = 0.2", &format!("duration_s = {}", ticks / 1000));
    let run = watch(&format!("{scene}{tables}"));
    assert_eq!((run.outcome.end, run.records.len()), (RunEnd::Finished, ticks));
    run
}

fn assert_no_limit_is_passed(run: &Watched) {
    // A few roundings of the largest number involved.
    let slack = 1.0 + 8.0 * f64::EPSILON;
    let (most_n, most_nm) = (DVec3::new(4.0, 5.0, 6.0), DVec3::splat(0.5));
    let mut last = flotor_hal::Wrench::ZERO;
    for record in &run.records {
        let sent = record.commanded;
        assert!(sent.is_finite(), "{record:?}");
        assert!(sent.force().abs().cmple(most_n * slack).all(), "{record:?}");
        assert!(sent.torque().abs().cmple(most_nm * slack).all(), "{record:?}");
        // But for the fall of a part of the last one: those fill the ball between the last one and zero.
        let rise = |sent: DVec3, last: DVec3| (sent - last * 0.5).length() - last.length() * 0.5;
        assert!(rise(sent.force(), last.force()) <= 3.0 * slack, "{last:?} {record:?}");
        assert!(rise(sent.torque(), last.torque()) <= 0.2 * slack, "{last:?} {record:?}");
        last = sent;
    }
    assert!(run.records.iter().any(|record| record.events.intersects(Events::FORCE_LIMITED)));
}

/// Random numbers, NaN, infinities, 1e300, alternating signs.
#[test]
fn nothing_a_wild_model_answers_gets_past_a_limit_or_the_slew() {
    let ticks = TestSize::of_this_run().pick(20_000, 1_000_000);
    let controlled = "\npassivity = \"control\"\nvelocity_m_per_s = 0.1";
    // The controller leaves so little to a hand that has put nothing in that the slew limit has nothing to do.
    for (tables, last_guard) in [("", Events::SLEW_LIMITED), (controlled, Events::PASSIVITY_DAMPED)] {
        let run = wild(ticks, "fault = \"wild\"", tables);
        assert_no_limit_is_passed(&run);
        let rejected = the_model(&run).rejected.ticks;
        assert!(rejected > 100, "NaN and infinity are counted, by name: {rejected}");
        assert!(run.records.iter().any(|record| record.events.intersects(last_guard)));
    }
}

#[test]
fn a_wild_model_that_is_late_or_panics_gets_past_nothing_either_and_the_cause_is_named() {
    let ticks = TestSize::of_this_run().pick(20_000, 1_000_000);
    let at_tick = ticks * 9 / 10;
    let late = wild(ticks, &format!("fault = \"wild-and-late\"\nat_tick = {at_tick}"), "");
    assert_no_limit_is_passed(&late);
    let alone = late.records.iter().filter(|record| record.events.intersects(Events::MODEL_OVERRUN)).count();
    assert!(alone > ticks / 200, "single late steps are counted and borne: {alone}");
    let overrun = the_model(&late).overrun.expect("late in every tick at the end");
    assert_eq!(overrun.limit_ns, 20_000);
    assert!(overrun.tick < at_tick as u64 + 5, "{overrun:?}");

    let panics = wild(ticks, &format!("fault = \"wild-and-panics\"\nat_tick = {at_tick}"), "");
    assert_no_limit_is_passed(&panics);
    assert_eq!(the_model(&panics).panicked_at, Some(at_tick as u64));
    let [(name, _, words)] = &panics.outcome.models[..] else { panic!("one model") };
    assert_eq!(name, "block");
    assert!(words.contains(&format!("step gave up at tick {at_tick}")), "{words}");
    assert_eq!(panics.records[ticks - 1].commanded, flotor_hal::Wrench::ZERO, "nothing is left of it");
}
