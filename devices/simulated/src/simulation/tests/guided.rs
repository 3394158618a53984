//! Guidance of the hand by a client: force at a wall, start and release without a jump of the force, clock and energy balance.

use super::*;

const GUIDE: f64 = 4711.0;

/// Mass of flotor and firm hand, kg.
const MASS_KG: f64 = 1.08;

/// The force of a plane below home without damping.
fn wall(state: &State, stiffness_n_per_m: f64) -> Wrench {
    let depth_m = (-state.position_m.z).max(0.0);
    Wrench { force_n: DVec3::Z * (stiffness_n_per_m * depth_m), ..Wrench::ZERO }
}

fn run(simulation: &mut Simulation, milliseconds: u32, coils: impl Fn(&State) -> Wrench) {
    for _ in 0..milliseconds {
        let wrench = coils(&simulation.state());
        assert!(simulation.advance(MILLISECOND_NS, wrench).is_empty());
        if simulation.guided_by() == GUIDE {
            simulation.guide(GUIDE).expect("it guides");
        }
    }
}

fn guide_to(simulation: &mut Simulation, target_m: DVec3) {
    simulation.guide(GUIDE).expect("nobody else guides");
    for (axis, target_m) in target_m.to_array().into_iter().enumerate() {
        simulation.guide_to(axis, target_m).expect("it guides");
    }
}

/// A firm hand and a wall of the same stiffness are two equal springs in series: a target 2 mm deep is a handle 1 mm deep and 2 N.
#[test]
fn a_guided_handle_rests_where_hand_and_wall_balance() {
    for hand in [Hand::EXPLORING, Hand::AWAY] {
        let hand = Hand { impedance: Impedance::FIRM, ..hand };
        let mut simulation = simulation(&Setup { hand, ..Setup::DEMO });
        run(&mut simulation, 400, |_| Wrench::ZERO);
        guide_to(&mut simulation, DVec3::new(0.0, 0.0, -2.0e-3));
        run(&mut simulation, 2000, |state| wall(state, 2000.0));
        let force_n = wall(&simulation.state(), 2000.0).force_n.z;
        // The slowest mode, 4000 N/m and 72 N s/m on 1.08 kg, has decayed by e^-100 after the follower has arrived.
        assert!((force_n - 2.0).abs() < 1.0e-6, "{force_n} N");
    }
}

/// Largest change of the force on flotor and hand within a millisecond, N, over some milliseconds.
fn largest_jump_n(simulation: &mut Simulation, milliseconds: u32, object_n_per_m: f64) -> f64 {
    let (mut before, mut before_n, mut largest_n) = (simulation.state(), None, 0.0_f64);
    for _ in 0..milliseconds {
        run(simulation, 1, |state| spring(state, object_n_per_m, 0.0));
        let now = simulation.state();
        let force_n = (now.velocity_m_per_s - before.velocity_m_per_s) * (MASS_KG / 1.0e-3);
        if let Some(before_n) = before_n {
            largest_n = largest_n.max((force_n - before_n as DVec3).length());
        }
        (before, before_n) = (now, Some(force_n));
    }
    largest_n
}

#[test]
fn a_hand_is_taken_and_released_without_a_jump_of_the_force() {
    let held = Trajectory::Hold(Pose { position_m: DVec3::new(0.0, 0.0, 3.0e-3), ..Pose::HOME });
    let push = Script::load("push").map(Trajectory::Scripted).expect("built in");
    // A hand that means a force needs an object.
    let hands = [(Trajectory::EXPLORE, 0.0), (held, 0.0), (push, SPRING_1_N_PER_M), (Trajectory::Open, 0.0)];
    for (trajectory, object_n_per_m) in hands {
        let name = format!("{trajectory:?}");
        let hand = Hand { trajectory, ..Hand::EXPLORING };
        let start = State { velocity_m_per_s: DVec3::new(0.05, 0.0, 0.0), ..State::HOME };
        let mut simulation = simulation(&Setup { hand, start, ..Setup::DEMO });
        run(&mut simulation, 70, |_| Wrench::ZERO);
        let jump_m = 5.0e-3;
        let target_m = simulation.state().position_m + DVec3::Z * jump_m;
        guide_to(&mut simulation, target_m);
        let taken_n = largest_jump_n(&mut simulation, 900, object_n_per_m);
        let follows_m = target_m.z * 2000.0 / (2000.0 + object_n_per_m);
        assert!((simulation.state().position_m.z - follows_m).abs() < 0.1e-3, "{name}: it does not follow");
        simulation.guide(0.0).expect("a release is always legal");
        let released_n = largest_jump_n(&mut simulation, 1000, object_n_per_m);
        // The follower accelerates by 2500 / s² times the way: 12.5 mm/s in a millisecond, on 70 N s/m. Twice that leaves room for
        // the spring and for what the hand did before. At once it would be 2000 N/m times 5 mm, and 350 N from the damper.
        let most_n = 2.0 * 70.0 * 2500.0 * jump_m * 1.0e-3;
        assert!(taken_n < most_n && released_n < most_n, "{name}: {taken_n} N and {released_n} N");
        assert_eq!(simulation.guided_by(), 0.0);
    }
}

#[test]
fn a_guided_hand_is_the_same_for_ticks_of_any_length() {
    let reached = |tick_ns: u64| {
        let mut simulation = simulation(&Setup { tick_ns, ..Setup::DEMO });
        let until = |simulation: &mut Simulation, end_ns: u64| {
            while simulation.time_ns() < end_ns {
                let left_ns = end_ns - simulation.time_ns();
                simulation.advance(tick_ns.min(left_ns), Wrench::ZERO);
            }
        };
        until(&mut simulation, 500_300_000);
        guide_to(&mut simulation, DVec3::new(2.0e-3, -1.0e-3, -5.0e-3));
        until(&mut simulation, 700_000_000);
        simulation.guide(0.0).expect("a release is always legal");
        until(&mut simulation, 900_000_000);
        simulation.state().position_m
    };
    let expected_m = reached(MILLISECOND_NS);
    for tick_ns in [333_333, 10 * MILLISECOND_NS] {
        // Translation is exact in each piece; rounding of a thousand pieces.
        assert!((reached(tick_ns) - expected_m).length() < 1.0e-12, "{tick_ns} ns");
    }
}

#[test]
fn energy_balances_under_a_guide() {
    let mut simulation = simulation(&Setup::DEMO);
    let mut worst_j: f64 = 0.0;
    for round in 0..20 {
        let side = if round % 2 == 0 { 1.0 } else { -1.0 };
        if round % 4 == 3 {
            simulation.guide(0.0).expect("a release is always legal");
        } else {
            guide_to(&mut simulation, DVec3::new(2.0e-3 * side, 0.0, -6.0e-3 * side));
        }
        for _ in 0..150 {
            run(&mut simulation, 1, |state| spring(state, SPRING_1_N_PER_M, 1.0));
            worst_j = worst_j.max(simulation.ledger().imbalance_j().abs());
        }
    }
    let peak_j = simulation.ledger().peak_j();
    assert!(worst_j <= 1.0e-9 * peak_j, "{worst_j:e} J of {peak_j:e} J");
}
