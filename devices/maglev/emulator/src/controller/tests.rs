//! State machine in simulated time: accepted hosts, validity of commands, and behaviour without requests.
#![allow(clippy::cast_possible_truncation)] // random bytes

#[path = "../../tests/machine/mod.rs"]
mod machine;

use super::{Controller, ControllerConfig, LimitConfig, Reply, Sample};
use crate::{Pace, controller_config};
use flotor_hal::{DQuat, DVec3, Pose, Twist, Wrench};
use flotor_maglev::protocol::{Condition, Mode, Rejection, Request, RequestFrame};
use machine::CAPABILITIES;

const CYCLE_US: u64 = 1000;
const WATCHDOG_US: u32 = 8000;
const SESSION: u32 = 0xbeef;

fn config() -> ControllerConfig {
    controller_config(&CAPABILITIES, Pace::RealTime, "test")
}

/// A controller with a clock and a host that numbers its frames.
struct Bench {
    controller: Controller,
    now_us: u64,
    sequence: u32,
    sample: Sample,
}

impl Bench {
    fn new() -> Self {
        Self { controller: Controller::new(config()), now_us: 0, sequence: 0, sample: Sample::HOME }
    }

    fn levitating() -> Self {
        let mut bench = Self::new();
        bench.ask(Request::Arm { period_us: 1000, watchdog_us: WATCHDOG_US });
        bench.ask(Request::TakeOff);
        assert_eq!(bench.controller.mode(), Mode::Levitating);
        bench
    }

    fn frame(&mut self, request: Request) -> RequestFrame {
        self.sequence += 1;
        RequestFrame { sequence: self.sequence, acknowledged: 0, time_us: 0, session: SESSION, request }
    }

    fn ask(&mut self, request: Request) -> Option<Reply> {
        let frame = self.frame(request);
        self.controller.receive(&frame.encode(), self.now_us)
    }

    fn push(&mut self, force_n: f32) -> Option<Reply> {
        self.ask(Request::Command { wrench: [0.0, 0.0, force_n, 0.0, 0.0, 0.0], valid_us: 3000 })
    }

    fn cycle(&mut self) -> Wrench {
        let wrench = self.controller.drive(self.now_us, CYCLE_US);
        self.now_us += CYCLE_US;
        self.controller.observe(self.now_us, &self.sample);
        wrench
    }

    /// Vertical force after enough cycles for the slew limit to be over.
    fn settled_n(&mut self, force_n: f32) -> f64 {
        for _ in 0..4 {
            self.push(force_n);
            self.cycle();
        }
        self.push(force_n);
        self.cycle().force().z
    }
}

#[test]
fn coils_are_off_until_taken_off() {
    let mut bench = Bench::new();
    bench.push(5.0);
    assert_eq!(bench.cycle(), Wrench::ZERO);
    assert_eq!(
        bench.controller.intake().rejections().of(Rejection::Session),
        1,
        "nobody is armed, so nobody has a session"
    );
    bench.ask(Request::Arm { period_us: 1000, watchdog_us: WATCHDOG_US });
    bench.push(5.0);
    assert_eq!((bench.controller.mode(), bench.cycle()), (Mode::Armed, Wrench::ZERO));
    bench.ask(Request::TakeOff);
    assert_eq!(bench.settled_n(5.0), 5.0);
    bench.ask(Request::Disarm);
    assert_eq!((bench.controller.mode(), bench.cycle()), (Mode::Disarmed, Wrench::ZERO));
}

