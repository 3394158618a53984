//! The exact rod against reference tables computed elsewhere, reached the way a hand reaches a pose; and what
//! no table can show: convergence, energy, symmetry, totality. All rows and long walks with `FLOTOR_TEST_SIZE=full`.

use crate::preset::preset;
use crate::sample::{Loop, Sampler, Workspace, of};
use crate::table::{Row, rows};
use flotor_hal::glam::{DQuat, DVec3};
use flotor_spring::pose::Pose;
use flotor_spring::preset::Preset;
use flotor_spring::response::{Demand, Response};
use flotor_spring::rigidity::Spring;
use flotor_spring::rod::{Accuracy, Branch, Rod, Work};
use flotor_spring::validity::Validity;

/// Steps of a hand on its way, and ticks it is held at its goal.
const STEP_M: f64 = 0.05e-3;
const STEP_RAD: f64 = 0.002;
const MOST_HOLDS: u32 = 2000;

/// The goal of a row relative to home (m) and its rotation vector (rad).
fn goal(row: &Row, spring: &Spring) -> (DVec3, DVec3) {
    let free_length_mm = spring.geometry().free_length_m * 1e3;
    let position_mm = row.vector(["rx_mm", "ry_mm", "rz_mm"]) - DVec3::new(0.0, 0.0, free_length_mm);
    (position_mm * 1e-3, row.vector(["vx_rad", "vy_rad", "vz_rad"]))
}

/// Takes the rod from rest to a pose in a straight line and holds it there until it has converged.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few thousand steps
fn walk(rod: &mut Rod, (position_m, rotation_rad): (DVec3, DVec3)) -> Response {
    rod.reset();
    let steps = (position_m.length() / STEP_M).max(rotation_rad.length() / STEP_RAD).ceil().max(1.0) as u32;
    let at = |part: f64| Pose::from_rotation_vector(position_m * part, rotation_rad * part);
    for step in 1..steps {
        let _ = rod.step(&at(f64::from(step) / f64::from(steps)), Demand::WrenchAndEnergy);
    }
    hold(rod, &at(1.0))
}

fn hold(rod: &mut Rod, pose: &Pose) -> Response {
    let mut answer = rod.step(pose, Demand::WrenchAndEnergy);
    for _ in 0..MOST_HOLDS {
        if answer.validity != Validity::NotConverged {
            break;
        }
        answer = rod.step(pose, Demand::WrenchAndEnergy);
    }
    answer
}

/// Largest deviations over rows: force (N), torque (N·m), energy (J).
fn worst(file: &str, accuracy: Accuracy, keep: impl Fn(&Row) -> bool) -> (f64, f64, f64) {
    let (mut force_n, mut torque_nm, mut energy_j) = (0.0f64, 0.0f64, 0.0f64);
    let mut kept = 0;
    // Past buckling the ways are long: each day every third row of them.
    let stride = if file.contains("postbuckling") { of(1, 3) as usize } else { 1 };
    for row in rows(file).iter().filter(|row| keep(row)).step_by(stride) {
        kept += 1;
        let spring = preset(row).spring();
        let mut rod = Rod::new(&spring, accuracy);
        let answer = walk(&mut rod, goal(row, &spring));
        assert_eq!(answer.validity, Validity::Ok, "{}", row.text("id"));
        assert!(rod.state().is_stable(), "{}", row.text("id"));
        force_n = force_n.max((answer.force_n - row.vector(["FX_N", "FY_N", "FZ_N"])).length());
        let torque = row.vector(["MX_Nmm", "MY_Nmm", "MZ_Nmm"]) * 1e-3;
        torque_nm = torque_nm.max((answer.torque_nm - torque).length());
        energy_j = energy_j.max((answer.energy_j.expect("demanded") - row.number("W_Nmm") * 1e-3).abs());
    }
    assert!(kept > 0, "no row of {file} was kept");
    (force_n, torque_nm, energy_j)
}

