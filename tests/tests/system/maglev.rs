//! The maglev plugin against its emulated controller, in processes of their own, over real links: equal trajectories
//! with the simulated flotor, and what happens when one side dies, hangs, or talks nonsense.

use flotor_core::trace::{Events, TickRecord};
use flotor_hal::{Cycle, DVec3, DeviceState, Fault, LoopConfig, Tick, Wrench};
use flotor_loader::Setting;
use flotor_maglev::protocol::stream::{Received, StreamDecoder, coded};
use flotor_maglev::protocol::{Answer, AnswerFrame, Mode, Request, RequestFrame, Status};
use flotor_servo::RunEnd;
use flotor_session::registry::load_file;
use flotor_tests::TestSize;
use flotor_tests::library::{build_folder, plugin_file, rules_of_a_device};
use flotor_tests::process::Owned;
use flotor_tests::program::{Flotor, Ran, Running, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::watched::{watch, watch_strong};
use flotor_tests::workspace_root;
use rustix::process::Signal;
use serialport::{SerialPort, TTYPort};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

fn program(name: &str) -> PathBuf {
    let file = build_folder().join(format!("{name}{}", std::env::consts::EXE_SUFFIX));
    assert!(
        file.is_file(),
        "{} is missing: run `cargo build`, or all tests with `cargo test`",
        file.display()
    );
    file
}

/// An emulated controller in a process of its own; ended with the test.
struct Emulator {
    child: Owned,
    lines: std::io::Lines<BufReader<ChildStdout>>,
    transport: &'static str,
    address: String,
}

impl Emulator {
    fn start(transport: &'static str, arguments: &[&str]) -> Self {
        Self::listening(transport, "127.0.0.1:0", arguments)
    }

    fn listening(transport: &'static str, at: &str, arguments: &[&str]) -> Self {
        Self::staying(transport, at, &[&["--once"], arguments].concat())
    }

    /// One that waits for the next host when one is gone.
    fn staying(transport: &'static str, at: &str, arguments: &[&str]) -> Self {
        let mut command = Command::new(program("flotor-maglev-emulator"));
        command.args(["--transport", transport, "--listen", at]).args(arguments);
        let mut child = Owned::start(command.stdout(Stdio::piped()));
        let output = child.stdout.take().expect("a pipe was requested");
        let mut lines = BufReader::new(output).lines();
        let first = lines
            .by_ref()
            .map(|line| line.expect("its output is text"))
            .find(|line| line.starts_with("listening"))
            .expect("the emulator says where it is");
        let address = first.rsplit(' ').next().expect("the last word is the address").to_owned();
        Self { child, lines, transport, address }
    }

    /// Reads lines until one holds all of the words.
    fn wait_for(&mut self, words: &[&str]) -> String {
        self.line_with(words)
            .unwrap_or_else(|seen| panic!("the emulator never said {words:?}, but {seen:#?}"))
    }

    /// The same, or all lines until its end.
    fn line_with(&mut self, words: &[&str]) -> Result<String, Vec<String>> {
        let mut seen = Vec::new();
        for line in self.lines.by_ref() {
            let line = line.expect("the emulator's output is text");
            if words.iter().all(|word| line.contains(word)) {
                return Ok(line);
            }
            seen.push(line);
        }
        Err(seen)
    }

    /// A controller, and a host that levitates its handle. Starts both again if the machine delays the host so long that the
    /// watchdog of the controller expires before.
    fn levitating(transport: &'static str, scratch: &Scratch) -> (Self, Owned) {
        for _ in 0..3 {
            let mut emulator = Self::start(transport, &[]);
            let host = emulator.host(scratch);
            match emulator.line_with(&["mode Levitating"]) {
                Ok(_) => return (emulator, host),
                Err(seen) => eprintln!("the handle did not levitate; started again: {seen:#?}"),
            }
        }
        panic!("the handle did not levitate with any of three hosts");
    }

    /// A scene on this controller. Timings are loose: a test machine may be delayed for long, and none of these
    /// tests is about how long.
    fn scene(&self, device: &str) -> String {
        let transport = if self.transport == "pty" { "serial" } else { self.transport };
        format!(
            "rate_hz = 1000\nduration_s = 60\n[limits]\nwatchdog_ms = 60000\n[device]\nplugin = \"maglev\"\n[device.parameters]\ntransport = \"{transport}\"\n\
             address = \"{}\"\nwatchdog_ms = 700\ntimeout_ms = 8000\n{device}\n[[model]]\nplugin = \"spring\"\n",
            self.address
        )
    }

    /// Starts a host that runs the scene in real time.
    fn host(&self, scratch: &Scratch) -> Owned {
        let scene = scratch.file("maglev.toml", self.scene(""));
        let mut command = Command::new(program("flotor"));
        command.arg("run").arg(scene).env("NO_COLOR", "1").stdout(Stdio::null()).stderr(Stdio::piped());
        Owned::start(&mut command)
    }
}

/// The number after `key=` in a line.
fn number(line: &str, key: &str) -> u64 {
    let rest = line.split(&format!("{key}=")).nth(1).unwrap_or_else(|| panic!("{key} in {line}"));
    rest.split(' ').next().and_then(|word| word.parse().ok()).unwrap_or_else(|| panic!("{key} in {line}"))
}

// ---------------------------------------------------------------- one scene, two devices

#[test]
fn one_scene_gives_one_trajectory_on_both_devices() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    // The finest published resolution of the device, and that over the radius of its bowl.
    const RESOLUTION_M: f64 = 2.0e-6;
    const RESOLUTION_RAD: f64 = RESOLUTION_M / 0.115;
    for preset in ["plain", "full"] {
        let tail = "\n[[model]]\nplugin = \"spring\"\n";
        let simulated = watch(&format!(
            "duration_s = 2\n[device]\nplugin = \"simulated\"\n[device.parameters]\npreset = \"{preset}\"\n{tail}"
        ));
        let emulator = Emulator::start("tcp", &["--pace", "lockstep", "--set", &format!("preset={preset}")]);
        let scene = emulator.scene("pace = \"lockstep\"").replace("duration_s = 60", "duration_s = 2");
        let maglev = watch(&scene);
        assert_eq!(simulated.records.len(), maglev.records.len());
        let mut moved_m: f64 = 0.0;
        for (a, b) in simulated.records.iter().zip(&maglev.records) {
            let apart_m = a.pose.position().distance(b.pose.position());
            let apart_rad = a.pose.orientation().angle_between(b.pose.orientation());
            assert!(apart_m <= RESOLUTION_M, "{preset}: {apart_m} m apart in tick {}", a.tick);
            // `angle_between` goes through acos, which loses half the digits near 0: 1.5e-8 at best.
            assert!(apart_rad <= RESOLUTION_RAD, "{preset}: {apart_rad} rad apart in tick {}", a.tick);
            moved_m = moved_m.max(a.pose.position().length());
        }
        assert!(moved_m > 2.0e-3, "the handle moved by {moved_m} m only: nothing was compared");
    }
}

