//! The chain from command to delivered wrench against its limits and closed forms.

use super::coils::CURRENT_LIMIT_A;
use super::*;
use flotor_hal::glam::DVec3;

const TICK_S: f64 = 1.0e-3;

/// Even field, amplifiers without lag to speak of.
const IDEAL: ActuationParameters = ActuationParameters {
    amplifier_bandwidth_hz: 1.0e9,
    field: FieldError { peak_to_peak: 0.0 },
    ..ActuationParameters::MAGLEV
};

fn wrench(force_n: [f64; 3], torque_nm: [f64; 3]) -> Wrench {
    Wrench { force_n: force_n.into(), torque_nm: torque_nm.into() }
}

fn actuation(parameters: &ActuationParameters) -> Actuation {
    Actuation::new(parameters).expect("physical parameters")
}

#[test]
fn pure_axis_limits_meet_the_published_ones() {
    let limits = Coils::new(&CoilGeometry::MAGLEV).expect("independent coils").pure_axis_limits();
    let (force, torque) = (limits.force_n, limits.torque_nm);
    assert!(force.min_element() > 54.0 && force.max_element() < 141.0, "{force}");
    assert!(torque.min_element() > 6.1 && torque.max_element() < 12.7, "{torque}");
}

#[test]
fn within_the_limit_the_delivered_wrench_is_the_commanded_one() {
    let mut ideal = actuation(&IDEAL);
    let asked = wrench([10.0, -8.0, 30.0], [0.5, -0.7, 1.0]);
    let got = ideal.drive(&asked, Wiring::Intact, 0.0, TICK_S);
    // Rounding times the condition of the coil matrix, 17.
    assert!((got.force_n - asked.force_n).length() < 1.0e-5, "amplifiers of 1 GHz: 1e-7 of 33 N");
    assert!((got.torque_nm - asked.torque_nm).length() < 1.0e-6);
    assert!(!ideal.is_saturated());
}

#[test]
fn beyond_the_limit_the_wrench_keeps_its_direction() {
    let mut ideal = actuation(&IDEAL);
    let asked = wrench([100.0, -80.0, 300.0], [5.0, -7.0, 10.0]);
    let got = ideal.drive(&asked, Wiring::Intact, 0.0, TICK_S);
    let share = got.force_n.z / asked.force_n.z;
    assert!(share < 0.5 && ideal.is_saturated());
    assert!((got.force_n - asked.force_n * share).length() < 1.0e-10);
    assert!((got.torque_nm - asked.torque_nm * share).length() < 1.0e-10);
    let largest_a = ideal.currents_a.iter().fold(0.0_f64, |a, i| a.max(i.abs()));
    assert!((largest_a - CURRENT_LIMIT_A).abs() < 1.0e-12, "one coil is at its limit: {largest_a}");
}

#[test]
fn amplifiers_approach_a_step_exponentially_and_give_the_whole_impulse() {
    let lagging = ActuationParameters { amplifier_bandwidth_hz: 100.0, ..IDEAL };
    let mut actuation = actuation(&lagging);
    let lag_s = 1.0 / (std::f64::consts::TAU * 100.0);
    let asked = wrench([0.0, 0.0, 10.0], [0.0; 3]);
    let mut impulse_ns = 0.0;
    for tick in 1..=10 {
        impulse_ns += actuation.drive(&asked, Wiring::Intact, 0.0, TICK_S).force_n.z * TICK_S;
        let t = f64::from(tick) * TICK_S;
        let expected_ns = 10.0 * (t - lag_s * (1.0 - (-t / lag_s).exp()));
        assert!((impulse_ns - expected_ns).abs() < 1.0e-14, "{tick}: {impulse_ns} {expected_ns}");
    }
}

#[test]
fn an_open_coil_pushes_nothing_and_the_others_go_on() {
    let mut broken = actuation(&IDEAL);
    let asked = wrench([0.0, 0.0, 30.0], [0.0; 3]);
    let got = broken.drive(&asked, Wiring::Open(0), 0.0, TICK_S);
    // Each coil of ring A carries a third of a vertical force.
    assert!((got.force_n.z - 20.0).abs() < 1.0e-5, "{got:?}");
    assert!(got.torque_nm.length() > 0.5, "what is left is not balanced");
    assert_eq!(broken.currents_a[0], 0.0);
}

#[test]
fn the_uneven_field_scales_the_vertical_force_alone() {
    let uneven = ActuationParameters { field: FieldError::THESIS, ..IDEAL };
    let mut actuation = actuation(&uneven);
    let asked = wrench([10.0, 5.0, 20.0], [0.1, 0.2, 0.3]);
    let got = actuation.drive(&asked, Wiring::Intact, 7.0e-3, TICK_S);
    let share = FieldError::THESIS.delivered_share(7.0e-3);
    assert!((got.force_n - DVec3::new(10.0, 5.0, 20.0 * share)).length() < 1.0e-5);
}

#[test]
fn coils_that_cannot_push_in_all_directions_are_refused() {
    let at_the_pole = CoilGeometry { meridian_ring_rad: 0.0, ..CoilGeometry::MAGLEV };
    let refused = Actuation::new(&ActuationParameters { geometry: at_the_pole, ..IDEAL });
    assert_eq!(refused.map(|_| ()), Err(InvalidParameter::DependentCoils));
    let flat = CoilGeometry { radius_m: -0.1, ..CoilGeometry::MAGLEV };
    let refused = Actuation::new(&ActuationParameters { geometry: flat, ..IDEAL });
    assert!(matches!(refused, Err(InvalidParameter::NotPositive { name: "coil_radius_mm", .. })));
}
