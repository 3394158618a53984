//! The check of samples: what hands do passes at every rate, and everything else has its reason.

use super::*;
use crate::random::Random;
use flotor_hal::orientation_from_rotation_vector;
use std::f64::consts::TAU;

const PERIOD_NS: u64 = 1_000_000;
const DEVICE: Capabilities = Capabilities {
    sensed: Axes::ALL,
    actuated: Axes::ALL,
    range_m: [0.012; 3],
    range_rad: [0.12, 0.12, 0.5],
    resolution_m: 2.0e-6,
    max_force_n: [10.0; 3],
    max_torque_nm: [1.0; 3],
    max_force_slew_n_per_s: 1.0e4,
    max_torque_slew_nm_per_s: 1.0e3,
    max_stiffness_n_per_m: 1.0e4,
    rate_hz: [100.0, 10_000.0],
    latency_s: 0.0,
};

fn tick(index: u64, period_ns: u64) -> Tick {
    Tick { index, time_ns: index * period_ns, dt_ns: if index == 0 { 0 } else { period_ns } }
}

fn at(position_m: DVec3, time_ns: u64) -> DeviceState {
    DeviceState { pose: Pose::new(position_m, DQuat::IDENTITY), sampled_ns: time_ns, ..DeviceState::HOME }
}

/// A check that has seen ten samples at home.
fn settled() -> PlausibilityCheck {
    let mut check = PlausibilityCheck::new(&DEVICE, PERIOD_NS);
    for index in 0..10 {
        let tick = tick(index, PERIOD_NS);
        assert_eq!(check.check(&tick, &at(DVec3::ZERO, tick.time_ns)), Ok(()));
    }
    check
}

/// What the sample of tick 10 comes to, made from one at home.
fn tenth(change: impl Fn(&mut DeviceState)) -> Result<(), Implausible> {
    let tick = tick(10, PERIOD_NS);
    let mut sample = at(DVec3::ZERO, tick.time_ns);
    change(&mut sample);
    settled().check(&tick, &sample)
}

#[test]
fn whatever_a_hand_does_can_be_at_every_rate_also_after_lost_samples() {
    for rate_hz in [100, 200, 1000, 4000, 10_000] {
        let period_ns = 1_000_000_000 / rate_hz;
        // To the edge of the range and back up to 40 times a second: 3 m/s, 80 times the acceleration of a fall.
        for (hz, lost_in) in [(1.0, 2), (10.0, 3), (40.0, 5), (40.0, 1_000_000)] {
            let mut check = PlausibilityCheck::new(&DEVICE, period_ns);
            for index in 0..rate_hz * 2 {
                let tick = tick(index, period_ns);
                if index % lost_in == 1 {
                    continue;
                }
                let (sin, cos) = (TAU * hz * tick.time_ns as f64 * 1.0e-9).sin_cos();
                // Noise of ten micrometres, here and there.
                let noise =
                    DVec3::new(1.0e-5, -1.0e-5, 1.0e-5) * if index.is_multiple_of(2) { 1.0 } else { -1.0 };
                let mut sample = at(DVec3::new(0.0, 0.0, 0.012) * sin + noise, tick.time_ns);
                let turned = orientation_from_rotation_vector(DVec3::new(0.0, 0.1 * cos, 0.1 * sin));
                sample.pose.orientation_xyzw = turned.to_array().map(|part| part * 1.0001);
                sample.twist =
                    Twist::new(DVec3::Z * (0.012 * TAU * hz * cos), DVec3::Z * (0.1 * TAU * hz * cos));
                assert_eq!(check.check(&tick, &sample), Ok(()), "{rate_hz} Hz, {hz} Hz, tick {index}");
            }
        }
    }
}

#[test]
fn no_number_of_a_pose_or_a_velocity_may_be_nan_or_infinite() {
    for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for part in 0..13 {
            let is = tenth(|sample| match part {
                0..3 => sample.pose.position_m[part] = wrong,
                3..7 => sample.pose.orientation_xyzw[part - 3] = wrong,
                7..10 => sample.twist.linear_m_per_s[part - 7] = wrong,
                _ => sample.twist.angular_rad_per_s[part - 10] = wrong,
            });
            assert_eq!(is, Err(Implausible::NotFinite), "{wrong} as number {part}");
        }
    }
}

