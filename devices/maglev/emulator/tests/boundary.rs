//! Constant pushes out of the range, against the walls of host and controller with sampling and delay: the handle at rest has
//! the penetration given by the stiffness, the penetration on the way stays below the printed bound, and if this bound is
//! beyond the range, the controller lands before the flotor leaves the sensors' range.
#![allow(clippy::cast_possible_truncation)] // f32 is what the wire has

use flotor_hal::{Axes, Capabilities, DQuat, DVec3, DeviceState, Pose, SampledLoop, Twist, Wrench};
use flotor_maglev::boundary::Walls;
use flotor_maglev::facts;
use flotor_maglev::protocol::{Condition, Mode, Request, RequestFrame};
use flotor_maglev_emulator::controller::{Controller, Sample};
use flotor_maglev_emulator::{Pace, controller_config};

const PERIOD_US: u64 = 1000;
const PERIOD_S: f64 = 1.0e-3;
const MASS_KG: f64 = facts::FLOTOR_MASS_KG[0];
/// Damping of the hand that pushes, N·s/m: relaxed (van Beek and others 2015).
const HAND_NS_PER_M: f64 = 6.45;
const RESOLUTION_M: f64 = 2.0e-6;
/// Where the sensors lose the flotor, m.
const EDGE_M: f64 = facts::RANGE_M;
/// Where the controller's own wall takes part, m: up to there the printed bound is about the host's wall alone.
const OWN_WALL_M: f64 = 11.8e-3;
const MOST_N: f64 = 40.0;
/// What the hand's damping leaves of a swing falls to 1/e in 0.18 s: this is 13 of them.
const TICKS: u64 = 2400;
/// The plant is integrated in steps of an eighth of a period.
const STEPS: u32 = 8;

/// Marsaglia 2003.
struct Random(u64);