// ---------------------------------------------------------------- calibration

/// `flotor calibrate`, with patience for a delayed test machine.
fn calibrate(emulator: &Emulator, sensor: &Path, arguments: &[&str]) -> Ran {
    start_calibrating(emulator, sensor, arguments).wait()
}

fn start_calibrating(emulator: &Emulator, sensor: &Path, arguments: &[&str]) -> Running {
    let address = format!("address={}", emulator.address);
    let device =
        ["--device", "maglev", "--set", &address, "--set", "watchdog_ms=700", "--set", "timeout_ms=8000"];
    let sensor = sensor.to_str().expect("a scratch folder has a plain name");
    let sensor = ["--sensor", sensor, "--sensor-set", "timeout_ms=20000"];
    Flotor::with(["calibrate"].iter().chain(arguments).chain(&device).chain(&sensor)).start()
}

/// In lockstep, on an emulated stand: the controller waits for a delayed host, and so does the stand. The file is a calibration of a
/// device with this serial number.
fn calibrate_on_the_stand(protocol: &[&str], settings: &[&str], serial: &str, ended: &str) {
    let scratch = Scratch::default();
    let (sensor, file) = (scratch.path().join("force"), scratch.path().join("mine.toml"));
    let [sensor_name, file_name] =
        [&sensor, &file].map(|path| path.to_str().expect("a scratch folder has a plain name"));
    let rig = ["--calibration-rig", sensor_name, "--rig-step-mm", "2", "--rig-stop-s", "0.8"];
    let mut emulator =
        Emulator::staying("tcp", "127.0.0.1:0", &[&["--pace", "lockstep"], protocol, &rig[..]].concat());
    let plan =
        ["vertical", "--steps", "7", "--step-mm", "2", "--runs", "1", "--readings", "2", "--json", "-"];
    let to = ["--out", file_name, "--set", "pace=lockstep"];
    let ran = calibrate(&emulator, &sensor, &[&plan[..], &to, settings].concat());
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    let report: serde_json::Value = serde_json::from_str(&ran.stdout).expect("the summary is JSON");
    let number = |key: &str| report[key].as_f64().unwrap_or_else(|| panic!("{key} in {report}"));
    // The field's error is 10.87 % over exactly 14 mm; the stand gives way by at most 0.3 mm, at the steep end of 1.1 %
    // a millimetre.
    assert!((number("error_before_percent") - 10.87).abs() < 0.4, "{report}");
    assert!(number("error_after_percent") <= 0.5, "{report}");
    assert!((number("weight_n") - 8.58).abs() < 0.05, "{report}");
    emulator.wait_for(&[ended]);
    let text = std::fs::read_to_string(&file).expect("the file was written");
    let serial = format!("serial = \"{serial}\"");
    assert!(text.contains("plugin = \"maglev\"") && text.contains(&serial), "{text}");
}

