//! The plugin of Haply's Inverse3 on Haply's service as Flotor provides it: a closed circle around the simulated flotor, in which
//! an error of either side shows.

use super::services::Service;
use flotor_hal::{Cycle, DVec3, DeviceState, LoopConfig, Tick, Wrench};
use flotor_loader::{ActiveDevice, Plugin, Setting};
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::stand_in::said_of_a_spring_on;
use flotor_tests::stand_in::{
    assert_every_rule_holds, assert_missing_torque_is_told, assert_runs_with_force, demo_on,
};
use flotor_tests::workspace_root;
use rustix::process::Signal;
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(20);
/// Ticks until the service's force has faded in.
const RAMP: usize = 220;

/// A flotor at its centre, held by a soft hand that moves nowhere by itself.
const HELD: &str = "rate_hz = 1000\n[device]\nplugin = \"simulated\"\n[device.parameters]\npreset = \"plain\"\n\
    hand = \"oscillate\"\nhand_centre_mm = 0\nhand_amplitude_mm = 0.0001\n[limits]\nforce_n = 8\n[[model]]\nplugin = \"program\"\n";

fn activated(service: &Service) -> ActiveDevice {
    let plugin = Plugin::in_process(&flotor_inverse3::FLOTOR_ENTRY).expect("it is a plugin");
    let settings = [("address", &*service.simulation), ("timeout_ms", "9000")];
    let settings =
        settings.map(|(key, value)| Setting::parse(plugin.parameters(), key, value).expect("it is legal"));
    let opened = plugin.open_device(&settings).expect("the service agrees");
    let config = LoopConfig { period_ns: 1_000_000, seed: 1 };
    opened.activate(&config).map_err(|(_, refusal)| refusal).expect("nobody else commands it")
}

/// Pushes for so many samples; the last one.
fn pushed(device: &mut ActiveDevice, index: &mut u64, force_n: DVec3, samples: usize) -> DeviceState {
    let (mut state, started, mut fresh) = (DeviceState::HOME, Instant::now(), 0);
    while fresh < samples {
        let tick = Tick { index: *index, time_ns: *index * 1_000_000, dt_ns: 1_000_000 };
        *index += 1;
        match device.read(&tick, &mut state) {
            Cycle::Fresh => {
                fresh += 1;
                assert!(!matches!(device.write(&tick, &Wrench::from_force(force_n)), Cycle::Fault(_)));
            }
            Cycle::Stale => std::thread::sleep(Duration::from_micros(20)),
            Cycle::Fault(fault) => panic!("{}", fault.advice()),
        }
        assert!(started.elapsed() < PATIENCE, "{fresh} samples");
    }
    state
}

#[test]
fn a_push_along_each_axis_is_felt_and_moves_the_flotor_along_it() {
    let scratch = Scratch::default();
    let scene = scratch.file("held.toml", HELD);
    let service = Service::start(&[&scene.display().to_string(), "--pace", "lockstep"]);
    let mut device = activated(&service);
    let mut index = 0;
    let home_m = pushed(&mut device, &mut index, DVec3::ZERO, RAMP).pose.position();
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        for force_n in [axis * 1.5, axis * -1.5] {
            let state = pushed(&mut device, &mut index, force_n, RAMP);
            assert!((state.delivered.force() - force_n).length() < 1.0e-12, "{force_n}: {state:?}");
            // The hand gives way, and along this axis only.
            let moved_m = state.pose.position() - home_m;
            let along_m = moved_m.dot(force_n.normalize());
            assert!(along_m > 1.0e-4, "{force_n}: {moved_m}");
            assert!(
                (moved_m - along_m * force_n.normalize()).length() < 0.05 * along_m,
                "{force_n}: {moved_m}"
            );
        }
    }
    drop(device);
    let summary = service.end();
    assert!(summary.contains("asked for 1.500 N"), "{summary}");
}

#[test]
fn a_torque_that_it_cannot_give_is_told_when_it_is_paired() {
    let service = Service::start(&[]);
    assert_missing_torque_is_told(|table| said_of_a_spring_on("inverse3", &service.simulation, table));
}

/// The demo with the two lines of the device changed.
#[test]
fn the_demo_runs_on_it_with_two_changed_lines() {
    let (service, scratch) = (Service::start(&[]), Scratch::default());
    let scene = demo_on(&scratch, "inverse3", &format!("address = \"{}\"", service.simulation));
    let long = ["--duration", "2s", "--set", "device.timeout_ms=9000"];
    assert_runs_with_force(&scratch, &[&[&*scene], &long[..]].concat(), &[]);
    let said = service.end();
    assert!(said.contains("asked for"), "{said}");
}

#[test]
fn with_the_service_every_rule_is_checked_and_holds() {
    let service = Service::start(&[]);
    let address = format!("address={}", service.simulation);
    assert_every_rule_holds("flotor-inverse3", &[&address, "timeout_ms=9000"]);
}

#[test]
fn a_service_that_is_killed_ends_the_run_as_a_device_that_is_gone() {
    let service = Service::start(&[]);
    let scene = workspace_root().join("host/scenes/inverse3.toml").display().to_string();
    let address = format!("device.address={}", service.simulation);
    let running = Flotor::with(["run", &scene, "--set", &address, "--set", "device.timeout_ms=9000"]).start();
    std::thread::sleep(Duration::from_millis(1500));
    service.process.signal(Signal::KILL);
    let ran = running.wait();
    assert_eq!(ran.code, Some(exit_code::DEVICE_FAULT), "{ran:#?}");
    assert!(ran.stderr.contains("the device is gone"), "{ran:#?}");
}
