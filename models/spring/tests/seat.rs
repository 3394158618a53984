//! The spring on its seat against reference tables, and the properties of a free base.

use crate::sample::{Sampler, Workspace};
use crate::table::{preset, rows};
#[allow(dead_code)] // each test needs its part of the helpers
use flotor_hal::glam::{DQuat, DVec2, DVec3};
use flotor_spring::energy::EnergyForm;
use flotor_spring::held::HeldSpring;
use flotor_spring::pose::Pose;
use flotor_spring::preset::Preset;
use flotor_spring::response::{Demand, Response};
use flotor_spring::rigidity::Spring;
use flotor_spring::rod::{Accuracy, Coils, Rod};
use flotor_spring::seat::{Friction, Seat};
use flotor_spring::validity::Validity;

/// Walks from rest in steps of at most 0.05 mm and 0.002 rad, then holds until converged.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few hundred steps
fn walk(mut step: impl FnMut(&Pose) -> Response, position_m: DVec3, rotation_rad: DVec3) -> Response {
    let steps = (position_m.length() / 0.05e-3).max(rotation_rad.length() / 0.002).ceil().max(1.0) as u32;
    let at = |part: f64| Pose::from_rotation_vector(position_m * part, rotation_rad * part);
    for n in 1..steps {
        let _ = step(&at(f64::from(n) / f64::from(steps)));
    }
    let mut answer = step(&at(1.0));
    for _ in 0..2000 {
        if answer.validity != Validity::NotConverged {
            break;
        }
        answer = step(&at(1.0));
    }
    answer
}

#[test]
fn rod_on_its_seat_agrees_with_the_table() {
    for row in &rows("e_unseating_planar.csv") {
        let spring = preset(row).spring();
        let (mut rod, mut seat) =
            (Rod::new(&spring, Accuracy::Tight), Seat::new(&spring, Friction::STICKING));
        let height_mm = row.number("rz_mm") - spring.geometry().free_length_m * 1e3;
        let position_m = DVec3::new(row.number("rx_mm"), 0.0, height_mm) * 1e-3;
        let rotation_rad = DVec3::new(0.0, row.number("tilt_rad"), 0.0);
        let step = |pose: &Pose| seat.step(&mut rod, pose, Demand::WrenchAndEnergy);
        let answer = walk(step, position_m, rotation_rad);
        assert_eq!(answer.validity, Validity::Ok, "{}", row.text("id"));
        let force_n = DVec3::new(row.number("FX_N"), 0.0, row.number("FZ_N"));
        // Required 1e-6 N and 1e-6 rad; the table's bisection leaves 1e-11 rad.
        let error_n = (answer.force_n - force_n).length();
        assert!(error_n < 1e-6, "{}: {error_n:e} N", row.text("id"));
        let error_rad = (seat.tilt_rad() - DVec2::new(row.number("base_roll_rad"), 0.0)).length();
        assert!(error_rad < 1e-6, "{}: {error_rad:e} rad", row.text("id"));
        let error_nm = (answer.torque_nm - DVec3::new(0.0, row.number("MY_Nmm") * 1e-3, 0.0)).length();
        assert!(error_nm < 1e-8, "{}: {error_nm:e} N·m", row.text("id"));
    }
}

/// Poses at which the base tips, in any direction.
fn tipping(spring: &Spring) -> Vec<Pose> {
    let workspace = Workspace { shear: 0.15, height: 0.02, tilt_rad: 0.1, yaw_rad: 0.1 };
    let mut sampler = Sampler::new(9);
    let down = DVec3::new(0.0, 0.0, -0.06) * spring.geometry().free_length_m;
    (0..20)
        .map(|_| {
            let pose = workspace.pose(&mut sampler, spring.geometry().free_length_m);
            Pose { position_m: pose.position_m + down, ..pose }
        })
        .collect()
}

fn settled(seat: &mut Seat, law: &mut EnergyForm, pose: &Pose) -> Response {
    let mut answer = seat.step(law, pose, Demand::WrenchAndEnergy);
    for _ in 0..200 {
        if answer.validity != Validity::NotConverged {
            break;
        }
        answer = seat.step(law, pose, Demand::WrenchAndEnergy);
    }
    assert_eq!(answer.validity, Validity::Ok, "{pose:?}");
    answer
}

