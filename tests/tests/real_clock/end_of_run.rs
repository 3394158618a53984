//! How force begins and ends on the real clock: a device is energised right before its first tick and stopped right after
//! its last one, and in between nothing drops.

use flotor_core::Change;
use flotor_core::limits::{Bound, Boundary};
use flotor_core::rendered_boundary::RenderedBoundary;
use flotor_core::trace::{Events, TickRecord};
use flotor_hal::abi::{Entry, device_entry};
use flotor_hal::{
    ActiveDevice, Axes, Capabilities, Cycle, Device, DeviceInfo, DeviceState, LoopConfig, Refusal, SafeStop,
    Settings, Tick, Wrench,
};
use flotor_live::Directory;
use flotor_servo::RunEnd;
use flotor_servo::{Clock, EmergencySource, StopSwitch};
use flotor_session::registry::Registry;
use flotor_session::scene::Scene;
use flotor_session::{Observer, RunOptions, Session};
use flotor_tests::scratch::Scratch;
use flotor_tests::watched::{watch, watch_on};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// A handle at rest whose button is pressed from tick 50 on.
struct Button;

static ENTRY: Entry = device_entry::<Button>();
static STOPPED: AtomicBool = AtomicBool::new(false);
/// Name of the thread that energised it.
static ENERGISED_BY: Mutex<Option<String>> = Mutex::new(None);

struct Stop;

impl SafeStop for Stop {
    fn safe_stop(&self) {
        STOPPED.store(true, Ordering::Release);
    }
}

impl Device for Button {
    const INFO: DeviceInfo = DeviceInfo::new("button", "Button", "A handle at rest with a button");
    type Active = Self;
    type Stop = Stop;

    fn open(_: &Settings<'_>) -> Result<Self, Refusal> {
        Ok(Self)
    }

    fn capabilities(&self) -> Capabilities {
        let full = Capabilities::driving(Axes::ALL).with_range(0.012, 0.12).with_limits(10.0, 1.0);
        full.with_slew(1.0e6, 1.0e6).with_stiffness(1.0e4)
    }

    fn stopper(&self) -> Stop {
        Stop
    }

    fn activate(self, _: &LoopConfig) -> Result<Self, (Self, Refusal)> {
        *ENERGISED_BY.lock().expect("nobody panics with it") =
            std::thread::current().name().map(str::to_owned);
        Ok(self)
    }
}

impl ActiveDevice for Button {
    type Opened = Self;

    fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle {
        *state = DeviceState::HOME;
        state.sampled_ns = tick.time_ns;
        state.buttons = u32::from(tick.index >= 50);
        Cycle::Fresh
    }

    fn write(&mut self, _: &Tick, _: &Wrench) -> Cycle {
        Cycle::Fresh
    }

    fn deactivate(self) -> Self {
        self
    }
}

/// Somebody who looks at the first tick until the device has been stopped, as a recorder on a disk that hangs would.
#[derive(Default)]
struct Dawdler {
    saw_it_stopped: bool,
}

impl Observer for Dawdler {
    fn observe(&mut self, _: &TickRecord) {
        let started = Instant::now();
        while !STOPPED.load(Ordering::Acquire) && started.elapsed() < Duration::from_secs(20) {
            std::thread::sleep(Duration::from_millis(1));
        }
        self.saw_it_stopped = STOPPED.load(Ordering::Acquire);
    }

    fn change(&mut self, _: &Change) {}
}

