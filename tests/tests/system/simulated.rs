//! The simulated flotor as a host meets it: hands that follow files, faults on purpose, parameters that are
//! refused, and the same bits however it is run.

use flotor_core::trace::{Events, TickRecord};
use flotor_hal::{Conditions, Cycle, DVec3, DeviceState, Fault, LoopConfig, Tick, Wrench};
use flotor_loader::{LoadError, OpenedDevice, Setting};
use flotor_servo::RunEnd;
use flotor_session::registry::load_file;
use flotor_tests::TestSize;
use flotor_tests::library::plugin_file;
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::watched::{Watched, watch};
use rayon::prelude::*;
use serde_json::Value;

const PERIOD_NS: u64 = 1_000_000;

/// The demo's spring on the flotor with these parameters (lines of TOML), for some seconds.
fn scene(duration_s: f64, parameters: &str) -> String {
    format!(
        "duration_s = {duration_s}\n[device]\nplugin = \"simulated\"\n[device.parameters]\n{parameters}\n\
         [[model]]\nplugin = \"spring\"\n[model.mapping]\nmotion_scale = 1.6666666666666667\n"
    )
}

/// Runs the demo with these settings of the device on the virtual clock.
fn run_demo(settings: &[&str]) -> Ran {
    let mut arguments = vec!["run".to_owned(), "--clock".to_owned(), "virtual".to_owned()];
    arguments.extend(["--duration", "3s", "--json", "-"].map(str::to_owned));
    for setting in settings {
        arguments.extend(["--set".to_owned(), format!("device.{setting}")]);
    }
    Flotor::with(arguments).run()
}

fn summary(ran: &Ran) -> Value {
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    serde_json::from_str(&ran.stdout).expect("the summary is JSON")
}

// ---------------------------------------------------------------- hands that follow files

#[test]
fn a_script_lies_beside_its_scene_and_is_named_in_the_summary() {
    let scratch = Scratch::default();
    let script = "[[step]]\nmove = { to_mm = [0, 0, -3], duration_s = 0.2 }\n";
    let _ = scratch.file("mine.toml", script);
    let scene = scratch.file("scene.toml", scene(0.5, "hand_script = \"mine.toml\""));
    let ran = Flotor::with(["run", &scene.display().to_string(), "--clock", "virtual", "--json", "-"]).run();
    let summary = summary(&ran);
    // A firm hand of 2000 N/m gets 64 % of the way against a spring of 1131 N/m: 2.2 N.
    let peak_n = summary["peak_force_n"].as_f64().expect("a number");
    assert!((1.8..2.8).contains(&peak_n), "{peak_n}");
    let told = summary["plugins"][0]["parameters"]["hand_script"].as_str();
    assert_eq!(told, Some(&*scratch.path().join("mine.toml").display().to_string()));
}

#[test]
fn every_built_in_script_runs_on_both_presets() {
    for script in ["press", "hold", "release", "shear", "tilt", "tap", "push"] {
        for preset in ["plain", "full"] {
            let parameters = format!("hand_script = \"{script}\"\npreset = \"{preset}\"");
            let Watched { records, outcome, .. } = watch(&scene(2.5, &parameters));
            assert_eq!(outcome.end, RunEnd::Finished, "{script} {preset}");
            let ledger = outcome.devices[0].ledger.expect("the flotor has an energy balance");
            let imbalance = ledger.residual_j().abs() / ledger.peak_j;
            assert!(imbalance <= 1.0e-9, "{script} {preset}: {imbalance:e}");
            let moved = records.iter().any(|record| record.pose.position().length() > 0.1e-3);
            assert!(moved || script == "tilt", "{script} {preset}");
        }
    }
}