#[test]
fn wrench_of_the_free_spring_is_the_gradient_of_its_energy() {
    let spring = Preset::Thesis1.spring();
    let mut law = EnergyForm::new(&spring);
    let mut tipped = 0;
    for pose in tipping(&spring) {
        let mut seat = Seat::new(&spring, Friction::STICKING);
        let here = settled(&mut seat, &mut law, &pose);
        tipped += u32::from(seat.tilt_rad().length() > 0.01);
        let h = 1e-4;
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            let mut energy = |s: f64| {
                let position_m = pose.position_m + axis * (s * h * spring.geometry().free_length_m);
                settled(&mut seat.clone(), &mut law, &Pose { position_m, ..pose }).energy_j.expect("demanded")
            };
            let force_n = -(energy(1.0) - energy(-1.0)) / (2.0 * h * spring.geometry().free_length_m);
            // Second order in a step of 1e-4, on 10 N per free length.
            assert!((force_n - here.force_n.dot(axis)).abs() < 2e-6, "{pose:?}");
            let mut turned = |s: f64| {
                let orientation = DQuat::from_axis_angle(axis, s * h) * pose.orientation;
                settled(&mut seat.clone(), &mut law, &Pose { orientation, ..pose })
                    .energy_j
                    .expect("demanded")
            };
            let torque_nm = -(turned(1.0) - turned(-1.0)) / (2.0 * h);
            assert!((torque_nm - here.torque_nm.dot(axis)).abs() < 2e-8, "{pose:?}");
        }
    }
    assert!(tipped > 5, "{tipped} of the poses tip the base");
}

/// A hand that rocks and shoves a lightly pressed spring, several times a second.
fn rocking(spring: &Spring, tick: u32) -> Pose {
    let phase = std::f64::consts::TAU * 1e-3 * f64::from(tick);
    let position_m = DVec3::new(
        0.18 * (1.3 * phase).sin(),
        0.12 * (1.9 * phase + 0.4).sin(),
        -0.08 + 0.05 * (0.7 * phase).cos(),
    ) * spring.geometry().free_length_m;
    let rotation_rad = DVec3::new(0.08 * (1.5 * phase).sin(), 0.08 * (2.1 * phase).cos(), 0.05 * phase.sin());
    Pose::from_rotation_vector(position_m, rotation_rad)
}

/// Ticks that waited for their equilibrium, of those on which the base was tipped.
fn waited<S: HeldSpring>(spring: &Spring, law: &mut S) -> (u32, u32) {
    let mut seat = Seat::new(spring, Friction::STICKING);
    let (mut waited, mut tipped) = (0, 0);
    for tick in 0..2000 {
        let answer = seat.step(law, &rocking(spring, tick), Demand::Wrench);
        waited += u32::from(answer.validity == Validity::NotConverged);
        tipped += u32::from(seat.tilt_rad() != DVec2::ZERO);
    }
    (waited, tipped)
}

#[test]
fn a_moving_base_keeps_up_with_the_hand() {
    for preset in [Preset::Thesis1, Preset::Thesis2, Preset::Thesis3] {
        let spring = preset.spring();
        let energy = waited(&spring, &mut EnergyForm::new(&spring));
        let rod = waited(&spring, &mut Rod::to_rounding(&spring, Coils::Pass));
        for (waited, tipped) in [energy, rod] {
            assert!(tipped > 500, "{preset:?}: {tipped} ticks tip the base");
            // The rod waits where it jumps to the tipped base: a hundredth at most.
            assert!(waited * 100 < tipped, "{preset:?}: {waited} of {tipped}");
        }
    }
}