#[test]
fn each_wrong_frame_is_counted_and_moves_nothing() {
    let mut bench = Bench::levitating();
    assert_eq!(bench.settled_n(1.0), 1.0);
    let good = bench.frame(Request::Command { wrench: [0.0, 0.0, 50.0, 0.0, 0.0, 0.0], valid_us: 3000 });
    let mut damaged = good.encode();
    damaged[30] ^= 4;
    let nan = RequestFrame { request: Request::Command { wrench: [f32::NAN; 6], valid_us: 3000 }, ..good };
    let stranger = RequestFrame { session: SESSION + 1, ..good };
    let over = RequestFrame { sequence: good.sequence - 3, ..good };
    let again = RequestFrame { sequence: good.sequence - 1, ..good };
    let packets = [
        good.encode()[..63].to_vec(),
        [good.encode().as_slice(), &[0]].concat(),
        damaged.to_vec(),
        nan.encode().to_vec(),
        stranger.encode().to_vec(),
        over.encode().to_vec(),
        again.encode().to_vec(),
        Vec::new(),
    ];
    let before = bench.controller.clone();
    for packet in packets {
        assert_eq!(bench.controller.receive(&packet, bench.now_us), None);
    }
    bench.controller.receive_malformed();
    let counted = *bench.controller.intake().rejections();
    use Rejection::{Checksum, Duplicate, Length, NotFinite, Old, Session};
    let one_each = [Checksum, NotFinite, Session, Old, Duplicate].map(|reason| counted.of(reason));
    assert_eq!((one_each, counted.of(Length), counted.total()), ([1; 5], 4, 9));
    // The next wrench is what it would have been without them.
    let mut untouched = before;
    assert_eq!(bench.controller.drive(bench.now_us, CYCLE_US), untouched.drive(bench.now_us, CYCLE_US));
}

#[test]
fn silence_ends_the_session_by_the_watchdog_and_two_milliseconds() {
    let mut bench = Bench::levitating();
    bench.settled_n(5.0);
    let heard_us = bench.now_us - CYCLE_US;
    while bench.controller.mode() == Mode::Levitating {
        bench.cycle();
        assert!(bench.now_us - heard_us <= u64::from(WATCHDOG_US) + 2000, "still obeying");
    }
    assert_eq!(bench.controller.mode(), Mode::Holding);
    assert!(bench.controller.condition().contains(Condition::WATCHDOG));
    // The host wakes up: its frames, right in every other way, are of a session that is over.
    assert_eq!(bench.push(50.0), None);
    assert_eq!(bench.controller.intake().rejections().of(Rejection::Session), 1);

    let mut modes = vec![Mode::Holding];
    for _ in 0..2000 {
        let wrench = bench.cycle();
        if modes.last() != Some(&bench.controller.mode()) {
            modes.push(bench.controller.mode());
        }
        if bench.controller.mode() == Mode::Fault {
            assert_eq!(wrench, Wrench::ZERO);
        }
    }
    assert_eq!(modes, [Mode::Holding, Mode::Landing, Mode::Fault], "hold, land, stay down");
    // Latched: arming is not enough, switching off is.
    bench.ask(Request::Arm { period_us: 1000, watchdog_us: WATCHDOG_US });
    assert_eq!(bench.controller.mode(), Mode::Fault);
    bench.ask(Request::Disarm);
    assert_eq!(bench.controller.mode(), Mode::Disarmed);
    // And then by a new session only: an old frame cannot begin the old one again.
    bench.ask(Request::Arm { period_us: 1000, watchdog_us: WATCHDOG_US });
    assert_eq!(bench.controller.mode(), Mode::Disarmed);
    let arm = bench.frame(Request::Arm { period_us: 1000, watchdog_us: WATCHDOG_US });
    bench
        .controller
        .receive(&RequestFrame { session: SESSION + 1, sequence: 1, ..arm }.encode(), bench.now_us);
    assert_eq!(bench.controller.mode(), Mode::Armed);
}

#[test]
fn a_lost_link_switches_off_at_once() {
    let mut bench = Bench::levitating();
    bench.settled_n(5.0);
    bench.controller.link_lost(bench.now_us);
    assert_eq!((bench.controller.mode(), bench.cycle()), (Mode::Disarmed, Wrench::ZERO));
    assert!(bench.controller.condition().contains(Condition::LINK_LOST));
}

