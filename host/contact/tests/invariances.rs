//! What must not change an answer, and what an answer never does.

mod common;

use common::{Case, PERIOD_S, cases, set, unlimited};
use flotor_contact::{Contact, ContactSet, Coupling, Limits, Outcome, Replacement, Solver, Validity};
use flotor_core::Random;
use flotor_hal::glam::{DQuat, DVec3};
use flotor_hal::{Pose, Twist, Wrench};

fn wrenches(case: &Case) -> Vec<Wrench> {
    let mut solver =
        Solver::new(case.coupling, unlimited(), Replacement::Immediate, PERIOD_S).expect("a period above 0");
    solver.replace(&set(&case.anchor, &case.contacts));
    case.ticks.iter().map(|(pose, twist, age_s)| solver.solve(pose, twist, *age_s).wrench).collect()
}

#[track_caller]
fn assert_same(seed: u64, first: &[Wrench], second: &[Wrench]) {
    for (first, second) in first.iter().zip(second) {
        let difference =
            (first.force() - second.force()).length().max((first.torque() - second.torque()).length());
        // Of the bound against the generic solver; the largest seen is printed there.
        assert!(difference <= 1.0e-9, "case {seed}: {difference:e} N");
    }
}

#[test]
fn the_order_of_the_contacts_does_not_matter() {
    for seed in 0..cases(300, 20_000) as u64 {
        let mut case = Case::new(seed);
        let first = wrenches(&case);
        case.contacts.reverse();
        let middle = case.contacts.len() / 3;
        case.contacts.rotate_left(middle);
        assert_same(seed, &first, &wrenches(&case));
    }
}

#[test]
fn the_frame_of_the_scene_does_not_matter() {
    for seed in 0..cases(300, 20_000) as u64 {
        let mut case = Case::new(seed);
        let first = wrenches(&case);
        let mut random = Random::new(50, seed);
        let turn = DQuat::from_scaled_axis(random.vector() * 2.0);
        let shift = random.vector() * 0.1;
        let moved =
            |pose: &Pose| Pose::new(turn * pose.position() + shift, (turn * pose.orientation()).normalize());
        case.anchor = moved(&case.anchor);
        for contact in &mut case.contacts {
            *contact = Contact {
                surface_point_m: turn * contact.surface_point_m + shift,
                normal: turn * contact.normal,
                surface_velocity_m_per_s: turn * contact.surface_velocity_m_per_s,
                ..*contact
            };
        }
        for (pose, twist, _) in &mut case.ticks {
            *pose = moved(pose);
            *twist = Twist::new(turn * twist.linear(), turn * twist.angular());
        }
        let back = |wrench: &Wrench| {
            Wrench::new(turn.conjugate() * wrench.force(), turn.conjugate() * wrench.torque())
        };
        let second: Vec<_> = wrenches(&case).iter().map(back).collect();
        assert_same(seed, &first, &second);
    }
}

#[test]
fn equal_inputs_have_equal_bits() {
    for seed in 0..100 {
        let case = Case::new(seed);
        assert_eq!(wrenches(&case), wrenches(&case));
    }
}