#[test]
#[ignore = "a stand that moves for 25 s, and wants both cores: .ci/full runs it alone"]
fn a_device_is_calibrated_with_a_force_sensor_on_a_serial_port() {
    calibrate_on_the_stand(&[], &[], "emulated", "mode Disarmed");
}

#[test]
#[ignore = "a stand that moves for 25 s, and wants both cores: .ci/full runs it alone"]
fn a_device_is_calibrated_over_the_ml_api() {
    let settings = ["--set", "protocol=ml-api", "--set", "gravity=off"];
    let protocol = ["--protocol", "ml-api"];
    calibrate_on_the_stand(&protocol, &settings, "ml-api 1.5b-flotor", "flight Landed");
}

#[test]
fn a_calibration_that_cannot_be_says_why_and_lets_the_handle_down() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let scratch = Scratch::default();
    let sensor = scratch.path().join("force");
    let rig = ["--calibration-rig", sensor.to_str().unwrap(), "--rig-stop-s", "60"];
    // The stand stays at the top: 5 mm is where nobody brings it.
    let mut emulator = Emulator::listening("tcp", "127.0.0.1:0", &rig);
    let ran = calibrate(&emulator, &sensor, &["vertical", "--steps", "10", "--patience", "3s"]);
    assert_eq!(ran.code, Some(exit_code::OTHER), "{ran:#?}");
    assert!(ran.error().contains("did not come to rest at 5.00 mm within the time limit"), "{}", ran.error());
    emulator.wait_for(&["mode Disarmed"]);
    // Nobody holds the handle, and the sensor is somewhere else: 10 N on 7.7 N that are carried already.
    let _elsewhere = Emulator::listening("tcp", "127.0.0.1:0", &rig);
    let mut emulator = Emulator::listening("tcp", "127.0.0.1:0", &["--set", "hand=open"]);
    let ran = calibrate(&emulator, &sensor, &["vertical", "--patience", "60s"]);
    assert_eq!(ran.code, Some(exit_code::OTHER), "{ran:#?}");
    assert!(ran.error().contains("lost contact with the force sensor"), "{}", ran.error());
    emulator.wait_for(&["mode Disarmed"]);
    let emulator = Emulator::listening("tcp", "127.0.0.1:0", &[]);
    let ran = calibrate(&emulator, &sensor, &["vertical", "--force", "10,30"]);
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
    assert!(
        ran.error().contains("the plan needs 30 N; device and host exert at most 20 N"),
        "{}",
        ran.error()
    );
    let missing = scratch.path().join("nowhere");
    let ran = calibrate(&emulator, &missing, &["vertical"]);
    assert!(ran.error().contains("cannot open the force sensor at"), "{}", ran.error());
    let ran = calibrate(&emulator, Path::new("/dev/null"), &["vertical"]);
    assert!(
        ran.error()
            .contains("cannot open the force sensor at /dev/null: the file is not a usable serial port"),
        "{}",
        ran.error()
    );
    for (set, words) in [
        ("timout_ms=50", "--sensor-set timout_ms: no parameter"),
        ("port=/dev/null", "--sensor-set port: omit this option; `--sensor PORT` sets the port"),
    ] {
        let ran = calibrate(&emulator, &sensor, &["vertical", "--sensor-set", set]);
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
        assert!(ran.error().contains(words), "{}", ran.error());
    }
    // A port that nobody answers at, for as long as the setting says.
    let (_silent, port) = TTYPort::pair().expect("the system has pseudo terminals");
    let port = port.name().expect("a pseudo terminal has a path");
    let sensor = ["--sensor", &port, "--sensor-set", "timeout_ms=50"];
    let ran = Flotor::with(["calibrate", "vertical", "--device", "maglev"].iter().chain(&sensor)).run();
    assert!(ran.error().contains("does not answer within 50 ms"), "{}", ran.error());
    let ran = Flotor::with(["calibrate", "vertical", "--device", "maglev"]).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
}

