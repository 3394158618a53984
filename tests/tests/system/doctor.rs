//! `flotor doctor --device` on a Falcon and an Inverse3 that do not start: the whole of what it prints, with the files of a made-up
//! machine for the bus. What each plugin says of itself is tested beside it.

use super::falcon::Emulator;
use flotor_hal::DVec3;
use flotor_inverse3::stand_in::{ARM, Said, StandIn, configured, state};
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;

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
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
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
    finds(&told, "bad", "on USB", "no device 0403:cb48", "connect it and switch it on");
    finds(&told, "bad", "opening", "no emulated Falcon at 127.0.0.1:1", "`flotor emulate falcon` starts one");
    bad(&told, 2);
}

#[test]
fn who_has_a_falcon_is_named() {
    let drivers = [
        (
            "ftdi_sio",
            "the kernel's driver `ftdi_sio` has it",
            "`echo 1-4:1.0 > /sys/bus/usb/drivers/ftdi_sio/unbind`",
        ),
        ("usbfs", "another program has it open", "end that program"),
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
        "it has no firmware since its power was off",
        "name your own file with `firmware`",
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
        "does not know where its handle is",
        "push the handle in as far as it goes",
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
        (usize::MAX, String::new(), "1234", "it has no device 1234, but ", "must be one of them"),
        (1, "nonsense".to_owned(), ARM, "is no state of a device", "update the service to 3.5 or newer"),
        (2, busy, ARM, "another program commands this Inverse3", "end that one first"),
    ];
    let computer = Computer::default();
    for (from, text, arm, words, remedy) in cases {
        let service = service(from, text);
        let sets =
            [format!("address={}", service.address), format!("device={arm}"), "timeout_ms=9000".to_owned()];
        let told = computer.doctor("inverse3", &sets.each_ref().map(String::as_str));
        finds(&told, "bad", "on USB", "no device 16c0:0483 or 2fe3:0100", "connect it and switch it on");
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
    finds(&told, "note", "on USB", "no device 16c0:0483 or 2fe3:0100", "it is open all the same");
    finds(&told, "good", "opening", "Haply Inverse3 is open, without force", "");
    finds(&told, "good", "axes", "6 sensed, 3 driven; at most 5 N", "");
    finds(&told, "good", "without its host", "stops by itself", "");
    bad(&told, 0);
}
