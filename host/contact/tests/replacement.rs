//! Sets that follow one another at the rate of a model that is slower than the loop.

mod common;

use common::{PERIOD_S, at, cases, floor, set, unlimited};
use flotor_contact::{Contact, ContactSet, Coupling, Outcome, Replacement, Solver, Validity};
use flotor_core::Random;
use flotor_hal::glam::{DQuat, DVec3};
use flotor_hal::{Pose, Twist};
use std::f64::consts::TAU;

const CONSERVING: Replacement = Replacement::Conserving { surface_power_w: 1.0 };

fn solver() -> Solver {
    Solver::new(Coupling::RIGID, unlimited(), CONSERVING, PERIOD_S).expect("a period above 0")
}

const STIFFNESS_N_PER_M: f64 = 2000.0;

/// Ticks between two sets and from the pose of a set to its publication: 100 and 200 Hz, up to almost a period late.
const TIMINGS: [(u32, u32); 6] = [(10, 0), (10, 5), (10, 9), (5, 0), (5, 2), (5, 4)];

/// Share of the peak force that a force may differ by, at 100 and at 200 Hz.
fn tolerance(ticks: u32) -> f64 {
    if ticks == 10 { 0.15 } else { 0.08 }
}

fn contact(normal: DVec3, surface_point_m: DVec3) -> Contact {
    Contact { normal, surface_point_m, stiffness_n_per_m: STIFFNESS_N_PER_M, ..floor(0.0) }
}

/// Object whose contacts depend on place and time, computed in every tick and, one period late, by a model at its own rate.
struct Run<'a> {
    /// Ticks between two sets.
    ticks: u32,
    /// Ticks from the pose that a set was computed for to its publication.
    latency: u32,
    seconds: f64,
    path: &'a dyn Fn(f64) -> DVec3,
    contacts: &'a dyn Fn(DVec3, f64) -> Vec<Contact>,
}

/// Tick of a run.
struct Tick {
    time_s: f64,
    force: DVec3,
    in_loop: DVec3,
    /// Largest force into a surface of the newest set.
    pull_n: f64,
}

impl Run<'_> {
    fn ticks(&self) -> Vec<Tick> {
        let mut solver = solver();
        let mut published: Option<(f64, ContactSet)> = None;
        let mut computing: Option<(f64, ContactSet)> = None;
        let mut ticks = Vec::new();
        let mut tick = 0;
        while f64::from(tick) * PERIOD_S < self.seconds {
            let time_s = f64::from(tick) * PERIOD_S;
            let position = (self.path)(time_s);
            let velocity = (position - (self.path)(time_s - PERIOD_S)) / PERIOD_S;
            if tick % self.ticks == 0 {
                computing = Some((time_s, set(&at(position), &(self.contacts)(position, time_s))));
            }
            if tick % self.ticks == self.latency
                && let Some((at_s, set)) = computing.take()
            {
                solver.replace(&set);
                published = Some((at_s, set));
            }
            let age_s = published.as_ref().map_or(0.0, |(at_s, _)| time_s - at_s);
            let force = solver.solve(&at(position), &Twist::new(velocity, DVec3::ZERO), age_s).wrench.force();
            let mut exact =
                Solver::new(Coupling::RIGID, unlimited(), Replacement::Immediate, PERIOD_S).expect("above 0");
            exact.replace(&set(&at(position), &(self.contacts)(position, time_s)));
            let in_loop = exact.solve(&at(position), &Twist::ZERO, 0.0).wrench.force();
            let newest = published.as_ref().map(|(_, set)| set.contacts()).unwrap_or_default();
            let pull_n = newest.iter().map(|contact| -contact.normal.dot(force)).fold(0.0, f64::max);
            ticks.push(Tick { time_s, force, in_loop, pull_n });
            tick += 1;
        }
        ticks
    }
}

/// Extremes of a run, N.
struct Judged {
    peak_n: f64,
    pull_n: f64,
    step_n: f64,
    error_n: f64,
}

