//! Duration of a solve, printed: `cargo test --release -p flotor-contact --test timing -- --ignored --nocapture`.

mod common;

use common::{PERIOD_S, at, floor, set, unlimited};
use flotor_contact::{Contact, Coupling, Replacement, Solver};
use flotor_core::Random;
use flotor_hal::glam::DVec3;
use flotor_hal::{Pose, Twist};
use std::time::Instant;

fn solver(coupling: Coupling) -> Solver {
    Solver::new(coupling, unlimited(), Replacement::Conserving { surface_power_w: 1.0 }, PERIOD_S)
        .expect("a period above 0")
}

/// Durations of the solves of a tool that circles on 16 contacts, and the most Newton steps.
fn durations(coupling: Coupling, contacts: &[Contact]) -> (Vec<f64>, u32, f64) {
    let mut solver = solver(coupling);
    solver.replace(&set(&Pose::HOME, contacts));
    let mut microseconds = Vec::new();
    let mut most = 0;
    let mut sum = 0.0;
    for tick in 0..20_000_u32 {
        let phase = f64::from(tick) * PERIOD_S * 12.0;
        let (sine, cosine) = phase.sin_cos();
        let position = DVec3::new(8.0e-3 * cosine, 8.0e-3 * sine, -1.0e-3 + 0.8e-3 * (0.7 * phase).sin());
        let twist = Twist::new(DVec3::new(-0.096 * sine, 0.096 * cosine, 0.0), DVec3::ZERO);
        let pose = at(position);
        let start = Instant::now();
        let solution = solver.solve(&pose, &twist, f64::from(tick) * PERIOD_S);
        microseconds.push(start.elapsed().as_secs_f64() * 1.0e6);
        most = most.max(solution.steps);
        sum += f64::from(solution.steps);
    }
    (microseconds, most, sum / 20_000.0)
}

fn print(name: &str, (mut microseconds, most, mean): (Vec<f64>, u32, f64)) {
    microseconds.sort_by(f64::total_cmp);
    let at = |thousandths: usize| microseconds[thousandths * (microseconds.len() - 1) / 1000];
    println!(
        "{name}: median {:.2} us, p99 {:.2} us, p99.9 {:.2} us; Newton steps: mean {mean:.2}, most {most}",
        at(500),
        at(990),
        at(999)
    );
}

#[test]
#[ignore = "a measurement, for people"]
fn sixteen_contacts() {
    let mut random = Random::new(1, 1);
    let contacts: Vec<_> = (0..16)
        .map(|_| Contact {
            tool_point_m: random.vector() * 0.02 * DVec3::new(1.0, 1.0, 0.0),
            normal: (DVec3::Z + random.vector() * 0.2).normalize(),
            stiffness_n_per_m: 2000.0,
            tangential_stiffness_n_per_m: 1000.0,
            damping_ns_per_m: 1.0,
            friction: 0.4,
            ..floor(0.0)
        })
        .collect();
    print("below the coupling's stiffness", durations(Coupling::RIGID, &contacts));
    print("eight times the coupling's", durations(Coupling::new(4000.0, 5.0).expect("above 0"), &contacts));
    let rigid: Vec<_> = contacts.iter().map(|c| Contact { stiffness_n_per_m: 1.0e6, ..*c }).collect();
    print("thousands of times", durations(Coupling::new(4000.0, 5.0).expect("above 0"), &rigid));
    let set = set(&Pose::HOME, &contacts);
    let mut solver = solver(Coupling::new(4000.0, 5.0).expect("above 0"));
    let mut microseconds = Vec::new();
    for _ in 0..20_000 {
        let start = Instant::now();
        solver.replace(&set);
        solver.solve(&at(DVec3::Z * -1.0e-3), &Twist::ZERO, 0.0);
        microseconds.push(start.elapsed().as_secs_f64() * 1.0e6);
    }
    print("the same, with a new set", (microseconds, 0, 0.0));
}