#[test]
fn a_command_is_never_replayed_beyond_its_time() {
    let mut bench = Bench::levitating();
    assert_eq!(bench.settled_n(5.0), 5.0);
    // Valid for 3 ms, and one cycle of it is over. Then: damping alone, which is nothing at rest.
    let forces: Vec<f64> = (0..4).map(|_| bench.cycle().force().z).collect();
    assert_eq!(forces, [5.0, 5.0, 0.0, 0.0]);
    assert!(bench.controller.condition().contains(Condition::EXPIRED));
    assert_eq!(bench.controller.mode(), Mode::Levitating, "the watchdog is not over");
    assert_eq!(bench.settled_n(2.0), 2.0, "and the next command is obeyed");
}

#[test]
fn force_torque_and_their_change_are_limited() {
    let mut bench = Bench::levitating();
    let LimitConfig { max_force_n, max_torque_nm, force_slew_n_per_s, .. } = config().limits;
    let mut last = DVec3::ZERO;
    for _ in 0..20 {
        bench.ask(Request::Command { wrench: [1.0e4; 6], valid_us: 3000 });
        let wrench = bench.cycle();
        assert!((wrench.force() - last).length() <= force_slew_n_per_s * 1.0e-3 * (1.0 + 1.0e-12));
        last = wrench.force();
    }
    let wrench = bench.controller.drive(bench.now_us, CYCLE_US);
    assert_eq!((wrench.force(), wrench.torque()), (max_force_n, max_torque_nm));
    assert!(bench.controller.condition().contains(Condition::LIMITED));
}

#[test]
fn too_much_for_too_long_is_a_fault() {
    let mut bench = Bench::levitating();
    let mut seconds: f64 = 0.0;
    while bench.controller.mode() == Mode::Levitating {
        bench.push(140.0);
        bench.cycle();
        seconds += 1.0e-3;
        assert!(seconds < 60.0, "full load is never borne for a minute");
    }
    // 1 - e^(-t/60) = (2/3.5)^2: 23.7 s.
    assert!((seconds - 23.7).abs() < 0.2, "{seconds} s");
    assert!(bench.controller.condition().contains(Condition::OVERLOAD));
    let mut bench = Bench::levitating();
    for _ in 0..100_000 {
        bench.push(75.0);
        bench.cycle();
    }
    assert_eq!(bench.controller.mode(), Mode::Levitating, "75 of 140 N may stay for ever");
}

#[test]
fn the_controllers_own_wall_keeps_the_flotor_in_range() {
    let mut bench = Bench::levitating();
    let limits = config().limits;
    let outside = DVec3::X * (limits.wall_m + 0.1e-3);
    bench.sample.pose = Pose::new(outside, DQuat::IDENTITY);
    bench.sample.twist = Twist::new(DVec3::X * 0.02, DVec3::ZERO);
    bench.cycle();
    let pushed_n = bench.settled_n(0.0);
    let wrench = bench.controller.drive(bench.now_us, CYCLE_US);
    let expected = -(limits.wall_n_per_m * 0.1e-3 + limits.wall_ns_per_m * 0.02);
    assert!((wrench.force().x - expected).abs() < 1.0e-9 && pushed_n == 0.0);
    assert!(bench.controller.condition().contains(Condition::BOUNDARY));
}

#[test]
fn a_flotor_that_leaves_the_range_is_landed_before_the_sensors_lose_it() {
    let mut bench = Bench::levitating();
    bench.settled_n(5.0);
    // 11.9 mm, and beyond 11.95 mm within two milliseconds.
    bench.sample.pose = Pose::new(DVec3::X * 11.9e-3, DQuat::IDENTITY);
    bench.sample.twist = Twist::new(DVec3::X * 0.1, DVec3::ZERO);
    bench.cycle();
    let wrench = bench.cycle();
    assert_eq!(
        (bench.controller.mode(), bench.controller.condition().faults()),
        (Mode::Landing, Condition::EDGE)
    );
    assert!(wrench.force().x < -1.5, "wall and damping go on: {wrench:?}");
    assert_eq!(bench.push(50.0), None, "and its host has no say any more");
    (0..600).for_each(|_| {
        bench.cycle();
    });
    assert_eq!((bench.controller.mode(), bench.cycle()), (Mode::Fault, Wrench::ZERO));
}