#[test]
fn a_wrong_script_is_told_with_file_line_and_key() {
    let scratch = Scratch::default();
    let script = scratch.file("wrong.toml", "[[step]]\nhold = { duration_s = -1 }\n").display().to_string();
    let ran = run_demo(&[&format!("hand_script={script}")]);
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(
        ran.error().ends_with(&format!("{script}:2: `duration_s`: -1 is outside 0.01 to 3600 s")),
        "{ran:?}"
    );
    let ran = run_demo(&["hand_script=prss"]);
    assert!(ran.error().contains("a script is a TOML file or one of press, hold"), "{ran:?}");
    let ran = run_demo(&["hand_script=press", "hand_recording=run.mcap"]);
    assert!(ran.error().contains("`hand_script` and `hand_recording` are both set"), "{ran:?}");
}

#[test]
fn the_path_of_a_recorded_run_drives_the_hand_again() {
    let scratch = Scratch::default();
    let recording = scratch.path().join("run.mcap").display().to_string();
    let recorded = Flotor::with([
        "run",
        "--clock",
        "virtual",
        "--duration",
        "3s",
        "--record",
        &recording,
        "--set",
        "device.hand_script=press",
    ]);
    assert_eq!(recorded.run().code, Some(exit_code::OK));
    let original = watch(&scene(2.0, "hand_script = \"press\"")).records;
    // A hand ten times as stiff goes where the recorded handle went.
    let stiff = "hand_stiffness_n_per_m = 20000\nhand_damping_ns_per_m = 200";
    let again = watch(&scene(2.0, &format!("hand_recording = \"{recording}\"\n{stiff}"))).records;
    let height_mm = |record: &TickRecord| record.pose.position_m[2] * 1.0e3;
    let deepest_mm = original.iter().map(height_mm).fold(0.0, f64::min);
    assert!(deepest_mm < -3.0, "{deepest_mm}");
    for (one, other) in original.iter().zip(&again) {
        // A spring of 1131 N/m takes 5 % of the way of a hand of 20 000 N/m, inertia another 2 %.
        assert!((height_mm(one) - height_mm(other)).abs() < -0.08 * deepest_mm, "tick {}", one.tick);
    }
}

// ---------------------------------------------------------------- faults on purpose

const FAULT_START: usize = 200;
const FAULT_TICKS: usize = 20;

/// Half a second with a fault from tick 200 on for 20 ticks.
fn with_fault(fault: &str, more: &str) -> Watched {
    let parameters = format!(
        "preset = \"full\"\nfault = \"{fault}\"\nfault_time_s = 0.2\nfault_duration_s = 0.02\n{more}"
    );
    watch(&scene(0.5, &parameters))
}

fn heights_m(records: &[TickRecord]) -> Vec<f64> {
    records.iter().map(|record| record.pose.position_m[2]).collect()
}

fn stale_ticks(records: &[TickRecord]) -> Vec<usize> {
    let is_stale = |tick: &usize| records[*tick].events.intersects(Events::STALE_SAMPLE);
    (0..records.len()).filter(is_stale).collect()
}

#[test]
fn faults_that_end_a_run_end_it_at_their_tick_and_say_which() {
    for (fault, expected) in [
        ("sensor-loss", Fault::SensorOutOfRange),
        ("over-temperature", Fault::OverTemperature),
        ("cable-pull", Fault::Disconnected),
    ] {
        let Watched { records, outcome, .. } = with_fault(fault, "");
        assert_eq!(outcome.end, RunEnd::DeviceFault(expected), "{fault}");
        assert_eq!(records.len(), FAULT_START + 1, "{fault}");
        let last = records.last().expect("ticks");
        assert!(last.events.intersects(Events::DEVICE_FAULT), "{fault}");
        assert_eq!(last.commanded, Wrench::ZERO, "{fault}: no force on a device that is not there");
    }
}

