//! The plugin of the Novint Falcon on an emulated device in another process: the rules of the contract, the demo, and the
//! vertical calibration.

use flotor_falcon_emulator::rig::{ERROR_PERCENT, WEIGHT_N};
use flotor_tests::TestSize;
use flotor_tests::library::{build_folder, plugin_file};
use flotor_tests::process::Owned;
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::stand_in::said_of_a_spring_on;
use flotor_tests::stand_in::{
    assert_every_rule_holds, assert_missing_torque_is_told, assert_runs_with_force, demo_on,
};
use rustix::process::Signal;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// The emulator in a process of its own; ended with the test.
pub(super) struct Emulator {
    process: Owned,
    pub(super) address: String,
}

impl Emulator {
    pub(super) fn start(arguments: &[&str]) -> Self {
        let program = build_folder().join(format!("flotor-falcon-emulator{}", std::env::consts::EXE_SUFFIX));
        let mut command = Command::new(program);
        let mut process = Owned::start(
            command
                .args(["--listen", "127.0.0.1:0"])
                .args(arguments)
                .stdout(Stdio::piped())
                .stderr(Stdio::piped()),
        );
        let output = process.stdout.take().expect("a pipe was requested");
        let address = BufReader::new(output)
            .lines()
            .map(|line| line.expect("its output is text"))
            .find_map(|line| line.strip_prefix("listening ").map(str::to_owned))
            .expect("a line says where it is");
        Self { process, address }
    }
}

#[test]
fn with_an_emulator_every_rule_is_checked_and_holds() {
    let emulator = Emulator::start(&[]);
    let address = format!("address={}", emulator.address);
    assert_every_rule_holds("flotor-falcon", &[&address, "timeout_ms=9000"]);
}

#[test]
fn a_torque_that_it_cannot_give_is_told_when_it_is_paired() {
    let emulator = Emulator::start(&[]);
    assert_missing_torque_is_told(|table| said_of_a_spring_on("falcon", &emulator.address, table));
}

/// The demo with the two lines of the device changed; then the cable is pulled.
#[test]
fn the_demo_runs_on_it_with_two_changed_lines_and_ends_when_it_is_gone() {
    let (emulator, scratch) = (Emulator::start(&[]), Scratch::default());
    let scene = demo_on(&scratch, "falcon", &format!("address = \"{}\"", emulator.address));
    let long = [&scene, "--set", "device.timeout_ms=9000"];
    assert_runs_with_force(&scratch, &[&long[..], &["--duration", "2s"]].concat(), &[]);

    let running = Flotor::with([&["run"], &long[..], &["--duration", "60s"]].concat()).start();
    std::thread::sleep(Duration::from_millis(1500));
    emulator.process.signal(Signal::KILL);
    let ran = running.wait();
    assert_eq!(ran.code, Some(exit_code::DEVICE_FAULT), "{ran:#?}");
    assert!(ran.stderr.contains("the device is gone"), "{ran:#?}");
}

/// `flotor calibrate` with this device, its force sensor, and patience for a delayed test machine.
fn calibrate(emulator: &Emulator, sensor: &Path, arguments: &[&str]) -> Ran {
    calibrate_with("falcon", emulator, sensor, arguments)
}

/// The same with the plugin of this id or file.
fn calibrate_with(plugin: &str, emulator: &Emulator, sensor: &Path, arguments: &[&str]) -> Ran {
    let (address, sensor) = (format!("address={}", emulator.address), sensor.display().to_string());
    let device = ["--device", plugin, "--set", &address, "--set", "timeout_ms=9000", "--sensor", &sensor];
    Flotor::with(["calibrate"].iter().chain(arguments).chain(&device)).run()
}

fn numbers(ran: &Ran, keys: [&str; 2]) -> [f64; 2] {
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    let report: serde_json::Value = serde_json::from_str(&ran.stdout).expect("the summary is JSON");
    keys.map(|key| report[key].as_f64().unwrap_or_else(|| panic!("{key} in {report}")))
}