/// Judges a run; the error only in the ticks that `counts` accepts.
fn judged(name: &str, ticks: &[Tick], counts: impl Fn(&Tick) -> bool) -> Judged {
    let largest = |numbers: &mut dyn Iterator<Item = f64>| numbers.fold(0.0, f64::max);
    let errors = ticks.iter().filter(|tick| counts(tick)).map(|tick| (tick.force - tick.in_loop).length());
    let judged = Judged {
        peak_n: largest(&mut ticks.iter().map(|tick| tick.in_loop.length())),
        pull_n: largest(&mut ticks.iter().map(|tick| tick.pull_n)),
        step_n: largest(&mut ticks.windows(2).map(|two| (two[1].force - two[0].force).length())),
        error_n: largest(&mut errors.into_iter()),
    };
    let Judged { peak_n, pull_n, step_n, error_n } = judged;
    let share = 100.0 * error_n / peak_n;
    println!(
        "{name}: peak {peak_n:.2} N, pull {pull_n} N, step {step_n:.3} N, error {error_n:.3} N = {share:.1} %"
    );
    judged
}

#[test]
fn a_wall_at_rest_is_the_wall_in_the_loop() {
    let wall = |_: DVec3, _: f64| vec![contact(DVec3::Z, DVec3::ZERO)];
    for frequency in [1.0, 3.0, 8.0] {
        let path = move |time_s: f64| DVec3::Z * (1.0e-3 * (TAU * frequency * time_s).cos());
        for (ticks, latency) in TIMINGS.into_iter().chain([(2, 1)]) {
            let ticks = Run { ticks, latency, seconds: 2.0, path: &path, contacts: &wall }.ticks();
            for tick in &ticks {
                assert!((tick.force - tick.in_loop).length() <= 1.0e-12, "{} {}", tick.force, tick.in_loop);
            }
            assert!(ticks.iter().any(|tick| tick.force.z > 1.9));
        }
    }
}

#[test]
fn a_hand_that_slides_over_a_ball_feels_the_ball() {
    let ball = |position: DVec3, _: f64| vec![contact(position.normalize(), position.normalize() * 0.02)];
    // Into the ball within 0.1 s, then 1 to 2 mm deep around it at 0.1 m/s.
    let path = |time_s: f64| {
        let depth = if time_s < 0.1 {
            0.025 * time_s - 0.0015
        } else {
            1.5e-3 - 0.5e-3 * (TAU * 2.0 * (time_s - 0.1)).cos()
        };
        DVec3::new((5.0 * time_s).sin(), 0.0, (5.0 * time_s).cos()) * (0.02 - depth)
    };
    for (ticks, latency) in TIMINGS {
        let run = Run { ticks, latency, seconds: 2.0, path: &path, contacts: &ball }.ticks();
        let judged = judged(&format!("ball, {ticks} ticks, {latency} late"), &run, |tick| tick.time_s > 0.1);
        assert_eq!(judged.pull_n, 0.0);
        assert!(judged.error_n <= tolerance(ticks) * judged.peak_n);
        // Travel 0.1 mm; two surfaces differ by 1 mm squared over 40 mm, in half a period.
        assert!(judged.step_n <= 1.5 * STIFFNESS_N_PER_M * (1.0e-4 + 2.5e-5 / 5.0));
    }
}

