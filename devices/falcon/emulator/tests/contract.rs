//! The plugin through the contract, on an emulated device over TCP.

use flotor_emulation::clients::{Clients, Tenure};
use flotor_emulation::port::{Port, Reach};
use flotor_falcon::kinematics::CENTRE_M;
use flotor_falcon_emulator::in_process::InProcess;
use flotor_falcon_emulator::machine::{Fault, Machine, Motion, Power};
use flotor_falcon_emulator::server;
use flotor_hal::{Cycle, DVec3, DeviceState, LoopConfig, Tick, VerticalCalibration, Wrench};
use flotor_loader::{ActiveDevice, OpenedDevice, Plugin, Setting};
use std::time::{Duration, Instant};

pub(super) const CONFIG: LoopConfig = LoopConfig { period_ns: 1_000_000, seed: 1 };
const PATIENCE: Duration = Duration::from_secs(20);
/// Half a count of each arm, at the handle.
const COUNT_M: f64 = 40.0e-6;
/// Half a word of each motor at an arm of some 30 mm, N.
const WORD_N: f64 = 5.0e-3;

/// A device at a port of this machine, for one host after another.
pub(super) fn serve(power: Power, place_m: DVec3) -> (InProcess, String) {
    let device = InProcess::new(Machine::new(power, Motion::held(place_m)));
    let port = Port::bind("127.0.0.1:0", Reach::ThisUser).expect("there is a port");
    let address = format!("tcp:{}", port.address().expect("it is bound"));
    let mut clients = Clients::of(port).expect("the system waits");
    let served = device.clone();
    std::thread::spawn(move || {
        while let Ok(stream) = clients.wait_for_one() {
            let _ = server::serve(stream, &served, Tenure::begin(&mut clients));
        }
    });
    (device, address)
}

pub(super) fn open(address: &str, more: &[(&str, &str)]) -> Result<OpenedDevice, String> {
    let plugin = Plugin::in_process(&flotor_falcon::FLOTOR_ENTRY).expect("it is a plugin");
    let settings = [("address", address), ("timeout_ms", "9000")];
    let settings: Vec<Setting> = settings
        .iter()
        .chain(more)
        .map(|(key, value)| Setting::parse(plugin.parameters(), key, value).expect("it is legal"))
        .collect();
    plugin.open_device(&settings).map_err(|error| error.to_string())
}

fn activated(opened: OpenedDevice) -> ActiveDevice {
    opened.activate(&CONFIG).map_err(|(_, refusal)| refusal).expect("it starts")
}

/// Ticks with this force until so many samples are fresh; the last one.
fn pushed(device: &mut ActiveDevice, index: &mut u64, force_n: DVec3, samples: usize) -> DeviceState {
    let (mut state, mut fresh, started) = (DeviceState::HOME, 0, Instant::now());
    while fresh < samples {
        let tick = Tick { index: *index, time_ns: *index * 1_000_000, dt_ns: 1_000_000 };
        *index += 1;
        match device.read(&tick, &mut state) {
            Cycle::Fault(fault) => panic!("{}", fault.advice()),
            cycle => fresh += usize::from(cycle == Cycle::Fresh),
        }
        let _ = device.write(&tick, &Wrench::from_force(force_n));
        assert!(started.elapsed() < PATIENCE);
        std::thread::sleep(Duration::from_micros(500));
    }
    state
}

/// The system waits for a socket in steps of milliseconds; a report is due a millisecond after the one before.
#[test]
fn a_report_comes_in_most_ticks() {
    const TICKS: u32 = 60;
    let (_device, address) = serve(Power::On, CENTRE_M);
    let mut device = activated(open(&address, &[]).expect("it is there"));
    let (mut state, started, mut index) = (DeviceState::HOME, Instant::now(), 0);
    // In a stretch in which nothing else delays the two.
    loop {
        let mut fresh = 0;
        for _ in 0..TICKS {
            let tick = Tick { index, time_ns: index * 1_000_000, dt_ns: 1_000_000 };
            index += 1;
            fresh += u32::from(device.read(&tick, &mut state) == Cycle::Fresh);
            let _ = device.write(&tick, &Wrench::ZERO);
            std::thread::sleep(Duration::from_millis(1));
        }
        if fresh > TICKS / 2 {
            return;
        }
        assert!(started.elapsed() < PATIENCE, "{fresh} of {TICKS}");
    }
}