#[test]
fn a_dropped_sample_is_stale_and_the_force_ends_once_it_is_old() {
    let Watched { records, outcome, .. } = with_fault("dropped-sample", "");
    assert_eq!(outcome.end, RunEnd::Finished);
    assert_eq!(stale_ticks(&records), Vec::from_iter(FAULT_START..FAULT_START + FAULT_TICKS));
    // Ten ticks of the last sample, then nothing until the next.
    let force_n =
        |tick: usize| records[tick].model.force().length().min(records[tick].commanded.force().length());
    assert!(force_n(FAULT_START + 9) > 0.0);
    assert_eq!(records[FAULT_START + 10].commanded, Wrench::ZERO);
    // The hand has moved meanwhile: the force fades in again instead of jumping to where it would be.
    let back = &records[FAULT_START + FAULT_TICKS];
    assert!(back.events.intersects(Events::RAMPING) && !back.events.intersects(Events::STALE_SAMPLE));
    assert!(records.last().expect("ticks").commanded != Wrench::ZERO, "it goes on");
}

#[test]
fn late_and_doubled_samples_are_old_without_saying_so() {
    let late = with_fault("late-sample", "").records;
    assert_eq!(stale_ticks(&late), [] as [usize; 0]);
    assert_eq!(
        late[FAULT_START].pose,
        late[FAULT_START - 1].pose,
        "the first late sample is the last good one"
    );
    assert_ne!(late[FAULT_START + 1].pose, late[FAULT_START].pose, "then they go on, a tick behind");

    let doubled = with_fault("duplicate-sample", "").records;
    assert_eq!(stale_ticks(&doubled), [] as [usize; 0]);
    let poses = &doubled[FAULT_START - 1..FAULT_START + FAULT_TICKS];
    assert!(poses.iter().all(|record| record.pose == poses[0].pose), "the same sample again and again");
    assert_ne!(doubled[FAULT_START + FAULT_TICKS].pose, poses[0].pose);
}

#[test]
fn a_stuck_axis_stays_while_the_others_go_on() {
    for axis in 0..3 {
        let records = with_fault("stuck-axis", &format!("fault_index = {axis}")).records;
        let stuck = &records[FAULT_START..FAULT_START + FAULT_TICKS];
        for coordinate in 0..3 {
            let is_constant = |coordinate: usize| {
                let first = stuck[0].pose.position_m[coordinate];
                stuck.iter().all(|record| record.pose.position_m[coordinate] == first)
            };
            assert_eq!(is_constant(coordinate), coordinate == axis, "axis {axis}, coordinate {coordinate}");
        }
    }
}

#[test]
fn an_open_coil_delivers_less_than_was_commanded() {
    let missing_n = |records: &[TickRecord]| {
        let pairs = records.windows(2).skip(FAULT_START).take(FAULT_TICKS);
        let missing = pairs.map(|pair| (pair[1].delivered.force() - pair[0].commanded.force()).length());
        missing.fold(0.0, f64::max)
    };
    let (broken, intact) = (with_fault("coil-open", "").records, with_fault("none", "").records);
    // An intact machine is off by the unevenness of the field and the lag of its amplifiers.
    assert!(missing_n(&broken) > 3.0 * missing_n(&intact), "{} {}", missing_n(&broken), missing_n(&intact));
}

#[test]
fn a_stuttering_clock_takes_samples_early_and_nothing_else() {
    let (stutter, steady) = (with_fault("clock-jitter", "").records, with_fault("none", "").records);
    assert_eq!(heights_m(&stutter)[..FAULT_START], heights_m(&steady)[..FAULT_START]);
    let off_m: Vec<f64> =
        heights_m(&stutter).iter().zip(heights_m(&steady)).map(|(a, b)| (a - b).abs()).collect();
    let during = &off_m[FAULT_START + 1..FAULT_START + FAULT_TICKS];
    // Up to half a tick at some centimetres a second, and the steps of the sensor.
    assert!(during.iter().copied().fold(0.0, f64::max) > 0.0);
    assert!(during.iter().copied().fold(0.0, f64::max) < 0.1e-3, "{during:?}");
}

