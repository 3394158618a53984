use super::*;
use flotor_hal::{DQuat, Pose};

const PERIOD_S: f64 = 1.0e-3;

fn passivity(mode: PassivityMode) -> Passivity {
    let controller = Controller { damping_ns_per_m: 15.0, damping_nms_per_rad: 0.15, period_s: PERIOD_S };
    Passivity::new(mode, controller, [DVec3::splat(40.0); 2])
}

fn at(z_m: f64, velocity_m_per_s: f64) -> DeviceState {
    DeviceState {
        pose: Pose::new(DVec3::Z * z_m, DQuat::IDENTITY),
        twist: Twist::new(DVec3::Z * velocity_m_per_s, DVec3::ZERO),
        ..DeviceState::HOME
    }
}

#[test]
fn what_a_spring_got_is_what_it_holds() {
    let mut observer = passivity(PassivityMode::Observe);
    let (stiffness_n_per_m, steps) = (500.0, 1000_i32);
    let mut held = Wrench::ZERO;
    // Into the spring by 5 mm, slowly: half k x², but for the half step by which a held force lags behind.
    for step in 0..=steps {
        let z_m = -0.005 * f64::from(step) / f64::from(steps);
        observer.observe(&at(z_m, 0.0), &held);
        held = Wrench::from_force(DVec3::Z * -stiffness_n_per_m * z_m);
    }
    let stored_j = 0.5 * stiffness_n_per_m * 0.005 * 0.005;
    let lag_j = stored_j / f64::from(steps);
    assert!((observer.energy_j() - (stored_j - lag_j)).abs() < 1.0e-15, "{}", observer.energy_j());
}

#[test]
fn turning_against_a_torque_puts_energy_in() {
    let mut observer = passivity(PassivityMode::Observe);
    let mut state = DeviceState::HOME;
    observer.observe(&state, &Wrench::ZERO);
    state.pose = Pose::new(DVec3::ZERO, DQuat::from_rotation_y(0.01));
    observer.observe(&state, &Wrench::new(DVec3::ZERO, DVec3::new(5.0, -2.0, 5.0)));
    assert!((observer.energy_j() - 0.02).abs() < 1.0e-9, "{}", observer.energy_j());
}

#[test]
fn observing_changes_nothing() {
    let push = Wrench::from_force(DVec3::Z * 40.0);
    assert_eq!(passivity(PassivityMode::Observe).guard(&push, &at(0.0, 1.0)), None);
}

#[test]
fn a_controller_lets_pass_what_takes_energy_and_what_there_is_energy_for() {
    let mut controller = passivity(PassivityMode::Control);
    let push = Wrench::from_force(DVec3::Z * 4.0);
    assert_eq!(controller.guard(&push, &at(0.0, -0.1)), None, "it brakes");
    controller.energy_j = 1.0;
    assert_eq!(controller.guard(&push, &at(0.0, 0.1)), None, "0.4 mJ of 1 J");
}

#[test]
fn what_drives_without_energy_becomes_damping_or_nothing() {
    let controller = passivity(PassivityMode::Control);
    let push = Wrench::from_force(DVec3::Z * 0.5);
    let moving = controller.guard(&push, &at(0.0, 0.1)).expect("it is too much");
    assert!(moving.force().z < 0.0, "15 N s/m at 0.1 m/s are more than 0.5 N: {moving:?}");
    let at_rest = controller.guard(&push, &at(0.0, 0.0)).expect("it is too much");
    assert_eq!(at_rest, Wrench::ZERO, "nothing to damp");
}

/// A planar device that is carried along an axis it cannot drive: that motion damps nothing and takes nothing.
#[test]
fn what_cannot_be_slowed_is_not_counted_on() {
    let damping = Controller { damping_ns_per_m: 15.0, damping_nms_per_rad: 0.15, period_s: PERIOD_S };
    let planar = Passivity::new(PassivityMode::Control, damping, [DVec3::new(3.0, 3.0, 0.0), DVec3::ZERO]);
    let mut state = at(0.0, 0.5); // along z
    state.twist.linear_m_per_s[0] = 0.1;
    let push = Wrench::from_force(DVec3::X * 2.0);
    let kept = planar.guard(&push, &state).expect("there is no energy for it").force();
    assert_eq!(kept.z, 0.0, "{kept}");
    let way = state.twist.linear() * PERIOD_S;
    let surprise_m = 0.5 * EXPECTED.acceleration_m_per_s2 * PERIOD_S * PERIOD_S;
    assert!(kept.x * way.x + kept.x.abs() * surprise_m <= 1.0e-15, "{kept} still brings energy out");
}

/// The promise of the controller: no motion within what is expected makes the energy negative.
#[test]
fn no_expected_motion_brings_out_more_than_there_is() {
    let mut controller = passivity(PassivityMode::Control);
    let numbers = [0.0, 1.0e-9, -3.0e-3, 0.2, -1.5, 40.0];
    let mut cases = 0_u32;
    for energy_j in [0.0, 1.0e-6, 1.0e-3] {
        controller.energy_j = energy_j;
        for (x, z, speed) in numbers.iter().flat_map(|x| {
            numbers.iter().flat_map(move |z| [0.0, 0.001, 0.1, -0.1, 2.0].map(|speed| (*x, *z, speed)))
        }) {
            let wrench = Wrench::from_force(DVec3::new(x, 0.0, z));
            let state = at(0.0, speed);
            let sent = controller.guard(&wrench, &state).unwrap_or(wrench);
            for direction in
                [DVec3::X, DVec3::NEG_X, DVec3::Z, DVec3::NEG_Z, sent.force().normalize_or_zero()]
            {
                let surprise = direction * (0.5 * EXPECTED.acceleration_m_per_s2 * PERIOD_S * PERIOD_S);
                let way = state.twist.linear() * PERIOD_S + surprise;
                let left_j = energy_j - sent.force().dot(way);
                assert!(left_j >= -1.0e-15, "{wrench:?} at {speed} m/s with {energy_j} J leaves {left_j} J");
                cases += 1;
            }
        }
    }
    assert!(cases > 2000);
}
