//! The energy form is one energy: its wrench is the gradient, closed paths cost nothing, and nothing depends on
//! how the axes are laid. The printed law serves as the counter-example.

use std::f64::consts::TAU;

use crate::sample::{Loop, Sampler, Workspace};
use flotor_hal::glam::{DQuat, DVec3};
use flotor_spring::closed_form::{ClosedForm, Form};
use flotor_spring::energy::EnergyForm;
use flotor_spring::pose::Pose;
use flotor_spring::preset::Preset;
use flotor_spring::response::{Demand, Response};
use flotor_spring::rigidity::{Geometry, Material, Spring, Stiffness};
use flotor_spring::validity::Validity;

/// What the device reaches: 7 degrees, a quarter of the free length.
const DEVICE: Workspace = Workspace { shear: 0.25, height: 0.5, tilt_rad: 0.12, yaw_rad: 0.12 };
/// Far beyond: plates crossing, nearly half a turn, past solid and past buckling.
const ANYTHING: Workspace = Workspace { shear: 0.8, height: 1.2, tilt_rad: 1.4, yaw_rad: 1.8 };

fn every(law: &EnergyForm, pose: &Pose) -> Response {
    law.respond(pose, Demand::WrenchAndEnergy)
}

/// Each preset with its law and free length.
fn laws() -> impl Iterator<Item = (Preset, EnergyForm, f64)> {
    Preset::ALL.into_iter().map(|preset| {
        let spring = preset.spring();
        (preset, EnergyForm::new(&spring), spring.geometry().free_length_m)
    })
}

/// Derivative at zero by central differences of sixth order.
fn derivative(f: impl Fn(f64) -> f64, step: f64) -> f64 {
    let pair = |n: f64| f(n * step) - f(-n * step);
    (45.0 * pair(1.0) - 9.0 * pair(2.0) + pair(3.0)) / (60.0 * step)
}

#[test]
fn wrench_is_the_gradient_of_the_energy() {
    for (preset, law, free_length_m) in laws() {
        for workspace in [DEVICE, ANYTHING] {
            let mut sampler = Sampler::new(1);
            for _ in 0..200 {
                let pose = workspace.pose(&mut sampler, free_length_m);
                let here = every(&law, &pose);
                if here.validity == Validity::OutOfDomain {
                    continue;
                }
                let scale_n = here.force_n.length() + here.energy_j.unwrap().abs() / free_length_m;
                let scale_n = scale_n.max(here.torque_nm.length() / free_length_m);
                // Long steps meet the bend short of buckling, short ones round: the best of three counts.
                let error = [3e-4, 3e-5, 3e-6].map(|step| {
                    let (force_n, torque_nm) = gradient(&law, &pose, free_length_m, step);
                    let torque_error_n = (torque_nm - here.torque_nm).length() / free_length_m;
                    (force_n - here.force_n).length().max(torque_error_n) / scale_n
                });
                let best = error.into_iter().fold(f64::INFINITY, f64::min);
                assert!(best < 1e-9, "{preset:?} {pose:?}: {best:e}");
            }
        }
    }
}

/// Minus the gradient of the energy; the step is in free lengths and radians.
fn gradient(law: &EnergyForm, pose: &Pose, free_length_m: f64, step: f64) -> (DVec3, DVec3) {
    let energy = |pose: Pose| every(law, &pose).energy_j.expect("the pose has an answer");
    let (mut force_n, mut torque_nm) = (DVec3::ZERO, DVec3::ZERO);
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        let shifted = |s: f64| energy(Pose { position_m: pose.position_m + axis * s, ..*pose });
        force_n -= axis * derivative(shifted, step * free_length_m);
        let turned = |s: f64| {
            energy(Pose { orientation: DQuat::from_axis_angle(axis, s) * pose.orientation, ..*pose })
        };
        torque_nm -= axis * derivative(turned, step);
    }
    (force_n, torque_nm)
}

/// Work taken from the hand on a closed path, and the sum of all work exchanged (J).
fn work(respond: impl Fn(&Pose) -> Response, path: &Loop, steps: u32) -> (f64, f64) {
    let (mut net, mut gross) = (0.0, 0.0);
    for step in 0..steps {
        let (pose, velocity, angular) = path.at(TAU * f64::from(step) / f64::from(steps));
        let answer = respond(&pose);
        let power = answer.force_n.dot(velocity) + answer.torque_nm.dot(angular);
        net += power;
        gross += power.abs();
    }
    let interval = TAU / f64::from(steps);
    (net * interval, gross * interval)
}

#[test]
fn closed_paths_cost_nothing() {
    for (preset, law, free_length_m) in laws() {
        // The rectangle rule is exact to rounding on smooth periodic integrands. Where a path crosses the bend
        // short of buckling it is of third order, and the slender spring's bend is within 0.5 % of its length.
        let steps = if preset == Preset::Slender { 80_000 } else { 20_000 };
        for workspace in [DEVICE, ANYTHING] {
            let mut sampler = Sampler::new(2);
            for _ in 0..10 {
                let path = Loop::new(&mut sampler, workspace, free_length_m);
                let (net, gross) = work(|pose| every(&law, pose), &path, steps);
                assert!(net.abs() < 1e-9 * gross, "{preset:?}: {net:e} of {gross:e} J");
            }
        }
    }
}