#[test]
fn a_hand_that_slides_over_an_edge_feels_no_jump() {
    // Half as wide as 20 mm; the face of least depth.
    let faces = |position: DVec3, _: f64| {
        let faces = [DVec3::X, DVec3::NEG_X, DVec3::Z, DVec3::NEG_Z];
        let closest = faces.into_iter().max_by(|a, b| a.dot(position).total_cmp(&b.dot(position)));
        closest.map(|normal| contact(normal, normal * 0.02)).into_iter().collect()
    };
    for depth in [1.0e-3, 2.0e-3] {
        // Down in the middle within 0.1 s, then along x at 0.1 m/s and out through the side.
        let path = move |time_s: f64| {
            if time_s < 0.1 {
                DVec3::Z * (0.0205 - (depth + 0.5e-3) * time_s / 0.1)
            } else {
                DVec3::new(0.1 * (time_s - 0.1), 0.0, 0.02 - depth)
            }
        };
        for (ticks, latency) in TIMINGS {
            let run = Run { ticks, latency, seconds: 0.4, path: &path, contacts: &faces }.ticks();
            let edge_s = 0.1 + (0.02 - depth) / 0.1;
            // Two periods after the edge, and as many ticks as the set is late beyond half a period.
            let until_s = edge_s + f64::from(2 * ticks + latency.saturating_sub(ticks / 2)) * PERIOD_S;
            let counts = |tick: &Tick| tick.time_s > 0.1 && !(edge_s..until_s).contains(&tick.time_s);
            let judged = judged(&format!("edge {depth} m, {ticks} ticks, {latency} late"), &run, counts);
            assert_eq!(judged.pull_n, 0.0);
            assert!(judged.error_n <= tolerance(ticks) * judged.peak_n);
            let spread = depth / (0.5 * f64::from(ticks));
            assert!(judged.step_n <= 1.5 * STIFFNESS_N_PER_M * (1.0e-4 + spread), "{} N", judged.step_n);
        }
    }
}

#[test]
fn a_plane_that_oscillates_pushes_as_it_says() {
    let angular = TAU * 2.0;
    let plane = |_: DVec3, time_s: f64| {
        let (sine, cosine) = (angular * time_s).sin_cos();
        let velocity = DVec3::Z * (2.0e-3 * angular * cosine);
        vec![Contact { surface_velocity_m_per_s: velocity, ..contact(DVec3::Z, DVec3::Z * (2.0e-3 * sine)) }]
    };
    for (rest, sway) in [(0.0, 0.0), (-1.5e-3, 0.0), (-3.0e-3, 0.0), (-1.5e-3, 1.0e-3)] {
        let path = move |time_s: f64| {
            let from_above = 0.01 * (1.0 - time_s / 0.1).max(0.0);
            DVec3::Z * (rest + sway * (TAU * 3.0 * time_s).sin() + from_above)
        };
        for (ticks, latency) in TIMINGS {
            let run = Run { ticks, latency, seconds: 3.0, path: &path, contacts: &plane }.ticks();
            let judged =
                judged(&format!("plane, {ticks} ticks, {latency} late"), &run, |tick| tick.time_s > 0.1);
            assert_eq!(judged.pull_n, 0.0);
            assert!(judged.error_n <= 0.05 * judged.peak_n);
            assert!(judged.step_n <= 1.5 * STIFFNESS_N_PER_M * 1.15e-4, "{} N", judged.step_n);
        }
    }
}

#[test]
fn a_surface_that_appears_around_the_tool_has_force_only_where_the_tool_moves_deeper() {
    let mut solver = solver();
    let wall = set(&Pose::HOME, &[contact(DVec3::Z, DVec3::Z * 1.0e-3)]);
    let force = |solver: &mut Solver, depth: f64, ticks: u32| {
        let mut felt = DVec3::ZERO;
        for _ in 0..ticks {
            felt = solver.solve(&at(DVec3::Z * (1.0e-3 - depth)), &Twist::ZERO, 0.0).wrench.force();
        }
        felt.z
    };
    force(&mut solver, 1.0e-3, 5);
    solver.replace(&wall);
    // What the balance gains from nothing, 1.7 nJ in a tick, pays for 0.04 mm in a second.
    assert!(force(&mut solver, 1.0e-3, 1000) <= 0.1);
    let withheld = solver.withheld_m();
    assert!(withheld > 0.9e-3, "{withheld} m");
    assert!((force(&mut solver, 1.5e-3, 1) - (1.5e-3 - withheld) * STIFFNESS_N_PER_M).abs() < 0.02);
    force(&mut solver, -1.0e-6, 1);
    assert_eq!(solver.withheld_m(), 0.0);
    assert!((force(&mut solver, 1.5e-3, 1) - 3.0).abs() < 1.0e-12);
}

