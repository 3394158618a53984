//! `flotor doctor --device` on a Falcon and an Inverse3 that do not start: the whole of what it prints, with the files of a made-up
//! machine for the bus. What each plugin says of itself is tested beside it.

use super::falcon::Emulator;
use flotor_hal::DVec3;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use service_with_faults::{ARM, Said, StandIn, configured, state};

#[path = "../../../devices/inverse3/tests/stand_in/mod.rs"]
#[allow(dead_code, unused_imports)] // the tests of the plugin use the rest
mod service_with_faults;

/// A machine with nothing on its bus, until something is connected.
#[derive(Default)]
struct Computer(Scratch);

impl Computer {
    /// With a device, and the driver that has its interface.
    fn connected(ids: [&str; 2], driver: Option<&str>) -> Self {
        let computer = Self::default();
        let devices = computer.0.path().join("sys/bus/usb/devices");
        let (device, interface) = (devices.join("1-4"), devices.join("1-4:1.0"));
        let node = computer.0.path().join("dev/bus/usb/001");
        for folder in [&device, &interface, &node] {
            std::fs::create_dir_all(folder).expect("there is room");
        }
        let [vendor, product] = ids;
        for (file, text) in [("idVendor", vendor), ("idProduct", product), ("busnum", "1"), ("devnum", "7")] {
            std::fs::write(device.join(file), text).expect("there is room");
        }
        std::fs::write(node.join("007"), "").expect("there is room");
        if let Some(driver) = driver {
            std::os::unix::fs::symlink(format!("../../drivers/{driver}"), interface.join("driver"))
                .expect("there is room");
        }
        computer
    }

    /// What is found of a device with these parameters.
    fn doctor(&self, id: &str, sets: &[&str]) -> String {
        let root = self.0.path().display().to_string();
        let sets: Vec<&str> = sets.iter().flat_map(|set| ["--set", set]).collect();
        let ran = Flotor::with([&["doctor", "--device", id, "--root", &root][..], &sets].concat()).run();
        let expected = if ran.stdout.contains("not ready") { exit_code::OTHER } else { exit_code::OK };
        assert_eq!(ran.code, Some(expected), "{ran:?}");
        ran.stdout
    }
}

/// That a line has this grade, this name and these words, and the next one this remedy.
fn finds(told: &str, grade: &str, what: &str, words: &str, remedy: &str) {
    let begins = format!("  {grade:<5} {what:<18} ");
    let lines: Vec<&str> = told.lines().collect();
    let is_it = |line: &&str| line.starts_with(&begins) && line.contains(words);
    let place = lines.iter().position(is_it).unwrap_or_else(|| panic!("{begins}{words}: {told}"));
    // What the plugin says has its remedy in the same sentence.
    let beside = [lines.get(place), lines.get(place + 1)].into_iter().flatten();
    assert!(beside.into_iter().any(|line| line.contains(remedy)), "{remedy}: {told}");
}

/// That there are so many bad findings.
fn bad(told: &str, count: usize) {
    let verdict = told.lines().last().unwrap_or_default();
    match count {
        0 => assert!(verdict.contains("ready") && !verdict.contains("not ready"), "{told}"),
        count => assert!(verdict.contains(&format!("bad findings: {count}")), "{told}"),
    }
}

#[test]
fn a_falcon_that_is_not_there_is_told_by_its_numbers() {
    let told = Computer::default().doctor("falcon", &["address=tcp:127.0.0.1:1"]);
    finds(&told, "bad", "on USB", "no device 0403:cb48", "connect the device and switch it on");
    finds(
        &told,
        "bad",
        "opening",
        "no emulated Falcon at 127.0.0.1:1",
        "start one with `flotor emulate falcon`",
    );
    bad(&told, 2);
}

#[test]
fn who_has_a_falcon_is_named() {
    let drivers = [
        (
            "ftdi_sio",
            "the kernel's driver `ftdi_sio` uses the device",
            "`echo 1-4:1.0 > /sys/bus/usb/drivers/ftdi_sio/unbind`",
        ),
        ("usbfs", "another program has the device open", "end that program"),
    ];
    for (driver, words, remedy) in drivers {
        let computer = Computer::connected(["0403", "cb48"], Some(driver));
        let told = computer.doctor("falcon", &["address=tcp:127.0.0.1:1"]);
        finds(&told, "good", "on USB", "0403:cb48 at 1-4", "");
        finds(&told, "bad", "driver", words, remedy);
        bad(&told, 2);
    }
}

