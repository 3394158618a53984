//! Poses from light spots, their errors and delay, and the trade-off of noise and lag in the velocity estimates.

use super::*;
use crate::validation::InvalidParameter;
use flotor_hal::glam::DQuat;
use flotor_hal::orientation_from_rotation_vector;
use std::f64::consts::PI;

const TICK_S: f64 = 1.0e-3;

/// Cells without any error.
const IDEAL: SensingParameters = SensingParameters {
    noise_m: 0.0,
    step_m: 0.0,
    edge_nonlinearity: 0.0,
    bandwidth_hz: 0.0,
    latency_ns: 0,
    estimator: EstimatorKind::Difference,
    ..SensingParameters::MAGLEV
};

fn optics() -> Optics {
    Optics::new(&OpticsGeometry::MAGLEV).expect("a sound layout")
}

fn pose(position_mm: [f64; 3], rotation_deg: [f64; 3]) -> Pose {
    let rotation_rad = DVec3::from(rotation_deg) * (PI / 180.0);
    Pose {
        position_m: DVec3::from(position_mm) * 1.0e-3,
        orientation: orientation_from_rotation_vector(rotation_rad),
    }
}

/// Poses all over ±12 mm and ±8 degrees, corners included.
fn poses() -> Vec<Pose> {
    let mut noise = Noise::new(3, Stream::Faults);
    let mut random = |limit: f64| [0; 3].map(|_| limit * (2.0 * noise.uniform() - 1.0));
    let mut poses: Vec<Pose> =
        (0..2000).map(|_| pose(random(12.0 / 3.0_f64.sqrt()), random(8.0 / 3.0_f64.sqrt()))).collect();
    for axis in 0..6 {
        for sign in [-1.0, 1.0] {
            let (mut mm, mut deg) = ([0.0; 3], [0.0; 3]);
            if axis < 3 {
                mm[axis] = 12.0 * sign
            } else {
                deg[axis - 3] = 8.0 * sign
            }
            poses.push(pose(mm, deg));
        }
    }
    poses
}

fn assert_same(found: &Pose, expected: &Pose) {
    let (off_m, off_rad) =
        ((found.position_m - expected.position_m).length(), expected.rotation_to(found).length());
    assert!(off_m <= 1.0e-10 && off_rad <= 1.0e-9, "{off_m:e} m {off_rad:e} rad at {expected:?}");
}

#[test]
fn the_pose_is_found_over_the_whole_range_from_home_and_from_nearby() {
    let optics = optics();
    for truth in poses() {
        let spots = optics.spots(&truth).expect("the cells see the whole range");
        assert_same(&optics.find(&spots, &Pose::HOME).expect("found from home"), &truth);
        let near = Pose { position_m: truth.position_m * 0.99, ..truth };
        assert_same(&optics.find(&spots, &near).expect("found from nearby"), &truth);
    }
}

#[test]
fn spots_no_pose_makes_are_out_of_range_and_nothing_diverges() {
    let optics = optics();
    let mut noise = Noise::new(4, Stream::Faults);
    let mut none = 0;
    for _ in 0..10_000 {
        let mut scattered = || DVec3::from([0; 3].map(|_| 9.0e-3 * (2.0 * noise.uniform() - 1.0)));
        let spots = Spots { across_m: scattered(), up_m: scattered() };
        match optics.find(&spots, &Pose::HOME) {
            Some(pose) => assert!(pose.position_m.length() <= 24.0e-3 && pose.orientation.is_normalized()),
            None => none += 1,
        }
    }
    assert!(none > 1000, "most scattered spots belong to no pose: {none}");
    for poison in [f64::NAN, f64::INFINITY, 1.0e300] {
        let spots = Spots { across_m: DVec3::splat(poison), up_m: DVec3::splat(poison) };
        assert_eq!(optics.find(&spots, &Pose::HOME), None);
        let lost = Pose { position_m: DVec3::splat(poison), orientation: DQuat::IDENTITY };
        assert_eq!(optics.spots(&lost), None);
    }
}

#[test]
fn diodes_in_a_line_are_refused() {
    let geometry = OpticsGeometry { diode_azimuths_rad: [0.0, PI, PI], ..OpticsGeometry::MAGLEV };
    assert_eq!(Optics::new(&geometry).map(|_| ()), Err(InvalidParameter::DiodesInALine));
}

fn sensing(parameters: &SensingParameters) -> Sensing {
    Sensing::new(parameters, 1, &Pose::HOME).expect("physical parameters")
}

