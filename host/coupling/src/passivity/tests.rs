use super::*;
use crate::port_energy::PortObserver;
use crate::tests::random::Random;
use flotor_hal::{DQuat, Pose};

const PERIOD_S: f64 = 1.0e-3;

fn passivity(mode: PassivityMode) -> Passivity {
    passivity_at(PERIOD_S, mode)
}

fn passivity_at(period_s: f64, mode: PassivityMode) -> Passivity {
    Passivity::new(mode, Controller::new(15.0, 0.15, period_s), [DVec3::splat(40.0); 2])
}

fn at(z_m: f64, velocity_m_per_s: f64) -> DeviceState {
    DeviceState {
        pose: Pose::new(DVec3::Z * z_m, DQuat::IDENTITY),
        twist: Twist::new(DVec3::Z * velocity_m_per_s, DVec3::ZERO),
        ..DeviceState::HOME
    }
}

/// The port of a device under a passivity controller.
struct Port {
    passivity: Passivity,
    motion: PortObserver,
    held: Wrench,
}

impl Port {
    fn new(period_s: f64) -> Self {
        Self {
            passivity: passivity_at(period_s, PassivityMode::Control),
            motion: PortObserver::default(),
            held: Wrench::ZERO,
        }
    }

    /// One tick: the force that reaches the hand, N.
    fn tick(&mut self, state: &DeviceState, request_n: f64) -> f64 {
        self.passivity.observe(&self.motion.moved(&state.pose), &self.held);
        let request = Wrench::from_force(DVec3::Z * request_n);
        self.held = self.passivity.limit(&request, &self.held, state).unwrap_or(request);
        self.held.force().z
    }
}

#[test]
fn a_spring_stores_what_it_received() {
    let (mut observer, mut motion) = (passivity(PassivityMode::Observe), PortObserver::default());
    let (stiffness_n_per_m, steps) = (500.0, 1000_i32);
    let mut held = Wrench::ZERO;
    // Into the spring by 5 mm, slowly: half k x², but for the half step by which a held force lags behind.
    for step in 0..=steps {
        let z_m = -0.005 * f64::from(step) / f64::from(steps);
        observer.observe(&motion.moved(&at(z_m, 0.0).pose), &held);
        held = Wrench::from_force(DVec3::Z * -stiffness_n_per_m * z_m);
    }
    let stored_j = 0.5 * stiffness_n_per_m * 0.005 * 0.005;
    let lag_j = stored_j / f64::from(steps);
    assert!((observer.energy_j() - (stored_j - lag_j)).abs() < 1.0e-15, "{}", observer.energy_j());
}

#[test]
fn turning_against_a_torque_puts_energy_in() {
    let (mut observer, mut motion) = (passivity(PassivityMode::Observe), PortObserver::default());
    motion.moved(&Pose::HOME);
    let turned = motion.moved(&Pose::new(DVec3::ZERO, DQuat::from_rotation_y(0.01)));
    observer.observe(&turned, &Wrench::new(DVec3::ZERO, DVec3::new(5.0, -2.0, 5.0)));
    assert!((observer.energy_j() - 0.02).abs() < 1.0e-9, "{}", observer.energy_j());
}

#[test]
fn observing_changes_nothing() {
    let push = Wrench::from_force(DVec3::Z * 40.0);
    assert_eq!(passivity(PassivityMode::Observe).limit(&push, &Wrench::ZERO, &at(0.0, 1.0)), None);
}

#[test]
fn a_controller_lets_pass_what_takes_energy_and_what_there_is_energy_for() {
    let mut controller = passivity(PassivityMode::Control);
    let push = Wrench::from_force(DVec3::Z * 4.0);
    assert_eq!(controller.limit(&push, &Wrench::ZERO, &at(0.0, -0.1)), None, "it brakes");
    controller.energy_j = 1.0;
    assert_eq!(controller.limit(&push, &push, &at(0.0, 0.1)), None, "0.4 mJ of 1 J");
}

#[test]
fn a_force_along_the_motion_has_the_energy_of_the_port_and_half_the_reserve_and_no_more() {
    let mut controller = passivity(PassivityMode::Control);
    let push = Wrench::from_force(DVec3::Z * 0.5);
    let mut sent_n = |energy_j| {
        controller.energy_j = energy_j;
        controller.limit(&push, &push, &at(0.0, 0.1)).expect("it is too much").force().z
    };
    let predicted_j = PREDICTED_SHARE * reserve_j(PERIOD_S);
    // Over a way of 0.1 mm.
    assert!((0.0..=predicted_j / 1.0e-4).contains(&sent_n(0.0)));
    for energy_j in [1.0e-6, 1.0e-5] {
        let most_n = (predicted_j + energy_j) / 1.0e-4;
        let sent_n = sent_n(energy_j);
        assert!((0.9 * most_n..=most_n).contains(&sent_n), "{sent_n} N of {most_n} N");
    }
    assert!(sent_n(-1.0e-3) <= 0.0);
}

