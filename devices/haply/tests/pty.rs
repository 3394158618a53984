//! Plugin with an emulated board at a pseudo terminal, called through the device contract as by a host.

use flotor_hal::glam::DVec2;
use flotor_hal::{Axes, Cycle, DVec3, DeviceState, Fault, LoopConfig, Tick, Wrench};
use flotor_haply::emulator::EmulatedBoard;
use flotor_haply::pantograph::Pantograph;
use flotor_loader::{OpenedDevice, Plugin, Setting};
use serialport::{SerialPort, TTYPort};
use std::io::{Read, Write};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

const LINKAGE: Pantograph = Pantograph { inner_m: 0.07, outer_m: 0.09, base_m: 0.038 };
const CENTRE_M: DVec2 = DVec2::new(0.019, 0.1);
const CONFIG: LoopConfig = LoopConfig { period_ns: 1_000_000, seed: 1 };

/// What is done to the bytes of a board on their way.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Line {
    Whole,
    /// Every 31st byte of all answers is lost: every third or fourth answer.
    Lossy,
    /// Nothing comes back.
    Dead,
    /// The board is unplugged.
    Cut,
}

/// An emulated board on a thread of its own.
struct Rig {
    shared: Arc<Mutex<(EmulatedBoard, Line)>>,
    path: String,
    thread: Option<JoinHandle<()>>,
}

impl Rig {
    fn start() -> Self {
        let (mut board_end, host_end) = TTYPort::pair().expect("the system has pseudo terminals");
        let path = host_end.name().expect("a pseudo terminal has a path");
        board_end.set_timeout(Duration::from_millis(5)).expect("it is ours");
        let shared = Arc::new(Mutex::new((EmulatedBoard::new(LINKAGE, CENTRE_M), Line::Whole)));
        let of_thread = Arc::clone(&shared);
        let thread = std::thread::spawn(move || {
            let (mut chunk, mut sent, host_end) = ([0; 256], 0_u64, host_end);
            loop {
                let length = board_end.read(&mut chunk).unwrap_or(0);
                let mut shared = of_thread.lock().expect("nobody panics with it");
                let line = shared.1;
                let mut said = shared.0.receive(&chunk[..length]);
                drop(shared);
                match line {
                    Line::Whole => {}
                    Line::Lossy => said.retain(|_| {
                        sent += 1;
                        !sent.is_multiple_of(31)
                    }),
                    Line::Dead => said.clear(),
                    Line::Cut => break,
                }
                if board_end.write_all(&said).is_err() {
                    break;
                }
            }
            drop(host_end);
        });
        Self { shared, path, thread: Some(thread) }
    }