#[test]
fn each_impossible_sample_has_its_reason() {
    let position = |z_m: f64| move |sample: &mut DeviceState| sample.pose.position_m[2] = z_m;
    let turned = |rotation_rad: DVec3| {
        move |sample: &mut DeviceState| {
            sample.pose.orientation_xyzw = orientation_from_rotation_vector(rotation_rad).to_array();
        }
    };
    let quaternion = |xyzw: [f64; 4]| move |sample: &mut DeviceState| sample.pose.orientation_xyzw = xyzw;
    assert_eq!(tenth(|_| ()), Ok(()));
    assert_eq!(tenth(position(-1.0e30)), Err(Implausible::Range));
    assert_eq!(tenth(position(f64::MAX)), Err(Implausible::Range));
    assert_eq!(tenth(position(0.0245)), Err(Implausible::Range));
    assert_eq!(tenth(position(0.006)), Err(Implausible::Speed), "6 mm in 1 ms");
    assert_eq!(tenth(position(0.005)), Ok(()));
    assert_eq!(tenth(turned(DVec3::X * 0.25)), Err(Implausible::Range));
    assert_eq!(tenth(turned(DVec3::Z * 0.1)), Err(Implausible::Speed));
    assert_eq!(tenth(turned(DVec3::Z * 0.05)), Ok(()));
    assert_eq!(tenth(quaternion([0.0; 4])), Err(Implausible::Quaternion));
    assert_eq!(tenth(quaternion([1.0e10; 4])), Err(Implausible::Quaternion));
    assert_eq!(tenth(quaternion([0.0, 0.0, 0.0, 1.01])), Err(Implausible::Quaternion));
    assert_eq!(tenth(quaternion([0.0, 0.0, 0.0, -1.0])), Ok(()), "the same rotation");
    assert_eq!(tenth(|sample| sample.twist.linear_m_per_s[0] = 1.0e30), Err(Implausible::Speed));
    assert_eq!(tenth(|sample| sample.twist.angular_rad_per_s[0] = -1.0e3), Err(Implausible::Speed));
    assert_eq!(tenth(|sample| sample.sampled_ns = u64::MAX), Err(Implausible::Time));
    assert_eq!(tenth(|sample| sample.sampled_ns = 0), Err(Implausible::Time), "before the last one");
    assert_eq!(tenth(|sample| sample.sampled_ns = 9 * PERIOD_NS), Ok(()), "the last one once more");
}

#[test]
fn a_jump_there_and_back_is_more_than_a_hand_can_do() {
    let mut check = settled();
    let mut sample =
        |index: u64, z_m: f64| check.check(&tick(index, PERIOD_NS), &at(DVec3::Z * z_m, index * PERIOD_NS));
    assert_eq!(sample(10, 0.004), Ok(()));
    assert_eq!(sample(11, 0.0), Err(Implausible::Acceleration), "4 m/s there and 4 m/s back");
    assert_eq!(sample(12, 0.006), Ok(()));
}

#[test]
fn time_that_has_passed_since_the_last_sample_counts() {
    let tick = tick(12, PERIOD_NS);
    assert_eq!(settled().check(&tick, &at(DVec3::Z * 0.014, tick.time_ns)), Ok(()));
}

#[test]
fn an_old_sample_is_known_by_its_time() {
    let mut check = settled();
    let mut sample =
        |index: u64, sampled_ns: u64| check.check(&tick(index, PERIOD_NS), &at(DVec3::ZERO, sampled_ns));
    // The same one again for ten ticks, and no longer.
    for index in 10..20 {
        assert_eq!(sample(index, 9 * PERIOD_NS), Ok(()), "{index}");
    }
    assert_eq!(sample(20, 9 * PERIOD_NS), Err(Implausible::Time));
    assert_eq!(sample(21, 10 * PERIOD_NS), Ok(()));
    assert_eq!(sample(1000, 890 * PERIOD_NS), Err(Implausible::Time), "0.11 s ago");
    assert_eq!(sample(1001, 1000 * PERIOD_NS), Ok(()));
    // A device that has latency says so: at first it has nothing but where it started.
    let slow = Capabilities { latency_s: 0.5, ..DEVICE };
    let mut check = PlausibilityCheck::new(&slow, PERIOD_NS);
    for index in 0..2000_u64 {
        let sampled_ns = index.saturating_sub(500) * PERIOD_NS;
        assert_eq!(check.check(&tick(index, PERIOD_NS), &at(DVec3::ZERO, sampled_ns)), Ok(()), "{index}");
    }
}

#[test]
fn only_a_pose_with_noise_is_stuck() {
    let run = |conditions: Conditions| {
        let mut check = PlausibilityCheck::new(&DEVICE, PERIOD_NS);
        let stuck = |index: &u64| {
            let tick = tick(*index, PERIOD_NS);
            check.check(&tick, &DeviceState { conditions, ..at(DVec3::ZERO, tick.time_ns) })
                == Err(Implausible::Stuck)
        };
        (0..10_000).find(stuck)
    };
    assert_eq!(run(Conditions::NONE), None, "an encoder at rest");
    assert_eq!(run(Conditions::NOISY), Some(51));
}