/// A planar device that is carried along an axis it cannot drive: that motion damps nothing and takes nothing.
#[test]
fn motion_along_an_axis_that_is_not_driven_does_not_count() {
    let controller = Controller::new(15.0, 0.15, PERIOD_S);
    let mut planar =
        Passivity::new(PassivityMode::Control, controller, [DVec3::new(3.0, 3.0, 0.0), DVec3::ZERO]);
    let mut state = at(0.0, 0.5); // along z
    state.twist.linear_m_per_s[0] = 0.1;
    let push = Wrench::from_force(DVec3::X * 2.0);
    let kept = planar.limit(&push, &push, &state).expect("there is no energy for it").force();
    assert_eq!(kept.z, 0.0, "{kept}");
    let way = state.twist.linear() * PERIOD_S;
    assert!(kept.dot(way) <= planar.predicted_j, "{kept} gives more energy than there is");
}

/// A force that the hand presses against from rest passes as a whole: one that assumed an acceleration of 50 m/s² deleted every
/// contact slower than `a T / 2`, 25 mm/s at 1 kHz, for as long as it lasted.
#[test]
fn a_contact_at_any_speed_and_rate_has_its_force() {
    for rate_hz in [100.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0] {
        for stiffness_n_per_m in [500.0, 2000.0, 20_000.0] {
            for speed_m_per_s in [1.0e-3, 5.0e-3, 20.0e-3, 100.0e-3] {
                let mut port = Port::new(1.0 / rate_hz);
                // Smoothly to that speed in 50 ms, 2 mm before the wall and 2 mm into it.
                let (mut z_m, mut speed, mut sent_n, mut requested_n) = (2.0e-3, 0.0, 0.0, 0.0);
                while z_m > -2.0e-3 {
                    speed = (speed + speed_m_per_s / (0.05 * rate_hz)).min(speed_m_per_s);
                    z_m -= speed / rate_hz;
                    requested_n = (-stiffness_n_per_m * z_m).max(0.0);
                    sent_n = port.tick(&at(z_m, -speed), requested_n);
                }
                assert_eq!(
                    sent_n,
                    requested_n,
                    "{rate_hz} Hz, {stiffness_n_per_m} N/m, {speed_m_per_s} m/s: {} J",
                    port.passivity.energy_j()
                );
            }
        }
    }
}

/// Hands that move to and fro with sums of sines of at most 50 m/s², into springs and models that pump: the energy is integrated here,
/// from positions and forces.
#[test]
fn no_hand_gets_more_than_the_reserve_out_of_a_spring_or_a_pump() {
    let mut random = Random(45);
    for rate_hz in [250.0, 1000.0, 4000.0] {
        for case in 0..60 {
            let stiffness_n_per_m = 1000.0 * 20.0_f64.powf(0.5 + 0.5 * random.symmetric());
            let pump_ns_per_m = if case % 3 == 0 { 20.0 } else { 0.0 };
            let waves: Vec<[f64; 3]> = (0..4)
                .map(|_| {
                    let omega = 2.0 * std::f64::consts::TAU * 8.0_f64.powf(0.5 + 0.5 * random.symmetric());
                    let most_m = (12.0 / (omega * omega)).min(2.0e-3);
                    [most_m * random.symmetric(), omega, 3.0 * random.symmetric()]
                })
                .collect();
            let mut port = Port::new(1.0 / rate_hz);
            let (mut given_j, mut most_j, mut last_m, mut sent_n) = (0.0, 0.0_f64, None, 0.0);
            for tick in 0..3000 {
                let t_s = f64::from(tick) / rate_hz;
                // From rest.
                let rise = (t_s / 0.2).min(1.0);
                let z_m =
                    rise * waves.iter().map(|[a, w, p]| a * ((w * t_s + p).sin() - p.sin())).sum::<f64>();
                let speed = waves.iter().map(|[a, w, p]| rise * a * w * (w * t_s + p).cos()).sum::<f64>();
                given_j += sent_n * (z_m - last_m.unwrap_or(z_m));
                last_m = Some(z_m);
                most_j = most_j.max(given_j);
                let request_n = (-stiffness_n_per_m * z_m + pump_ns_per_m * speed).clamp(-40.0, 40.0);
                sent_n = port.tick(&at(z_m, speed), request_n);
            }
            let way_m = 0.5 * 50.0 / (rate_hz * rate_hz);
            let bound_j = 0.5 * stiffness_n_per_m * way_m * way_m;
            assert!(
                most_j <= bound_j,
                "case {case}, {rate_hz} Hz, {stiffness_n_per_m} N/m: {most_j} J of {bound_j} J"
            );
        }
    }
}
