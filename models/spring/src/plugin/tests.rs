use super::*;
use flotor_hal::glam::{DQuat, DVec3};
use flotor_hal::{Demand, Pose};

/// A pose with every kind of load.
fn input() -> Input {
    let pose =
        Pose::new(DVec3::new(1e-3, -2e-3, -3e-3), DQuat::from_xyzw(0.01, 0.02, -0.03, 0.999_299_754_828_6));
    Input { demand: Demand::ALL, ..Input::at_rest(pose) }
}

#[test]
fn a_live_change_gives_the_law_of_a_fresh_start() {
    for variant in Variant::ALL {
        let choice = Choice::default_with(variant);
        let mut model = SpringModel::new(choice);
        let mut before = model.step(&input());
        for (id, value) in [("gamma_n", 12.0), ("free_length_mm", 30.0), ("shear_modulus_mpa", 8e4)] {
            let index = SCHEMA.iter().position(|parameter| parameter.id() == id).unwrap();
            model.set_parameter(index, value).unwrap();
            let after = model.step(&input());
            assert_ne!(after.wrench, before.wrench, "{variant:?} {id}");
            let fresh = SpringModel::new(model.choice).step(&input());
            assert_eq!((after.wrench, after.status()), (fresh.wrench, fresh.status()), "{variant:?} {id}");
            assert_eq!(model.parameter(index), value, "{variant:?} {id}");
            before = after;
        }
    }
}

#[test]
fn a_refused_change_changes_nothing() {
    let mut model = SpringModel::new(Choice::default_with(Variant::Energy));
    let before = model.step(&input());
    let index = SCHEMA.iter().position(|parameter| parameter.id() == "free_length_mm").unwrap();
    let refused = model.set_parameter(index, 7.0).unwrap_err();
    // 11.8 coils of 0.63 mm touch at 7.434 mm.
    assert!((refused.min - 7.434).abs() < 1e-12 && refused.max == 1000.0, "{refused}");
    assert_eq!(model.step(&input()), before);
    assert_eq!(model.parameter(index), 25.0);
}

#[test]
fn a_batch_is_single_steps_for_every_variant() {
    for variant in Variant::ALL {
        let mut model = SpringModel::new(Choice::default_with(variant));
        let inputs = [input(), Input::at_rest(Pose::HOME), Input { demand: Demand::FORCE, ..input() }];
        let mut outputs = [Output::default(); 3];
        model.step_batch(&inputs, &mut outputs);
        for (input, output) in inputs.iter().zip(&outputs) {
            let single = model.step(input);
            assert_eq!((output.wrench, output.status()), (single.wrench, single.status()), "{variant:?}");
            assert_eq!(output.energy_j.to_bits(), single.energy_j.to_bits(), "{variant:?}");
        }
    }
}