fn state(pose: &Pose) -> State {
    State { position_m: pose.position_m, orientation: pose.orientation, ..State::HOME }
}

#[test]
fn a_sample_arrives_after_its_latency_with_the_time_it_was_taken() {
    let mut sensing = sensing(&SensingParameters { latency_ns: 3_400_000, ..IDEAL });
    assert_eq!(sensing.latency(1_000_000), (3, 400_000));
    assert_eq!(sensing.latency(4_000_000), (0, 3_400_000));
    assert_eq!(sensing.latency(250_000), (13, 150_000));
    for tick in 0..10_u32 {
        let truth = pose([0.0, 0.0, 0.1 * f64::from(tick)], [0.0; 3]);
        sensing.sample(&state(&truth), u64::from(tick), TICK_S);
        if tick >= 3 {
            let sample = sensing.arrived(3);
            assert_eq!(sample.taken_ns, u64::from(tick - 3));
            let expected = pose([0.0, 0.0, 0.1 * f64::from(tick - 3)], [0.0; 3]);
            assert_same(&sample.pose.expect("in range"), &expected);
        }
    }
}

#[test]
fn a_spot_beside_its_cell_gives_no_pose_and_coming_back_gives_one() {
    let mut sensing = sensing(&IDEAL);
    for (height_mm, seen) in [(5.0, true), (60.0, false), (6.0, true)] {
        sensing.sample(&state(&pose([0.0, 0.0, height_mm], [0.0; 3])), 0, TICK_S);
        assert_eq!(sensing.arrived(0).pose.is_some(), seen, "{height_mm}");
    }
}

#[test]
fn noise_has_the_size_it_is_said_to_have() {
    let mut sensing = sensing(&SensingParameters { noise_m: 2.0e-6, ..IDEAL });
    let mut square_m2 = 0.0;
    const SAMPLES: u32 = 20_000;
    for _ in 0..SAMPLES {
        sensing.sample(&State::HOME, 0, TICK_S);
        square_m2 += sensing.arrived(0).pose.expect("in range").position_m.z.powi(2);
    }
    // z is the mean of three coordinates; four standard errors of a variance.
    let ratio = square_m2 / f64::from(SAMPLES) / (2.0e-6_f64.powi(2) / 3.0);
    assert!((ratio - 1.0).abs() < 4.0 * (2.0 / f64::from(SAMPLES)).sqrt(), "{ratio}");
}

#[test]
fn steps_round_and_edges_bend() {
    let truth = state(&pose([0.0, 0.0, 8.0], [0.0; 3]));
    let height_mm = |parameters: &SensingParameters| {
        let mut sensing = sensing(parameters);
        sensing.sample(&truth, 0, TICK_S);
        sensing.arrived(0).pose.expect("in range").position_m.z * 1.0e3
    };
    let stepped = height_mm(&SensingParameters { step_m: 30.0e-6, ..IDEAL });
    assert!((stepped - 8.01).abs() < 1.0e-9, "the next multiple of 30 um: {stepped}");
    // A spot 8/3 mm out on a half width of 9 mm: 1 % of (8/27)^2.
    let bent = height_mm(&SensingParameters { edge_nonlinearity: 0.01, ..IDEAL });
    let expected = 8.0 * (1.0 + 0.01 * (8.0_f64 / 27.0).powi(2));
    assert!((bent - expected).abs() < 1.0e-9, "{bent} {expected}");
}

#[test]
fn a_bandwidth_of_125_hz_follows_a_step_exponentially() {
    let mut sensing = sensing(&SensingParameters { bandwidth_hz: 125.0, ..IDEAL });
    sensing.sample(&State::HOME, 0, TICK_S);
    for tick in 1..=5 {
        sensing.sample(&state(&pose([0.0, 0.0, 1.0], [0.0; 3])), 0, TICK_S);
        let height_m = sensing.arrived(0).pose.expect("in range").position_m.z;
        let expected_m = 1.0e-3 * (1.0 - (-std::f64::consts::TAU * 125.0 * f64::from(tick) * TICK_S).exp());
        assert!((height_m - expected_m).abs() < 1.0e-12, "{tick}: {height_m} {expected_m}");
    }
}

#[test]
fn the_same_seed_gives_the_same_samples() {
    let run = |seed| {
        let mut sensing = Sensing::new(&SensingParameters::MAGLEV, seed, &Pose::HOME).expect("physical");
        (0..50).for_each(|tick| sensing.sample(&State::HOME, tick, TICK_S));
        sensing.arrived(0)
    };
    assert_eq!(run(5), run(5));
    assert_ne!(run(5).pose, run(6).pose);
}