#[test]
fn the_force_of_a_set_that_is_too_old_fades() {
    let mut solver = solver();
    let validity = Validity { duration_s: 0.03, ..Validity::UNLIMITED };
    let wall = ContactSet::new(&Pose::HOME, &[contact(DVec3::Z, DVec3::ZERO)], validity).expect("consistent");
    solver.replace(&wall);
    let mut last = 0.0;
    for tick in 0..100_u32 {
        let pose = at(DVec3::Z * if tick == 0 { 1.0e-6 } else { -1.0e-3 });
        let age_s = f64::from(tick) * PERIOD_S;
        let felt = solver.solve(&pose, &Twist::ZERO, age_s).wrench.force().z;
        match tick {
            0 => assert_eq!(felt, 0.0),
            1..=30 => assert!((felt - 2.0).abs() < 1.0e-12, "{felt} N after {age_s} s"),
            31..=50 => {
                assert!(felt >= 0.0 && felt <= last && last - felt <= 0.101, "{felt} N after {age_s} s")
            }
            _ => assert_eq!(felt, 0.0, "after {age_s} s"),
        }
        last = felt;
    }
}

/// Random sequence of sets: energy that the hand got beyond the bound, J, at its largest.
///
/// Each set has nothing to do with the one before; it comes 1 to 100 ticks after it, 0 to 100 ms late.
struct Sequence {
    coupling: [f64; 2],
    /// With friction and damping, whose own sampling error the bound then includes.
    is_rough: bool,
    surfaces_move: bool,
}

impl Sequence {
    fn contacts(&self, random: &mut Random, pose: &Pose) -> Vec<Contact> {
        let mut contacts = common::contacts(random, pose);
        for contact in &mut contacts {
            contact.stiffness_n_per_m = contact.stiffness_n_per_m.min(2.0e4);
            if !self.is_rough {
                (contact.friction, contact.damping_ns_per_m) = (0.0, 0.0);
            }
            if !self.surfaces_move {
                contact.surface_velocity_m_per_s = DVec3::ZERO;
            }
        }
        contacts
    }

    /// Energy of sampled springs in a motion, `K T / 2` times the integral of the squared relative speed.
    fn sampled_j<'a>(&self, contacts: impl Iterator<Item = &'a Contact>, before: &Pose, pose: &Pose) -> f64 {
        let mut sum = 0.0;
        for contact in contacts {
            let point = |pose: &Pose| pose.position() + pose.orientation() * contact.tool_point_m;
            let travel = point(pose) - point(before) - contact.surface_velocity_m_per_s * PERIOD_S;
            let along = contact.normal.dot(travel);
            let damping = contact.damping_ns_per_m / PERIOD_S;
            sum += 0.5 * (contact.stiffness_n_per_m + damping) * along * along;
            if contact.friction > 0.0 {
                sum += 0.5 * contact.tangential_stiffness_n_per_m * (travel.length_squared() - along * along);
            }
        }
        let turn = (pose.orientation() * before.orientation().conjugate()).xyz() * 2.0;
        let shift = pose.position() - before.position();
        let felt =
            0.5 * (self.coupling[0] * shift.length_squared() + self.coupling[1] * turn.length_squared());
        if self.surfaces_move || felt.is_nan() { sum } else { sum.min(felt) }
    }

    fn excess_j(&self, seed: u64, ticks: u64) -> f64 {
        let mut random = Random::new(52, seed);
        let random = &mut random;
        let coupling = Coupling::new(self.coupling[0], self.coupling[1]).expect("above 0");
        let mut solver = Solver::new(coupling, unlimited(), CONSERVING, PERIOD_S).expect("a period above 0");
        let (mut pose, mut last_pose) = (Pose::HOME, Pose::HOME);
        let (mut velocity, mut spin) = (DVec3::ZERO, DVec3::ZERO);
        // Contacts of the set before still fade.
        let (mut contacts, mut before_last) = (Vec::new(), Vec::new());
        let (mut age_s, mut next) = (0.0, 0);
        let (mut energy, mut allowed, mut worst) = (0.0, 0.0, f64::NEG_INFINITY);
        let longest = 1 + random.bits() % 100;
        for tick in 0..ticks {
            // A hand with a time constant of 50 ms, held near the middle.
            velocity += random.vector() * 0.004 - velocity * 0.02 - pose.position() * 0.4;
            spin += random.vector() * 0.1 - spin * 0.02 - pose.orientation().xyz() * 0.8;
            age_s += PERIOD_S;
            if tick == next {
                next += 1 + random.bits() % longest;
                age_s = random.unit() * 0.1;
                before_last = std::mem::replace(&mut contacts, self.contacts(random, &pose));
                solver.replace(&set(&pose, &contacts));
            }
            // The motion since the last tick, against both sets where one has just replaced the other.
            allowed += 1.15 * self.sampled_j(contacts.iter().chain(&before_last), &last_pose, &pose)
                + 0.1e-3 / 60.0 * PERIOD_S;
            worst = worst.max(-energy - allowed);
            let solution = solver.solve(&pose, &Twist::new(velocity, spin), age_s);
            assert!(solution.wrench.is_finite() && solution.outcome == Outcome::Solved, "{solution:?}");
            // The force acts until the next tick; a surface moves with at most 1 W.
            energy += solver.forces().map(|(force, speed)| force.dot(speed).min(1.0) * PERIOD_S).sum::<f64>();
            let step = DQuat::from_xyzw(0.5e-3 * spin.x, 0.5e-3 * spin.y, 0.5e-3 * spin.z, 1.0).normalize();
            last_pose = pose;
            pose = Pose::new(pose.position() + velocity * PERIOD_S, (step * pose.orientation()).normalize());
            energy -= solution.wrench.force().dot(pose.position() - last_pose.position());
            energy -= solution.wrench.torque().dot(step.xyz() * 2.0);
        }
        worst
    }
}