/// The stand goes on with the commands: a delayed host misses no stop of it. It comes down twice, half a minute in all; at full size
/// three times more, to verify the file.
#[test]
fn it_is_calibrated_with_a_force_sensor_on_a_serial_port() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let scratch = Scratch::default();
    let (sensor, file) = (scratch.path().join("force"), scratch.path().join("mine.toml"));
    let (sensor_name, file_name) = (sensor.display().to_string(), file.display().to_string());
    let rig = ["--calibration-rig", &sensor_name, "--rig-stop-s", "0.6"];
    let emulator = Emulator::start(&rig);
    let plan = ["--steps", "7", "--step-mm", "2", "--runs", "1", "--readings", "2", "--json", "-"];
    let vertical = ["vertical", "--force", "4,6", "--out", &file_name];
    let ran = calibrate(&emulator, &sensor, &[&vertical[..], &plan].concat());
    let errors = ["error_before_percent", "error_after_percent"];
    // A count of an encoder is up to 40 um, on a curve that falls by 1.2 % a millimetre at most: 0.05 % at either end.
    let [before, after] = numbers(&ran, errors);
    println!("calibrate: {before:.3} % to {after:.3} %");
    assert!((before - ERROR_PERCENT).abs() < 0.1, "{before}");
    assert!(after <= 0.1, "{after}");
    let [weight_n, _] = numbers(&ran, ["weight_n", "residual_n"]);
    assert!((weight_n - WEIGHT_N).abs() < 0.05, "{weight_n}");
    if TestSize::of_this_run() < TestSize::Full {
        return;
    }

    let ran = calibrate(&emulator, &sensor, &["verify", &file_name, "--force", "5", "--json", "-"]);
    let [without, with] = numbers(&ran, errors);
    println!("verify: {without:.3} % to {with:.3} %");
    assert!((without - ERROR_PERCENT).abs() < 0.1, "{without}");
    assert!(with <= 0.1, "{with}");
}

/// A calibration file names the id of the plugin, also if the command line names its file.
#[test]
fn a_calibration_is_for_a_plugin_and_not_for_its_file() {
    let scratch = Scratch::default();
    let (sensor, file) = (scratch.path().join("force"), scratch.path().join("other.toml"));
    let (sensor_name, file_name) = (sensor.display().to_string(), file.display().to_string());
    let emulator = Emulator::start(&["--calibration-rig", &sensor_name]);
    let other = ["calibrate", "import", "--device", "falcon", "--serial", "other", "--out", &file_name];
    let ran = Flotor::with(other).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    let plugin = plugin_file("flotor-falcon").display().to_string();
    let ran = calibrate_with(&plugin, &emulator, &sensor, &["verify", &file_name]);
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
    let expected = "the file is for `falcon` other, the device is `falcon`";
    assert!(ran.error().contains(expected), "{}", ran.error());
}

/// What the motors cut off would be fitted as a loss.
#[test]
fn a_calibration_with_more_than_the_motors_have_says_so() {
    let scratch = Scratch::default();
    let sensor = scratch.path().join("force");
    let sensor_name = sensor.display().to_string();
    let emulator = Emulator::start(&["--calibration-rig", &sensor_name, "--rig-step-mm", "7"]);
    // Within what it declares as its limit, and above the 7.2 N that a word of 4095 gives upwards at 7 mm.
    let ran =
        calibrate(&emulator, &sensor, &["vertical", "--force", "7.5,8", "--steps", "7", "--step-mm", "2"]);
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
    assert!(ran.error().contains("N of the planned 7.5 N at 7.0 mm"), "{}", ran.error());
    let ran = calibrate(&emulator, &sensor, &["vertical"]);
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
    assert!(ran.error().contains("at most 8 N") && ran.error().contains("--force"), "{}", ran.error());
}