#[test]
fn printed_law_generates_energy_on_closed_paths() {
    let spring = Preset::Thesis1.spring();
    let law = ClosedForm::new(&spring, Form::Printed);
    let mut sampler = Sampler::new(2);
    let path = Loop::new(&mut sampler, DEVICE, spring.geometry().free_length_m);
    let (net, gross) = work(|pose| law.respond(pose, Demand::Wrench), &path, 2000);
    // It is the quadrature that is exact, not the law that is unlucky: percents, not rounding.
    assert!(net.abs() > 1e-3 * gross, "{net:e} of {gross:e} J");
}

#[test]
fn turning_everything_about_the_axis_turns_the_answer() {
    let mut sampler = Sampler::new(3);
    for (preset, law, free_length_m) in laws() {
        for _ in 0..100 {
            let pose = ANYTHING.pose(&mut sampler, free_length_m);
            let turn = DQuat::from_rotation_z(3.0 * sampler.signed());
            let turned = Pose {
                position_m: turn * pose.position_m,
                orientation: turn * pose.orientation * turn.conjugate(),
            };
            let (here, there) = (every(&law, &pose), every(&law, &turned));
            assert_eq!(here.validity, there.validity);
            // Rounding of the turn, amplified where stiffness is large compared with the wrench.
            let scale_n = here.force_n.length() + 1.0;
            assert!((turn * here.force_n - there.force_n).length() < 1e-11 * scale_n, "{preset:?} {pose:?}");
            let torque = (turn * here.torque_nm - there.torque_nm).length();
            assert!(torque < 1e-11 * scale_n * free_length_m, "{preset:?} {pose:?}");
        }
    }
}

#[test]
fn mirror_image_has_the_mirrored_wrench() {
    let mut sampler = Sampler::new(4);
    for (preset, law, free_length_m) in laws() {
        for _ in 0..100 {
            let pose = ANYTHING.pose(&mut sampler, free_length_m);
            // Mirror y -> -y: vectors change the sign of y, rotations those of x and z.
            let DQuat { x, y, z, w } = pose.orientation;
            let mirrored = Pose {
                position_m: pose.position_m * DVec3::new(1.0, -1.0, 1.0),
                orientation: DQuat::from_xyzw(-x, y, -z, w),
            };
            let (here, there) = (every(&law, &pose), every(&law, &mirrored));
            assert_eq!(here.force_n * DVec3::new(1.0, -1.0, 1.0), there.force_n, "{preset:?} {pose:?}");
            assert_eq!(here.torque_nm * DVec3::new(-1.0, 1.0, -1.0), there.torque_nm, "{preset:?} {pose:?}");
            assert_eq!(here.energy_j, there.energy_j);
        }
    }
}

#[test]
fn the_plates_are_interchangeable() {
    // Seen from the upper plate, upside down, the lower plate is the upper one. Same energy.
    let upside_down = DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0);
    let mut sampler = Sampler::new(5);
    for (preset, law, free_length_m) in laws() {
        let lower_plate = DVec3::new(0.0, 0.0, -free_length_m);
        for _ in 0..100 {
            let pose = DEVICE.pose(&mut sampler, free_length_m);
            let back = pose.orientation.conjugate();
            let seen = back * (lower_plate - pose.position_m);
            let exchanged = Pose {
                position_m: upside_down * seen + lower_plate,
                orientation: upside_down * back * upside_down.conjugate(),
            };
            let (here, there) =
                (every(&law, &pose).energy_j.unwrap(), every(&law, &exchanged).energy_j.unwrap());
            // Rounding of three rotations.
            assert!(
                (here - there).abs() < 1e-12 * here.abs().max(1e-4),
                "{preset:?} {pose:?}: {here:e} {there:e}"
            );
        }
    }
}

#[test]
fn rest_is_free_of_load_and_the_axis_is_hookes() {
    for (preset, law, free_length_m) in laws() {
        let rest = every(&law, &Pose::HOME);
        assert_eq!((rest.force_n, rest.torque_nm), (DVec3::ZERO, DVec3::ZERO));
        assert_eq!((rest.energy_j, rest.validity), (Some(0.0), Validity::Ok));
        let stiffness = preset.spring().axial_stiffness_n_per_m();
        for z in [-0.6, -0.05, -1e-9, 1e-9, 0.5] {
            let stretch_m = z * free_length_m;
            let answer = every(&law, &Pose { position_m: DVec3::new(0.0, 0.0, stretch_m), ..Pose::HOME });
            // A handful of roundings.
            assert!((answer.force_n.z + stiffness * stretch_m).abs() < 1e-15 * stiffness * stretch_m.abs());
            assert_eq!((answer.force_n.x, answer.force_n.y, answer.torque_nm), (0.0, 0.0, DVec3::ZERO));
            let energy_j = 0.5 * stiffness * stretch_m * stretch_m;
            assert!((answer.energy_j.unwrap() - energy_j).abs() < 1e-15 * energy_j);
        }
    }
}

