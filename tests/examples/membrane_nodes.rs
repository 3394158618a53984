//! How many masses one core updates in a millisecond: a 45 by 45 sheet (2 025 masses, each linked to its four neighbours)
//! with a ball pressed into it, explicit steps, all active.
//!
//! `cargo run --release -p flotor-tests --features measurements --example membrane_nodes` prints the best and the median of
//! twenty runs: a busy machine can only make it slower.

use flotor_hal::DVec3;
use flotor_membrane::ball::Ball;
use flotor_membrane::mesh::{Mesh, Sheet};
use flotor_membrane::network::{Network, Surroundings};
use std::hint::black_box;
use std::time::Instant;

const SHEET: Sheet =
    Sheet { nodes_per_side: 45, side_m: 0.1, mass_kg: 0.05, stiffness_n_per_m: 200.0, stretch: 1.25 };
const SURROUNDINGS: Surroundings =
    Surroundings { gravity_m_per_s2: 9.806_65, damping_per_s: 20.0, contact_n_per_m: 400.0 };
const BALL: Ball = Ball { centre_m: DVec3::new(0.0, 0.0, 0.004), radius_m: 0.006 };
const NODES: f64 = 2025.0;
const STEPS: u32 = 500;

fn nodes_per_ms(network: &mut Network) -> f64 {
    let step_s = network.longest_step_s();
    let started = Instant::now();
    for _ in 0..STEPS {
        network.activate(); // it must not rest while it is measured
        black_box(network.step(step_s, Some(&BALL)));
    }
    NODES * f64::from(STEPS) / (started.elapsed().as_secs_f64() * 1.0e3)
}

fn main() {
    let mut network = Network::new(&Mesh::sheet(&SHEET), SURROUNDINGS);
    nodes_per_ms(&mut network); // warm, and the ball settled
    let mut runs: Vec<f64> = (0..20).map(|_| nodes_per_ms(&mut network)).collect();
    runs.sort_by(f64::total_cmp);
    println!("{:.0} nodes per ms of one core (best of 20 runs; median {:.0})", runs[19], runs[10]);
}