#[test]
fn tight_rod_is_the_reference_before_buckling() {
    // The table's own residual is 1e-9 N and 1e-8 N mm at worst; required 1e-9 N and 1e-11 N·m.
    let (force_n, torque_nm, energy_j) = worst("b_exact_rod_prebuckling.csv", Accuracy::Tight, |_| true);
    assert!(
        force_n < 1e-9 && torque_nm < 1e-11 && energy_j < 1e-11,
        "{force_n:e} {torque_nm:e} {energy_j:e}"
    );
}

#[test]
fn servo_rod_meets_its_bounds_before_buckling() {
    let moderate = |row: &Row| !["combined", "large_rotation"].contains(&row.text("category"));
    // Required 4e-5 N and 1e-4 N; a servo tick may cost three microseconds, and this is what it buys.
    let (force_n, ..) = worst("b_exact_rod_prebuckling.csv", Accuracy::Servo, moderate);
    assert!(force_n < 5e-6, "{force_n:e}");
    let (force_n, ..) = worst("b_exact_rod_prebuckling.csv", Accuracy::Servo, |_| true);
    assert!(force_n < 5e-6, "{force_n:e}");
}

#[test]
fn tight_rod_is_the_reference_past_buckling() {
    // Required 1e-8 N. Rows with another flag are equilibria of the plane that are saddles in space.
    let planar = "c_postbuckling_planar.csv";
    let (force_n, torque_nm, _) = worst(planar, Accuracy::Tight, |row| row.text("stable_spatial") == "1");
    assert!(force_n < 1e-8 && torque_nm < 1e-10, "{force_n:e} {torque_nm:e}");
    // Perfect rods may bulge to any side: to -x by convention, like the table.
    let (force_n, torque_nm, _) =
        worst(planar, Accuracy::Tight, |row| row.text("stable_spatial") == "neutral");
    assert!(force_n < 1e-8 && torque_nm < 1e-10, "{force_n:e} {torque_nm:e}");
    let (force_n, torque_nm, _) = worst("c2_postbuckling_spatial.csv", Accuracy::Tight, |_| true);
    assert!(force_n < 1e-8 && torque_nm < 1e-10, "{force_n:e} {torque_nm:e}");
}

#[test]
fn servo_rod_stays_below_the_device_past_buckling() {
    // The device resolves 3 mN; a millinewton is a third of it.
    let (force_n, ..) =
        worst("c_postbuckling_planar.csv", Accuracy::Servo, |row| row.text("stable_spatial") == "1");
    assert!(force_n < 1e-3, "{force_n:e}");
    let (force_n, ..) = worst("c2_postbuckling_spatial.csv", Accuracy::Servo, |_| true);
    assert!(force_n < 1e-3, "{force_n:e}");
}

#[test]
fn saddles_of_the_plane_are_left() {
    // Less energy than the planar equilibrium, or its mirror image; never a wrench that is the saddle's.
    for row in rows("c_postbuckling_planar.csv").iter().filter(|row| row.text("stable_spatial") == "0") {
        let spring = preset(row).spring();
        let mut rod = Rod::new(&spring, Accuracy::Servo);
        let answer = walk(&mut rod, goal(row, &spring));
        assert_eq!(answer.validity, Validity::Ok, "{}", row.text("id"));
        assert_eq!(rod.state().branch, Branch::Buckled);
        let saddle_j = row.number("W_Nmm") * 1e-3;
        // The softest saddles are microjoules above; the servo's energy errs by less than one.
        assert!(answer.energy_j.expect("demanded") < saddle_j + 1e-6, "{}", row.text("id"));
        let away_nm = (answer.torque_nm - row.vector(["MX_Nmm", "MY_Nmm", "MZ_Nmm"]) * 1e-3).length();
        assert!(away_nm > 1e-3, "{}: still at the saddle", row.text("id"));
    }
}

/// A hand that moves at one to three times per second, well inside the workspace.
fn smooth(spring: &Spring, tick: u32) -> Pose {
    let phase = std::f64::consts::TAU * 1e-3 * f64::from(tick);
    let position_m =
        DVec3::new(0.10 * (2.0 * phase).sin(), 0.10 * (3.0 * phase + 1.0).sin(), -0.2 + 0.15 * phase.cos())
            * spring.geometry().free_length_m;
    let rotation_rad =
        DVec3::new(0.1 * (1.5 * phase).sin(), 0.1 * (2.5 * phase + 0.4).cos(), 0.1 * phase.sin());
    Pose::from_rotation_vector(position_m, rotation_rad)
}