#[test]
fn force_has_no_step_on_the_way_to_solid() {
    for (preset, law, free_length_m) in laws() {
        let at = |relative: f64| {
            let position_m = DVec3::new(0.02, 0.01, relative - 1.0) * free_length_m;
            every(&law, &Pose::from_rotation_vector(position_m, DVec3::new(0.01, -0.03, 0.02)))
        };
        let steps = 100_000;
        let (mut last, mut clamped) = (at(1.3), false);
        for step in 1..=steps {
            let here = at(1.3 - 1.1 * f64::from(step) / f64::from(steps));
            // A step of 1e-5 L0 moves the axial force by 1e-5 gamma; a hundred times that would be a step.
            let change = (here.force_n - last.force_n).length();
            assert!(
                change < 1e-3 * preset.spring().rigidities().gamma_n,
                "{preset:?} at step {step}: {change} N"
            );
            clamped |= here.validity == Validity::Clamped;
            last = here;
        }
        let buckles = matches!(preset, Preset::Thesis3 | Preset::Slender);
        assert_eq!(clamped, buckles, "{preset:?}: springs 1 and 2 never come near buckling");
    }
}

#[test]
fn lesser_demands_agree_with_greater_ones() {
    let mut sampler = Sampler::new(6);
    for (_, law, free_length_m) in laws() {
        let pose = DEVICE.pose(&mut sampler, free_length_m);
        let [force, wrench, all] =
            [Demand::Force, Demand::Wrench, Demand::WrenchAndEnergy].map(|demand| law.respond(&pose, demand));
        assert_eq!(force, Response { torque_nm: DVec3::ZERO, energy_j: None, ..all });
        assert_eq!(wrench, Response { energy_j: None, ..all });
    }
}

#[test]
fn every_pose_gets_a_finite_answer() {
    let lengths = [0.0, 1e-300, 1e-9, 1e-3, -5e-3, -0.025, -0.0249, -0.06, 0.1, 5.0, -1e9, 1e300, f64::NAN];
    let angles = [0.0, 1e-300, 0.1, -2.0, 3.1, std::f64::consts::PI, f64::NEG_INFINITY];
    for (preset, law, _) in laws() {
        for x in lengths {
            for z in lengths {
                for angle in angles {
                    for axis in [DVec3::X, DVec3::new(0.6, 0.0, 0.8), DVec3::Z] {
                        let pose = Pose::from_rotation_vector(DVec3::new(x, 0.3 * x, z), axis * angle);
                        let answer = every(&law, &pose);
                        let finite = answer.force_n.is_finite() && answer.torque_nm.is_finite();
                        assert!(finite && answer.energy_j.is_none_or(f64::is_finite), "{preset:?} {pose:?}");
                        let finite_input = x.is_finite() && z.is_finite() && angle.is_finite();
                        assert_eq!(answer.validity == Validity::InvalidInput, !finite_input, "{pose:?}");
                        assert_eq!(answer.energy_j.is_none(), no_answer(&answer), "{pose:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn every_spring_gets_finite_answers() {
    // Any spring the checks let through: slender as a hair or squat, steel or stranger than that.
    let mut sampler = Sampler::new(7);
    let mut springs = 0;
    for _ in 0..2000 {
        let mut decade = |low: f64, high: f64| low * (high / low).powf(0.5 * (sampler.signed() + 1.0));
        let geometry = Geometry {
            free_length_m: decade(1e-3, 1.0),
            wire_diameter_m: decade(5e-5, 5e-2),
            coil_diameter_m: decade(5e-4, 0.2),
            active_coils: decade(1.0, 500.0),
        };
        let shear_modulus_pa = decade(1e6, 1e12);
        let material = Material { youngs_modulus_pa: shear_modulus_pa * decade(0.1, 2.99), shear_modulus_pa };
        let Ok(spring) = Spring::new(geometry, material, Stiffness::Physical) else { continue };
        springs += 1;
        let law = EnergyForm::new(&spring);
        for _ in 0..20 {
            let pose = ANYTHING.pose(&mut sampler, geometry.free_length_m);
            let answer = every(&law, &pose);
            let finite = answer.force_n.is_finite() && answer.torque_nm.is_finite();
            assert!(
                finite && answer.energy_j.is_none_or(f64::is_finite),
                "{geometry:?} {material:?} {pose:?}"
            );
            assert_ne!(answer.validity, Validity::InvalidInput);
        }
    }
    assert!(springs > 100, "{springs} springs");
}

fn no_answer(answer: &Response) -> bool {
    matches!(answer.validity, Validity::OutOfDomain | Validity::InvalidInput)
}
