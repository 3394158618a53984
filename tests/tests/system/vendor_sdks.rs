//! Devices over a vendor's SDK. Behind their plugins stand, in turn, Flotor's own drop-in libraries on the simulated flotor, so
//! that an error of one side shows at the other, and small libraries in C with one thing wrong each.

use flotor_core::grip::GripRecord;
use flotor_core::trace::{Events, TickRecord};
use flotor_hal::{DVec3, rotation_vector};
use flotor_record::Recording;
use flotor_tests::library::{build_folder, compile_c_file, plugin_file, rules_of_a_device};
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::stand_in::{assert_missing_torque_is_told, assert_runs_with_force, demo_on};
use flotor_tests::tools::{self, Tool};
use flotor_tests::{TestSize, workspace_root};
use std::path::{Path, PathBuf};

/// A plugin and what stands in for its SDK.
#[derive(Clone, Copy)]
struct Api {
    id: &'static str,
    package: &'static str,
    /// Flotor's drop-in library.
    drop_in: &'static str,
    /// The library with one thing wrong.
    source: &'static str,
    /// Rounding of a number on its way: none, or that of millimetres and single precision.
    rounding: f64,
}

const DHD: Api = Api {
    id: "force-dimension",
    package: "flotor-force-dimension",
    drop_in: "libdrd.so",
    source: "dhd.c",
    rounding: 1.0e-12,
};
const HD: Api =
    Api { id: "openhaptics", package: "flotor-touch", drop_in: "libHD.so", source: "hd.c", rounding: 1.0e-7 };
const APIS: [Api; 2] = [DHD, HD];

impl Api {
    fn drop_in(&self) -> PathBuf {
        build_folder().join("deps").join(self.drop_in)
    }

    /// The library with one thing wrong, which macros say.
    fn broken(&self, scratch: &Scratch, name: &str, macros: &[&str]) -> PathBuf {
        let library = scratch.path().join(format!("lib{name}.so"));
        compile_c_file(&workspace_root().join("tests/c/sdks").join(self.source), macros, &library);
        library
    }

    /// A scene with this device, of its parameters and a model.
    fn scene(&self, scratch: &Scratch, duration_s: f64, parameters: &str, rest: &str) -> PathBuf {
        let text = format!(
            "duration_s = {duration_s}\n{rest}\n[device]\nplugin = \"{}\"\n[device.parameters]\n{parameters}\n",
            self.id
        );
        scratch.file(&format!("{}.toml", self.id), text)
    }
}

/// What is behind a drop-in library: the simulated flotor, with a hand that does this.
fn simulated(scratch: &Scratch, hand: &str) -> PathBuf {
    let text = format!(
        "[device]\nplugin = \"simulated\"\n[device.parameters]\npreset = \"plain\"\nhand = \"{hand}\"\n\
         [limits]\nforce_n = 8\ntorque_nm = 0.15\nwatchdog_ms = 60000\n[[model]]\nplugin = \"program\"\n"
    );
    scratch.file("simulated.toml", text)
}

/// The records of both sides of a circle: the plugin's host, and the simulated flotor's.
struct Circle {
    ran: Ran,
    outside: Vec<TickRecord>,
    inside: Vec<TickRecord>,
}

impl Circle {
    /// Runs a scene over a drop-in library.
    fn run(scratch: &Scratch, scene: &Path, hand: &str, pace: &str) -> Self {
        let [outside, inside] = ["outside", "inside"].map(|side| scratch.path().join(format!("{side}.mcap")));
        let clock = if pace == "lockstep" { "virtual" } else { "real" };
        let scene = scene.display().to_string();
        let ran = Flotor::with(["run", &scene, "--clock", clock, "--record", &outside.display().to_string()])
            .env("FLOTOR_SCENE", &simulated(scratch, hand).display().to_string())
            .env("FLOTOR_PACE", pace)
            .env("FLOTOR_RECORD", &inside.display().to_string())
            .run();
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
        let [outside, inside] = [outside, inside].map(|file| records(&file));
        Self { ran, outside, inside }
    }