#[test]
fn one_is_borne_several_hold_and_more_are_a_fault() {
    for (period_ns, held, lost) in [(100_000, 101, 1001), (1_000_000, 11, 101), (10_000_000, 3, 21)] {
        let mut check = PlausibilityCheck::new(&DEVICE, period_ns);
        let mut trusts = Vec::new();
        for index in 0..2000 {
            let tick = tick(index, period_ns);
            assert_eq!(check.check(&tick, &at(DVec3::ONE, tick.time_ns)), Err(Implausible::Range));
            trusts.push(check.trust());
        }
        let first = |trust| trusts.iter().position(|found| *found == trust).map(|index| index + 1);
        assert_eq!((first(Trust::Withdrawn), first(Trust::Lost)), (Some(held), Some(lost)), "{period_ns} ns");
        assert_eq!(trusts.last(), Some(&Trust::Lost));
        assert_eq!(check.found().to_string(), "2000 implausible samples (range 2000), the first at tick 0");
    }
}

#[test]
fn trust_comes_back_with_samples_that_can_be() {
    let mut check = settled();
    for index in 10..30 {
        let _ = check.check(&tick(index, PERIOD_NS), &at(DVec3::ONE, index * PERIOD_NS));
    }
    let is_believed = |index: &u64| {
        assert_eq!(check.check(&tick(*index, PERIOD_NS), &at(DVec3::ZERO, index * PERIOD_NS)), Ok(()));
        check.trust() == Trust::Full
    };
    // Twenty bad ones, ten of which are borne: twenty good ones for each of the others.
    assert_eq!((30..10_000).find(is_believed), Some(30 + 199));
}

#[test]
fn a_sensor_without_a_pose_may_leave_it_as_it_likes() {
    let mut check = PlausibilityCheck::new(&Capabilities::UNDRIVEN, PERIOD_NS);
    for index in 0..1000 {
        let mut sample = at(DVec3::ONE * (index as f64 * 1.0e6), 0);
        sample.pose.orientation_xyzw = [0.0; 4];
        assert_eq!(check.check(&tick(index, PERIOD_NS), &sample), Ok(()));
    }
}

/// A unit quaternion in six decimals or in single precision is a rotation, and a model gets it with length one.
#[test]
fn an_accepted_orientation_has_length_one_and_a_unit_quaternion_keeps_its_bits() {
    let mut random = Random::new(1, 0);
    for _ in 0..10_000 {
        let exact = orientation_from_rotation_vector(random.vector() * 3.0);
        let pose = Pose::new(DVec3::X, exact);
        assert_eq!(normalised(&pose), pose);
        for scale in [0.999_01, 1.0 - 1.0e-6, 1.0 + 1.0e-6, 1.000_9] {
            let accepted = exact * scale;
            assert!(is_rotation(accepted));
            let unit = normalised(&Pose::new(DVec3::X, accepted));
            // Rounding of a product, a root and a quotient.
            assert!((unit.orientation() - exact).length() < 1.0e-15, "{scale} {exact}");
            assert_eq!(normalised(&unit), unit, "once is enough");
        }
    }
    for refused in [0.0, 0.9989, 1.0011, 1.0e200, f64::NAN] {
        let pose = Pose::new(DVec3::X, DQuat::from_xyzw(0.0, 0.0, 0.0, refused));
        assert_eq!(
            normalised(&pose).orientation_xyzw.map(f64::to_bits),
            pose.orientation_xyzw.map(f64::to_bits)
        );
    }
}

#[test]
fn the_bounds_of_a_pose_are_ellipsoids_of_twice_the_range() {
    let bounds = PoseBounds::of(&DEVICE);
    let at = |position_m: [f64; 3], rotation_rad: [f64; 3]| {
        let orientation = orientation_from_rotation_vector(DVec3::from_array(rotation_rad));
        bounds.contain(&Pose::new(DVec3::from_array(position_m), orientation))
    };
    assert!(at([0.0239, 0.0, 0.0], [0.0; 3]) && at([0.0; 3], [0.0, 0.23, 0.0]));
    // Within twice the range along each axis, and beyond it as a whole.
    assert!(
        !at([0.0239, 0.0, 0.0239], [0.0; 3])
            && !at([0.0; 3], [0.2, 0.2, 0.0])
            && !at([f64::NAN; 3], [0.0; 3])
    );
    let endless = PoseBounds::of(&Capabilities { range_m: [0.0; 3], range_rad: [0.0; 3], ..DEVICE });
    assert!(endless.contain(&Pose::new(DVec3::X * 9.9, DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0))));
    assert!(!endless.contain(&Pose::new(DVec3::X * 10.1, DQuat::IDENTITY)));
}
