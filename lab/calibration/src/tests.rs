//! The fit against fields that are known exactly.

use super::fit::fit;
use super::procedure::{Plan, Reading, measure};
use super::rig::{Rest, Rig};
use super::{CalibrationError, thesis};
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// A rig whose field is a function, with a sensor of even noise of the same deviation as a normal one.
struct KnownField {
    share: fn(f64) -> f64,
    noise: Option<Pcg64Mcg>,
}

const WEIGHT_N: f64 = 8.58;
const NOISE_N: f64 = 0.02;

impl Rig for KnownField {
    fn rest_at(&mut self, target_m: f64, command_n: &dyn Fn(f64) -> f64) -> Result<Rest, CalibrationError> {
        Ok(Rest { height_m: target_m, delivered_n: command_n(target_m) * (self.share)(target_m) })
    }

    fn read_force_n(&mut self, rest: &Rest) -> Result<f64, CalibrationError> {
        // An even distribution over ±1 has the deviation 1/sqrt 3.
        let even =
            self.noise.as_mut().map_or(0.0, |noise| noise.next_u64() as f64 / u64::MAX as f64 * 2.0 - 1.0);
        Ok(rest.delivered_n - WEIGHT_N + even * 3.0_f64.sqrt() * NOISE_N)
    }
}

fn readings(share: fn(f64) -> f64, seed: Option<u64>) -> Vec<Reading> {
    let mut rig = KnownField { share, noise: seed.map(Pcg64Mcg::seed_from_u64) };
    measure(&mut rig, &Plan::thesis(), || {}).unwrap()
}

fn parabola(z_m: f64) -> f64 {
    1.05 - 6.0 * z_m - 1100.0 * z_m * z_m
}

#[test]
fn without_noise_the_field_comes_out_to_rounding() {
    let fit = fit(&readings(parabola, None)).unwrap();
    for step in -70..=70 {
        let z_m = f64::from(step) * 1.0e-4;
        assert!((fit.calibration.share(z_m) - parabola(z_m)).abs() < 1.0e-12);
    }
    assert!((fit.weight_n[0] - WEIGHT_N).abs() < 1.0e-11);
}

#[test]
fn cross_validation_finds_the_degree() {
    let cubic = |z_m: f64| parabola(z_m) + 4.0e5 * z_m * z_m * z_m; // 0.14 at 7 mm
    for (share, degree) in
        [((|_| 1.03) as fn(f64) -> f64, 0), (|z_m| 1.03 - 6.0 * z_m, 1), (parabola, 2), (cubic, 3)]
    {
        // The one-standard-error rule never takes too few where the term is many times the noise, and seldom one
        // too many.
        let found: Vec<usize> =
            (1..=10).map(|seed| fit(&readings(share, Some(seed))).unwrap().degree).collect();
        assert!(found.iter().all(|found| *found >= degree), "{found:?} for {degree}");
        assert!(found.iter().filter(|found| **found == degree).count() >= 6, "{found:?} for {degree}");
    }
}

#[test]
fn intervals_hold_what_they_promise() {
    let (mut weight_inside, mut band_inside, mut residuals) = (0, 0, 0.0);
    // Quickly: 20 seeds. 95 of 100 are expected, deviation 2.2: less than 86 has a chance of 1e-4, less than 15 of 20 one of 3e-4.
    let is_quick = std::env::var("FLOTOR_TEST_SIZE").map_or(true, |size| size == "quick");
    let (seeds, least): (u32, u32) = if is_quick { (20, 15) } else { (100, 86) };
    for seed in 1..=seeds {
        let fit = fit(&readings(parabola, Some(u64::from(seed)))).unwrap();
        let [weight_n, half_n] = fit.weight_n;
        weight_inside += u32::from((weight_n - WEIGHT_N).abs() <= half_n);
        // Shape: deviation from the value in the middle of the range, where the mean nearly is.
        let shape = |z_m: f64| {
            fit.calibration.share(z_m) / fit.calibration.share(0.0) - parabola(z_m) / parabola(0.0)
        };
        let worst = (-70..=70).map(|step| shape(f64::from(step) * 1.0e-4).abs()).fold(0.0, f64::max);
        band_inside += u32::from(worst * 100.0 <= 2.0 * fit.band_95_percent);
        residuals += fit.residual_n / f64::from(seeds);
    }
    assert!(weight_inside >= least, "{weight_inside} of {seeds}");
    assert!(band_inside >= least, "{band_inside} of {seeds}");
    assert!((residuals - NOISE_N).abs() < 0.02 * NOISE_N, "{residuals}");
}

#[test]
fn one_force_cannot_tell_the_weight_from_the_field() {
    let mut one: Vec<Reading> = readings(parabola, None);
    one.retain(|reading| reading.commanded_n == 10.0);
    assert!(matches!(fit(&one), Err(CalibrationError::TooFew { forces: 1, .. })));
    let few: Vec<Reading> = readings(parabola, None).into_iter().filter(|reading| reading.stop < 5).collect();
    assert!(matches!(fit(&few), Err(CalibrationError::TooFew { heights: 5, .. })));
    assert!(matches!(fit(&[]), Err(CalibrationError::TooFew { .. })));
}

#[test]
fn the_polynomial_of_the_thesis_is_the_printed_one() {
    // Section 3.4 at z = 2 mm: p = -0.01804 - 0.05166 + 0.19157 = 0.12187 N, on a feed-forward of 10 N.
    let calibration = thesis::calibration(10.0).unwrap();
    assert!((calibration.share(2.0e-3) - 1.012_187).abs() < 1.0e-12);
    // Its program corrects only what exceeds the feed-forward.
    assert_eq!(thesis::command_n(thesis::FEED_FORWARD_N, 2.0e-3), thesis::FEED_FORWARD_N);
    let spring_n = thesis::command_n(10.0, 2.0e-3) - thesis::FEED_FORWARD_N;
    assert!((spring_n - 2.3 * 7.7 / 7.821_87).abs() < 1.0e-12);
}