#[test]
fn a_falcon_without_firmware_is_told_where_it_may_be() {
    let emulator = Emulator::start(&["--power", "off"]);
    let computer = Computer::connected(["0403", "cb48"], None);
    let told = computer.doctor("falcon", &[&format!("address={}", emulator.address)]);
    finds(&told, "good", "permission", "this user may use /dev/bus/usb/001/007", "");
    finds(
        &told,
        "bad",
        "opening",
        "the Falcon sends no reports, probably because it has no firmware after power-off",
        "give your own firmware file with `firmware`",
    );
    bad(&told, 1);
}

#[test]
fn a_falcon_that_is_not_homed_is_told_to_whoever_does_not_wait() {
    let emulator = Emulator::start(&["--power", "off"]);
    let computer = Computer::connected(["0403", "cb48"], None);
    let firmware = computer.0.file("firmware.bin", "no firmware of anybody's");
    let sets = [
        format!("address={}", emulator.address),
        format!("firmware={}", firmware.display()),
        format!("firmware_sha256={}", flotor_falcon::firmware::digest(b"no firmware of anybody's")),
        "homing_s=0".to_owned(),
    ];
    let told = computer.doctor("falcon", &sets.each_ref().map(String::as_str));
    finds(
        &told,
        "bad",
        "opening",
        "has not found its home position",
        "push the handle in as far as possible",
    );
    bad(&told, 1);
}

/// The bus has it as claimed, by the doctor itself.
#[test]
fn a_falcon_that_is_well_is_ready() {
    let emulator = Emulator::start(&[]);
    let computer = Computer::connected(["0403", "cb48"], Some("usbfs"));
    let told = computer.doctor("falcon", &[&format!("address={}", emulator.address)]);
    finds(&told, "good", "opening", "Novint Falcon is open, without force", "");
    finds(&told, "good", "axes", "3 sensed, 3 driven; at most 8 N", "");
    bad(&told, 0);
}

/// A service that says this from its message of this number on, and what it should before.
fn service(from: usize, text: String) -> StandIn {
    StandIn::start(move |number, _| match number {
        _ if number >= from => Said::Text(text.clone()),
        1 => Said::Text(configured(0.0)),
        _ => Said::Text(state(DVec3::ZERO, DVec3::ZERO)),
    })
    .expect("there is a port")
}

#[test]
fn what_keeps_an_inverse3_from_starting_is_told() {
    let well = state(DVec3::ZERO, DVec3::ZERO);
    let busy = well.replace("\"control_mode\":\"idle\"", "\"control_mode\":\"force\"");
    let cases = [
        (
            usize::MAX,
            String::new(),
            "1234",
            "the service has no device 1234; ",
            "set `device` to the id of one of its devices",
        ),
        (1, "nonsense".to_owned(), ARM, "malformed device state", "update the service to 3.5 or newer"),
        (2, busy, ARM, "another program commands this Inverse3", "end that program first"),
    ];
    let computer = Computer::default();
    for (from, text, arm, words, remedy) in cases {
        let service = service(from, text);
        let sets =
            [format!("address={}", service.address), format!("device={arm}"), "timeout_ms=9000".to_owned()];
        let told = computer.doctor("inverse3", &sets.each_ref().map(String::as_str));
        finds(
            &told,
            "bad",
            "on USB",
            "no device 16c0:0483 or 2fe3:0100",
            "connect the device and switch it on",
        );
        finds(&told, "bad", "opening", words, remedy);
        bad(&told, 2);
    }
    let told = computer.doctor("inverse3", &["address=127.0.0.1:1"]);
    finds(&told, "bad", "opening", "the Inverse Service at 127.0.0.1:1: ", "start Haply's service");
}

#[test]
fn an_inverse3_that_is_well_is_ready_with_what_was_found() {
    let service = service(usize::MAX, String::new());
    let sets =
        [format!("address={}", service.address), format!("device={ARM}"), "timeout_ms=9000".to_owned()];
    let told = Computer::default().doctor("inverse3", &sets.each_ref().map(String::as_str));
    finds(&told, "note", "on USB", "no device 16c0:0483 or 2fe3:0100", "the device is open nevertheless");
    finds(&told, "good", "opening", "Haply Inverse3 is open, without force", "");
    finds(&told, "good", "axes", "6 sensed, 3 driven; at most 5 N", "");
    finds(&told, "good", "without its host", "stops by itself", "");
    bad(&told, 0);
}

