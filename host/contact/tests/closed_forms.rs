//! Contacts whose forces have a closed form.

mod common;

use common::{PERIOD_S, at, floor, set, unlimited};
use flotor_contact::{Contact, Coupling, Limits, Outcome, Replacement, Solution, Solver};
use flotor_hal::glam::{DQuat, DVec3};
use flotor_hal::{Pose, Twist, Wrench};

/// Twelve digits: some ten roundings of numbers of one size.
const TOLERANCE: f64 = 1.0e-12;

fn coupling(stiffness_n_per_m: f64, stiffness_nm_per_rad: f64) -> Coupling {
    Coupling::new(stiffness_n_per_m, stiffness_nm_per_rad).expect("above 0")
}

fn solver(coupling: Coupling, contacts: &[Contact]) -> Solver {
    let mut solver =
        Solver::new(coupling, unlimited(), Replacement::Immediate, PERIOD_S).expect("a period above 0");
    solver.replace(&set(&Pose::HOME, contacts));
    solver
}

/// Force at rest at a place.
fn force(coupling: Coupling, contacts: &[Contact], position_m: DVec3) -> DVec3 {
    let solution = solver(coupling, contacts).solve(&at(position_m), &Twist::ZERO, 0.0);
    assert_eq!(solution.outcome, Outcome::Solved);
    solution.wrench.force()
}

/// Force of the only contact along z.
fn normal_n(solver: &Solver) -> f64 {
    solver.forces().map(|(force, _)| force.z).sum()
}

#[track_caller]
fn assert_close(force: DVec3, expected: DVec3) {
    assert!((force - expected).length() <= TOLERANCE * expected.length(), "{force} instead of {expected}");
}

#[test]
fn a_contact_is_as_stiff_at_the_handle_as_it_says() {
    for stiffness in [10.0, 1000.0, 9_999.0, 10_000.0] {
        let contact = Contact { stiffness_n_per_m: stiffness, ..floor(0.0) };
        for depth in [1.0e-6, 1.0e-3, 0.02] {
            let expected = DVec3::Z * stiffness * depth;
            assert_close(force(coupling(1.0e4, 1.0), &[contact], DVec3::Z * -depth), expected);
        }
        assert_eq!(force(coupling(1.0e4, 1.0), &[contact], DVec3::Z * 1.0e-9), DVec3::ZERO);
    }
}

#[test]
fn a_stiffer_contact_is_as_stiff_as_the_coupling() {
    for stiffness in [10_001.0, 1.0e5, 1.0e9] {
        let contact = Contact { stiffness_n_per_m: stiffness, ..floor(0.0) };
        let felt = force(coupling(1.0e4, 1.0), &[contact], DVec3::Z * -1.0e-3);
        // 1 N more stiffness than the coupling's cancels in 1 / k - 1 / c.
        assert!((felt - DVec3::Z * 10.0).length() < 1.0e-11 * 10.0, "{felt}");
    }
}