#[test]
fn random_faults_come_at_their_rate_and_repeat_with_the_seed() {
    let random = "fault_rate_per_s = 20\nfault_duration_s = 0.001";
    let run = |duration_s| {
        let parameters = format!("preset = \"full\"\nfault = \"dropped-sample\"\n{random}");
        watch(&scene(duration_s, &parameters)).records
    };
    let (records, again) = (run(10.0), run(10.0));
    let stale = stale_ticks(&records);
    // 1 - e^-0.02 of ten thousand ticks are 198: four standard errors.
    assert!((stale.len() as f64 - 198.0).abs() < 4.0 * 198.0_f64.sqrt(), "{}", stale.len());
    assert_eq!(stale, stale_ticks(&again));
}

// ---------------------------------------------------------------- what the coils cannot give

#[test]
fn saturated_coils_are_counted_in_the_summary() {
    let scratch = Scratch::default();
    let text = "[[step]]\nmove = { to_mm = [3, 0, -8], duration_s = 1 }\n";
    let script = format!("hand_script={}", scratch.file("corner.toml", text).display());
    // Coils of 1 N each: the envelope lets through all they can give upwards, and then there is a force across.
    let weak = summary(&run_demo(&["preset=full", "coil_force_n=1", &script]));
    assert!(weak["events"]["saturated"].as_u64().is_some_and(|ticks| ticks > 100), "{}", weak["events"]);
    let strong = summary(&run_demo(&["preset=full", &script]));
    assert_eq!(strong["events"]["saturated"], Value::Null);
}

#[test]
fn the_plain_flotor_tells_when_more_than_its_limits_is_commanded() {
    let mut flotor = activated(&[], 1);
    let (mut state, tick) =
        (DeviceState::HOME, |index| Tick { index, time_ns: index * PERIOD_NS, dt_ns: PERIOD_NS });
    for (index, force_n, expected) in
        [(1, 1.0, Conditions::NONE), (2, 1.0e3, Conditions::SATURATED), (3, 1.0, Conditions::NONE)]
    {
        assert_eq!(flotor.write(&tick(index), &Wrench::from_force(DVec3::X * force_n)), Cycle::Fresh);
        let _ = flotor.read(&tick(index + 1), &mut state);
        assert_eq!(state.conditions, expected, "{force_n} N");
    }
}

// ---------------------------------------------------------------- parameters that are refused

#[test]
fn bad_parameters_are_refused_before_anything_moves_with_the_reason() {
    for (settings, reason) in [
        (&["mass_kg=-0.58"][..], "`mass_kg` = -0.58: must be 0.01 to 10 kg"),
        (&["mass_kg=nan"], "`mass_kg` = NaN: must be"),
        (&["mass_kg=heavy"], "`mass_kg` must be a number in kg, not `heavy`"),
        (&["inertia_z_kg_m2=0.5"], "no body has the moments of inertia"),
        (&["fault=sensor-loss"], "`fault` has no effect in preset `plain`"),
        (&["velocity=kalman", "preset=plain"], "set `preset` to `full` as well"),
        (&["mass_kg=1", "sensor_noise_um=5"], "`sensor_noise_um` has no effect in preset `plain`"),
        (&["preset=full", "led_2_deg=0"], "the three LEDs do not span a plane"),
        (&["preset=full", "led_2_deg=240", "led_3_deg=240"], "the three LEDs do not span a plane"),
        (&["preset=full", "coil_ring_a_deg=0"], "the wrenches of the six coils are linearly dependent"),
        (&["preset=full", "coil_ring_b_deg=0"], "the wrenches of the six coils are linearly dependent"),
        (&["hand_damping_ns_per_m=1000", "mass_kg=0.01", "hand_mass_kg=0"], "steps per millisecond"),
    ] {
        let ran = run_demo(settings);
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{settings:?}: {ran:?}");
        assert!(ran.error().contains(reason), "{settings:?}: {}", ran.error());
    }
}

// ---------------------------------------------------------------- the same bits

