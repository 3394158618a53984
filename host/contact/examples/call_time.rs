//! Time of a call with 16 contacts in a loop: `cargo run --release -p flotor-contact --example call_time`.
//!
//! Each row is 50 rounds of 1000 ticks of a tool that circles on a set with 16 contacts, with friction and damping: median of the call
//! of a tick, p99.9 of the quietest round (other programs interrupt the others), and the number of Newton steps.
//! The last row takes a new set in every fifth call, as from a model at 200 Hz beside a loop at 1 kHz.

use flotor_contact::{Contact, ContactSet, Coupling, Limits, Replacement, Solver, Validity};
use flotor_core::Random;
use flotor_hal::{DQuat, DVec3, Pose, Twist};
use std::error::Error;
use std::time::Instant;

const PERIOD_S: f64 = 1.0e-3;
const ROUND: usize = 1000;
const TICKS: u32 = 50_000;
const CONTACTS: usize = 16;

/// Contacts of points within 20 mm of the handle with planes that lean up to 0.2 to each side.
fn contacts(stiffness_n_per_m: f64) -> Vec<Contact> {
    let mut random = Random::new(1, 1);
    let contact = |_| {
        let tool_point_m = random.vector() * 0.02 * DVec3::new(1.0, 1.0, 0.0);
        let normal = (DVec3::Z + random.vector() * 0.2).normalize();
        Contact {
            tool_point_m,
            surface_point_m: DVec3::ZERO,
            normal,
            gap_m: normal.dot(tool_point_m),
            surface_velocity_m_per_s: DVec3::ZERO,
            stiffness_n_per_m,
            tangential_stiffness_n_per_m: 1000.0,
            damping_ns_per_m: 1.0,
            friction: 0.4,
        }
    };
    (0..CONTACTS).map(contact).collect()
}

/// Row of the table: stiffness of a contact and of the coupling, N/m, and the number of ticks between two new sets; 0: no new set.
struct Row {
    name: &'static str,
    contact_n_per_m: f64,
    coupling_n_per_m: f64,
    ticks_to_new: u32,
}

fn measure(row: &Row) -> Result<(), Box<dyn Error>> {
    let coupling = Coupling::new(row.coupling_n_per_m, 5.0)?;
    let limits = Limits::new(f64::INFINITY, f64::INFINITY)?;
    let replacement = Replacement::Conserving { surface_power_w: 1.0 };
    let mut solver = Solver::new(coupling, limits, replacement, PERIOD_S)?;
    let set = ContactSet::new(&Pose::HOME, &contacts(row.contact_n_per_m), Validity::UNLIMITED)?;
    solver.replace(&set);
    let (mut times_us, mut most, mut sum) = (Vec::with_capacity(TICKS as usize), 0, 0);
    for tick in 0..TICKS {
        let time_s = f64::from(tick) * PERIOD_S;
        let (sine, cosine) = (12.0 * time_s).sin_cos();
        let height_m = -1.0e-3 + 0.8e-3 * (8.4 * time_s).sin();
        let pose = Pose::new(DVec3::new(8.0e-3 * cosine, 8.0e-3 * sine, height_m), DQuat::IDENTITY);
        let twist = Twist::new(DVec3::new(-0.096 * sine, 0.096 * cosine, 0.0), DVec3::ZERO);
        let begun = Instant::now();
        let age = if row.ticks_to_new == 0 { tick } else { tick % row.ticks_to_new };
        if age == 0 {
            solver.replace(&set);
        }
        let solution = solver.solve(&pose, &twist, f64::from(age) * PERIOD_S);
        times_us.push(begun.elapsed().as_secs_f64() * 1.0e6);
        most = most.max(solution.steps);
        sum += solution.steps;
    }
    let p999_us = times_us.chunks_mut(ROUND).map(|round| {
        round.sort_by(f64::total_cmp);
        round[round.len() - 1 - round.len() / 1000]
    });
    let p999_us = p999_us.fold(f64::INFINITY, f64::min);
    times_us.sort_by(f64::total_cmp);
    let median_us = times_us[times_us.len() / 2];
    let mean = f64::from(sum) / f64::from(TICKS);
    println!("{:<38}{:>9.2}{:>9.2}{mean:>9.2}{most:>7}", row.name, median_us, p999_us);
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let row = |name, contact_n_per_m, coupling_n_per_m, ticks_to_new| Row {
        name,
        contact_n_per_m,
        coupling_n_per_m,
        ticks_to_new,
    };
    println!("{:<38}{:>9}{:>9}{:>16}", "16 contacts", "median", "p99.9", "Newton steps");
    println!("{:<38}{:>9}{:>9}{:>9}{:>7}", "", "µs", "µs", "mean", "most");
    for row in [
        row("softer than the coupling", 2000.0, 1.0e6, 0),
        row("together eight times the coupling", 2000.0, 4000.0, 0),
        row("together thousands of times", 1.0e6, 4000.0, 0),
        row("eight times, a new set every 5 ticks", 2000.0, 4000.0, 5),
    ] {
        measure(&row)?;
    }
    Ok(())
}
