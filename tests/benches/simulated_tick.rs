//! What a tick of the simulated flotor costs in time, by preset and velocity estimator.
//!
//! ```text
//! cargo bench -p flotor-tests --features measurements --bench simulated_tick
//! ```

use criterion::{Criterion, criterion_group, criterion_main};
use flotor_hal::glam::DVec3;
use flotor_hal::{DeviceState, Tick};
use flotor_simulated::machine::{Machine, MachineParameters};
use flotor_simulated::plant::{State, Wrench};
use flotor_simulated::sensing::SensingParameters;
use flotor_simulated::sensing::velocity::EstimatorKind;
use flotor_simulated::simulation::{Setup, Simulation};
use std::hint::black_box;

/// A spring of 1 N/mm.
fn spring(simulation: &Simulation) -> Wrench {
    Wrench { force_n: simulation.state().position_m * -1000.0, torque_nm: DVec3::ZERO }
}

fn plain(criterion: &mut Criterion) {
    let mut simulation = Simulation::new(&Setup::DEMO).expect("the demo is physical");
    criterion.bench_function("tick/plain", |bencher| {
        bencher.iter(|| {
            let wrench = spring(&simulation);
            simulation.advance(black_box(1_000_000), wrench)
        });
    });
}

fn full(criterion: &mut Criterion) {
    let kalman = EstimatorKind::Kalman { noise_m: 1.2e-6, acceleration_m_per_s2: 2.0 };
    for (name, estimator) in [
        ("tick/full, difference", EstimatorKind::Difference),
        ("tick/full, low-pass", EstimatorKind::UTAH),
        ("tick/full, kalman", kalman),
    ] {
        let sensing = SensingParameters { estimator, ..SensingParameters::MAGLEV };
        let parameters = MachineParameters { sensing, ..MachineParameters::MAGLEV };
        let mut simulation = Simulation::new(&Setup::DEMO).expect("the demo is physical");
        let mut machine = Machine::new(&parameters, &State::HOME, 1).expect("physical");
        let (mut state, mut index) = (DeviceState::HOME, 0);
        criterion.bench_function(name, |bencher| {
            bencher.iter(|| {
                index += 1;
                let tick = Tick { index, time_ns: index * 1_000_000, dt_ns: 1_000_000 };
                let wrench = spring(&simulation);
                machine.cycle(&mut simulation, &tick, &wrench, black_box(&mut state))
            });
        });
    }
}

criterion_group!(benches, plain, full);
criterion_main!(benches);