/// The flotor in this process, with these settings.
fn opened(settings: &[(&str, &str)]) -> Result<OpenedDevice, LoadError> {
    let plugin = load_file(&plugin_file("flotor-simulated"))?;
    let parse = |(id, value): &(&str, &str)| Setting::parse(plugin.parameters(), id, value).expect("legal");
    plugin.open_device(&settings.iter().map(parse).collect::<Vec<_>>())
}

fn activated(settings: &[(&str, &str)], seed: u64) -> flotor_loader::ActiveDevice {
    let device = opened(settings).expect("it opens");
    let Ok(device) = device.activate(&LoopConfig { period_ns: PERIOD_NS, seed }) else {
        panic!("it can be activated")
    };
    device
}

/// Everything random there is.
const UNSTEADY: [(&str, &str); 6] = [
    ("preset", "full"),
    ("hand_script", "push"),
    ("hand_tremor_um", "50"),
    ("hand_force_noise_percent", "4"),
    ("fault", "late-sample"),
    ("fault_rate_per_s", "10"),
];

/// A flotor on a spring of 1 N/mm that is stepped in stretches of ticks, on a new thread after each stretch; the
/// bits of every state.
fn trace(seed: u64, stretches: &[u64]) -> Vec<u64> {
    let mut device = activated(&UNSTEADY, seed);
    let (mut state, mut index, mut bits) = (DeviceState::HOME, 0, Vec::new());
    for ticks in stretches {
        let end = index + ticks;
        (device, state, bits) = std::thread::scope(|scope| {
            let stretch = scope.spawn(move || {
                for index in index..end {
                    let dt_ns = if index == 0 { 0 } else { PERIOD_NS };
                    let tick = Tick { index, time_ns: index * PERIOD_NS, dt_ns };
                    let _ = device.read(&tick, &mut state);
                    let numbers =
                        [state.pose.position_m, state.twist.linear_m_per_s, state.delivered.force_n];
                    bits.extend(numbers.as_flattened().iter().map(|number| number.to_bits()));
                    bits.push(state.sampled_ns);
                    let _ = device.write(&tick, &Wrench::from_force(state.pose.position() * -1000.0));
                }
                (device, state, bits)
            });
            stretch.join().expect("a stretch of ticks")
        });
        index = end;
    }
    bits
}

#[test]
fn a_run_may_be_cut_at_any_tick_and_gives_the_same_bits() {
    let whole = trace(1, &[1500]);
    assert_eq!(whole, trace(1, &[1500]));
    assert_eq!(whole, trace(1, &[1, 1, 998, 37, 463]));
    assert_eq!(whole, trace(1, &[500; 3]));
    assert_ne!(whole, trace(2, &[1500]), "the seed matters");
}

#[test]
fn runs_side_by_side_give_the_same_bits_as_one_after_the_other() {
    let seeds: Vec<u64> = (0..TestSize::of_this_run().pick(8, 64)).map(|seed| seed as u64).collect();
    let alone: Vec<_> = seeds.iter().map(|seed| trace(*seed, &[600])).collect();
    let together: Vec<_> = seeds.par_iter().map(|seed| trace(*seed, &[600])).collect();
    assert!(alone == together, "runs disturb each other");
}

#[test]
fn sessions_side_by_side_leave_the_same_records() {
    let run = |script: &&str| {
        let parameters = format!("preset = \"full\"\nhand_script = \"{script}\"\nhand_tremor_um = 50");
        let records = watch(&scene(0.5, &parameters)).records;
        // Measured times are left out.
        records
            .iter()
            .map(|record| (record.pose, record.twist, record.commanded, record.events))
            .collect::<Vec<_>>()
    };
    let scripts = ["press", "shear", "tilt", "tap"];
    let alone: Vec<_> = scripts.iter().map(run).collect();
    let together: Vec<_> = scripts.par_iter().map(run).collect();
    assert!(alone == together, "sessions disturb each other");
}
