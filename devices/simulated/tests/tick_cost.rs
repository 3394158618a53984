//! What a tick costs, in instructions: the same on every machine, busy or not.
//!
//! Callgrind (valgrind) counts while this test runs itself once more. The count of a tick is the difference between
//! a long and a short run, so that starting up does not matter; what is asserted is its ratio to a plain rigid body
//! advanced by the classical Runge-Kutta method, compiled with it. Without valgrind the test says so and passes.
//!
//! ```text
//! cargo test --release -p flotor-simulated --test tick_cost -- --nocapture
//! ```

use flotor_hal::glam::{DQuat, DVec3};
use flotor_hal::{DeviceState, Tick};
use flotor_simulated::machine::{Machine, MachineParameters};
use flotor_simulated::plant::{State, Wrench};
use flotor_simulated::simulation::{Setup, Simulation};
use std::hint::black_box;
use std::process::Command;

/// Which of the workloads a process is to run, and how many times.
const WORKLOAD: &str = "FLOTOR_COUNTED_WORKLOAD";

/// Ticks of the short and of the long run.
const TICKS: [u64; 2] = [1000, 3000];

/// A spring of 1 N/mm: 1 ms of flotor and hand, with or without the machine around them.
fn ticks_of_the_flotor(machine: Option<MachineParameters>, ticks: u64) {
    let mut simulation = Simulation::new(&Setup::DEMO).expect("the demo is physical");
    let mut machine = machine.map(|parameters| Machine::new(&parameters, &State::HOME, 1).expect("physical"));
    let mut state = DeviceState::HOME;
    for index in 0..ticks {
        let tick = Tick { index, time_ns: index * 1_000_000, dt_ns: 1_000_000 };
        let wrench = Wrench { force_n: simulation.state().position_m * -1000.0, torque_nm: DVec3::ZERO };
        match &mut machine {
            Some(machine) => {
                let _ = black_box(machine.cycle(&mut simulation, &tick, &wrench, &mut state));
            }
            None => {
                black_box(simulation.advance(tick.dt_ns, wrench));
            }
        }
    }
}

/// The measure: a rigid body that tumbles, one step of the classical Runge-Kutta method at a time.
fn steps_of_the_yardstick(steps: u64) {
    let inertia = black_box(DVec3::new(3.2e-3, 3.9e-3, 5.1e-3));
    let rate = |(attitude, spin): (DQuat, DVec3)| {
        let half = spin * 0.5;
        let turning = attitude * DQuat::from_xyzw(half.x, half.y, half.z, 0.0);
        (turning, (inertia * spin).cross(spin) / inertia)
    };
    let moved = |(q, w): (DQuat, DVec3), (dq, dw): (DQuat, DVec3), h: f64| (q + dq * h, w + dw * h);
    let mut body = (DQuat::IDENTITY, DVec3::new(0.8, 7.9, 0.5));
    let h = 1.0e-3;
    for _ in 0..steps {
        let k1 = rate(body);
        let k2 = rate(moved(body, k1, 0.5 * h));
        let k3 = rate(moved(body, k2, 0.5 * h));
        let k4 = rate(moved(body, k3, h));
        let outer = moved(moved(body, k1, h / 6.0), k4, h / 6.0);
        let (attitude, spin) = moved(moved(outer, k2, h / 3.0), k3, h / 3.0);
        body = black_box((attitude.normalize(), spin));
    }
}

/// Not a test by itself: what the counted processes run.
#[test]
fn workload() {
    let Ok(workload) = std::env::var(WORKLOAD) else { return };
    let (name, ticks) = workload.split_once(' ').expect("a name and a number");
    let ticks = ticks.parse().expect("a number");
    match name {
        "full" => ticks_of_the_flotor(Some(MachineParameters::MAGLEV), ticks),
        "plain" => ticks_of_the_flotor(None, ticks),
        _ => steps_of_the_yardstick(ticks),
    }
}

/// Instructions a tick, or nothing where there is no valgrind.
fn instructions(name: &str) -> Option<f64> {
    let count = |ticks: u64| {
        let counted = Command::new("valgrind")
            .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
            .arg(std::env::current_exe().expect("a running test has a file"))
            .args(["--exact", "workload", "--test-threads=1"])
            .env(WORKLOAD, format!("{name} {ticks}"))
            .output()
            .ok()?;
        let told = String::from_utf8_lossy(&counted.stderr).into_owned();
        let total = told.lines().find_map(|line| line.split("Collected : ").nth(1))?;
        total.trim().parse::<f64>().ok()
    };
    let [short, long] = TICKS;
    Some((count(long)? - count(short)?) / (long - short) as f64)
}

#[test]
fn a_tick_costs_no_more_than_so_many_steps_of_a_rigid_body() {
    if cfg!(debug_assertions) {
        eprintln!("skipped: this is a promise of optimised builds; `cargo test --release` checks it");
        return;
    }
    let Some(yardstick) = instructions("yardstick") else {
        eprintln!("skipped: there is no valgrind to count instructions with");
        return;
    };
    // What was counted (2.56 and 24.3) and a tenth, for other versions of compiler and libraries.
    let bounds = [("plain", 2.8), ("full", 26.7)];
    for (name, bound) in bounds {
        let tick = instructions(name).expect("valgrind was there a moment ago");
        println!(
            "{name}: {tick:.0} instructions a tick, {:.2} steps of a rigid body ({yardstick:.0})",
            tick / yardstick
        );
        assert!(tick / yardstick <= bound, "{name}: {:.2} steps", tick / yardstick);
    }
}