#[test]
fn the_handle_is_where_the_hand_holds_it_and_a_force_pushes_along_its_axis() {
    // 10 mm to the right, 5 mm up, 20 mm away from the user: the maker's z is towards the user.
    let (device, address) = serve(Power::On, CENTRE_M + DVec3::new(0.010, 0.005, -0.020));
    device.machine().moves(Motion::held(CENTRE_M + DVec3::new(0.010, 0.005, -0.020)), 0b1010);
    let mut active = activated(open(&address, &[]).expect("it runs"));
    let mut index = 0;
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        for force_n in [axis * 2.0, axis * -2.0] {
            let state = pushed(&mut active, &mut index, force_n, 10);
            let off_m = state.pose.position() - DVec3::new(0.010, 0.020, 0.005);
            assert!(off_m.length() < COUNT_M, "{state:?}");
            assert!((state.delivered.force() - force_n).length() < WORD_N, "{state:?}");
            assert_eq!(state.buttons, 0b1010);
            let maker_n = device.machine().force_n(device.now()).expect("it has a posture");
            // Host x, y, z are the maker's x, -z, y.
            let felt_n = DVec3::new(maker_n.x, -maker_n.z, maker_n.y);
            assert!((felt_n - force_n).length() < 2.0 * WORD_N, "{force_n}: {felt_n}");
        }
    }
    // More than the motors have: less of it, in the same direction.
    let state = pushed(&mut active, &mut index, DVec3::new(100.0, 100.0, 0.0), 10);
    let given_n = state.delivered.force();
    assert!(given_n.x > 1.0 && (given_n.x - given_n.y).abs() < 2.0 * WORD_N, "{given_n}");
    assert!(device.machine().command().motors.iter().all(|word| word.abs() <= 4095));
    drop(active);
    let started = Instant::now();
    while device.machine().command().motors != [0; 3] {
        assert!(started.elapsed() < PATIENCE);
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn a_calibration_divides_the_vertical_command() {
    let (device, address) = serve(Power::On, CENTRE_M);
    let mut opened = open(&address, &[]).expect("it runs");
    let half = VerticalCalibration::new([-0.05, 0.05], &[0.5]).expect("it is plausible");
    opened.calibrate_vertical(&half).expect("it takes one");
    let mut active = activated(opened);
    let state = pushed(&mut active, &mut 0, DVec3::Z, 10);
    assert!((state.delivered.force() - DVec3::Z).length() < WORD_N, "{state:?}");
    let maker_n = device.machine().force_n(device.now()).expect("it has a posture");
    assert!((maker_n - DVec3::Y * 2.0).length() < 2.0 * WORD_N, "{maker_n}");
}

#[test]
fn a_cold_device_is_loaded_with_the_users_file_and_homed() {
    let (_device, address) = serve(Power::Off, CENTRE_M);
    let path = std::env::temp_dir().join(format!("flotor-dummy-{}", std::process::id()));
    std::fs::write(&path, [7; 300]).expect("a folder for such files");
    let (name, digest) = (path.display().to_string(), flotor_falcon::firmware::digest(&[7; 300]));
    let refused = open(&address, &[("firmware", &name)]).err().unwrap_or_default();
    assert!(refused.contains("300 bytes") && refused.contains("known firmware: nvent"), "{refused}");
    let with_file = [("firmware", name.as_str()), ("firmware_sha256", digest.as_str())];
    let opened = open(&address, &with_file).expect("it is loaded");
    // The hand that homes it needs 50 commands.
    let mut active = activated(opened);
    let state = pushed(&mut active, &mut 0, DVec3::ZERO, 3);
    assert!(state.pose.position().length() < COUNT_M, "{state:?}");
    drop(active);
    std::fs::remove_file(&path).expect("it is ours");
}

#[test]
fn counts_that_cannot_be_end_the_run_without_force() {
    for fault in [Fault::Unhomed(300), Fault::NoPosture(300)] {
        let (device, address) = serve(Power::On, CENTRE_M);
        device.machine().breaks(Some(fault));
        let mut active = activated(open(&address, &[]).expect("it runs"));
        let (mut index, mut state, started) = (0, DeviceState::HOME, Instant::now());
        let found = loop {
            let tick = Tick { index, time_ns: index * 1_000_000, dt_ns: 1_000_000 };
            index += 1;
            if let Cycle::Fault(fault) = active.read(&tick, &mut state) {
                break fault;
            }
            let _ = active.write(&tick, &Wrench::from_force(DVec3::Z));
            assert!(started.elapsed() < PATIENCE);
            std::thread::sleep(Duration::from_micros(500));
        };
        assert_eq!(found, flotor_hal::Fault::SensorOutOfRange, "{fault:?}");
        while device.machine().command().motors != [0; 3] {
            assert!(started.elapsed() < PATIENCE);
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

#[test]
fn addresses_that_are_none_are_refused() {
    for (address, words) in [
        ("serial", "is not valid; write usb, usb:SERIAL or tcp:HOST:PORT"),
        ("usb:", "is not valid; write usb"),
    ] {
        let refused = open(address, &[]).err().unwrap_or_default();
        assert!(refused.contains(words) && refused.lines().count() == 1, "{address}: {refused}");
    }
}
