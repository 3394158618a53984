//! The load against what it is by definition: a constant, a resistance without memory, and the gradient of its energy.

use flotor_hal::{DQuat, DVec3, ForceModel, Input, Output, Pose, WorldModel};
use flotor_load::free::FreeBody;
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

/// Two hands push one ball, from below and from the side, at 1 kHz: what the hands feel in a tick is what the ball loses.
#[test]
fn the_impulse_on_all_hands_is_the_momentum_the_ball_gives() {
    let mut ball = FreeBody::new(0.2, 0.015, 1000.0);
    let (period_s, mut largest) = (1.0e-3, 0.0_f64);
    for tick in 0..400_u32 {
        let time_s = f64::from(tick) * period_s;
        let below = DVec3::new(0.0, 0.001, -0.031 + 0.03 * time_s);
        let beside = DVec3::new(0.016 - 0.05 * time_s, 0.0, -0.013);
        let before = ball.momentum();
        let pushes = ball.advance(&[Some(below), Some(beside)], if tick == 0 { 0.0 } else { period_s });
        let impulse = (pushes[0].force_n + pushes[1].force_n) * if tick == 0 { 0.0 } else { period_s };
        let lost = before - ball.momentum();
        largest = largest.max(impulse.length());
        // A few roundings of a momentum below 0.1 kg m/s.
        assert!((impulse - lost).length() < 1.0e-16, "tick {tick}: {impulse} {lost}");
    }
    assert!(largest > 1.0e-4, "the hands push with more than 0.1 N: {largest} N s in a tick");
    assert!(ball.momentum().z > 0.0 && ball.momentum().x < 0.0, "{}", ball.momentum());
}

/// Between two handles that hold still the ball swings on two springs: omega = sqrt(2 k / m).
#[test]
fn a_ball_between_two_handles_swings_at_the_frequency_of_two_springs() {
    let (mass_kg, radius_m, stiffness_n_per_m) = (0.2, 0.015, 1000.0);
    let mut ball = FreeBody::new(mass_kg, radius_m, stiffness_n_per_m);
    // 4 mm deep at both sides, and pushed in by another 1 mm at one side.
    let [left, right] = [-1.0, 1.0].map(|side| Some(DVec3::new(side * 0.011, 0.0, -radius_m)));
    let aside = right.map(|place| place - DVec3::X * 1.0e-3);
    ball.advance(&[left, aside], 0.0);
    let step_s = 1.0e-5;
    // The handles are in place within the first step; the ball is 0.5 mm off its new middle.
    let mut crossings = Vec::new();
    let mut before_n = 0.0;
    for step in 0..200_000_u32 {
        let pushes = ball.advance(&[left, aside], step_s);
        let sum_n = (pushes[0].force_n + pushes[1].force_n).x;
        if before_n < 0.0 && sum_n >= 0.0 {
            crossings.push(f64::from(step) - sum_n / (sum_n - before_n));
        }
        before_n = sum_n;
    }
    let swings = (crossings.len() - 1) as f64;
    let period_s = (crossings[crossings.len() - 1] - crossings[0]) / swings * step_s;
    let exact_s = std::f64::consts::TAU * (mass_kg / (2.0 * stiffness_n_per_m)).sqrt();
    // The symplectic step is short by (omega h)^2 / 24, here 4e-8, and the crossings are interpolated.
    assert!(crossings.len() > 20 && (period_s / exact_s - 1.0).abs() < 1.0e-6, "{period_s} {exact_s}");
}

#[test]
fn hands_carry_a_shared_weight_in_equal_parts_and_one_hand_carries_all_of_it() {
    let mut load = Load::new(Kind::Felt, FORCE_N, ONSET_M);
    let at = |height_m: f64| Input::at_rest(Pose::new(DVec3::Z * height_m, DQuat::IDENTITY));
    let inputs = [at(0.002), at(-0.001), at(0.0), at(0.01)];
    for count in 1..=4 {
        let mut outputs = [Output::default(); 4];
        load.step_ports(&inputs[..count], &mut outputs[..count]);
        let carried: DVec3 = outputs[..count].iter().map(|output| output.wrench.force()).sum();
        assert_eq!(carried, DVec3::Z * -FORCE_N, "{count} hands");
    }
    let mut alone = [Output::default()];
    load.step_ports(&inputs[..1], &mut alone);
    assert_eq!(alone[0], load.step(&inputs[0]));
}