/// A machine whose control groups have these files, in the folder of the hierarchy.
fn grouped(groups: &str, mounts: &str, files: &[(&str, &str)]) -> Scratch {
    let machine = Scratch::default();
    let own = [("proc/self/cgroup", groups), ("proc/self/mountinfo", mounts)];
    for (file, text) in own.iter().chain(files) {
        let file = machine.path().join(file);
        std::fs::create_dir_all(file.parent().expect("a folder")).expect("there is room");
        std::fs::write(file, text).expect("there is room");
    }
    machine
}

fn machine_doctor(machine: &Scratch) -> String {
    let root = machine.path().display().to_string();
    let ran = Flotor::with(["doctor", "--root", &root]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    ran.stdout
}

#[test]
fn limits_of_control_groups_are_named_with_the_remedy_that_helps() {
    let machine = grouped(
        "3:cpu:/docker/a\n2:memory:/docker/a\n1:pids:/docker/a\n",
        "31 24 0:27 / /cg/cpu rw - cgroup cgroup rw,cpu\n32 24 0:28 / /cg/memory rw - cgroup cgroup rw,memory\n\
         33 24 0:29 / /cg/pids rw - cgroup cgroup rw,pids\n",
        &[
            ("cg/cpu/cpu.rt_runtime_us", "950000\n"),
            ("cg/cpu/cpu.rt_period_us", "1000000\n"),
            ("cg/cpu/docker/cpu.rt_runtime_us", "0\n"),
            ("cg/cpu/docker/cpu.rt_period_us", "1000000\n"),
            ("cg/cpu/docker/a/cpu.rt_runtime_us", "0\n"),
            ("cg/cpu/docker/a/cpu.rt_period_us", "1000000\n"),
            ("cg/cpu/docker/cpu.cfs_quota_us", "-1\n"),
            ("cg/cpu/docker/cpu.cfs_period_us", "100000\n"),
            ("cg/cpu/docker/a/cpu.cfs_quota_us", "15000\n"),
            ("cg/cpu/docker/a/cpu.cfs_period_us", "100000\n"),
            ("cg/memory/memory.limit_in_bytes", "9223372036854771712\n"),
            ("cg/memory/memory.usage_in_bytes", "900000000\n"),
            ("cg/memory/docker/a/memory.limit_in_bytes", "104857600\n"),
            ("cg/memory/docker/a/memory.usage_in_bytes", "103809024\n"),
            ("cg/pids/docker/a/pids.max", "20\n"),
            ("cg/pids/docker/a/pids.current", "7\n"),
        ],
    );
    let told = machine_doctor(&machine);
    let folder = machine.path().display().to_string();
    // The outer group, without which the inner ones take none.
    finds(
        &told,
        "bad",
        "RT budget",
        "none in the control group",
        &format!("> {folder}/cg/cpu/docker/cpu.rt_runtime_us"),
    );
    finds(
        &told,
        "bad",
        "CPU quota",
        "0.15 cores",
        &format!("echo -1 > {folder}/cg/cpu/docker/a/cpu.cfs_quota_us"),
    );
    finds(&told, "bad", "memory limit", "100 MiB in the control group", "99 MiB in use");
    finds(&told, "bad", "threads", "20 in the control group", "--pids-limit");
}

#[test]
fn limits_of_control_groups_of_version_2_are_named() {
    let mounts = "31 24 0:27 / /cg rw - cgroup2 cgroup2 rw\n";
    let cases = [
        ("cpu.max", "50000 100000", "bad", "CPU quota", "0.50 cores", "echo max > "),
        ("cpu.max", "400000 100000", "note", "CPU quota", "4.00 cores", "echo max > "),
        ("memory.max", "1073741824", "note", "memory limit", "1024 MiB", "MemoryMax="),
        ("memory.high", "536870912", "note", "memory threshold", "512 MiB", "MemoryHigh="),
        ("pids.max", "5000", "good", "threads", "5000 in the control group", ""),
    ];
    for (file, text, grade, what, found, remedy) in cases {
        let file = format!("cg/a/{file}");
        let files = [(file.as_str(), text), ("cg/a/memory.current", "0"), ("cg/a/pids.current", "9")];
        finds(&machine_doctor(&grouped("0::/a\n", mounts, &files)), grade, what, found, remedy);
    }
    let unlimited = ["cpu.max", "memory.max", "memory.high", "pids.max"].map(|file| format!("cg/a/{file}"));
    let texts = ["max 100000", "max", "max", "max"];
    let files: Vec<_> = unlimited.iter().map(String::as_str).zip(texts).collect();
    let told = machine_doctor(&grouped("0::/a\n", mounts, &files));
    assert!(!told.contains("control group ("), "{told}");
}