#[test]
fn no_answer_is_above_the_limits_or_not_a_number() {
    let limits = Limits::new(5.0, 0.1).expect("above 0");
    let (mut limited, mut unsolved, mut ticks) = (0, 0, 0);
    let conserving = Replacement::Conserving { surface_power_w: 1.0 };
    for seed in 0..cases(500, 20_000) as u64 {
        let replacement = if seed % 2 == 0 { Replacement::Immediate } else { conserving };
        let mut random = Random::new(51, seed);
        let mut solver =
            Solver::new(Case::new(seed).coupling, limits, replacement, PERIOD_S).expect("a period above 0");
        let mut any = |scale: f64| random.vector() * scale * 10.0_f64.powf(random.symmetric() * 12.0);
        for tick in 0..20_u64 {
            // Sets that follow one another without sense, tools that jump, and numbers of any size.
            let mut case = Case::new(seed * 20 + tick);
            for contact in &mut case.contacts {
                contact.stiffness_n_per_m = any(1.0e3).x.abs().clamp(1.0e-9, 1.0e9);
                contact.tangential_stiffness_n_per_m = any(1.0e3).x.abs().min(1.0e9);
                contact.damping_ns_per_m = any(1.0).x.abs().min(1.0e9);
            }
            solver.replace(&set(&case.anchor, &case.contacts));
            for (pose, twist, age_s) in &case.ticks {
                let pose = if tick % 3 == 0 { Pose::new(any(1.0e-3), pose.orientation()) } else { *pose };
                let solution = solver.solve(&pose, twist, *age_s);
                ticks += 1;
                limited += u32::from(solution.is_limited);
                unsolved += u32::from(solution.outcome == Outcome::BestIterate);
                assert!(solution.wrench.is_finite(), "case {seed}: {solution:?}");
                assert!(solution.wrench.force().length() <= 5.0, "case {seed}: {solution:?}");
                assert!(solution.wrench.torque().length() <= 0.1, "case {seed}: {solution:?}");
                for (contact, (force, _)) in case.contacts.iter().zip(solver.forces()) {
                    // Rounding: the friction across the normal is no larger than 1.5 times the normal force.
                    assert!(contact.normal.dot(force) >= -1.0e-12 * force.length(), "case {seed}");
                }
            }
        }
    }
    println!("{ticks} ticks: {limited} limited, {unsolved} not solved");
    assert!(limited > 0);
}

#[test]
fn a_tick_with_numbers_that_are_not_finite_gives_no_force_and_spoils_nothing() {
    let case = Case::new(3);
    let expected = wrenches(&case);
    let mut solver =
        Solver::new(case.coupling, unlimited(), Replacement::Immediate, PERIOD_S).expect("a period above 0");
    solver.replace(&set(&case.anchor, &case.contacts));
    let mut found = Vec::new();
    for (pose, twist, age_s) in &case.ticks {
        let nan = Pose::new(DVec3::new(0.0, f64::NAN, 0.0), pose.orientation());
        let fast = Twist::new(DVec3::X * f64::INFINITY, DVec3::ZERO);
        let spun = Pose { orientation_xyzw: [0.0; 4], ..*pose };
        for answer in [solver.solve(&nan, twist, *age_s), solver.solve(pose, &fast, *age_s)] {
            assert_eq!((answer.outcome, answer.wrench), (Outcome::InvalidInput, Wrench::ZERO));
        }
        assert_eq!(solver.solve(&spun, twist, *age_s).outcome, Outcome::InvalidInput);
        assert_eq!(solver.solve(pose, twist, f64::NAN).outcome, Outcome::InvalidInput);
        found.push(solver.solve(pose, twist, *age_s).wrench);
    }
    assert_eq!(found, expected);
}

#[test]
fn a_set_says_where_and_how_long_it_is_valid() {
    let validity = Validity { displacement_m: 1.0e-3, rotation_rad: 0.1, duration_s: 0.03 };
    let set = ContactSet::new(&Pose::HOME, &[common::floor(0.0)], validity).expect("consistent");
    let mut solver = Solver::new(Coupling::RIGID, unlimited(), Replacement::Immediate, PERIOD_S)
        .expect("a period above 0");
    solver.replace(&set);
    let mut is_in_range = |pose: Pose, age_s| solver.solve(&pose, &Twist::ZERO, age_s).is_in_range;
    assert!(is_in_range(common::at(DVec3::X * 0.9e-3), 0.03));
    assert!(!is_in_range(common::at(DVec3::X * 1.1e-3), 0.0));
    assert!(!is_in_range(Pose::HOME, 0.031));
    assert!(!is_in_range(Pose::new(DVec3::ZERO, DQuat::from_rotation_y(0.11)), 0.0));
}