#[test]
fn a_device_is_energised_and_stopped_by_the_loops_own_thread_whatever_an_observer_is_at() {
    let _turn = crate::alone();
    let scene = "rate_hz = 1000\nduration_s = 60\n[device]\nplugin = \"button\"\n\
                 [limits]\nemergency_button = 0\nwatchdog_ms = 60000\n";
    let scene = Scene::parse(Path::new("scene.toml"), scene).expect("the scene is right");
    let registry = Registry::search(&[]).with_linked(&ENTRY).expect("it is a plugin");
    let options = RunOptions { clock: Clock::Real, seed: 1 };
    let session = Session::prepare(&scene, &registry, &options).expect("it starts");
    let scratch = Scratch::default();
    let directory = Directory::at(scratch.path().join("runs"));
    let session = session.latched_in(&directory);
    let energised_by = || ENERGISED_BY.lock().expect("nobody panics with it").clone();
    assert_eq!(energised_by(), None, "before it runs nothing is energised");
    let mut dawdler = Dawdler::default();
    let outcome = session.run(&mut dawdler, &StopSwitch::default()).expect("it runs");
    assert_eq!(outcome.end, RunEnd::EmergencyStop(EmergencySource::Button));
    let pressed = directory.latch().state().pressed.expect("it stays");
    assert!(pressed.source.starts_with("emergency stop (button of the device)"), "{pressed}");
    assert!(dawdler.saw_it_stopped, "the device was stopped after the observer had looked");
    assert_eq!(energised_by().as_deref(), Some("flotor-servo"));
}

/// A handle held 3 mm below home in a wall for 1.2 s; half a second of ramp.
const HELD: &str = "rate_hz = 1000\nduration_s = 1.2\n[device]\nplugin = \"simulated\"\n[device.parameters]\n\
                    hand = \"hold\"\nhand_centre_mm = -3\n[[model]]\nplugin = \"wall\"\n\
                    [limits]\nramp_s = 0.5\nwatchdog_ms = 60000\n";

#[test]
fn a_run_whose_time_is_over_fades_out_and_does_not_drop() {
    let _turn = crate::alone();
    let run = watch_on(Clock::Real, HELD);
    assert_eq!(run.outcome.end, RunEnd::Finished);
    let force_n = |record: &TickRecord| record.commanded.force().length();
    let most_n = run.records.iter().map(force_n).fold(0.0, f64::max);
    let last = run.records.last().expect("there were ticks");
    assert!(most_n > 0.5, "{most_n} N");
    // Where the last tick comes late, the release is over before it.
    assert!(run.records.iter().any(|record| record.events.intersects(Events::RELEASING)), "{last:?}");
    // Even if its last tenth were missed, the ramp is at less than 3 % of the force there.
    assert!(force_n(last) < 0.03 * most_n, "{} of {most_n} N", force_n(last));
    // Nobody holds anything on the virtual clock.
    let run = watch(HELD);
    let last = run.records.last().expect("there were ticks");
    assert!(force_n(last) > 0.5 && !last.events.intersects(Events::RELEASING), "{last:?}");
}

/// Height at which the boundary wall of the simulated flotor begins, mm: 12 mm of range, and a limit of force far above 5 N.
fn wall_mm(rate_hz: u64) -> f64 {
    let flotor = Capabilities { range_m: [0.012; 3], max_force_n: [50.0; 3], ..Capabilities::UNDRIVEN };
    let wall = RenderedBoundary::new(&Boundary::default(), &flotor, &Bound::NONE, 1_000_000_000 / rate_hz);
    wall.begins_m[2] * 1.0e3
}

/// A free flotor that leans on the wall at the edge of its range with a third of a newton, where no damping but the wall's own
/// holds it.
#[test]
fn the_boundary_holds_and_creates_no_energy_at_any_rate() {
    let _turn = crate::alone();
    for rate_hz in [100, 200, 300, 1000, 10_000] {
        let scene = format!(
            "rate_hz = {rate_hz}\nduration_s = 3\n[device]\nplugin = \"simulated\"\n[device.parameters]\n\
             hand = \"open\"\nfeedforward_n = 6\nstart_z_mm = {}\n",
            wall_mm(rate_hz)
        );
        let run = watch(&scene);
        assert_eq!(run.outcome.end, RunEnd::Finished, "{rate_hz} Hz");
        let lowest_j = run.records.iter().map(|record| record.port_energy_j).fold(0.0, f64::min);
        let wall = run.records.iter().filter(|record| record.events.intersects(Events::BOUNDARY)).count();
        assert!(lowest_j > -1.0e-6, "{rate_hz} Hz: {lowest_j} J");
        assert!(wall > run.records.len() / 2, "{rate_hz} Hz: {wall} of {} ticks", run.records.len());
    }
}