    fn board(&self) -> MutexGuard<'_, (EmulatedBoard, Line)> {
        self.shared.lock().expect("nobody panics with it")
    }

    /// Waits until the board knows something: bytes take the time the machine gives them.
    fn until_board<T>(&self, knows: impl Fn(&EmulatedBoard) -> Option<T>) -> T {
        let started = Instant::now();
        while started.elapsed() < Duration::from_secs(10) {
            let known = knows(&self.board().0);
            if let Some(known) = known {
                return known;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        panic!("the board does not know within ten seconds");
    }

    /// Waits until the board gives no force.
    fn until_released(&self) {
        self.until_board(|board| (board.force_n().map(DVec2::length) == Some(0.0)).then_some(()));
    }

    /// By a host that waits for long: a machine may delay every answer.
    fn open(&self) -> OpenedDevice {
        self.open_waiting_ms("8000")
    }

    fn open_waiting_ms(&self, timeout_ms: &str) -> OpenedDevice {
        let plugin = Plugin::in_process(&flotor_haply::FLOTOR_ENTRY).expect("it is a plugin");
        let set = |key, value| Setting::parse(plugin.parameters(), key, value).expect("it is a parameter");
        let settings = [set("port", &self.path), set("timeout_ms", timeout_ms)];
        plugin.open_device(&settings).unwrap_or_else(|error| panic!("{error}"))
    }
}

impl Drop for Rig {
    fn drop(&mut self) {
        self.board().1 = Line::Cut;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// A loop that reads and writes until something holds, or for ten seconds.
struct Loop {
    device: flotor_loader::ActiveDevice,
    index: u64,
    state: DeviceState,
    started: Instant,
}

impl Loop {
    fn start(rig: &Rig) -> Self {
        Self::of(rig.open())
    }

    fn of(opened: OpenedDevice) -> Self {
        let active = opened.activate(&CONFIG).map_err(|(_, refusal)| refusal).expect("it answers");
        Self { device: active, index: 0, state: DeviceState::HOME, started: Instant::now() }
    }

    fn tick(&mut self, wrench: &Wrench) -> Cycle {
        let time_ns = u64::try_from(self.started.elapsed().as_nanos()).expect("a few seconds");
        let tick = Tick { index: self.index, time_ns, dt_ns: 1_000_000 };
        self.index += 1;
        let cycle = self.device.read(&tick, &mut self.state);
        let written = self.device.write(&tick, wrench);
        std::thread::sleep(Duration::from_millis(1));
        if let Cycle::Fault(_) = cycle {
            cycle
        } else if let Cycle::Fault(_) = written {
            written
        } else {
            cycle
        }
    }

    fn until(&mut self, wrench: &Wrench, mut holds: impl FnMut(Cycle, &DeviceState) -> bool) {
        let started = Instant::now();
        while started.elapsed() < Duration::from_secs(10) {
            let cycle = self.tick(wrench);
            if holds(cycle, &self.state) {
                return;
            }
        }
        panic!("not within ten seconds; the last state is {:?}", self.state);
    }
}

#[test]
fn the_handle_is_where_the_hand_has_it_and_the_force_arrives() {
    let rig = Rig::start();
    let mut run = Loop::start(&rig);
    // To the right of and nearer to the user than the centre: the board's x is to the left, its y to the user.
    rig.board().0.move_handle(CENTRE_M + DVec2::new(-0.02, 0.01));
    let there = DVec3::new(0.02, -0.01, 0.0);
    // f32 degrees at 0.16 m: a few nanometres in a micrometre.
    run.until(&Wrench::ZERO, |cycle, state| {
        cycle == Cycle::Fresh && (state.pose.position() - there).length() < 1.0e-6
    });
    let pushed = Wrench::from_force(DVec3::new(1.5, -0.5, 7.0));
    // What the motors do at the angles the board is at is the force, turned into the board's frame. The board may be a tick or
    // two behind what was said to be delivered.
    run.until(&pushed, |_, state| {
        let at_the_motors_n = rig.board().0.force_n().expect("the linkage closes");
        state.delivered.force() == DVec3::new(1.5, -0.5, 0.0)
            && (at_the_motors_n - DVec2::new(-1.5, 0.5)).length() < 1.0e-5
    });
    // Not more than allowed, in the same direction.
    run.until(&Wrench::from_force(DVec3::new(30.0, 40.0, 0.0)), |_, state| {
        (state.delivered.force() - DVec3::new(1.8, 2.4, 0.0)).length() < 1.0e-12
    });
    let opened = run.device.deactivate().expect("it comes back");
    rig.until_released();
    drop(opened);
}

#[test]
fn it_declares_two_axes_and_can_be_activated_again() {
    let rig = Rig::start();
    let mut opened = rig.open();
    let capabilities = opened.capabilities().expect("they are numbers");
    assert_eq!((capabilities.sensed, capabilities.actuated), (Axes::PLANE, Axes::PLANE));
    for _ in 0..2 {
        let active = opened.activate(&CONFIG).map_err(|(_, refusal)| refusal).expect("it answers");
        opened = active.deactivate().expect("it comes back");
    }
    let arms = rig.until_board(|board| board.arms().copied());
    assert_eq!(arms.map(|arm| arm.start_deg), [168.0, 12.0]);
}

#[test]
fn lost_bytes_cost_samples_and_nothing_else() {
    let rig = Rig::start();
    let mut run = Loop::start(&rig);
    rig.board().1 = Line::Lossy;
    rig.board().0.move_handle(CENTRE_M + DVec2::new(0.01, 0.0));
    let (mut fresh, mut worst_m) = (0, 0.0_f64);
    run.until(&Wrench::ZERO, |cycle, state| {
        assert!(!matches!(cycle, Cycle::Fault(_)), "{cycle:?}");
        fresh += u32::from(cycle == Cycle::Fresh);
        if fresh > 3 {
            worst_m = worst_m.max((state.pose.position() - DVec3::NEG_X * 0.01).length());
        }
        fresh > 40
    });
    // Half an answer is forgotten before the next request: no pose is made of two.
    assert!(worst_m < 1.0e-6, "{worst_m}");
    rig.board().1 = Line::Whole;
    run.until(&Wrench::ZERO, |cycle, state| {
        cycle == Cycle::Fresh && (state.pose.position() - DVec3::NEG_X * 0.01).length() < 1.0e-6
    });
}

#[test]
fn a_silent_board_is_a_timeout_and_an_unplugged_one_is_gone() {
    let rig = Rig::start();
    let mut run = Loop::of(rig.open_waiting_ms("1000"));
    rig.board().1 = Line::Dead;
    run.until(&Wrench::ZERO, |cycle, _| cycle == Cycle::Fault(Fault::Timeout));
    rig.board().1 = Line::Cut;
    run.until(&Wrench::ZERO, |cycle, _| cycle == Cycle::Fault(Fault::Disconnected));
}

#[test]
fn another_thread_takes_the_force_away_even_if_the_loop_never_comes_back() {
    let rig = Rig::start();
    let opened = rig.open();
    let stopper = opened.stopper();
    let mut run = Loop::of(opened);
    run.until(&Wrench::from_force(DVec3::X), |_, state| state.delivered.force() == DVec3::X);
    std::thread::spawn(move || stopper.safe_stop()).join().expect("it does not panic");
    // No tick from here on.
    rig.until_released();
    run.until(&Wrench::from_force(DVec3::X), |_, state| state.delivered == Wrench::ZERO);
}

#[test]
fn without_a_port_and_without_a_board_it_says_what_to_do() {
    let plugin = Plugin::in_process(&flotor_haply::FLOTOR_ENTRY).expect("it is a plugin");
    let error = |settings: &[Setting]| match plugin.open_device(settings) {
        Ok(_) => panic!("there is no board"),
        Err(error) => error.to_string(),
    };
    assert!(error(&[]).contains("`port`"), "{}", error(&[]));
    let port = Setting::parse(plugin.parameters(), "port", "/dev/no-such-port").expect("a path is text");
    let message = error(&[port]);
    assert!(message.contains("/dev/no-such-port") && message.contains("/dev/serial/by-id"), "{message}");
}
