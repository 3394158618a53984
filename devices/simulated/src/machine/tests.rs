//! Actuators and sensors around the simulation: their effect without a fault, and the effect of each fault.

use super::*;
use crate::actuation::field::FieldError;
use crate::hand::{Hand, Script, Trajectory};
use crate::simulation::Setup;
use flotor_hal::glam::DVec3;

const TICK_NS: u64 = 1_000_000;

/// Nothing between controller and flotor but arithmetic.
const TRANSPARENT: MachineParameters = MachineParameters {
    actuation: ActuationParameters {
        amplifier_bandwidth_hz: 1.0e9,
        field: FieldError { peak_to_peak: 0.0 },
        ..ActuationParameters::MAGLEV
    },
    sensing: SensingParameters {
        noise_m: 0.0,
        step_m: 0.0,
        edge_nonlinearity: 0.0,
        latency_ns: 0,
        ..SensingParameters::MAGLEV
    },
    fault: None,
};

/// A spring of 1 N/mm on the machine; what the controller saw, tick by tick.
fn run(parameters: &MachineParameters, seed: u64, ticks: u64) -> (Vec<(Cycle, DeviceState)>, Simulation) {
    run_setup(&Setup::DEMO, parameters, seed, ticks)
}

/// The same with any flotor and hand.
fn run_setup(
    setup: &Setup,
    parameters: &MachineParameters,
    seed: u64,
    ticks: u64,
) -> (Vec<(Cycle, DeviceState)>, Simulation) {
    let mut simulation = Simulation::new(setup).expect("physical setup");
    let mut machine = Machine::new(parameters, &State::HOME, seed).expect("physical machine");
    let mut state = DeviceState::HOME;
    let mut commanded = Wrench::ZERO;
    let mut seen = Vec::new();
    for index in 0..ticks {
        let dt_ns = if index == 0 { 0 } else { TICK_NS };
        let tick = Tick { index, time_ns: index * TICK_NS, dt_ns };
        let cycle = machine.cycle(&mut simulation, &tick, &commanded, &mut state);
        seen.push((cycle, state));
        commanded = Wrench { force_n: state.pose.position() * -1000.0, torque_nm: DVec3::ZERO };
    }
    (seen, simulation)
}

fn broken(kind: FaultKind) -> MachineParameters {
    let plan = FaultPlan { kind, start_ns: 100 * TICK_NS, duration_ns: 20 * TICK_NS, rate_per_s: 0.0 };
    MachineParameters { fault: Some(plan), ..MachineParameters::MAGLEV }
}

#[test]
fn a_transparent_machine_shows_the_flotor_as_it_is() {
    let (seen, simulation) = run(&TRANSPARENT, 1, 1000);
    let (cycle, state) = seen.last().expect("ticks");
    assert_eq!(*cycle, Cycle::Fresh);
    assert!((state.pose.position() - simulation.state().position_m).length() <= 1.0e-10);
    assert!(seen.iter().any(|(_, state)| state.pose.position().length() > 1.0e-3), "it moved");
}

#[test]
fn the_real_machine_is_off_by_microns_and_a_tick() {
    let (seen, _) = run(&MachineParameters::MAGLEV, 1, 2000);
    let (ideal, _) = run(&TRANSPARENT, 1, 2000);
    for ((cycle, real), (_, ideal)) in seen.iter().zip(&ideal) {
        assert_eq!(*cycle, Cycle::Fresh);
        // A tick at 50 mm/s, noise, edge error of 1 % at most.
        assert!((real.pose.position() - ideal.pose.position()).length() < 0.3e-3);
    }
    assert!(seen.iter().skip(1).all(|(_, state)| state.is_finite()));
}

#[test]
fn the_books_of_energy_close_with_coils_and_cells_in_between() {
    let (_, simulation) = run(&MachineParameters::MAGLEV, 1, 3000);
    let ledger = simulation.ledger();
    assert!(ledger.relative_imbalance() <= 1.0e-9, "{:e}", ledger.relative_imbalance());
}

#[test]
fn the_books_of_energy_close_in_every_script() {
    for name in Script::NAMES {
        let script = Script::load(name).expect("built in");
        let ticks = script.end_ns() / TICK_NS + 500;
        let hand = Hand { trajectory: Trajectory::Scripted(script), ..Hand::EXPLORING };
        let setup = Setup { hand, ..Setup::DEMO };
        let (_, simulation) = run_setup(&setup, &MachineParameters::MAGLEV, 1, ticks);
        let imbalance = simulation.ledger().relative_imbalance();
        assert!(imbalance <= 1.0e-9, "{name}: {imbalance:e}");
    }
}