#[test]
fn what_the_sensors_say_is_a_fault_in_the_same_cycle() {
    let wrongs = [
        (Sample { in_range: false, ..Sample::HOME }, Condition::SENSOR_RANGE),
        (Sample { too_hot: true, ..Sample::HOME }, Condition::OVER_TEMPERATURE),
        (Sample { twist: Twist::new(DVec3::Z * 3.0, DVec3::ZERO), ..Sample::HOME }, Condition::OVER_SPEED),
        (Sample { pose: Pose::new(DVec3::NAN, DQuat::IDENTITY), ..Sample::HOME }, Condition::SENSOR_RANGE),
    ];
    for (sample, condition) in wrongs {
        let mut bench = Bench::levitating();
        bench.settled_n(5.0);
        bench.sample = sample;
        bench.cycle();
        bench.push(5.0);
        assert_eq!(bench.cycle(), Wrench::ZERO, "{condition}");
        assert_eq!((bench.controller.mode(), bench.controller.condition()), (Mode::Fault, condition));
    }
}

#[test]
fn landing_on_request_ends_disarmed_without_a_fault() {
    let mut bench = Bench::levitating();
    bench.settled_n(5.0);
    bench.ask(Request::Land);
    assert_eq!(bench.controller.mode(), Mode::Landing);
    assert_eq!(bench.settled_n(50.0), 0.0, "who lands obeys no command");
    (0..600).for_each(|_| {
        bench.cycle();
    });
    assert_eq!((bench.controller.mode(), bench.controller.condition()), (Mode::Disarmed, Condition::NONE));
}

/// A host that says anything in any order: the coils never give more than their limits, never NaN, and never
/// anything while the controller is disarmed, armed or faulted.
#[test]
fn no_conversation_breaks_the_limits() {
    let size = std::env::var("FLOTOR_TEST_SIZE");
    let conversations = if size.is_ok_and(|size| size == "full") { 20_000 } else { 500 };
    let mut seed = 0x1234_5678_9abc_def1_u64;
    let mut random = move || {
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        seed
    };
    let limits = config().limits;
    let mut levitated = 0;
    for _ in 0..conversations {
        let mut bench = Bench::new();
        for _ in 0..100 {
            let big = (random() % 2001) as f32 - 1000.0;
            let request = match random() % 12 {
                0 => Request::Arm { period_us: 1000, watchdog_us: (random() % 20_000) as u32 },
                1 | 2 => Request::TakeOff,
                3 => Request::Land,
                4 if random() % 4 == 0 => Request::Disarm,
                5 => Request::Describe { page: (random() % 5) as u16 },
                _ => Request::Command {
                    wrench: [big, -big, big, big, 0.0, big],
                    valid_us: (random() % 9000) as u16,
                },
            };
            let mut bytes = bench.frame(request).encode();
            if random() % 8 == 0 {
                bytes[(random() % 64) as usize] ^= (random() % 255 + 1) as u8;
            }
            bench.controller.receive(&bytes, bench.now_us);
            if random() % 16 == 0 {
                bench.sample.twist = Twist::new(DVec3::splat((random() % 1000) as f64 * 1.0e-3), DVec3::ZERO);
                bench.sample.pose = Pose::new(DVec3::X * ((random() % 12) as f64 * 1.0e-3), DQuat::IDENTITY);
            }
            let wrench = bench.cycle();
            assert!(wrench.is_finite());
            assert!(wrench.force().abs().cmple(limits.max_force_n).all(), "{wrench:?}");
            assert!(wrench.torque().abs().cmple(limits.max_torque_nm).all(), "{wrench:?}");
            let flying = matches!(bench.controller.mode(), Mode::Levitating | Mode::Holding | Mode::Landing);
            assert!(flying || wrench == Wrench::ZERO);
            levitated += u32::from(flying);
        }
    }
    assert!(levitated > conversations * 10, "{levitated} cycles in the air");
}