#[test]
fn servo_rod_follows_a_smooth_hand() {
    for preset in [Preset::Thesis1, Preset::Thesis3] {
        let spring = preset.spring();
        let (mut servo, mut tight) = (Rod::new(&spring, Accuracy::Servo), Rod::new(&spring, Accuracy::Tight));
        let start = smooth(&spring, 0);
        assert_eq!(hold(&mut servo, &start).validity, Validity::Ok);
        assert_eq!(hold(&mut tight, &start).validity, Validity::Ok);
        for tick in 1..of(5000, 500) {
            let pose = smooth(&spring, tick);
            let (fast, exact) = (servo.step(&pose, Demand::Wrench), tight.step(&pose, Demand::Wrench));
            assert_eq!((fast.validity, exact.validity), (Validity::Ok, Validity::Ok), "{preset:?} {tick}");
            // Required 5e-6 N; the eighth polynomials would do, the tenth are there for the buckled rod.
            assert!((fast.force_n - exact.force_n).length() < 5e-7, "{preset:?} {tick}");
            assert!((fast.torque_nm - exact.torque_nm).length() < 5e-9, "{preset:?} {tick}");
        }
    }
}

/// Instructions of a tick from what it did, in thousands. Counted on x86-64 with AVX2 (`tests/instructions` counts ticks one by
/// one): one evaluation takes 7.6, one that computes a matrix and factors it 50 more.
fn thousand_instructions(work: Work) -> f64 {
    7.6 * f64::from(work.evaluations) + 38.0 * f64::from(work.matrices) + 12.0 * f64::from(work.factorings)
}

#[test]
fn no_tick_of_the_servo_costs_ten_times_the_mean() {
    for preset in Preset::ALL {
        let spring = preset.spring();
        let mut rod = Rod::new(&spring, Accuracy::Servo);
        let _ = hold(&mut rod, &smooth(&spring, 0));
        let cost = |tick| {
            let _ = rod.step(&smooth(&spring, tick), Demand::Wrench);
            thousand_instructions(rod.work())
        };
        let costs: Vec<f64> = (1..2000).map(cost).collect();
        let mean = costs.iter().sum::<f64>() / costs.len() as f64;
        let worst = costs.iter().copied().fold(0.0, f64::max);
        // The slender spring buckles and unbuckles on this way; the mean of the others is that of the servo.
        assert!(worst <= 10.0 * mean, "{preset:?}: {worst} of {mean}");
        if preset != Preset::Slender {
            assert!(mean < 20.0, "{preset:?}: {mean}");
        }
    }
}

#[test]
fn wrench_is_the_gradient_of_the_energy() {
    // The polynomial's own energy, so the servo's derivative is as exact as the tight one's.
    let workspace = Workspace { shear: 0.2, height: 0.3, tilt_rad: 0.2, yaw_rad: 0.3 };
    for accuracy in [Accuracy::Servo, Accuracy::Tight] {
        for preset in [Preset::Thesis1, Preset::Thesis2, Preset::Thesis3] {
            let spring = preset.spring();
            let free_length_m = spring.geometry().free_length_m;
            let mut rod = Rod::new(&spring, accuracy);
            let mut sampler = Sampler::new(5);
            for _ in 0..4 {
                let pose = workspace.pose(&mut sampler, free_length_m);
                let here = settled(&mut rod, &pose);
                let h = 1e-3;
                for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                    let shift = |s: f64| {
                        let position_m = pose.position_m + axis * (s * h * free_length_m);
                        settled(&mut rod.clone(), &Pose { position_m, ..pose }).energy_j.expect("demanded")
                    };
                    let force_n = -derivative(shift) / (h * free_length_m);
                    // Sixth order: h⁶ times a seventh derivative of order 1e6, and 1e-16 J over 1e-5 m.
                    assert!((force_n - here.force_n.dot(axis)).abs() < 1e-8, "{preset:?} {accuracy:?}");
                    let turn = |s: f64| {
                        let orientation = DQuat::from_axis_angle(axis, s * h) * pose.orientation;
                        settled(&mut rod.clone(), &Pose { orientation, ..pose }).energy_j.expect("demanded")
                    };
                    let torque_nm = -derivative(turn) / h;
                    assert!((torque_nm - here.torque_nm.dot(axis)).abs() < 1e-10, "{preset:?} {accuracy:?}");
                }
            }
        }
    }
}

