//! Coils that touch: under the plates and along a bulge, as part of one energy.

use crate::sample::{Loop, Sampler, Workspace};
use flotor_hal::glam::DVec3;
use flotor_spring::contact::AxialContact;
use flotor_spring::energy::EnergyForm;
use flotor_spring::held::{Held, HeldSpring};
use flotor_spring::pose::Pose;
use flotor_spring::preset::Preset;
use flotor_spring::response::{Demand, Response};
use flotor_spring::rod::{Accuracy, Coils, Rod};
use flotor_spring::validity::Validity;
use flotor_spring::wire::Wire;

fn at(free_length_m: f64, shear: f64, compression: f64, tilt_rad: f64) -> Pose {
    let position_m = DVec3::new(shear, 0.0, -compression) * free_length_m;
    Pose::from_rotation_vector(position_m, DVec3::new(0.0, tilt_rad, 0.0))
}

/// Taken to a pose in small steps and held there until it has converged, and three times more.
fn walked(rod: &mut Rod, goal: &Pose) -> Response {
    for step in 1..=400 {
        let part = f64::from(step) / 400.0;
        let between = Pose {
            position_m: goal.position_m * part,
            orientation: flotor_hal::glam::DQuat::IDENTITY.slerp(goal.orientation, part),
        };
        let _ = rod.step(&between, Demand::WrenchAndEnergy);
    }
    settled(rod, goal)
}

fn settled(rod: &mut Rod, pose: &Pose) -> Response {
    let mut answer = rod.step(pose, Demand::WrenchAndEnergy);
    for _ in 0..2000 {
        if answer.validity != Validity::NotConverged {
            break;
        }
        answer = rod.step(pose, Demand::WrenchAndEnergy);
    }
    for _ in 0..3 {
        answer = rod.step(pose, Demand::WrenchAndEnergy);
    }
    assert_eq!(answer.validity, Validity::Ok, "{pose:?}");
    answer
}

#[test]
fn compressed_straight_both_laws_feel_the_same_coils() {
    for preset in [Preset::Thesis1, Preset::Thesis2] {
        let spring = preset.spring();
        let geometry = spring.geometry();
        let contact = Some(AxialContact::new(&spring));
        let mut energy = Held { law: EnergyForm::new(&spring), contact, wire: None };
        let solid = 1.0 - geometry.solid_length_m() / geometry.free_length_m;
        for compression in [solid - 0.01, solid, solid + 0.005, solid + 0.02] {
            let pose = at(geometry.free_length_m, 0.0, compression, 0.0);
            let over_m = ((compression - solid) * geometry.free_length_m).max(0.0);
            // gamma p, and 25 N/mm of what is over.
            let force_n = spring.rigidities().gamma_n * compression + 25.0e3 * over_m;
            let stored_j =
                0.5 * spring.axial_stiffness_n_per_m() * (compression * geometry.free_length_m).powi(2)
                    + 0.5 * 25.0e3 * over_m * over_m;
            let mut rod = Rod::with_coils(&spring, Accuracy::Tight, Coils::Touch);
            for answer in [energy.respond(&pose, Demand::WrenchAndEnergy), walked(&mut rod, &pose)] {
                // Rounding on tens of newtons and millijoules.
                assert!((answer.force_n.z - force_n).abs() < 1e-11, "{preset:?} {compression}");
                assert!((answer.energy_j.unwrap() - stored_j).abs() < 1e-14, "{preset:?} {compression}");
            }
        }
    }
}

/// Every law that has an energy, with the wire and without: no way round and round gains or loses work.
#[test]
fn closed_paths_cost_nothing_with_a_wire() {
    let spring = Preset::Thesis1.spring();
    let workspace = Workspace { shear: 0.2, height: 0.4, tilt_rad: 0.12, yaw_rad: 0.12 };
    let wire = Some(Wire::new(&spring));
    let mut energy = Held { law: EnergyForm::new(&spring), contact: None, wire };
    let mut rod = Held { law: Rod::new(&spring, Accuracy::Tight), contact: None, wire };
    let mut sampler = Sampler::new(21);
    for _ in 0..3 {
        let path = Loop::new(&mut sampler, workspace, spring.geometry().free_length_m);
        for law in [&mut energy as &mut dyn HeldSpring, &mut rod] {
            let (mut net, mut gross) = (0.0, 0.0f64);
            for step in 0..400 {
                let (pose, velocity, angular) = path.at(std::f64::consts::TAU * f64::from(step) / 400.0);
                let mut answer = law.respond(&pose, Demand::Wrench);
                while answer.validity == Validity::NotConverged {
                    answer = law.respond(&pose, Demand::Wrench);
                }
                let power = answer.force_n.dot(velocity) + answer.torque_nm.dot(angular);
                net += power;
                gross += power.abs();
            }
            // The rectangle rule is exact to rounding on smooth periodic integrands. Required 1e-9.
            assert!(net.abs() < 1e-9 * gross, "{net:e} of {gross:e}");
        }
    }
}

#[test]
fn a_bulge_closes_its_inner_coils() {
    // Spring 3 buckles at 54.54 % and its concave coils meet at 54.7 %: before that contact changes nothing.
    let spring = Preset::Thesis3.spring();
    let free_length_m = spring.geometry().free_length_m;
    for (compression, touch) in [(0.5, false), (0.546, false), (0.56, true), (0.62, true)] {
        let pose = at(free_length_m, 0.0, compression, 0.0);
        let [free, touching] = [Coils::Pass, Coils::Touch].map(|coils| {
            let mut rod = Rod::with_coils(&spring, Accuracy::Tight, coils);
            let answer = walked(&mut rod, &pose);
            assert!(rod.state().is_stable());
            answer
        });
        let change_n = touching.force_n.z - free.force_n.z;
        let stored_j = touching.energy_j.unwrap() - free.energy_j.unwrap();
        if touch {
            assert!(change_n > 1e-4 && stored_j > 0.0, "{compression}: {change_n} N");
        } else {
            // The rounded rim of a coil stands a little back: nothing touches.
            assert!(change_n.abs() < 1e-9, "{compression}: {change_n} N");
        }
    }
}

#[test]
fn wrench_with_contact_is_the_gradient_of_the_energy() {
    for (preset, compression) in [(Preset::Thesis3, 0.6), (Preset::Thesis1, 0.71)] {
        let spring = preset.spring();
        let free_length_m = spring.geometry().free_length_m;
        let pose = at(free_length_m, 0.05, compression, 0.06);
        let mut rod = Rod::with_coils(&spring, Accuracy::Servo, Coils::Touch);
        let here = walked(&mut rod, &pose);
        let without = walked(&mut Rod::new(&spring, Accuracy::Servo), &pose);
        assert!((here.force_n - without.force_n).length() > 1e-3, "{preset:?}: nothing touches");
        let h = 1e-5 * free_length_m;
        for axis in [DVec3::X, DVec3::Z] {
            let energy = |s: f64| {
                let moved = Pose { position_m: pose.position_m + axis * (s * h), ..pose };
                settled(&mut rod.clone(), &moved).energy_j.unwrap()
            };
            let force_n = -(energy(1.0) - energy(-1.0)) / (2.0 * h);
            // The stiffness has steps where a station touches: first order in the step, on 25 N/mm.
            assert!(
                (force_n - here.force_n.dot(axis)).abs() < 1e-3,
                "{preset:?} {axis}: {force_n} {}",
                here.force_n
            );
        }
    }
}
