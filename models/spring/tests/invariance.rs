//! What must hold for any spring and any pose: symmetry, scaling, totality. Cases are found by proptest.

use flotor_hal::glam::{DQuat, DVec3};
use flotor_spring::closed_form::{ClosedForm, Form};
use flotor_spring::energy::EnergyForm;
use flotor_spring::pose::Pose;
use flotor_spring::precision::Precision;
use flotor_spring::preset::Preset;
use flotor_spring::response::{Demand, Response};
use flotor_spring::rigidity::{Geometry, Spring, Stiffness};
use flotor_spring::thesis::Thesis;
use flotor_spring::validity::Validity;
use proptest::prelude::*;

/// Any law of the crate at one demand.
type Respond = Box<dyn Fn(&Pose) -> Response>;

/// Springs that differ from a preset by scale and stiffness.
fn scaled(preset: Preset, size: f64, stiffness: f64) -> (Spring, Stiffness) {
    let (geometry, material, _) = preset.parameters();
    let gamma = Stiffness::Gamma(preset.spring().rigidities().gamma_n * stiffness);
    let geometry = Geometry {
        free_length_m: size * geometry.free_length_m,
        wire_diameter_m: size * geometry.wire_diameter_m,
        coil_diameter_m: size * geometry.coil_diameter_m,
        ..geometry
    };
    (Spring::new(geometry, material, gamma).expect("a preset, scaled"), gamma)
}

/// All laws, each with a name; the last is symmetric about the axis, the others in two planes only.
fn laws(spring: &Spring, stiffness: Stiffness) -> Vec<(&'static str, Respond)> {
    let printed = ClosedForm::new(spring, Form::Printed);
    let current = ClosedForm::new(spring, Form::CurrentLength);
    let energy = EnergyForm::new(spring);
    let [double, single] =
        [Precision::Double, Precision::Single].map(|precision| Thesis::new(spring, stiffness, precision));
    let rounded = printed.with_precision(Precision::Single);
    vec![
        ("thesis f64", Box::new(move |pose| double.respond(pose, Demand::WrenchAndEnergy))),
        ("thesis f32", Box::new(move |pose| single.respond(pose, Demand::WrenchAndEnergy))),
        ("closed-form f64", Box::new(move |pose| printed.respond(pose, Demand::WrenchAndEnergy))),
        ("closed-form f32", Box::new(move |pose| rounded.respond(pose, Demand::WrenchAndEnergy))),
        ("current-length", Box::new(move |pose| current.respond(pose, Demand::WrenchAndEnergy))),
        ("energy", Box::new(move |pose| energy.respond(pose, Demand::WrenchAndEnergy))),
    ]
}

fn preset() -> impl Strategy<Value = Preset> {
    prop::sample::select(Preset::ALL.to_vec())
}

/// Position in free lengths and rotation vector, within and around the device's workspace.
fn placement() -> impl Strategy<Value = (DVec3, DVec3)> {
    let shear = -0.3..0.3;
    let tilt = -0.3..0.3;
    (shear.clone(), shear, -0.45..0.4, tilt.clone(), tilt.clone(), tilt)
        .prop_map(|(x, y, z, rx, ry, rz)| (DVec3::new(x, y, z), DVec3::new(rx, ry, rz)))
}

/// Deviation of two responses: force relative to the rigidity, torque to it times the free length.
fn deviation(a: &Response, b: &Response, spring: &Spring) -> f64 {
    let (gamma_n, free_length_m) = (spring.rigidities().gamma_n, spring.geometry().free_length_m);
    let energy_j = a.energy_j.unwrap_or(0.0) - b.energy_j.unwrap_or(0.0);
    ((a.force_n - b.force_n).length() + (a.torque_nm - b.torque_nm).length() / free_length_m) / gamma_n
        + energy_j.abs() / (gamma_n * free_length_m)
}

