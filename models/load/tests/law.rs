//! The load against what it is by definition: a constant, a resistance without memory, and the gradient of its energy.

use flotor_load::{Kind, Load};

const FORCE_N: f64 = 4.0;
const ONSET_M: f64 = 1.0e-3;

#[test]
fn a_weight_is_the_same_everywhere() {
    let felt = Load::new(Kind::Felt, FORCE_N, ONSET_M);
    for height_m in [-0.5, -0.004, 0.0, 0.01] {
        assert_eq!(felt.at(height_m), (-FORCE_N, FORCE_N * height_m));
    }
}

#[test]
fn a_resistance_comes_up_and_never_pushes_by_itself() {
    let exerted = Load::new(Kind::Exerted, FORCE_N, ONSET_M);
    assert_eq!(exerted.at(0.004), (0.0, 0.0));
    assert_eq!(exerted.at(0.0).0, 0.0);
    // Five onsets deep tanh is 1 to a part in ten thousand.
    assert!((exerted.at(-5.0 * ONSET_M).0 / FORCE_N - 1.0).abs() < 1.0e-4);
    let (force_n, energy_j) = exerted.at(-1.0);
    assert!(force_n == FORCE_N && energy_j.is_finite(), "no overflow a thousand onsets deep");
}

/// Force is minus the slope of the energy: central differences of 1e-6 m leave 1e-6 of it.
#[test]
fn force_is_the_gradient_of_the_energy() {
    const STEP_M: f64 = 1.0e-6;
    for kind in [Kind::Felt, Kind::Exerted] {
        let load = Load::new(kind, FORCE_N, ONSET_M);
        for height_m in [-0.008, -0.0021, -0.0004, 0.003] {
            let slope = (load.at(height_m + STEP_M).1 - load.at(height_m - STEP_M).1) / (2.0 * STEP_M);
            assert!((load.at(height_m).0 + slope).abs() < 1.0e-5, "{kind:?} at {height_m} m");
        }
    }
}
