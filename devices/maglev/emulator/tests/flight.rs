//! Take-off and landing through the plugin: the handle moves home from its start position and is weighed; failures are
//! reported.
#![allow(clippy::unwrap_used)] // helpers of tests

use crate::machine::CAPABILITIES;
use flotor_hal::{Cycle, DVec3, DeviceState, LoopConfig, Pose, Refusal, Tick, Twist, Wrench};
use flotor_loader::{ActiveDevice, Plugin, Setting};
use flotor_maglev::protocol::Mode;
use flotor_maglev::transport::stream::StreamLink;
use flotor_maglev::transport::tcp::prepared;
use flotor_maglev_emulator::controller::Sample;
use flotor_maglev_emulator::{Emulator, Event, Pace, Plant, controller_config};
use std::net::TcpListener;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};

const PERIOD_NS: u64 = 1_000_000;
const START_M: f64 = -3.0e-3;
/// The spring that holds the handle along z, N/m: it gives way under what it carries.
const HOLDING_N_PER_M: f64 = 10_000.0;

/// Nothing holds it but the coils: it falls. What they push with stands in `pushed_n`.
struct Falling {
    weight_n: f64,
    z_m: f64,
    v_m_per_s: f64,
    pushed_n: Arc<Mutex<f64>>,
}

impl Plant for Falling {
    fn advance(&mut self, dt_us: u64, wrench: &Wrench) -> Sample {
        *self.pushed_n.lock().unwrap() = wrench.force().z;
        let steps = 8.0;
        for _ in 0..8 {
            let h = dt_us as f64 * 1.0e-6 / steps;
            let mass_kg = self.weight_n / 9.806_65;
            self.v_m_per_s += h * (wrench.force().z - self.weight_n) / mass_kg;
            self.z_m += h * self.v_m_per_s;
        }
        let pose = Pose::new(DVec3::Z * self.z_m, Pose::HOME.orientation());
        Sample { pose, twist: Twist::new(DVec3::Z * self.v_m_per_s, DVec3::ZERO), ..Sample::HOME }
    }

    fn restart(&mut self) {
        (self.z_m, self.v_m_per_s) = (START_M, 0.0);
    }
}

/// Takes off with this weight for so long and flies, if it came home; the modes of the controller, each with whether
/// something was wrong.
fn flight(
    weight_n: f64,
    takeoff_ms: f64,
    fly: impl FnOnce(Result<ActiveDevice, Refusal>, &Mutex<f64>),
) -> Vec<(Mode, bool)> {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let pushed_n = Arc::new(Mutex::new(0.0));
    let plant = Falling { weight_n, z_m: START_M, v_m_per_s: 0.0, pushed_n: Arc::clone(&pushed_n) };
    let emulator = std::thread::spawn(move || {
        let config = controller_config(&CAPABILITIES, Pace::Lockstep, "fly");
        let mut link = StreamLink::new(prepared(listener.accept().unwrap().0).unwrap());
        let mut modes = Vec::new();
        Emulator::new(config, Pace::Lockstep, plant).serve(
            &mut link,
            &AtomicBool::new(false),
            &mut |event| {
                if let Event::Mode { mode, condition, .. } = event {
                    modes.push((mode, !condition.faults().is_empty()));
                }
            },
        );
        modes
    });
    let plugin = Plugin::in_process(&flotor_maglev::FLOTOR_ENTRY).unwrap();
    let schema = plugin.parameters();
    let settings = [
        Setting::parse(schema, "address", &address),
        Setting::parse(schema, "pace", "lockstep"),
        Setting::parse(schema, "gravity", "defy"),
        Setting::number(schema, "takeoff_ms", takeoff_ms),
        Setting::number(schema, "landing_ms", 300.0),
        Setting::number(schema, "watchdog_ms", 1000.0),
    ];
    let device = plugin.open_device(&settings.map(Result::unwrap)).unwrap();
    let config = LoopConfig { period_ns: PERIOD_NS, seed: 1 };
    fly(device.activate(&config).map_err(|(_, refusal)| refusal), &pushed_n);
    emulator.join().unwrap()
}

#[test]
fn the_handle_comes_home_and_its_weight_is_found() {
    // The three weights that are published for one flotor (D5).
    for weight_n in [5.69, 6.9, 7.7] {
        let modes = flight(weight_n, 1500.0, |device, pushed_n| {
            let (mut device, mut state) = (device.unwrap(), DeviceState::HOME);
            assert_eq!(device.read(&Tick::default(), &mut state), Cycle::Fresh);
            let off_m = state.pose.position().z + weight_n / HOLDING_N_PER_M;
            assert!(off_m.abs() < 2.0e-5, "{off_m} m from where it should rest");
            // A scene without a force: what is carried is the weight that was found.
            let tick = Tick { index: 1, time_ns: PERIOD_NS, dt_ns: PERIOD_NS };
            assert_eq!(device.write(&tick, &Wrench::ZERO), Cycle::Fresh);
            assert_eq!(device.read(&tick, &mut state), Cycle::Fresh);
            let found_n = *pushed_n.lock().unwrap();
            // The velocity of a status is in steps of 0.1 mm/s, 1.5 mN of damping.
            assert!((found_n - weight_n).abs() < 2.0e-3, "{found_n} N of {weight_n} N");
            // Defied: with the weight carried beside the spring it does not fall, and it is let down in time.
            drop(device.deactivate());
        });
        let flown = [(Mode::Armed, false), (Mode::Levitating, false), (Mode::Disarmed, false)];
        assert_eq!(modes, flown, "{weight_n} N");
    }
}

#[test]
fn a_flight_that_goes_wrong_says_so() {
    // Heavier than the coils: it is leaving the range, and the controller lands.
    flight(400.0, 500.0, |device, _| {
        let refusal = device.err().expect("it cannot come home").to_string();
        assert!(
            refusal.contains("homing failed: the controller ended the levitation (faults: "),
            "{refusal}"
        );
    });
}
