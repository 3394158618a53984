//! The emulated device on the USB of a real kernel, found by the plugin through libusb.
//!
//! Attaching the device needs root and the module `vhci_hcd`: the tests are ignored by default; `.ci/vm` runs them in a virtual
//! machine.

use flotor_falcon::firmware::digest;
use flotor_falcon::kinematics::CENTRE_M;
use flotor_falcon_emulator::gadget::Gadget;
use flotor_falcon_emulator::in_process::InProcess;
use flotor_falcon_emulator::machine::{Machine, Motion, Power};
use flotor_hal::{Cycle, DVec3, DeviceState, Fault, LoopConfig, Tick, Wrench};
use flotor_loader::{Plugin, Setting};
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(60);

#[test]
#[ignore = "needs a kernel with vhci_hcd: .ci/vm"]
fn a_falcon_on_a_kernels_usb_is_loaded_homed_moved_and_unplugged() {
    let place_m = CENTRE_M + DVec3::new(0.0, 0.010, 0.0);
    let device = InProcess::new(Machine::new(Power::Off, Motion::held(place_m)));
    let gadget = Gadget::plug_in(device.clone()).expect("this kernel has vhci_hcd, and this is root");
    let firmware = vec![0x5a; 8492];
    let path = std::env::temp_dir().join("flotor-dummy-firmware");
    std::fs::write(&path, &firmware).expect("a folder for such files");
    let plugin = Plugin::in_process(&flotor_falcon::FLOTOR_ENTRY).expect("it is a plugin");
    let settings = [
        ("address", "usb:FLOTOR01".to_owned()),
        ("firmware", path.display().to_string()),
        ("firmware_sha256", digest(&firmware)),
        ("timeout_ms", "5000".to_owned()),
    ];
    let settings =
        settings.map(|(key, value)| Setting::parse(plugin.parameters(), key, &value).expect("it is legal"));
    let started = Instant::now();
    let opened = loop {
        match plugin.open_device(&settings) {
            Ok(opened) => break opened,
            Err(error) => assert!(started.elapsed() < PATIENCE, "{error}"),
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    println!("loaded {} bytes and ran after {:?}", firmware.len(), started.elapsed());
    let config = LoopConfig { period_ns: 1_000_000, seed: 1 };
    let mut active = opened.activate(&config).map_err(|(_, refusal)| refusal).expect("it is homed");
    let (mut state, mut fresh, began) = (DeviceState::HOME, 0, Instant::now());
    for index in 0..1000 {
        let tick = Tick { index, time_ns: index * 1_000_000, dt_ns: 1_000_000 };
        match active.read(&tick, &mut state) {
            Cycle::Fault(fault) => panic!("{}", fault.advice()),
            cycle => fresh += u32::from(cycle == Cycle::Fresh),
        }
        let _ = active.write(&tick, &Wrench::from_force(DVec3::Z));
        std::thread::sleep(Duration::from_millis(1));
    }
    println!("{fresh} samples in {:?}", began.elapsed());
    assert!(
        fresh > 100 && (state.pose.position() - DVec3::Z * 0.010).length() < 40.0e-6,
        "{fresh}: {state:?}"
    );
    assert!((state.delivered.force() - DVec3::Z).length() < 5.0e-3, "{state:?}");
    drop(gadget);
    let (mut index, pulled) = (1000, Instant::now());
    loop {
        let tick = Tick { index, time_ns: index * 1_000_000, dt_ns: 1_000_000 };
        index += 1;
        if active.read(&tick, &mut state) == Cycle::Fault(Fault::Disconnected) {
            break;
        }
        assert!(pulled.elapsed() < PATIENCE, "an unplugged device is a fault");
        std::thread::sleep(Duration::from_millis(1));
    }
    println!("unplugged: a fault after {:?}", pulled.elapsed());
}
