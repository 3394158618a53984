//! The load against what it is by definition: a constant, a resistance without memory, and the gradient of its energy.

use flotor_load::{Kind, Load};

const FORCE_N: f64 = 4.0;
const ONSET_M: f64 = 1.0e-3;

#[test]
fn a_weight_is_the_same_everywhere() {
    let felt = Load::new(Kind::Felt, FORCE_N, ONSET_M);
    for height_m in [-0.5, -0.004, 0.0, 0.01] {
        assert_eq!((felt.force_n(height_m), felt.energy_j(height_m)), (-FORCE_N, FORCE_N * height_m));
    }
}

#[test]
fn a_resistance_comes_up_and_never_pushes_by_itself() {
    let exerted = Load::new(Kind::Exerted, FORCE_N, ONSET_M);
    assert_eq!((exerted.force_n(0.004), exerted.energy_j(0.004)), (0.0, 0.0));
    assert_eq!(exerted.force_n(0.0), 0.0);
    // Five onsets deep tanh is 1 to a part in ten thousand.
    assert!((exerted.force_n(-5.0 * ONSET_M) / FORCE_N - 1.0).abs() < 1.0e-4);
    assert!(
        exerted.force_n(-1.0) == FORCE_N && exerted.energy_j(-1.0).is_finite(),
        "no overflow a thousand onsets deep"
    );
}

/// Force is minus the slope of the energy: central differences of 1e-6 m leave 1e-6 of it.
#[test]
fn force_is_the_gradient_of_the_energy() {
    const STEP_M: f64 = 1.0e-6;
    for kind in [Kind::Felt, Kind::Exerted] {
        let load = Load::new(kind, FORCE_N, ONSET_M);
        for height_m in [-0.008, -0.0021, -0.0004, 0.003] {
            let rise_j = load.energy_j(height_m + STEP_M) - load.energy_j(height_m - STEP_M);
            assert!(
                (load.force_n(height_m) + rise_j / (2.0 * STEP_M)).abs() < 1.0e-5,
                "{kind:?} at {height_m} m"
            );
        }
    }
}