#[test]
fn a_calibration_that_is_broken_off_lets_the_handle_down() {
    let scratch = Scratch::default();
    let (sensor, file) = (scratch.path().join("force"), scratch.path().join("mine.toml"));
    let rig = ["--calibration-rig", sensor.to_str().unwrap(), "--rig-stop-s", "60"];
    let mut emulator = Emulator::listening("tcp", "127.0.0.1:0", &rig);
    let running = start_calibrating(&emulator, &sensor, &["vertical", "--out", file.to_str().unwrap()]);
    emulator.wait_for(&["mode Levitating"]);
    std::thread::sleep(Duration::from_millis(300));
    running.signal(Signal::INT);
    let ran = running.wait();
    assert_eq!(ran.code, Some(exit_code::OTHER), "{ran:#?}");
    assert!(ran.error().contains("the calibration was aborted; the handle was lowered"), "{}", ran.error());
    assert!(!file.exists());
    // Told to let go, not found dead.
    let line = emulator.wait_for(&["mode Disarmed"]);
    assert!(!line.contains("faults="), "{line}");
}

#[test]
fn excess_force_is_one_event_with_a_beginning_and_an_end() {
    // A stiff hand presses 8 mm into a spring of 13.6 N/mm: 65 N, more than the 50 N at which one should be warned.
    let hand = ["hand=press", "hand_depth_mm=8", "hand_stiffness_n_per_m=20000", "hand_damping_ns_per_m=200"];
    let hand: Vec<&str> = hand.iter().flat_map(|setting| ["--set", *setting]).collect();
    let emulator = Emulator::start("tcp", &[&["--pace", "lockstep"], hand.as_slice()].concat());
    let scene = emulator.scene("pace = \"lockstep\"").replace("duration_s = 60", "duration_s = 1.5");
    let records = watch_strong(&format!("{scene}[model.mapping]\nforce_scale = 20.0\n")).records;
    let warned: Vec<bool> =
        records.iter().map(|record| record.events.intersects(Events::EXCESS_FORCE)).collect();
    assert_eq!((warned.first(), warned.last()), (Some(&false), Some(&true)));
    assert_eq!(warned.windows(2).filter(|pair| pair[0] != pair[1]).count(), 1, "one warning, not one a tick");
}

