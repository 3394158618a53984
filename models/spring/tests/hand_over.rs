//! One energy from two laws: what is felt is its gradient everywhere, and nothing jumps where they meet.

use flotor_hal::glam::{DQuat, DVec3};
use flotor_spring::energy::EnergyForm;
use flotor_spring::hand_over::HandOver;
use flotor_spring::held::HeldSpring;
use flotor_spring::pose::Pose;
use flotor_spring::preset::Preset;
use flotor_spring::response::{Demand, Response};
use flotor_spring::rod::{Accuracy, Coils, Rod};
use flotor_spring::validity::Validity;

/// Spring 3 from rest to past its buckling, sheared and tilted a little.
fn at(compression: f64) -> Pose {
    let free_length_m = Preset::Thesis3.spring().geometry().free_length_m;
    Pose::from_rotation_vector(
        DVec3::new(0.03 * compression, 0.02 * compression, -compression) * free_length_m,
        DVec3::new(0.04, -0.06, 0.05) * compression,
    )
}

fn settled<S: HeldSpring>(law: &mut S, pose: &Pose) -> Response {
    let mut answer = law.respond(pose, Demand::WrenchAndEnergy);
    for _ in 0..200 {
        answer = law.respond(pose, Demand::WrenchAndEnergy);
    }
    answer
}

#[test]
fn the_share_goes_from_one_law_to_the_other() {
    let spring = Preset::Thesis3.spring();
    let (mut law, energy) = (HandOver::new(&spring, Coils::Pass), EnergyForm::new(&spring));
    let mut rod = Rod::new(&spring, Accuracy::Servo);
    let (mut last_share, mut shared) = (0.0, 0);
    for step in 0..=1200 {
        let pose = at(f64::from(step) / 2000.0);
        let answer = law.respond(&pose, Demand::WrenchAndEnergy);
        assert!(law.share() >= last_share, "{step}");
        last_share = law.share();
        shared += u32::from(law.share() > 0.0 && law.share() < 1.0);
        let exact = rod.step(&pose, Demand::WrenchAndEnergy);
        if law.share() == 0.0 {
            assert_eq!(
                answer,
                energy.respond(&pose, Demand::WrenchAndEnergy),
                "{step}: nothing else is felt"
            );
            assert!(law.rod_state().is_none());
        }
        if law.share() == 1.0 && exact.validity == Validity::Ok && answer.validity == Validity::Ok {
            // Two rods with other pasts, each converged to the servo's tolerance.
            assert!((answer.force_n - exact.force_n).length() < 1e-5, "{step}");
        }
    }
    assert!(last_share == 1.0 && shared > 50, "{shared} steps blend");
}

#[test]
fn wrench_is_the_gradient_of_the_one_energy() {
    let spring = Preset::Thesis3.spring();
    let h = 1e-6;
    for wanted in [0.2, 0.5, 0.8] {
        let mut law = HandOver::new(&spring, Coils::Pass);
        let mut compression = 0.0;
        while law.share() < wanted {
            compression += 1e-3;
            let _ = law.respond(&at(compression), Demand::Force);
        }
        let pose = at(compression);
        let here = settled(&mut law, &pose);
        assert!(law.share() < 0.99, "{compression}: {}", law.share());
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            let slope = |at: &dyn Fn(f64) -> Pose| {
                let energy = |s: f64| settled(&mut law.clone(), &at(s * h)).energy_j.unwrap();
                (energy(1.0) - energy(-1.0)) / (2.0 * h)
            };
            let moved = |s: f64| Pose { position_m: pose.position_m + axis * s, ..pose };
            let turned =
                |s: f64| Pose { orientation: DQuat::from_axis_angle(axis, s) * pose.orientation, ..pose };
            // Second order in the step, and 1e-17 J of rounding over it.
            assert!((slope(&moved) + here.force_n.dot(axis)).abs() < 1e-7, "{compression} {axis}");
            assert!((slope(&turned) + here.torque_nm.dot(axis)).abs() < 1e-9, "{compression} {axis}");
        }
    }
}

/// The force, and its slope along the way, change by no more than a smooth function would between two steps.
#[test]
fn nothing_jumps_where_the_laws_meet() {
    let spring = Preset::Thesis3.spring();
    let mut law = HandOver::new(&spring, Coils::Pass);
    let forces: Vec<DVec3> = (0..=4000)
        .map(|step| law.respond(&at(0.2 + 0.18 * f64::from(step) / 4000.0), Demand::Force).force_n)
        .collect();
    let steps: Vec<f64> = forces.windows(2).map(|pair| (pair[1] - pair[0]).length()).collect();
    let typical = steps.iter().sum::<f64>() / steps.len() as f64;
    for (index, pair) in steps.windows(2).enumerate() {
        assert!(pair[1] < 3.0 * typical, "{index}: a step of {} N", pair[1]);
        assert!((pair[1] - pair[0]).abs() < 0.05 * typical, "{index}: a kink, {} and {} N", pair[0], pair[1]);
    }
}

/// Round and round through both laws: no work is done.
#[test]
fn closed_paths_through_both_laws_cost_nothing() {
    let spring = Preset::Thesis3.spring();
    let free_length_m = spring.geometry().free_length_m;
    let mut law = HandOver::new(&spring, Coils::Pass);
    let steps = 2000;
    let (mut net, mut gross) = (0.0, 0.0f64);
    for step in 0..2 * steps {
        let phase = std::f64::consts::TAU * f64::from(step) / f64::from(steps);
        let (sine, cosine) = phase.sin_cos();
        let position_m = DVec3::new(0.05 * sine, 0.04 * cosine, -0.30 + 0.04 * sine) * free_length_m;
        let velocity_m = DVec3::new(0.05 * cosine, -0.04 * sine, 0.04 * cosine) * free_length_m;
        let tilt_rad = 0.06 * cosine;
        let pose = Pose::from_rotation_vector(position_m, DVec3::X * tilt_rad);
        let answer = law.respond(&pose, Demand::Wrench);
        // The first round is to get there.
        if step >= steps {
            let power = answer.force_n.dot(velocity_m) - answer.torque_nm.x * 0.06 * sine;
            net += power;
            gross += power.abs();
        }
    }
    // The rectangle rule is exact on smooth periodic integrands; the share is smooth to second order, the servo to 1e-7.
    assert!(net.abs() < 1e-7 * gross, "{net:e} of {gross:e}");
}