/// Rounding of a pose, magnified by the stiffest law of the slender spring close to its poles.
const ROUNDING: f64 = 1e-11;

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(400) })]

    /// x to -x, by bits: no law prefers a side.
    #[test]
    fn mirrored_poses_have_mirrored_answers(preset in preset(), (position, rotation) in placement()) {
        let (spring, stiffness) = scaled(preset, 1.0, 1.0);
        let free_length_m = spring.geometry().free_length_m;
        let mirror = DVec3::new(-1.0, 1.0, 1.0);
        for (name, respond) in laws(&spring, stiffness) {
            let here = respond(&Pose::from_rotation_vector(position * free_length_m, rotation));
            let there = respond(&Pose::from_rotation_vector(position * mirror * free_length_m, -rotation * mirror));
            let expected = Response { force_n: here.force_n * mirror, torque_nm: -here.torque_nm * mirror, ..here };
            prop_assert_eq!(there, expected, "{}", name);
        }
    }

    /// Turning everything about the axis turns the answer of the energy form.
    #[test]
    fn energy_form_has_an_axis(preset in preset(), (position, rotation) in placement(), turn in -3.1..3.1f64) {
        let (spring, _) = scaled(preset, 1.0, 1.0);
        let free_length_m = spring.geometry().free_length_m;
        let law = EnergyForm::new(&spring);
        let turn = DQuat::from_rotation_z(turn);
        let respond = |position: DVec3, rotation: DVec3| {
            law.respond(&Pose::from_rotation_vector(position * free_length_m, rotation), Demand::WrenchAndEnergy)
        };
        let here = respond(position, rotation);
        let there = respond(turn * position, turn * rotation);
        let expected = Response { force_n: turn * here.force_n, torque_nm: turn * here.torque_nm, ..here };
        let error = deviation(&there, &expected, &spring);
        prop_assert!(error < ROUNDING, "{error:e}");
    }

    /// A spring `s` times as large and `c` times as stiff: force by `c`, torque and energy by `c s`.
    #[test]
    fn answers_scale_with_size_and_stiffness(
        preset in preset(),
        (position, rotation) in placement(),
        size in 0.1..10.0f64,
        stiffness in 0.1..10.0f64,
    ) {
        let (small, small_stiffness) = scaled(preset, 1.0, 1.0);
        let (large, large_stiffness) = scaled(preset, size, stiffness);
        let laws = laws(&small, small_stiffness).into_iter().zip(self::laws(&large, large_stiffness));
        for ((name, respond_small), (_, respond_large)) in laws {
            // Single precision rounds every size differently, the window is in millimetres.
            if name.ends_with("f32") || name.starts_with("thesis") {
                continue;
            }
            let at = |spring: &Spring| {
                Pose::from_rotation_vector(position * spring.geometry().free_length_m, rotation)
            };
            let (here, there) = (respond_small(&at(&small)), respond_large(&at(&large)));
            let expected = Response {
                force_n: here.force_n * stiffness,
                torque_nm: here.torque_nm * (size * stiffness),
                energy_j: here.energy_j.map(|energy_j| energy_j * (size * stiffness)),
                ..here
            };
            // The printed law has a pole in the slender spring's workspace.
            let magnified = ROUNDING * (1.0 + deviation(&here, &Response { force_n: DVec3::ZERO, torque_nm: DVec3::ZERO, ..here }, &small).powi(2));
            let error = deviation(&there, &expected, &large);
            prop_assert!(error < magnified, "{name}: {error:e}");
        }
    }

    /// A live change of stiffness gives the law a fresh start would.
    #[test]
    fn retuned_laws_are_new_laws(preset in preset(), stiffness in 0.01..100.0f64, size in prop::sample::select(vec![1.0, 1.25])) {
        let ((from, _), (to, _)) = (scaled(preset, 1.0, 1.0), scaled(preset, size, stiffness));
        prop_assert_eq!(EnergyForm::new(&from).retuned(&from, &to), EnergyForm::new(&to));
    }

    /// Any bits: a finite wrench, a verdict that fits the input.
    #[test]
    fn every_input_gets_a_finite_answer(preset in preset(), bits in prop::array::uniform7(any::<u64>()), unit in any::<bool>()) {
        let (spring, stiffness) = scaled(preset, 1.0, 1.0);
        let [x, y, z, qx, qy, qz, qw] = bits.map(f64::from_bits);
        let mut orientation = DQuat::from_xyzw(qx, qy, qz, qw);
        if unit {
            // Random bits hardly ever make a rotation; take the same as angles.
            let small = |bits: u64| (bits >> 11) as f64 / (1u64 << 51) as f64 - 2.0;
            let [_, _, _, a, b, c, _] = bits.map(small);
            orientation = Pose::from_rotation_vector(DVec3::ZERO, DVec3::new(a, b, c)).orientation;
        }
        let pose = Pose { position_m: DVec3::new(x, y, z), orientation };
        for (name, respond) in laws(&spring, stiffness) {
            let answer = respond(&pose);
            let finite = answer.force_n.is_finite() && answer.torque_nm.is_finite();
            prop_assert!(finite && answer.energy_j.is_none_or(f64::is_finite), "{name}: {answer:?}");
            prop_assert_eq!(answer.validity == Validity::InvalidInput, !pose.is_valid(), "{}", name);
        }
    }
}