/// Converged beyond the tolerance: three more ticks at rest square the error away.
fn settled(rod: &mut Rod, pose: &Pose) -> Response {
    let _ = hold(rod, pose);
    let _ = rod.step(pose, Demand::WrenchAndEnergy);
    let _ = rod.step(pose, Demand::WrenchAndEnergy);
    let answer = rod.step(pose, Demand::WrenchAndEnergy);
    assert_eq!(answer.validity, Validity::Ok);
    answer
}

/// Derivative at zero by central differences of sixth order, step one.
fn derivative(mut f: impl FnMut(f64) -> f64) -> f64 {
    let mut pair = |n: f64| f(n) - f(-n);
    (45.0 * pair(1.0) - 9.0 * pair(2.0) + pair(3.0)) / 60.0
}

#[test]
fn closed_paths_cost_nothing() {
    let spring = Preset::Thesis1.spring();
    let free_length_m = spring.geometry().free_length_m;
    let workspace = Workspace { shear: 0.25, height: 0.5, tilt_rad: 0.12, yaw_rad: 0.12 };
    let mut sampler = Sampler::new(2);
    for _ in 0..of(20, 1) {
        let path = Loop::new(&mut sampler, workspace, free_length_m);
        let mut rod = Rod::new(&spring, Accuracy::Tight);
        let steps = 400;
        let (mut net, mut gross) = (0.0, 0.0f64);
        for step in 0..steps {
            let (pose, velocity, angular) =
                path.at(std::f64::consts::TAU * f64::from(step) / f64::from(steps));
            let answer = hold(&mut rod, &pose);
            let power = answer.force_n.dot(velocity) + answer.torque_nm.dot(angular);
            net += power;
            gross += power.abs();
        }
        // The rectangle rule is exact to rounding on smooth periodic integrands.
        assert!(net.abs() < 1e-9 * gross, "{net:e} of {gross:e}");
    }
}

#[test]
fn turning_everything_turns_the_answer() {
    let spring = Preset::Thesis2.spring();
    let workspace = Workspace { shear: 0.25, height: 0.4, tilt_rad: 0.5, yaw_rad: 0.8 };
    let mut sampler = Sampler::new(3);
    for _ in 0..10 {
        let pose = workspace.pose(&mut sampler, spring.geometry().free_length_m);
        let turn = DQuat::from_rotation_z(2.3);
        let turned = Pose {
            position_m: turn * pose.position_m,
            orientation: turn * pose.orientation * turn.conjugate(),
        };
        let [here, there] =
            [pose, turned].map(|pose| settled(&mut Rod::new(&spring, Accuracy::Tight), &pose));
        // Rounding on forces of tens of newtons.
        assert!((turn * here.force_n - there.force_n).length() < 1e-11);
        assert!((turn * here.torque_nm - there.torque_nm).length() < 1e-13);
    }
}

#[test]
fn either_plate_may_be_the_lower_one() {
    let spring = Preset::Thesis2.spring();
    let workspace = Workspace { shear: 0.25, height: 0.4, tilt_rad: 0.5, yaw_rad: 0.8 };
    let mut sampler = Sampler::new(4);
    let rise = DVec3::new(0.0, 0.0, spring.geometry().free_length_m);
    for _ in 0..10 {
        let pose = workspace.pose(&mut sampler, spring.geometry().free_length_m);
        // Seen from the upper plate, and turned over so that the rod points up again.
        let over = DQuat::from_rotation_x(std::f64::consts::PI);
        let seen = over * pose.orientation.conjugate();
        let swapped = Pose {
            position_m: seen * -(pose.position_m + rise) - rise,
            orientation: seen * over.conjugate(),
        };
        let [here, there] =
            [pose, swapped].map(|pose| settled(&mut Rod::new(&spring, Accuracy::Tight), &pose));
        // The coordinates start at the lower plate, so this holds to the error of the polynomials.
        assert!((seen * -here.force_n - there.force_n).length() < 1e-11);
        assert!((here.energy_j.expect("demanded") - there.energy_j.expect("demanded")).abs() < 1e-14);
    }
}