/// Three cells with noise, and with steps that are evenly distributed over many places: the height is their mean.
#[test]
fn the_height_has_the_noise_of_the_mean_of_three_cells() {
    let (mut square, mut count) = (0.0, 0.0_f64);
    for place in 0..100_u32 {
        // Golden section: places spread over a millimetre, nowhere near the steps of the sensor.
        let truth = state(&pose([0.0, 0.0, (f64::from(place) * 0.618_033_988_749_895).fract()], [0.0; 3]));
        let mut sensing =
            Sensing::new(&SensingParameters::MAGLEV, u64::from(place), &Pose::HOME).expect("physical");
        let mut previous = f64::NAN;
        for tick in 0..200 {
            sensing.sample(&truth, tick, TICK_S);
            let height_m = sensing.arrived(0).pose.expect("in range").position_m.z;
            if previous.is_finite() {
                square += (height_m - previous).powi(2);
                count += 1.0;
            }
            previous = height_m;
        }
    }
    let noise_m = (square / (2.0 * count)).sqrt();
    let expected_m = 1.0e-6_f64.hypot(2.0e-6 / 12.0_f64.sqrt()) / 3.0_f64.sqrt();
    // Squares of differences of independent samples: six deviations of the root of their mean.
    let bound = 6.0 * (1.5 / (2.0 * count)).sqrt();
    assert!((noise_m / expected_m - 1.0).abs() < bound, "{noise_m} {expected_m}");
}

/// Root mean square error of a velocity estimate (m/s): at rest under noise, and behind a steady acceleration.
fn noise_and_lag(kind: EstimatorKind) -> (f64, f64) {
    const NOISE_M: f64 = 2.0e-6;
    const ACCELERATION: f64 = 2.0;
    let mut noise = Noise::new(9, Stream::Sensor);
    let (mut quiet, mut moving) = (Estimator::new(kind), Estimator::new(kind));
    let (mut square, mut lag) = (0.0, 0.0);
    const TICKS: u32 = 4000;
    for tick in 0..TICKS {
        let [error, _] = noise.normal_pair();
        let at = |z_m| Pose { position_m: DVec3::new(0.0, 0.0, z_m), ..Pose::HOME };
        square += quiet.update(&at(NOISE_M * error), TICK_S).linear_m_per_s.z.powi(2);
        let t = f64::from(tick) * TICK_S;
        lag = ACCELERATION * t - moving.update(&at(0.5 * ACCELERATION * t * t), TICK_S).linear_m_per_s.z;
    }
    ((square / f64::from(TICKS)).sqrt(), lag)
}

#[test]
fn each_estimate_trades_noise_for_lag_as_said() {
    let (difference_noise, difference_lag) = noise_and_lag(EstimatorKind::Difference);
    let (filtered_noise, filtered_lag) = noise_and_lag(EstimatorKind::LowPass { bandwidth_hz: 20.0 });
    let (kalman_noise, kalman_lag) =
        noise_and_lag(EstimatorKind::Kalman { noise_m: 2.0e-6, acceleration_m_per_s2: 2.0 });
    // Difference: sqrt 2 of the noise over a tick, half a tick late at 2 m/s^2.
    assert!((difference_noise / (2.0_f64.sqrt() * 2.0e-3) - 1.0).abs() < 0.05, "{difference_noise}");
    assert!((difference_lag - 1.0e-3).abs() < 1.0e-9, "{difference_lag}");
    assert!(filtered_noise < 0.2 * difference_noise && filtered_lag > 5.0 * difference_lag);
    assert!(
        kalman_noise < 0.5 * difference_noise && kalman_lag < filtered_lag,
        "{kalman_noise} {kalman_lag}"
    );
}

#[test]
fn rotation_is_estimated_like_translation() {
    for kind in [
        EstimatorKind::Difference,
        EstimatorKind::UTAH,
        EstimatorKind::Kalman { noise_m: 1.0e-6, acceleration_m_per_s2: 10.0 },
    ] {
        let mut estimator = Estimator::new(kind);
        let rate = DVec3::new(0.3, -0.2, 0.5);
        let mut velocity = Velocity::ZERO;
        for tick in 0..300 {
            let turned = orientation_from_rotation_vector(rate * (f64::from(tick) * TICK_S));
            velocity = estimator.update(&Pose { orientation: turned, ..Pose::HOME }, TICK_S);
        }
        assert!((velocity.angular_rad_per_s - rate).length() < 1.0e-6, "{kind:?} {velocity:?}");
    }
}