/// Corners of a square on the plane z = 0.
fn corners(stiffness_n_per_m: f64) -> Vec<Contact> {
    [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
        .map(|(x, y)| {
            let corner = DVec3::new(x, y, 0.0) * 0.01;
            Contact { tool_point_m: corner, surface_point_m: corner, stiffness_n_per_m, ..floor(0.0) }
        })
        .to_vec()
}

#[test]
fn parallel_contacts_add_up_to_the_coupling_and_no_further() {
    for (stiffness, felt) in [(1000.0, 4000.0), (2000.0, 8000.0), (2500.0, 10_000.0), (5000.0, 10_000.0)] {
        let expected = DVec3::Z * felt * 1.0e-3;
        assert_close(force(coupling(1.0e4, 10.0), &corners(stiffness), DVec3::Z * -1.0e-3), expected);
    }
    // Rotation by a small angle: two corners each side, 4 k a² = 0.8 N·m/rad; the two that rise leave the plane.
    let turned = Pose::new(DVec3::Z * -1.0e-3, DQuat::from_rotation_x(0.02));
    let solution = solver(Coupling::RIGID, &corners(2000.0)).solve(&turned, &Twist::ZERO, 0.0);
    let expected = -4.0 * 2000.0 * 0.01 * 0.02_f64.sin() * 0.01 * 0.02_f64.cos();
    assert!((solution.wrench.torque().x - expected).abs() < 1.0e-12, "{:?}", solution.wrench);
}

#[test]
fn a_device_without_torques_has_none_and_is_not_limited_by_that() {
    let limits = Limits::new(3.0, 0.0).expect("no torque");
    let mut solver = Solver::new(Coupling::RIGID, limits, Replacement::Immediate, PERIOD_S).expect("above 0");
    solver.replace(&set(&Pose::HOME, &[Contact { tool_point_m: DVec3::X * 0.01, ..floor(0.0) }]));
    let pressed = solver.solve(&at(DVec3::Z * -1.0e-3), &Twist::ZERO, 0.0);
    assert_eq!((pressed.wrench.torque(), pressed.is_limited), (DVec3::ZERO, false));
    assert_close(pressed.wrench.force(), DVec3::Z);
    let deeper = solver.solve(&at(DVec3::Z * -4.0e-3), &Twist::ZERO, 0.0);
    assert!(deeper.is_limited);
    assert_close(deeper.wrench.force(), DVec3::Z * 3.0);
}

#[test]
fn one_contact_of_a_set_above_the_coupling_is_softer_by_what_all_of_them_need() {
    // Two planes at right angles to the same tool point are independent, two equal ones are not: 1 / k + 1 / c - 1 / (2 k).
    let far = Contact { surface_point_m: DVec3::Z * -0.01, ..floor(0.0) };
    let (near, far) =
        (Contact { stiffness_n_per_m: 8000.0, ..floor(0.0) }, Contact { stiffness_n_per_m: 8000.0, ..far });
    let felt = 1.0 / (1.0 / 8000.0 + 1.0 / 1.0e4 - 1.0 / 16_000.0);
    let expected = DVec3::Z * felt * 1.0e-3;
    assert_close(force(coupling(1.0e4, 1.0), &[near, far], DVec3::Z * -1.0e-3), expected);
    let beside = Contact { normal: DVec3::X, stiffness_n_per_m: 1.0e6, ..near };
    assert_close(
        force(coupling(1.0e4, 1.0), &[near, beside], DVec3::new(1.0e-3, 0.0, -1.0e-3)),
        DVec3::Z * 8.0,
    );
}

#[test]
fn wedges_and_opposed_contacts_add_their_forces() {
    let side = |x: f64| Contact { normal: DVec3::new(x, 0.0, 1.0).normalize(), ..floor(0.0) };
    // Each side is pressed by 1 mm cos 45°; the horizontal parts cancel: 2 k d cos² 45°.
    let wedge = [side(1.0), side(-1.0)];
    assert_close(force(coupling(1.0e4, 1.0), &wedge, DVec3::Z * -1.0e-3), DVec3::Z);
    // Squeezed by 1 mm from below and 2 mm from above, 1 kN/m and 3 kN/m.
    let below = Contact { surface_point_m: DVec3::Z * 1.0e-3, ..floor(0.0) };
    let above = Contact {
        normal: DVec3::NEG_Z,
        surface_point_m: DVec3::Z * -2.0e-3,
        stiffness_n_per_m: 3000.0,
        ..floor(0.0)
    };
    assert_close(force(coupling(1.0e4, 1.0), &[below, above], DVec3::ZERO), DVec3::Z * -5.0);
    // Behind a coupling of 2 kN/m they are 2 kN/m stiff about the place of balance, 1.25 mm below.
    assert_close(force(coupling(2000.0, 1.0), &[below, above], DVec3::ZERO), DVec3::Z * -2.5);
}

#[test]
fn spring_and_damper_together_never_pull() {
    let contact = Contact { damping_ns_per_m: 2.0, ..floor(0.0) };
    for stiffness in [Coupling::RIGID, coupling(500.0, 1.0)] {
        for speed in [-1.0, -0.4, -0.1, 0.0, 0.1, 0.5, 0.51, 5.0] {
            let twist = Twist::new(DVec3::Z * speed, DVec3::ZERO);
            let mut solver = solver(stiffness, &[contact]);
            let felt = solver.solve(&at(DVec3::Z * -1.0e-3), &twist, 0.0).wrench.force().z;
            // Depth 1 mm: spring 1 N, damper -2 v, as far as the contact can have approached in a period.
            let expected = (1.0 - 2.0 * speed).clamp(0.0, 3.0);
            if stiffness == Coupling::RIGID {
                assert!((felt - expected).abs() <= TOLERANCE, "{speed} m/s: {felt} N");
            }
            assert!((0.0..=expected + TOLERANCE).contains(&felt), "{speed} m/s: {felt} N");
        }
        let outside = solver(stiffness, &[contact]).solve(
            &at(DVec3::Z * 1.0e-6),
            &Twist::new(DVec3::Z * -1.0, DVec3::ZERO),
            0.0,
        );
        assert_eq!(outside.wrench, Wrench::ZERO);
    }
}

/// Contact with friction, pressed by 1 mm.
fn rough(tangential_stiffness_n_per_m: f64) -> Contact {
    Contact { tangential_stiffness_n_per_m, friction: 0.5, ..floor(0.0) }
}

/// Moves the tool from x to x along y = 0 at a depth of 1 mm, in steps of 10 um.
fn slide(solver: &mut Solver, from_m: f64, to_m: f64) -> Solution {
    let steps = ((to_m - from_m).abs() / 1.0e-5).round();
    let mut last = None;
    let mut step = 0.0;
    while step <= steps {
        let x = from_m + (to_m - from_m) * (step / steps);
        last = Some(solver.solve(&at(DVec3::new(x, 0.0, -1.0e-3)), &Twist::ZERO, 0.0));
        step += 1.0;
    }
    last.expect("there is a step")
}

#[test]
fn a_sliding_contact_drags_with_the_friction_of_its_normal_force() {
    for stiffness in [Coupling::RIGID, coupling(800.0, 1.0)] {
        let mut solver = solver(stiffness, &[rough(700.0)]);
        for (from, to, sign) in [(0.0, 5.0e-3, -1.0), (5.0e-3, -1.0e-3, 1.0), (-1.0e-3, 4.0e-3, -1.0)] {
            let felt = slide(&mut solver, from, to).wrench.force();
            let normal = felt.z;
            assert!((felt.x - sign * 0.5 * normal).abs() <= TOLERANCE * normal, "{felt}");
        }
        let expected = if stiffness == Coupling::RIGID { 1.0 } else { 0.8 };
        assert!((normal_n(&solver) - expected).abs() <= TOLERANCE);
    }
}

#[test]
fn a_sticking_contact_does_not_creep() {
    for stiffness in [Coupling::RIGID, coupling(500.0, 1.0)] {
        let mut solver = solver(stiffness, &[rough(1000.0)]);
        slide(&mut solver, 0.0, 1.0e-5);
        // 0.3 mm, 0.3 N at the most, below 0.5 times 0.5 N.
        let pulled = slide(&mut solver, 1.0e-5, 2.0e-4).wrench;
        assert!(pulled.force().x < -0.09, "{pulled:?}");
        for _ in 0..100_000 {
            let held = solver.solve(&at(DVec3::new(2.0e-4, 0.0, -1.0e-3)), &Twist::ZERO, 0.0).wrench;
            assert!((held.force() - pulled.force()).length() <= 1.0e-13, "{held:?}");
        }
        let back = slide(&mut solver, 2.0e-4, 0.0).wrench.force();
        assert!(back.x.abs() <= 1.0e-2, "{back}: the anchor is where the contact began");
    }
}

#[test]
fn a_moving_surface_takes_the_tool_along() {
    let belt = Contact { surface_velocity_m_per_s: DVec3::X * 0.05, ..rough(1000.0) };
    let mut solver = solver(Coupling::RIGID, &[belt]);
    let mut felt = DVec3::ZERO;
    for tick in 0..100 {
        felt = solver.solve(&at(DVec3::Z * -1.0e-3), &Twist::ZERO, f64::from(tick) * PERIOD_S).wrench.force();
    }
    assert_close(felt, DVec3::new(0.5, 0.0, 1.0));
    // A tool that moves with the belt feels no change.
    for tick in 0..100 {
        let position = DVec3::new(5.0e-5 * f64::from(tick + 1), 0.0, -1.0e-3);
        let age_s = f64::from(100 + tick) * PERIOD_S;
        felt = solver.solve(&at(position), &Twist::new(DVec3::X * 0.05, DVec3::ZERO), age_s).wrench.force();
    }
    assert!((felt - DVec3::new(0.5, 0.0, 1.0)).length() <= 1.0e-12, "{felt}");
    // A floor that rises presses by its way.
    let lift = Contact { surface_velocity_m_per_s: DVec3::Z * 0.05, ..floor(0.0) };
    let mut solver = self::solver(Coupling::RIGID, &[lift]);
    let felt = solver.solve(&at(DVec3::ZERO), &Twist::ZERO, 0.02).wrench.force();
    assert_close(felt, DVec3::Z);
}

#[test]
fn the_same_set_once_more_changes_no_force() {
    for stiffness in [Coupling::RIGID, coupling(900.0, 1.0)] {
        let contacts = [rough(1000.0), Contact { tool_point_m: DVec3::X * 0.02, ..rough(500.0) }];
        let mut solver = solver(stiffness, &contacts);
        slide(&mut solver, 0.0, 1.0e-3);
        let before = slide(&mut solver, 1.0e-3, 0.9e-3).wrench;
        // In another order, and published for another pose.
        solver.replace(&set(&at(DVec3::new(0.9e-3, 0.0, -1.0e-3)), &[contacts[1], contacts[0]]));
        let after = solver.solve(&at(DVec3::new(0.9e-3, 0.0, -1.0e-3)), &Twist::ZERO, 0.0).wrench;
        assert!((after.force() - before.force()).length() <= 1.0e-12, "{before:?} {after:?}");
        assert!((after.torque() - before.torque()).length() <= 1.0e-13, "{before:?} {after:?}");
    }
}

#[test]
fn a_lap_with_friction_dissipates_and_one_without_does_not() {
    // A circle of 5 mm at a depth of 1 mm, by the trapezoid rule.
    let lap = |solver: &mut Solver| {
        let (mut work_j, mut last): (f64, Option<(DVec3, DVec3)>) = (0.0, None);
        for step in 0..=20_000_u32 {
            let (sine, cosine) = (f64::from(step) * std::f64::consts::TAU * 1.0e-4).sin_cos();
            let position = DVec3::new(5.0e-3 * cosine, 5.0e-3 * sine, -1.0e-3);
            let felt = solver.solve(&at(position), &Twist::ZERO, 0.0).wrench.force();
            if let Some((there, before)) = last
                && step > 10_000
            {
                work_j += (position - there).dot(felt + before) * 0.5;
            }
            last = Some((position, felt));
        }
        work_j
    };
    for stiffness in [Coupling::RIGID, coupling(700.0, 1.0)] {
        let mut rough = solver(stiffness, &[rough(1000.0)]);
        let work_j = lap(&mut rough);
        // Force mu N against the motion of the anchor, which trails by mu N / k on a smaller circle; once around.
        let normal = normal_n(&rough);
        let drag = 0.5 * normal;
        assert!(work_j < 0.0 && -work_j <= drag * std::f64::consts::TAU * 5.0e-3 * 1.000_001, "{work_j}");
        assert!(-work_j >= drag * std::f64::consts::TAU * 4.9e-3, "{work_j}");
        let tilted = Contact { normal: DVec3::new(0.2, 0.1, 1.0).normalize(), ..floor(0.0) };
        let work_j = lap(&mut solver(stiffness, &[tilted]));
        assert!(work_j.abs() <= 1.0e-9, "{work_j}");
    }
}

#[test]
fn the_wrench_is_the_gradient_of_an_energy_for_rotations_too() {
    // A loop in position and rotation without friction; contacts touch and leave, behind a coupling that yields.
    let contacts: Vec<_> = corners(3000.0)
        .into_iter()
        .chain([Contact { normal: DVec3::X, tool_point_m: DVec3::new(-0.01, 0.0, 0.02), ..floor(0.0) }])
        .map(|contact| Contact { surface_point_m: contact.tool_point_m, ..contact })
        .collect();
    let work = |steps: u32| {
        let mut solver = solver(coupling(4000.0, 0.6), &contacts);
        let (mut work_j, mut last): (f64, Option<(DVec3, DVec3, Wrench)>) = (0.0, None);
        for step in 0..=steps {
            let (sine, cosine) = (f64::from(step) / f64::from(steps) * std::f64::consts::TAU).sin_cos();
            let position = DVec3::new(-1.0e-3 * cosine, 1.0e-3 * sine, -0.5e-3 + 1.0e-3 * sine);
            // About one axis: the angle is a coordinate, and its torque the derivative.
            let angle = DVec3::X * (0.05 * cosine);
            let pose = Pose::new(position, DQuat::from_rotation_x(angle.x));
            let wrench = solver.solve(&pose, &Twist::ZERO, 0.0).wrench;
            if let Some((there, turned, before)) = last {
                let sum = before + wrench;
                work_j += 0.5 * (sum.force().dot(position - there) + sum.torque().dot(angle - turned));
            }
            last = Some((position, angle, wrench));
        }
        assert!(solver.excess() > 1.0);
        work_j.abs()
    };
    // The rule's error at a kink falls with the square of the step.
    let (coarse, fine) = (work(2_000), work(64_000));
    assert!(fine <= 1.0e-10 && fine <= coarse.max(1.0e-12), "{coarse:e} J, {fine:e} J");
}