#[test]
fn more_polynomials_are_not_needed() {
    // Both settings agree to the servo's error, and the tight one with the table to rounding: exponential
    // convergence leaves nothing between ten and twenty-eight polynomials worth paying for.
    let spring = Preset::Thesis1.spring();
    let pose = Pose::from_rotation_vector(DVec3::new(2e-3, -1e-3, -8e-3), DVec3::new(0.1, 0.05, -0.1));
    let [servo, tight] =
        [Accuracy::Servo, Accuracy::Tight].map(|accuracy| settled(&mut Rod::new(&spring, accuracy), &pose));
    let error = (servo.force_n - tight.force_n).length();
    assert!(error < 1e-7 && error > 0.0, "{error:e}");
}

/// A pose that is home but for numbers no processor likes costs what home costs: the rod never computes with them.
#[test]
fn numbers_that_are_nothing_are_zero() {
    let spring = Preset::Thesis1.spring();
    let answer = |position_m, rotation_rad| {
        let mut rod = Rod::new(&spring, Accuracy::Servo);
        let pose = Pose::from_rotation_vector(position_m, rotation_rad);
        (hold(&mut rod, &pose), rod.step(&pose, Demand::WrenchAndEnergy), rod.work())
    };
    let home = answer(DVec3::ZERO, DVec3::ZERO);
    for nothing in [1e-60, 1e-200, 1e-310] {
        assert_eq!(answer(DVec3::splat(nothing), DVec3::splat(-nothing)), home, "{nothing:e}");
    }
    // A nanometre is something.
    assert_ne!(answer(DVec3::splat(1e-9), DVec3::ZERO), home);
}

#[test]
fn jumps_are_followed_to_a_stable_end() {
    // A cold pose anywhere the device reaches is at most two seconds of ticks away.
    let device = Workspace { shear: 0.25, height: 0.5, tilt_rad: 0.12, yaw_rad: 0.12 };
    for preset in Preset::ALL {
        let spring = preset.spring();
        let mut rod = Rod::new(&spring, Accuracy::Servo);
        let mut sampler = Sampler::new(11);
        for _ in 0..of(500, 20) {
            let pose = device.pose(&mut sampler, spring.geometry().free_length_m);
            let answer = hold(&mut rod, &pose);
            assert_eq!(answer.validity, Validity::Ok, "{preset:?} {pose:?}");
            assert!(rod.state().is_stable());
        }
    }
}

#[test]
fn unusable_poses_leave_the_rod_as_it_was() {
    let spring = Preset::Thesis1.spring();
    let mut rod = Rod::new(&spring, Accuracy::Servo);
    let pose = smooth(&spring, 0);
    let before = settled(&mut rod, &pose);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let answer = rod.step(&Pose { position_m: DVec3::new(bad, 0.0, 0.0), ..pose }, Demand::Wrench);
        assert_eq!(answer.validity, Validity::InvalidInput);
        assert_eq!((answer.force_n, answer.torque_nm), (DVec3::ZERO, DVec3::ZERO));
    }
    let upside_down = Pose::from_rotation_vector(DVec3::ZERO, DVec3::X * 3.12);
    assert_eq!(rod.step(&upside_down, Demand::Wrench).validity, Validity::OutOfDomain);
    let after = rod.step(&pose, Demand::WrenchAndEnergy);
    assert_eq!(after.validity, Validity::Ok);
    assert!((after.force_n - before.force_n).length() < 1e-9);
}

#[test]
fn same_ticks_give_the_same_bits() {
    let spring = Preset::Slender.spring();
    let run = || {
        let mut rod = Rod::new(&spring, Accuracy::Servo);
        let bits = |answer: Response| answer.force_n.to_array().map(f64::to_bits);
        (0..300).map(|tick| bits(rod.step(&smooth(&spring, tick), Demand::Wrench))).collect::<Vec<_>>()
    };
    assert_eq!(run(), run());
}