#[test]
fn a_base_slides_where_friction_does_not_hold_it() {
    let spring = Preset::Thesis1.spring();
    let free_length_m = spring.geometry().free_length_m;
    let mut law = EnergyForm::new(&spring);
    let mut seat = Seat::new(&spring, Friction { coefficient: 0.1 });
    let at = |tick: u32| {
        let phase = std::f64::consts::TAU * 1e-3 * f64::from(tick);
        Pose::from_rotation_vector(
            DVec3::new(0.1 * phase.sin(), 0.05 * (2.0 * phase).sin(), -0.05) * free_length_m,
            DVec3::new(0.0, 0.02 * phase.sin(), 0.0),
        )
    };
    let (mut sliding, mut waited, mut work_j) = (0, 0, 0.0);
    let mut last = (at(0), seat.step(&mut law, &at(0), Demand::WrenchAndEnergy));
    for tick in 1..=4000 {
        let before = seat.slide_m();
        let pose = at(tick);
        let answer = seat.step(&mut law, &pose, Demand::WrenchAndEnergy);
        let along_n = answer.force_n.truncate().length();
        waited += u32::from(answer.validity == Validity::NotConverged);
        if answer.validity == Validity::Ok {
            assert!(
                along_n <= 0.1 * answer.force_n.z * (1.0 + 1e-5),
                "{tick}: {along_n} of {}",
                answer.force_n.z
            );
        }
        sliding += u32::from(seat.slide_m() != before);
        // What the hand puts in, by the trapezoidal rule.
        let (moved_m, turned) =
            (pose.position_m - last.0.position_m, pose.orientation * last.0.orientation.conjugate());
        work_j -= 0.5 * (answer.force_n + last.1.force_n).dot(moved_m)
            + 0.5 * (answer.torque_nm + last.1.torque_nm).dot(turned.to_scaled_axis());
        last = (pose, answer);
    }
    assert!(sliding > 1000 && seat.slide_m().length() > 0.0, "{sliding} ticks slide");
    assert!(waited * 100 < sliding, "{waited} of {sliding} wait");
    // Four rounds: friction takes energy, and the spring gives none.
    assert!(work_j > 1e-4, "{work_j} J");
}

#[test]
fn a_free_spring_cannot_be_pulled() {
    let spring = Preset::Thesis1.spring();
    let (mut law, mut seat) = (EnergyForm::new(&spring), Seat::new(&spring, Friction::STICKING));
    let pose = Pose::from_rotation_vector(DVec3::new(1e-3, 0.0, 2e-3), DVec3::ZERO);
    let answer = seat.step(&mut law, &pose, Demand::WrenchAndEnergy);
    assert_eq!((answer.force_n, answer.torque_nm, answer.energy_j), (DVec3::ZERO, DVec3::ZERO, Some(0.0)));
    assert!(seat.is_lifted());
    // Down again, it stands as before.
    let down = Pose::from_rotation_vector(DVec3::new(0.0, 0.0, -2e-3), DVec3::ZERO);
    let answer = seat.step(&mut law, &down, Demand::Wrench);
    assert!(!seat.is_lifted() && seat.tilt_rad() == DVec2::ZERO);
    assert!((answer.force_n.z - spring.axial_stiffness_n_per_m() * 2e-3).abs() < 1e-12);
}

#[test]
fn every_pose_gets_a_finite_answer() {
    let wild = Workspace { shear: 1.5, height: 1.5, tilt_rad: 2.0, yaw_rad: 3.0 };
    for preset in Preset::ALL {
        let spring = preset.spring();
        let (mut law, mut seat) = (EnergyForm::new(&spring), Seat::new(&spring, Friction::STICKING));
        let mut sampler = Sampler::new(13);
        for _ in 0..5000 {
            let pose = wild.pose(&mut sampler, spring.geometry().free_length_m);
            let answer = seat.step(&mut law, &pose, Demand::WrenchAndEnergy);
            assert!(answer.force_n.is_finite() && answer.torque_nm.is_finite(), "{preset:?} {pose:?}");
        }
        let bad = Pose::from_rotation_vector(DVec3::new(f64::NAN, 0.0, 0.0), DVec3::ZERO);
        assert_eq!(seat.step(&mut law, &bad, Demand::Wrench).validity, Validity::InvalidInput);
    }
}