#[test]
fn equal_runs_over_a_link_are_equal_to_the_bit() {
    let run = || {
        let emulator = Emulator::start("tcp", &["--pace", "lockstep", "--set", "preset=full"]);
        let scene = emulator.scene("pace = \"lockstep\"").replace("duration_s = 60", "duration_s = 0.5");
        let records = watch(&scene).records;
        records.iter().map(|record| (record.pose, record.twist, record.commanded)).collect::<Vec<_>>()
    };
    assert!(run() == run());
}

// ---------------------------------------------------------------- one side is gone

#[test]
fn a_killed_host_disarms_the_controller() {
    for transport in ["tcp", "pty"] {
        let scratch = Scratch::default();
        let (mut emulator, mut host) = Emulator::levitating(transport, &scratch);
        host.signal_host(Signal::KILL);
        let line = emulator.wait_for(&["mode Disarmed", "link-lost"]);
        // Long before the watchdog of 700 ms could have seen anything.
        assert!(number(&line, "silence_us") < 700_000, "{transport}: {line}");
        emulator.wait_for(&["closed rejected=0"]);
        let _ = host.wait();
    }
}

/// Suspends a host in flight until the controller has given it up, and lets it go on.
fn hang_and_wake_a_host(transport: &'static str) {
    let scratch = Scratch::default();
    let (mut emulator, host) = Emulator::levitating(transport, &scratch);
    host.signal_host(Signal::STOP);
    let line = emulator.wait_for(&["mode Holding", "watchdog"]);
    // By the controller's own clock, which is what the bound is about: watchdog and two milliseconds.
    assert!((700_000..=702_000).contains(&number(&line, "silence_us")), "{transport}: {line}");
    emulator.wait_for(&["mode Landing"]);
    emulator.wait_for(&["mode Fault", "watchdog"]);
    host.signal_host(Signal::CONT);
    let output = host.output();
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(exit_code::DEVICE_FAULT), "{transport}: {error}");
    assert!(error.contains("device fault"), "{transport}: {error}");
}

#[test]
fn a_hung_host_loses_its_session_and_is_told_when_it_wakes_up() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    // Both at once: most of it is waiting.
    std::thread::scope(|scope| {
        scope.spawn(|| hang_and_wake_a_host("pty"));
        hang_and_wake_a_host("tcp");
    });
}

#[test]
fn a_controller_that_vanishes_is_a_fault_of_the_device() {
    for transport in ["tcp", "pty"] {
        let scratch = Scratch::default();
        let (emulator, host) = Emulator::levitating(transport, &scratch);
        // The host has to hear of it too, or it is not running yet.
        std::thread::sleep(Duration::from_millis(300));
        emulator.child.signal(Signal::KILL);
        let output = host.output();
        let error = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(exit_code::DEVICE_FAULT), "{transport}: {error}");
        assert!(error.contains("the device is gone; check cable and power"), "{transport}: {error}");
    }
}

#[test]
fn a_cable_pulled_in_mid_stroke_is_a_fault_at_once_and_the_next_use_begins_anew() {
    let plugin = load_file(&plugin_file("flotor-maglev")).expect("it loads");
    let config = LoopConfig { period_ns: 1_000_000, seed: 1 };
    let scratch = Scratch::default();
    for transport in ["tcp", "pty"] {
        // A name that is the same after the cable is back.
        let tty = scratch.path().join("tty");
        let tty = tty.to_str().expect("a scratch folder has a plain name");
        let link = if transport == "pty" { vec!["--link", tty] } else { Vec::new() };
        let mut emulator = Emulator::start(transport, &link);
        let address = if transport == "pty" { tty.to_owned() } else { emulator.address.clone() };
        let kind = if transport == "pty" { "serial" } else { "tcp" };
        let settings =
            [("transport", kind), ("address", &*address), ("timeout_ms", "8000"), ("watchdog_ms", "700")];
        let settings = settings
            .map(|(key, value)| Setting::parse(plugin.parameters(), key, value).expect("it is legal"));
        let mut device = Some(plugin.open_device(&settings).expect("the controller is there"));
        for stroke in 0..2 {
            if stroke > 0 {
                let at = if transport == "tcp" { &*address } else { "127.0.0.1:0" };
                emulator = Emulator::listening(transport, at, &link);
            }
            let opened = device.take().expect("the device was given back");
            let mut active = opened.activate(&config).map_err(|(_, refusal)| refusal).expect("it takes off");
            let mut index = 0;
            let mut tick = |force_n: f64| {
                let tick = Tick { index, time_ns: index * 1_000_000, dt_ns: 1_000_000 };
                index += 1;
                let mut state = DeviceState::HOME;
                let read = active.read(&tick, &mut state);
                let written = active.write(&tick, &Wrench::from_force(DVec3::Z * force_n));
                std::thread::sleep(Duration::from_millis(1));
                [read, written].into_iter().find_map(|cycle| match cycle {
                    Cycle::Fault(fault) => Some(fault),
                    Cycle::Fresh | Cycle::Stale => None,
                })
            };
            assert!((0..100).all(|_| tick(3.0).is_none()), "{transport}");
            emulator.child.signal(Signal::KILL);
            emulator.child.wait().expect("it was killed");
            // 20 ms are 20 ticks; counted, because this machine's clock is nobody's own.
            let ticks = (1..).find(|_| tick(3.0).is_some()).expect("the search has no end");
            assert!(ticks <= 20, "{transport}: a fault in tick {ticks} after the cable was pulled");
            assert_eq!(tick(3.0), Some(Fault::Disconnected), "{transport}: and it stays one");
            device = active.deactivate();
        }
    }
}