/// A coupling that does not yield, and one that most sets are stiffer than.
const RIGID: [f64; 2] = [f64::INFINITY; 2];
const YIELDING: [f64; 2] = [3000.0, 2.0];

/// A test for each kind of sequence: together 1e5 at full size, each some minutes of one core.
fn gives_no_energy(sequence: &Sequence) {
    let mut worst = f64::NEG_INFINITY;
    for seed in 0..cases(30, 15_000) as u64 {
        let excess = sequence.excess_j(seed, 1000);
        if excess > 0.0 {
            println!("  {seed} {excess:e}");
        }
        worst = worst.max(excess);
    }
    let Sequence { coupling, is_rough, surfaces_move } = sequence;
    println!(
        "coupling {coupling:?}, rough {is_rough}, moving {surfaces_move}: at most {worst:e} J beyond the bound"
    );
    assert!(worst <= 0.0, "{worst:e} J");
}

#[test]
fn sets_without_sense_give_the_hand_no_energy() {
    gives_no_energy(&Sequence { coupling: RIGID, is_rough: false, surfaces_move: false });
}

#[test]
fn sets_that_move_give_the_hand_no_more_than_they_declare() {
    gives_no_energy(&Sequence { coupling: RIGID, is_rough: false, surfaces_move: true });
}

#[test]
fn sets_behind_a_coupling_give_the_hand_no_energy() {
    gives_no_energy(&Sequence { coupling: YIELDING, is_rough: false, surfaces_move: false });
}

#[test]
fn sets_that_move_behind_a_coupling_give_the_hand_no_more_than_they_declare() {
    gives_no_energy(&Sequence { coupling: YIELDING, is_rough: false, surfaces_move: true });
}

#[test]
fn rough_sets_that_move_give_the_hand_no_more_than_they_declare() {
    gives_no_energy(&Sequence { coupling: RIGID, is_rough: true, surfaces_move: true });
}

#[test]
fn rough_sets_behind_a_coupling_give_the_hand_no_energy() {
    gives_no_energy(&Sequence { coupling: YIELDING, is_rough: true, surfaces_move: false });
}

#[test]
fn rough_sets_that_move_behind_a_coupling_give_the_hand_no_more_than_they_declare() {
    gives_no_energy(&Sequence { coupling: YIELDING, is_rough: true, surfaces_move: true });
}