impl Random {
    fn below_one(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// A controller that has taken off, and a host that numbers its commands.
struct Device {
    controller: Controller,
    now_us: u64,
    sequence: u32,
}

impl Device {
    fn levitating() -> Self {
        let capabilities = Capabilities {
            sensed: Axes::ALL,
            actuated: Axes::ALL,
            range_m: [EDGE_M; 3],
            range_rad: [facts::RANGE_RAD; 3],
            resolution_m: RESOLUTION_M,
            max_force_n: [55.0, 55.0, 140.0],
            max_torque_nm: [6.3, 6.3, 12.2],
            max_force_slew_n_per_s: 55.0e3,
            max_torque_slew_nm_per_s: 6.3e3,
            max_stiffness_n_per_m: facts::MAX_STIFFNESS_N_PER_M,
            rate_hz: facts::SERVO_RATE_HZ,
            latency_s: 0.0,
        };
        let controller = Controller::new(controller_config(&capabilities, Pace::RealTime, "wall"));
        let mut device = Self { controller, now_us: 0, sequence: 0 };
        device.ask(Request::Arm { period_us: 1000, watchdog_us: 8000 });
        device.ask(Request::TakeOff);
        assert_eq!(device.controller.mode(), Mode::Levitating);
        device
    }

    fn ask(&mut self, request: Request) {
        self.sequence += 1;
        let frame =
            RequestFrame { sequence: self.sequence, acknowledged: 0, time_us: 0, session: 7, request };
        self.controller.receive(&frame.encode(), self.now_us);
    }

    /// A cycle under this command: what the coils give.
    fn cycle(&mut self, command: &Wrench, sample: &Sample) -> Wrench {
        let (f, t) = (command.force(), command.torque());
        let wrench = [f.x, f.y, f.z, t.x, t.y, t.z].map(|value| value as f32);
        self.controller.observe(self.now_us, sample);
        self.ask(Request::Command { wrench, valid_us: 3000 });
        let driven = self.controller.drive(self.now_us, PERIOD_US);
        self.now_us += PERIOD_US;
        driven
    }
}

/// How a push ended.
#[derive(Clone, Copy, Debug)]
struct End {
    deepest_m: f64,
    rests_m: f64,
    landed: bool,
    /// How far out it was when the controller took over, m.
    landed_at_m: f64,
}

/// Pushes outwards with a constant force, from rest `run_up_m` inside the wall.
fn push(walls: &Walls, outward: DVec3, push_n: f64, run_up_m: f64, delay_ticks: usize) -> End {
    let radius_m = walls.sphere.limit;
    let mut device = Device::levitating();
    let (mut x, mut v) = (outward * (radius_m - run_up_m), DVec3::ZERO);
    let mut under_way = std::collections::VecDeque::from(vec![Wrench::ZERO; delay_ticks]);
    let mut end = End { deepest_m: f64::NEG_INFINITY, rests_m: 0.0, landed: false, landed_at_m: 0.0 };
    for _ in 0..TICKS {
        let sensed = (x / RESOLUTION_M).round() * RESOLUTION_M;
        let (pose, twist) = (Pose::new(sensed, DQuat::IDENTITY), Twist::new(v, DVec3::ZERO));
        under_way.push_back(walls.wrench(&DeviceState { pose, twist, ..DeviceState::HOME }));
        let command = under_way.pop_front().expect("one was just pushed");
        let sample = Sample { pose, twist, in_range: sensed.length() <= EDGE_M, ..Sample::HOME };
        let driven = device.cycle(&command, &sample);
        assert!(driven.is_finite());
        assert!(driven.force().abs().cmple(DVec3::new(55.0, 55.0, 140.0)).all(), "{driven:?}");
        assert_eq!(driven.torque(), DVec3::ZERO);
        if device.controller.mode() != Mode::Levitating {
            assert!(
                device.controller.condition().contains(Condition::EDGE),
                "{}",
                device.controller.condition()
            );
            assert_eq!(device.controller.mode(), Mode::Landing, "and not too late to land");
            return End { landed: true, landed_at_m: sensed.length(), ..end };
        }
        for _ in 0..STEPS {
            let h = PERIOD_S / f64::from(STEPS);
            v += h / MASS_KG * (outward * push_n + driven.force() - HAND_NS_PER_M * v);
            x += h * v;
            end.deepest_m = end.deepest_m.max(x.length() - radius_m);
        }
        end.rests_m = x.length() - radius_m;
    }
    end
}

#[test]
fn pushes_end_at_the_wall_or_in_a_landing() {
    let full = std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| size == "full");
    let pushes = if full { 10_000 } else { 200 };
    let mut random = Random(0x2545_f491_4f6c_dd1d);
    let (mut held, mut landed) = (0, 0);
    let (mut most_of_bound, mut farthest_m) = (0.0_f64, 0.0_f64);
    for _ in 0..pushes {
        let radius_m = 7.0e-3 + 4.0e-3 * random.below_one();
        let delay_ticks = usize::from(random.below_one() < 0.5);
        let delay_s = PERIOD_S * delay_ticks as f64;
        let walls =
            Walls::maker(radius_m).stabilised(&SampledLoop { period_s: PERIOD_S, latency_s: delay_s });
        let direction = DVec3::from_array([(); 3].map(|()| random.below_one() - 0.5));
        let outward = direction.try_normalize().unwrap_or(DVec3::Z);
        let (push_n, run_up_m) = (MOST_N * random.below_one(), 2.0e-3 * random.below_one());
        // What the push has given it when it arrives, if nobody held it back.
        let arrives_m_per_s = (2.0 * push_n * run_up_m / MASS_KG).sqrt();
        let bound = walls.sphere.penetration(push_n, arrives_m_per_s, MASS_KG, PERIOD_S, delay_s);
        let end = push(&walls, outward, push_n, run_up_m, delay_ticks);
        let what = format!("{push_n} N, wall at {radius_m} m, {delay_ticks} late: {end:?}, {bound:?}");
        if end.landed {
            assert!(radius_m + bound.at_most + RESOLUTION_M > OWN_WALL_M, "no reason to land: {what}");
            assert!(end.landed_at_m < EDGE_M, "the sensors had lost it: {what}");
            farthest_m = farthest_m.max(end.landed_at_m);
            landed += 1;
        } else {
            assert!(end.rests_m <= bound.at_rest + RESOLUTION_M, "deeper at rest: {what}");
            assert!(end.deepest_m <= bound.at_most + RESOLUTION_M, "deeper on the way: {what}");
            most_of_bound = most_of_bound.max(end.deepest_m / bound.at_most);
            held += 1;
        }
    }
    println!(
        "{pushes} pushes: {held} held, at most {:.0} % of the bound deep; {landed} landed, at {:.3} mm of {:.0} at most",
        most_of_bound * 100.0,
        farthest_m * 1.0e3,
        EDGE_M * 1.0e3
    );
    // Enough of both ends are judged: half of the stable stiffness holds about a quarter of these pushes.
    assert!(held > pushes / 8 && landed > pushes / 20, "{held} held, {landed} landed");
}