    /// How many ticks of the flotor came before the first sample of the plugin: those of its start.
    fn ticks_before(&self) -> usize {
        let gap = |before: usize| {
            let pairs = self.outside.iter().zip(self.inside.iter().skip(before));
            pairs.map(|(outside, inside)| pose_gap(outside, inside)).fold(0.0, f64::max)
        };
        (0..8).min_by(|a, b| gap(*a).total_cmp(&gap(*b))).expect("there are some")
    }
}

fn records(file: &Path) -> Vec<TickRecord> {
    let recording = Recording::open(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    recording.map(|record| record.expect("it is whole")).collect()
}

/// Distance of two poses, m and rad, whichever is greater.
fn pose_gap(a: &TickRecord, b: &TickRecord) -> f64 {
    let turned = rotation_vector(a.pose.orientation() * b.pose.orientation().conjugate()).length();
    (a.pose.position() - b.pose.position()).length().max(turned)
}

/// Difference of what one host sent to its device and what the models of the other one got, N and N·m, whichever is greater.
fn wrench_gap(sent: &TickRecord, got: &TickRecord) -> f64 {
    let got = got.model.wrench().expect("a recording stores both");
    let sent = &sent.commanded;
    (sent.force() - got.force()).length().max((sent.torque() - got.torque()).length())
}

/// Displacement of a record from another, m and rad.
fn moved(from: &TickRecord, to: &TickRecord) -> [f64; 6] {
    let turned = rotation_vector(to.pose.orientation() * from.pose.orientation().conjugate());
    let DVec3 { x, y, z } = to.pose.position() - from.pose.position();
    [x, y, z, turned.x, turned.y, turned.z]
}

/// The grip of the simulated flotor is the gripper of the drop-in library, and that is the grip of the plugin.
#[test]
fn a_thing_between_the_fingers_is_felt_through_the_gripper_of_the_sdk() {
    let scratch = Scratch::default();
    let device = format!("library = {:?}\nstand_in = true\npace = \"lockstep\"", DHD.drop_in());
    let load = "[[model]]\nplugin = \"load\"\n[model.parameters]\nforce_n = 0\ngrip_stiffness_n_per_m = 500";
    let scene = DHD.scene(&scratch, 2.0, &format!("{device}\n{load}"), "");
    let circle = Circle::run(&scratch, &scene, "hold\"\nfingers = \"on", "lockstep");
    let grips = |records: &[TickRecord]| -> Vec<GripRecord> {
        records.iter().map(|record| record.grip.expect("it has a grip")).collect()
    };
    let (outside, inside) = (grips(&circle.outside), grips(&circle.inside));
    let gap_m = |before: usize| {
        let pairs = outside.iter().zip(inside.iter().skip(before));
        pairs
            .map(|(outside, inside)| (outside.state.opening - inside.state.opening).abs())
            .fold(0.0, f64::max)
    };
    // The flotor has some ticks before the first sample of the plugin.
    assert!((0..8).any(|before| gap_m(before) <= DHD.rounding), "{}", gap_m(0));
    let most = |efforts: &mut dyn Iterator<Item = f64>| efforts.fold(0.0, f64::max);
    let sent_n = most(&mut outside.iter().map(|grip| grip.commanded));
    let got_n = most(&mut inside.iter().map(|grip| grip.model));
    let read_n = most(&mut outside.iter().map(|grip| grip.state.delivered));
    assert!(sent_n > 1.0 && (sent_n - got_n).abs() <= DHD.rounding, "{sent_n} sent, {got_n} arrived");
    assert!((sent_n - read_n).abs() <= DHD.rounding, "{sent_n} sent, {read_n} read back");
}

#[test]
fn a_press_along_each_axis_moves_the_simulated_flotor_along_it_and_comes_back() {
    if !tools::required(Tool::Cc) {
        return;
    }
    // A newton, and a force that single precision has to round.
    for (api, press_n) in APIS.into_iter().flat_map(|api| [(api, 1.0), (api, 0.3)]) {
        let scratch = Scratch::default();
        let model = scratch.path().join("libpress.so");
        compile_c_file(&workspace_root().join("tests/c/press.c"), &[&format!("PRESS_N={press_n:?}")], &model);
        let device = format!("library = {:?}\nstand_in = true\npace = \"lockstep\"", api.drop_in());
        let scene = api.scene(&scratch, 4.0, &format!("{device}\n[[model]]\nplugin = {model:?}"), "");
        let circle = Circle::run(&scratch, &scene, "hold", "lockstep");
        assert_eq!(circle.outside.len(), 4000);
        let before = circle.ticks_before();
        let (mut worst_pose, mut worst_wrench, mut most_n) = (0.0_f64, 0.0_f64, 0.0_f64);
        for (outside, inside) in circle.outside.iter().zip(&circle.inside[before..]) {
            worst_pose = worst_pose.max(pose_gap(outside, inside));
        }
        // The wrench that answers a sample acts in the next tick of the flotor. The drop-in's ramp of 200 ms is over by then.
        let answers = circle.outside.iter().zip(&circle.inside[before + 1..]).skip(300);
        for (outside, inside) in answers {
            worst_wrench = worst_wrench.max(wrench_gap(outside, inside));
            most_n = most_n.max(inside.commanded.force().length());
            // What the device says it gave, one tick later.
            assert!(!inside.events.intersects(Events::FORCE_LIMITED), "{inside:?}");
        }
        println!(
            "{} at {press_n} N: pose {worst_pose:.1e}, wrench {worst_wrench:.1e}, {before} ticks before",
            api.id
        );
        assert!(worst_pose <= api.rounding, "{}: {worst_pose}", api.id);
        assert!(worst_wrench <= api.rounding, "{}: {worst_wrench}", api.id);
        assert!((most_n - press_n).abs() < 1.0e-6, "{}: the flotor felt {most_n} N", api.id);
        for axis in 0..6 {
            let begin = 400 + 600 * axis;
            for side in [&circle.outside[..], &circle.inside[before..]] {
                let displaced = moved(&side[begin], &side[begin + 299]);
                let along = displaced[axis];
                assert!(
                    along > press_n * if axis < 3 { 1.0e-4 } else { 1.0e-3 },
                    "{}: axis {axis}: {displaced:?}",
                    api.id
                );
                // Of the same unit: the others stay, but for what the hand couples.
                let same = if axis < 3 { 0..3 } else { 3..6 };
                let others = same.filter(|other| *other != axis).map(|other| displaced[other].abs());
                assert!(others.fold(0.0, f64::max) < 0.1 * along, "{}: axis {axis}: {displaced:?}", api.id);
            }
        }
        // What the device says it gave is what the flotor got in the tick of the sample.
        let told = circle.outside.iter().zip(&circle.inside[before..]).skip(300);
        let gap =
            told.map(|(outside, inside)| (outside.delivered.force() - inside.commanded.force()).length());
        let gap = gap.fold(0.0, f64::max);
        assert!(gap <= api.rounding, "{}: {gap} N", api.id);
    }
}

#[test]
fn the_demo_runs_on_each_with_two_changed_lines() {
    let folder = build_folder().join("deps").display().to_string();
    for api in APIS {
        let scratch = Scratch::default();
        let scene = demo_on(&scratch, api.id, "stand_in = true");
        assert_runs_with_force(&scratch, &[&scene, "--duration", "1s"], &[("LD_LIBRARY_PATH", &folder)]);
    }
}

#[test]
fn a_circle_in_real_time_goes_round_without_a_fault() {
    let seconds = TestSize::of_this_run().pick(1, 60);
    for api in APIS {
        let scratch = Scratch::default();
        // A machine that is delayed for long is no fault of the device.
        let device = format!("library = {:?}\nstand_in = true\ntimeout_ms = 9000", api.drop_in());
        // The device sets the pace where it has one of its own.
        let pacing = if api.id == HD.id { "pacing = \"device\"" } else { "" };
        let spring = "[[model]]\nplugin = \"spring\"\n[model.parameters]\nvariant = \"energy\"\n[limits]\nwatchdog_ms = 60000";
        let scene = api.scene(&scratch, seconds as f64, &format!("{device}\n{spring}"), pacing);
        let circle = Circle::run(&scratch, &scene, "oscillate", "real");
        let ticks = 1000 * seconds;
        assert!(circle.outside.len() >= ticks * 9 / 10, "{}: {:?}", api.id, circle.ran);
        // Every pose is one that the flotor had: compared as bits of the position, rounded.
        let near =
            |record: &TickRecord| circle.inside.iter().any(|inside| pose_gap(record, inside) <= api.rounding);
        let sampled: Vec<_> = circle.outside.iter().step_by(circle.outside.len() / 100).collect();
        assert!(sampled.iter().all(|record| near(record)), "{}: a pose that the flotor never had", api.id);
        let most = |records: &[TickRecord]| {
            records.iter().map(|record| record.commanded.force().length()).fold(0.0, f64::max)
        };
        let [sent_n, felt_n] = [most(&circle.outside), most(&circle.inside)];
        println!("{}: {} ticks, {sent_n:.3} N sent, {felt_n:.3} N felt", api.id, circle.outside.len());
        assert!(
            sent_n > 0.1 && felt_n > 0.5 * sent_n && felt_n <= 8.0 + 1.0e-9,
            "{}: {sent_n} N, {felt_n} N",
            api.id
        );
    }
}

#[test]
fn with_its_stand_in_each_keeps_every_rule() {
    for api in APIS {
        let scratch = Scratch::default();
        let library = plugin_file(api.package).display().to_string();
        let told = format!("library={}", api.drop_in().display());
        let ran = Flotor::with(["validate", &library, "--set", &told, "--set", "stand_in=true"])
            .env("FLOTOR_SCENE", &simulated(&scratch, "hold").display().to_string())
            .run();
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
        let kept = format!("{} rules", rules_of_a_device());
        assert!(ran.stdout.contains(&kept) || ran.stdout.lines().count() >= rules_of_a_device(), "{ran:?}");
    }
}

#[test]
fn a_library_that_cannot_be_used_is_named_with_what_to_do() {
    if !tools::required(Tool::Cc) {
        return;
    }
    for api in APIS {
        let scratch = Scratch::default();
        let head = |class: u8, machine: u8| {
            let mut head = vec![0x7f, b'E', b'L', b'F', class, 1, 1];
            head.resize(18, 0);
            head.extend([machine, 0]);
            head.resize(64, 0);
            head
        };
        let oldest: &[&str] = if api.id == DHD.id { &["MINOR=9"] } else { &["VERSION=\"2.9\""] };
        let lacking = if api.id == DHD.id { "dhdSetWatchdog" } else { "hdStopScheduler" };
        let cases = [
            (scratch.path().join("nowhere.so"), " does not exist"),
            (scratch.file("32.so", head(1, 3)), "is for 32-bit x86 and this program for 64-bit"),
            (
                scratch.file("arm.so", head(2, if cfg!(target_arch = "aarch64") { 62 } else { 183 })),
                "is for 64-bit",
            ),
            (scratch.file("text.so", "INPUT(libreal.so)"), "is not a shared library"),
            (
                scratch.file("cut.so", head(2, if cfg!(target_arch = "aarch64") { 183 } else { 62 })),
                "cannot be loaded (",
            ),
            (api.drop_in(), "stand_in = true"),
            (api.broken(&scratch, "old", oldest), " or later, or name another file with `library`"),
            (
                api.broken(&scratch, "lacks", &["LACKS"]),
                &format!("lacks the function `{lacking}`; install")[..],
            ),
        ];
        let mut told = Vec::new();
        for (library, words) in cases {
            let scene = api.scene(&scratch, 0.1, &format!("library = {library:?}"), "").display().to_string();
            let ran = Flotor::with(["run", &scene]).env("SDK_LOG", "/dev/null").run();
            assert!(ran.code.is_some_and(|code| code == exit_code::PLUGIN_REFUSED || code == exit_code::CONFIGURATION), "{ran:?}");
            assert!(ran.stderr.contains(words), "{words}: {ran:?}");
            assert!(ran.stderr.contains(&library.display().to_string()), "which file? {ran:?}");
            told.push(ran.stderr);
        }
        told.dedup();
        assert_eq!(told.len(), 8, "each has its own words");
    }
}

#[test]
fn doctor_tells_what_keeps_a_device_from_starting() {
    if !tools::required(Tool::Cc) {
        return;
    }
    let scratch = Scratch::default();
    // A machine with a Touch behind a hub, its serial port, and ModemManager.
    for (file, text) in [
        ("sys/bus/usb/devices/1-4.2/idVendor", "2988\n"),
        ("sys/bus/usb/devices/1-4.2/idProduct", "0302\n"),
        ("sys/bus/usb/devices/1-4.2:1.0/tty/ttyACM0/dev", "166:0\n"),
        ("proc/77/comm", "ModemManager\n"),
        ("dev/ttyACM0", ""),
    ] {
        let file = scratch.path().join(file);
        std::fs::create_dir_all(file.parent().expect("it is in a folder")).expect("there is room");
        std::fs::write(file, text).expect("there is room");
    }
    let root = scratch.path().display().to_string();
    let doctor = |api: Api, sets: &[String]| {
        let sets: Vec<&str> = sets.iter().flat_map(|set| ["--set", set]).collect();
        let ran = Flotor::with([&["doctor", "--device", api.id, "--root", &root][..], &sets].concat())
            .env("SDK_LOG", "/dev/null")
            .run();
        let is_ready = !ran.stdout.contains("\n  bad ");
        assert_eq!(ran.code, Some(if is_ready { exit_code::OK } else { exit_code::OTHER }), "{ran:?}");
        ran.stdout
    };
    let library = |file: &Path| vec![format!("library={}", file.display())];
    let elf32 = scratch
        .file("32.so", [&[0x7f, b'E', b'L', b'F', 1, 1, 1, 0][..], &[0; 10], &[3, 0], &[0; 44]].concat());
    let touch = doctor(HD, &library(&HD.broken(&scratch, "hd", &[])));
    for (what, words) in [
        ("hub", "behind a hub (1-4.2)"),
        ("ModemManager", "writes to its port"),
        ("permission", "this user may use /dev/ttyACM0"),
        ("opening", "is open, without force"),
        ("axes", "6 sensed, 3 driven; at most 3.3 N"),
        ("without its host", "its plugin declares no stop without the host"),
    ] {
        assert!(touch.lines().any(|line| line.contains(what) && line.contains(words)), "{what}: {touch}");
    }
    assert!(touch.contains("ENV{ID_MM_DEVICE_IGNORE}=\"1\"") && touch.contains("bad findings: 1"), "{touch}");
    let cases = [
        (DHD, library(Path::new("/nowhere/libdrd.so.3")), "the file /nowhere/libdrd.so.3 of"),
        (DHD, library(&elf32), "is for 32-bit x86 and this program for 64-bit"),
        (
            DHD,
            library(&DHD.broken(&scratch, "uninitialised", &["UNINITIALISED"])),
            "has no reference position",
        ),
        (
            DHD,
            library(&DHD.broken(&scratch, "driver", &["NO_DRIVER"])),
            "no driver lets this user open the USB device",
        ),
        (HD, library(&HD.broken(&scratch, "uncalibrated", &["UNCALIBRATED=0x5002"])), "is not calibrated"),
        (HD, library(&HD.drop_in()), "stand_in = true"),
    ];
    for (api, sets, words) in cases {
        let told = doctor(api, &sets);
        assert!(
            told.lines().any(|line| line.contains("bad   opening") && line.contains(words)),
            "{words}: {told}"
        );
        assert_eq!(told.contains("no device 1451:*"), api.id == DHD.id, "{told}");
    }
    let model = Flotor::with(["doctor", "--device", "spring"]).run();
    assert_eq!(model.code, Some(exit_code::CONFIGURATION), "{model:?}");
    assert!(model.error().contains("`spring` is a model"), "{model:?}");
}

/// What a library with one thing wrong has written down.
fn log(file: &Path) -> Vec<(String, [f64; 3])> {
    let text = std::fs::read_to_string(file).unwrap_or_default();
    let parse = |line: &str| {
        let mut words = line.split(' ');
        let what = words.next()?.to_owned();
        let mut number = || words.next()?.parse().ok();
        Some((what, [number()?, number()?, number()?]))
    };
    text.lines().filter_map(parse).collect()
}

/// A load that pulls down with a newton, on a device without torque.
const LOAD: &str = "[[model]]\nplugin = \"load\"\n[model.parameters]\nforce_n = 1\n[limits]\ntorque_nm = [0, 0, 0]\nramp_s = 0.01";

#[test]
fn a_device_that_fails_ends_the_run_by_name_and_the_force_goes() {
    if !tools::required(Tool::Cc) {
        return;
    }
    let cases: [(Api, &[&str], &str); 8] = [
        (DHD, &["LOST"], "the device is gone"),
        (DHD, &["SILENT"], "did not answer in time"),
        (DHD, &["REFUSED"], "malformed data"),
        (DHD, &["FORCE_OFF=2"], "moved faster than the device allows"),
        (DHD, &["FORCE_OFF=6"], "emergency stop"),
        (HD, &["ERROR=0x0302"], "the device is gone"),
        (HD, &["ERROR=0x0200"], "too hot"),
        (HD, &["ERROR=0x0203"], "moved faster than the device allows"),
    ];
    for (api, macros, words) in cases {
        let scratch = Scratch::default();
        let library = api.broken(&scratch, "fails", &[macros, &["AFTER=400"]].concat());
        let file = scratch.path().join("log");
        let parameters = format!("library = {library:?}\ntimeout_ms = 500\n{LOAD}");
        let scene = api.scene(&scratch, 5.0, &parameters, "").display().to_string();
        let ran = Flotor::with(["run", &scene]).env("SDK_LOG", &file.display().to_string()).run();
        assert_eq!(ran.code, Some(exit_code::DEVICE_FAULT), "{macros:?}: {ran:?}");
        assert!(ran.stderr.contains(words) || ran.stdout.contains(words), "{macros:?}: {ran:?}");
        let log = log(&file);
        let forces: Vec<_> = log.iter().filter(|(what, _)| what == "force").collect();
        assert!(forces.iter().any(|(_, force)| *force != [0.0; 3]), "{macros:?}: no force before: {log:?}");
        assert!(forces.last().is_some_and(|(_, last)| *last == [0.0; 3]), "{macros:?}: force stays: {log:?}");
        let off = if api.id == DHD.id { "stop" } else { "disable" };
        assert!(log.iter().any(|(what, _)| what == off), "{macros:?}: {log:?}");
        assert_eq!(log.last().map(|(what, _)| what.as_str()), Some("close"), "{macros:?}: {log:?}");
    }
}

#[test]
fn a_device_that_cannot_start_says_why_and_what_to_do() {
    if !tools::required(Tool::Cc) {
        return;
    }
    let cases: [(Api, &[&str], &str); 7] = [
        (DHD, &["NO_DEVICE"], "connect the device and switch it on"),
        (DHD, &["NO_DRIVER"], "doctor --device force-dimension"),
        (DHD, &["UNINITIALISED"], "initialise = \"automatic\""),
        (HD, &["NO_DEVICE"], "the maker's setup program"),
        (HD, &["UNCALIBRATED=0x5002"], "inkwell"),
        (HD, &["UNCALIBRATED=0x5001"], "move the arm through its range"),
        (HD, &["NO_TIMER"], "starting the scheduler failed"),
    ];
    for (api, macros, words) in cases {
        let scratch = Scratch::default();
        let library = api.broken(&scratch, "fails", macros);
        let file = scratch.path().join("log");
        let scene =
            api.scene(&scratch, 0.5, &format!("library = {library:?}\n{LOAD}"), "").display().to_string();
        let ran = Flotor::with(["run", &scene]).env("SDK_LOG", &file.display().to_string()).run();
        assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{macros:?}: {ran:?}");
        assert!(ran.stderr.contains(words), "{macros:?}: {ran:?}");
        let log = log(&file);
        assert!(log.iter().all(|(what, [x, y, z])| what != "force" || [*x, *y, *z] == [0.0; 3]), "{log:?}");
    }
}

#[test]
fn the_arm_moves_by_itself_only_if_it_is_told_to_and_force_comes_after_limits_and_watchdog() {
    if !tools::required(Tool::Cc) {
        return;
    }
    let scratch = Scratch::default();
    let library = DHD.broken(&scratch, "uninitialised", &["UNINITIALISED"]);
    let file = scratch.path().join("log");
    let parameters = format!("library = {library:?}\ninitialise = \"automatic\"\nmax_force_n = 5\n{LOAD}");
    let scene = DHD.scene(&scratch, 0.3, &parameters, "").display().to_string();
    let ran = Flotor::with(["run", &scene]).env("SDK_LOG", &file.display().to_string()).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let log = log(&file);
    let place = |what: &str| {
        log.iter().position(|(word, _)| word == what).unwrap_or_else(|| panic!("no {what}: {log:?}"))
    };
    let order = ["initialise", "most", "window", "watchdog", "enable", "force", "stop", "close"].map(place);
    assert!(order.is_sorted(), "{log:?}");
    // 5 N, a window of 20 ms, 160 units of 125 µs in expert mode.
    assert_eq!([log[order[1]].1[0], log[order[2]].1[0]], [5.0, 20.0]);
    assert_eq!(log[order[3]].1, [160.0, 1.0, 0.0]);
    // The load pulls down; theirs is z up as well. Handle and all else are where the library says.
    let pressed = log.iter().filter(|(what, _)| what == "force").map(|(_, [_, _, z])| *z).fold(0.0, f64::min);
    assert!((pressed + 1.0).abs() < 1.0e-9, "{pressed}");
    let json = scratch.path().join("run.mcap");
    let ran = Flotor::with(["run", &scene, "--record", &json.display().to_string()])
        .env("SDK_LOG", "/dev/null")
        .run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let at = records(&json).last().map(|record| (record.pose.position(), record.buttons));
    // 1 cm towards the user, 2 cm right, 3 cm up.
    assert_eq!(at, Some((DVec3::new(0.02, -0.01, 0.03), 5)));
}

#[test]
fn what_an_axis_cannot_do_is_told_when_it_is_paired() {
    if !tools::required(Tool::Cc) {
        return;
    }
    for api in APIS {
        let scratch = Scratch::default();
        let library = api.broken(&scratch, "three", &[]);
        let told = |limits: &str| {
            let device = format!("library = {library:?}\n[[model]]\nplugin = \"spring\"\n[model.parameters]");
            let device = format!("{device}\nvariant = \"energy\"\n{limits}");
            let scene = api.scene(&scratch, 0.1, &device, "").display().to_string();
            let ran = Flotor::with(["run", &scene]).env("SDK_LOG", "/dev/null").run();
            assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
            ran.stderr
        };
        assert_missing_torque_is_told(told);
    }
}