#[test]
fn where_no_controller_is_one_line_says_so() {
    let scratch = Scratch::default();
    for (device, words) in [
        ("address = \"127.0.0.1:1\"", "no controller at 127.0.0.1:1"),
        ("address = \"here\"", "is not valid; write host:port"),
        ("transport = \"serial\"\naddress = \"/dev/no-such-port\"", "no controller at /dev/no-such-port"),
    ] {
        let scene = scratch
            .file("nobody.toml", format!("[device]\nplugin = \"maglev\"\n[device.parameters]\n{device}\n"));
        let scene = scene.to_str().expect("a scratch folder has a plain name");
        let ran = flotor_tests::program::Flotor::with(["run", scene]).run();
        assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{ran:#?}");
        assert!(ran.error().contains(words), "{}", ran.error());
    }
}

#[test]
fn validation_says_what_it_could_not_check_without_a_controller() {
    let plugin = plugin_file("flotor-maglev");
    let plugin = plugin.to_str().expect("the build folder has a plain name");
    // The default address: whoever has a controller there checks more.
    if TcpStream::connect("127.0.0.1:5679").is_ok() {
        return;
    }
    let ran = flotor_tests::program::Flotor::with(["validate", plugin]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    assert!(ran.stdout.contains("ok      schema") && ran.stdout.contains("?       lifecycle"), "{ran:#?}");
    assert!(
        // Metadata, loading and schema need no device.
        ran.stdout.contains(&format!(
            "{} of {} rules could not be checked: no controller at 127.0.0.1:5679",
            rules_of_a_device() - 3,
            rules_of_a_device()
        )),
        "{ran:#?}"
    );
}

#[test]
fn with_a_controller_every_rule_is_checked_and_holds() {
    let emulator = Emulator::staying("tcp", "127.0.0.1:0", &[]);
    let library = plugin_file("flotor-maglev").display().to_string();
    let address = format!("address={}", emulator.address);
    let sets = ["--set", &address, "--set", "timeout_ms=8000", "--set", "watchdog_ms=700"];
    let ran = Flotor::with(["validate", &library, "--timeout", "60s"].iter().chain(&sets)).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    assert_eq!(ran.stdout.matches("  ok ").count(), rules_of_a_device(), "{}", ran.stdout);
    let ran = Flotor::with(["validate", &library, "--set", "addres=1"]).run();
    assert!(ran.stdout.contains("did you mean `address`?"), "{}", ran.stdout);
}

// ---------------------------------------------------------------- frames that are right and samples that cannot be

/// Between a host and a controller: passes on what both say, but makes each status in flight after the first so many a lie.
struct LyingLine {
    address: String,
    /// Requests of the host, each with the number of statuses in flight that had been passed on before.
    requests: Arc<Mutex<Vec<(u32, Request)>>>,
}

impl LyingLine {
    /// Statuses in flight that stay as they are.
    const HONEST: u32 = 500;

    fn to(controller: &str, mut lie: impl FnMut(u32, &mut Status) + Send + 'static) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("there is a free port");
        let address = listener.local_addr().expect("it is bound").to_string();
        let requests = Arc::new(Mutex::new(Vec::new()));
        let (kept, controller) = (Arc::clone(&requests), controller.to_owned());
        std::thread::spawn(move || {
            let (mut host, _) = listener.accept().expect("the host connects");
            let mut there = TcpStream::connect(controller).expect("the controller listens");
            for end in [&host, &there] {
                end.set_nodelay(true).expect("it is a connection");
            }
            let both = (host.try_clone().expect("a handle"), there.try_clone().expect("a handle"));
            let in_flight = Arc::new(AtomicU32::new(0));
            let passed = Arc::clone(&in_flight);
            std::thread::spawn(move || {
                let (mut from, mut to) = both;
                pass_on(&mut from, &mut to, |packet| {
                    if let Ok(frame) = RequestFrame::decode(&packet) {
                        let after = passed.load(Ordering::SeqCst);
                        kept.lock().expect("nobody panics with it").push((after, frame.request));
                    }
                    packet
                });
            });
            pass_on(&mut there, &mut host, |packet| {
                let Ok(mut frame) = AnswerFrame::decode(&packet) else { return packet };
                let Answer::Status(status) = &mut frame.answer else { return packet };
                if status.mode != Mode::Levitating {
                    return packet;
                }
                let number = in_flight.fetch_add(1, Ordering::SeqCst);
                if number >= Self::HONEST {
                    lie(number, status);
                }
                frame.encode()
            });
        });
        Self { address, requests }
    }
}

/// Passes packets on until one end is closed.
fn pass_on(from: &mut TcpStream, to: &mut TcpStream, mut change: impl FnMut([u8; 64]) -> [u8; 64]) {
    let (mut decoder, mut chunk) = (StreamDecoder::default(), [0; 512]);
    while let Ok(length @ 1..) = from.read(&mut chunk) {
        for byte in &chunk[..length] {
            let Some(Received::Packet(packet)) = decoder.push(*byte) else { continue };
            let (bytes, length) = coded(&change(packet));
            if to.write_all(&bytes[..length]).is_err() {
                return;
            }
        }
    }
    let _ = to.shutdown(std::net::Shutdown::Both);
}

#[test]
fn a_controller_whose_poses_cannot_be_loses_the_force_and_the_run() {
    type Lie = fn(u32, &mut Status);
    let lies: [(&str, Lie); 3] = [
        ("range", |_, status| status.position_m[2] = -1.0e30),
        ("range", |_, status| status.rotation_xyz = [0.0, 0.0, 1.0]),
        ("speed", |number, status| {
            // A linear congruential generator (Knuth's MMIX), its top bit.
            let drawn = u64::from(number).wrapping_mul(6_364_136_223_846_793_005);
            let drawn = (drawn ^ (drawn >> 29)).wrapping_mul(6_364_136_223_846_793_005);
            status.position_m[2] = if drawn >> 63 == 0 { 0.011 } else { -0.011 };
        }),
    ];
    for (why, lie) in lies {
        // In lockstep, so that it takes as many ticks on every machine.
        let emulator = Emulator::start("tcp", &["--pace", "lockstep"]);
        let line = LyingLine::to(&emulator.address, lie);
        let scene = emulator.scene("pace = \"lockstep\"").replace(&emulator.address, &line.address);
        let run = watch(&scene.replace("duration_s = 60", "duration_s = 2"));
        assert_eq!(run.outcome.end, RunEnd::DeviceFault(Fault::Protocol), "{why}");
        let (_, words) = run.outcome.faulted().expect("it is faulty");
        assert!(words.contains(&format!(" implausible samples ({why} ")), "{words}");
        let first = run.outcome.devices[0].implausible.first_tick().expect("there is one");
        let force_n = |record: &TickRecord| record.commanded.force().length();
        assert!(run.records.iter().any(|record| record.tick < first && force_n(record) > 0.5), "the control");
        let lost = run.records.iter().find(|record| record.events.intersects(Events::HOLDING));
        let lost = lost.expect("it was not believed").tick;
        assert!(lost >= first + 10 && lost < first + 50, "{why}: {first} to {lost}");
        assert!(
            run.records.iter().filter(|record| record.tick > lost + 30).all(|record| force_n(record) == 0.0)
        );

        // What the controller itself was told: more before, and in the end nothing.
        let requests = line.requests.lock().expect("nobody panics with it");
        let commanded = |request: &Request| match request {
            Request::Command { wrench, .. } => Some(wrench.map(f64::from)),
            _ => None,
        };
        let strongest =
            requests.iter().filter_map(|(_, request)| commanded(request)).map(|[.., z, _, _, _]| z.abs());
        assert!(strongest.fold(0.0, f64::max) > 0.5, "{why}: the control");
        let late = u32::try_from(lost - first + 40).expect("a small number") + LyingLine::HONEST;
        let later =
            requests.iter().filter(|(after, _)| *after > late).filter_map(|(_, request)| commanded(request));
        let later: Vec<[f64; 6]> = later.collect();
        assert!(later.len() > 20 && later.iter().all(|wrench| *wrench == later[0]), "{why}: {later:?}");
        assert!(matches!(requests.last(), Some((_, Request::Disarm))), "{why}: {:?}", requests.last());
    }
}

// ---------------------------------------------------------------- nonsense

#[test]
fn noise_on_the_line_is_counted_and_moves_nothing() {
    let mut emulator = Emulator::start("tcp", &[]);
    let mut stream = TcpStream::connect(&emulator.address).expect("the emulator listens");
    let mut seed = 1_u32;
    let noise: Vec<u8> = std::iter::repeat_with(|| {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (seed >> 24) as u8
    })
    .take(20_000)
    .chain([0])
    .collect();
    stream.write_all(&noise).expect("the emulator takes bytes");
    stream.shutdown(std::net::Shutdown::Write).expect("the connection is open");
    // It closes when it has read all of it; no mode line comes before that.
    let line =
        emulator.lines.by_ref().map(|line| line.expect("text")).find(|line| !line.starts_with("connected"));
    let line = line.expect("the emulator says what it rejected");
    assert!(line.starts_with("closed") && number(&line, "rejected") >= 20, "{line}");
}

/// The book's first command for a person at a device, with the book's scene of that device.
#[test]
fn a_study_runs_with_the_scene_of_the_book() {
    let book = workspace_root().join("docs/src");
    let read = |chapter: &str| std::fs::read_to_string(book.join(chapter)).expect("a chapter of the book");
    let page = read("devices/maglev.md");
    let (_, rest) =
        page.split_once("<!-- test: file maglev.toml -->\n```toml\n").expect("the scene of the book");
    let (scene, _) = rest.split_once("```").expect("its end");
    let command = "flotor study jnd --observer human --subject 3 --scene maglev.toml --out people";
    assert!(read("experiments.md").contains(command), "the book has another command");
    // The scene is tried with several stimuli before the sitting.
    let emulator = Emulator::staying("tcp", "127.0.0.1:0", &[]);
    let scratch = Scratch::default();
    // A busy machine may answer late.
    let scene = scene
        .replace(
            "\"127.0.0.1:5679\"",
            &format!("\"{}\"\nwatchdog_ms = 700\ntimeout_ms = 8000", emulator.address),
        )
        .replace("[limits]", "[limits]\nwatchdog_ms = 60000");
    let _ = scratch.file("maglev.toml", scene);
    let words = command.split_whitespace().skip(1);
    let more =
        ["--screen", "terminal", "--noise", "off", "--no-demo", "--least-time=0s", "--least-movement-mm=0"];
    let ran = Flotor::with(words.chain(more)).inside(scratch.path()).reading("\n\n\n1\nq\n").run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    assert!(ran.stdout.contains("sub-03 stopped after 1 presentations"), "{ran:?}");
}