#[test]
fn more_than_the_coils_can_give_is_told() {
    let mut simulation = Simulation::new(&Setup::DEMO).expect("physical setup");
    let mut machine = Machine::new(&MachineParameters::MAGLEV, &State::HOME, 1).expect("physical machine");
    let mut state = DeviceState::HOME;
    let tick = Tick { index: 1, time_ns: TICK_NS, dt_ns: TICK_NS };
    for (force_n, conditions) in
        [(10.0, Conditions::NONE), (1000.0, Conditions::SATURATED), (10.0, Conditions::NONE)]
    {
        let commanded = Wrench { force_n: DVec3::Z * force_n, torque_nm: DVec3::ZERO };
        let _ = machine.cycle(&mut simulation, &tick, &commanded, &mut state);
        assert_eq!(state.conditions, conditions, "{force_n} N");
    }
}

#[test]
fn a_seed_repeats_bit_for_bit_and_another_differs() {
    let last = |seed| run(&MachineParameters::MAGLEV, seed, 500).0.pop().expect("ticks").1;
    assert_eq!(last(1), last(1));
    assert_ne!(last(1), last(2));
}

#[test]
fn faults_that_end_a_run_say_which() {
    for (kind, expected) in [
        (FaultKind::SensorLoss, Fault::SensorOutOfRange),
        (FaultKind::OverTemperature, Fault::OverTemperature),
        (FaultKind::CablePull, Fault::Disconnected),
    ] {
        let (seen, _) = run(&broken(kind), 1, 130);
        for (tick, (cycle, _)) in seen.iter().enumerate() {
            let wanted = if (100..120).contains(&tick) { Cycle::Fault(expected) } else { Cycle::Fresh };
            assert_eq!(*cycle, wanted, "{kind:?} at {tick}");
        }
    }
}

#[test]
fn samples_are_late_doubled_or_missing_as_asked() {
    let sampled_ms = |kind| -> Vec<(Cycle, u64)> {
        let (seen, _) = run(&broken(kind), 1, 103);
        seen[98..103].iter().map(|(cycle, state)| (*cycle, state.sampled_ns / TICK_NS)).collect()
    };
    let fresh = |ms: [u64; 5]| ms.map(|ms| (Cycle::Fresh, ms)).to_vec();
    assert_eq!(sampled_ms(FaultKind::CoilOpen(0)), fresh([97, 98, 99, 100, 101]), "one tick of latency");
    assert_eq!(sampled_ms(FaultKind::LateSample), fresh([97, 98, 98, 99, 100]));
    assert_eq!(sampled_ms(FaultKind::DuplicateSample), fresh([97, 98, 98, 98, 98]));
    let dropped = sampled_ms(FaultKind::DroppedSample);
    assert_eq!(dropped[2..], [(Cycle::Stale, 98); 3]);
}

#[test]
fn a_stuck_axis_stays_while_the_others_move() {
    let (seen, simulation) = run(&broken(FaultKind::StuckAxis(2)), 1, 120);
    let heights: Vec<f64> = seen[100..120].iter().map(|(_, state)| state.pose.position_m[2]).collect();
    assert!(heights.iter().all(|height| *height == heights[0]));
    assert!((simulation.state().position_m.z - heights[0]).abs() > 1.0e-5, "the flotor went on");
}

#[test]
fn a_stuttering_clock_says_when_it_really_looked() {
    let (seen, _) = run(&broken(FaultKind::ClockJitter), 1, 130);
    let off_grid = seen.iter().filter(|(_, state)| state.sampled_ns % TICK_NS != 0).count();
    assert!((15..=20).contains(&off_grid), "{off_grid} of 20");
}

#[test]
fn an_open_coil_turns_the_flotor() {
    let (_, simulation) = run(&broken(FaultKind::CoilOpen(0)), 1, 119);
    let (_, intact) = run(&MachineParameters::MAGLEV, 1, 119);
    let turn = |simulation: &Simulation| simulation.state().orientation.xyz().length();
    assert!(turn(&simulation) > 10.0 * turn(&intact));
}
