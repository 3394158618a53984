//! Plugin with an emulated puck: a HID device created through /dev/uhid, found and read through hidraw.
//!
//! Needs write permission for /dev/uhid: `.ci/vm` runs the test in a virtual machine with this permission.

use flotor_hal::abi::PluginKind;
use flotor_hal::{Cycle, DVec3, DeviceState, Fault, LoopConfig, Tick};
use flotor_loader::Plugin;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::time::{Duration, Instant};

/// A multi-axis controller: translation in report 1, rotation in report 2, two buttons in report 3 (HID 1.11, items of
/// a report descriptor).
const DESCRIPTOR: &[u8] = &[
    0x05, 0x01, 0x09, 0x08, 0xa1, 0x01, // generic desktop, multi-axis controller, application
    0x16, 0xa2, 0xfe, 0x26, 0x5e, 0x01, 0x75, 0x10, 0x95, 0x03, // -350 to 350, 16 bits, three of them
    0xa1, 0x00, 0x85, 0x01, 0x09, 0x30, 0x09, 0x31, 0x09, 0x32, 0x81, 0x06, 0xc0, // report 1: x, y, z
    0xa1, 0x00, 0x85, 0x02, 0x09, 0x33, 0x09, 0x34, 0x09, 0x35, 0x81, 0x06, 0xc0, // report 2: rotations
    0xa1, 0x02, 0x85, 0x03, 0x05, 0x09, 0x19, 0x01, 0x29, 0x02, 0x15, 0x00, 0x25,
    0x01, // report 3: buttons 1, 2
    0x75, 0x01, 0x95, 0x02, 0x81, 0x02, 0x95, 0x0e, 0x81, 0x03, 0xc0, 0xc0, // and 14 bits of nothing
];

/// Events of the kernel's interface (linux/uhid.h): their numbers, and the size of the longest.
const UHID_CREATE2: u32 = 11;
const UHID_INPUT2: u32 = 12;
const UHID_DESTROY: u32 = 1;
const EVENT_BYTES: usize = 4 + 4376;

/// An emulated puck.
struct EmulatedPuck(File);

impl EmulatedPuck {
    fn plug_in() -> std::io::Result<Self> {
        let mut file = OpenOptions::new().read(true).write(true).open("/dev/uhid")?;
        let mut event = vec![0; EVENT_BYTES];
        let mut put = |at: usize, bytes: &[u8]| event[at..at + bytes.len()].copy_from_slice(bytes);
        put(0, &UHID_CREATE2.to_le_bytes());
        put(4, b"Emulated SpaceNavigator"); // name, of 128 bytes; then 64 each of place and serial number
        put(260, &u16::try_from(DESCRIPTOR.len()).expect("a short descriptor").to_le_bytes());
        put(262, &3_u16.to_le_bytes()); // USB
        put(264, &0x256f_u32.to_le_bytes()); // vendor, then product
        put(268, &0xc635_u32.to_le_bytes());
        put(280, DESCRIPTOR); // after version and country
        file.write_all(&event)?;
        Ok(Self(file))
    }

    fn send(&mut self, report: &[u8]) {
        let head = [
            &UHID_INPUT2.to_le_bytes()[..],
            &u16::try_from(report.len()).expect("a short report").to_le_bytes(),
        ]
        .concat();
        self.0.write_all(&[&head[..], report].concat()).expect("the kernel takes a report");
    }

    fn push(&mut self, number: u8, axes: [i16; 3]) {
        let words = axes.iter().flat_map(|axis| axis.to_le_bytes());
        self.send(&[number].into_iter().chain(words).collect::<Vec<u8>>());
    }

    fn unplug(&mut self) {
        let mut event = vec![0; EVENT_BYTES];
        event[..4].copy_from_slice(&UHID_DESTROY.to_le_bytes());
        self.0.write_all(&event).expect("the kernel takes it");
    }
}

#[test]
#[ignore = "needs /dev/uhid; .ci/vm has one"]
fn a_puck_at_hidraw_moves_the_pose() {
    let mut puck = EmulatedPuck::plug_in().expect("a device can be emulated at /dev/uhid");
    let plugin = Plugin::in_process(&flotor_spacemouse::FLOTOR_ENTRY).expect("it is a plugin");
    assert_eq!(plugin.metadata().kind, PluginKind::Device);
    // The device node comes a moment after the device.
    let started = Instant::now();
    let device = loop {
        match plugin.open_device(&[]) {
            Ok(device) => break device,
            Err(error) if started.elapsed() > Duration::from_secs(10) => panic!("{error}"),
            Err(_) => std::thread::sleep(Duration::from_millis(20)),
        }
    };
    let config = LoopConfig { period_ns: 1_000_000, seed: 1 };
    let mut active = device.activate(&config).map_err(|(_, refusal)| refusal).expect("it starts");
    let mut index = 0;
    let mut read = || {
        let dt_ns = if index == 0 { 0 } else { 1_000_000 };
        let tick = Tick { index, time_ns: index * 1_000_000, dt_ns };
        index += 1;
        let mut state = DeviceState::HOME;
        (active.read(&tick, &mut state), state)
    };
    assert_eq!(read().0, Cycle::Fresh);

    puck.push(1, [350, 0, 0]);
    puck.push(2, [0, 0, -350]);
    puck.send(&[3, 2, 0]);
    std::thread::sleep(Duration::from_millis(20));
    let (_, state) = read();
    assert!((state.twist.linear() - DVec3::X * 0.02).length() < 1.0e-9, "{state:?}");
    assert!(state.twist.angular().z > 0.3 && state.buttons == 2, "{state:?}");
    // 49 more steps of 20 µm.
    let state = (0..49).map(|_| read().1).last().expect("it was read");
    assert!((state.pose.position() - DVec3::X * 1.0e-3).length() < 1.0e-9, "{state:?}");

    puck.unplug();
    let gone = (0..100).any(|_| {
        std::thread::sleep(Duration::from_millis(10));
        read().0 == Cycle::Fault(Fault::Disconnected)
    });
    assert!(gone, "an unplugged puck is a fault");
}
