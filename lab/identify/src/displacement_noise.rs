//! Correction of the bias from noise of the displacement.
//!
//! Noise of the displacement reduces the estimated dependence of the force on the velocity and repeatedly reverses a dry
//! friction, regardless of the number of samples. The correction is that of a parametric bootstrap (Efron and Tibshirani 1993,
//! section 10.6): the fitted law gives the force for a smooth motion similar to the measured one; the law is fitted to this force
//! and the motion with equally strong noise, and the step from the known coordinates is the bias. Pairs of opposite noise cancel
//! its linear effect.

use crate::cells::{Cells, moving_mean};
use crate::fit::{Device, Fit, Problem};
use flotor_hal::math;
use nalgebra::DVector;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::f64::consts::TAU;

/// Number of pairs of opposite noise.
const PAIRS: u64 = 2;
/// Window of the moving average for the smooth motion, in cells.
const LIKENESS: usize = 4;
/// Half-width of the dead band for the noise of this average, in standard deviations.
const PLAY: f64 = 2.0;

/// Returns the coordinates of a fit, corrected for the bias from noise of the displacement.
pub(crate) fn corrected(fit: &Fit, cells: &Cells<'_>, device: Device) -> Option<DVector<f64>> {
    let (measurement, scales) = (cells.measurement(), cells.scales());
    let deviation_m = noise_of_displacement(measurement.displacement_m());
    let motion_m = likeness(measurement.displacement_m(), LIKENESS * cells.size(), deviation_m);
    let motion = measurement.replaced(motion_m.clone(), measurement.force_n().to_vec());
    let single = Cells::single(&motion);
    let force_n = Problem::of(fit, &single, device, scales).prediction_n(&fit.coordinates);
    let exact = measurement.replaced(motion_m, force_n);
    let mut bias = DVector::zeros(fit.coordinates.len());
    for pair in 0..PAIRS {
        let mut generator = Pcg64Mcg::seed_from_u64(pair);
        let noise_m: Vec<f64> =
            (0..cells.time_s().len()).map(|_| deviation_m * normal(&mut generator)).collect();
        for sign in [1.0, -1.0] {
            let noisy = exact.displaced(noise_m.iter().map(|noise_m| sign * noise_m));
            let noisy = cells.of_same_size(&noisy)?;
            bias += Problem::of(fit, &noisy, device, scales).step_of_data()? / (2 * PAIRS) as f64;
        }
    }
    let rest = Problem::of(fit, cells, device, scales).step()?;
    Some(&fit.coordinates + rest - bias)
}

/// Returns the measured motion without most of its noise: a moving average over `size` samples with a dead band, so that noise at
/// rest does not reverse a dry friction.
fn likeness(displacement_m: &[f64], size: usize, deviation_m: f64) -> Vec<f64> {
    let means_m = moving_mean(displacement_m, size);
    let play_m = PLAY * deviation_m / (size as f64).sqrt();
    let mut at_m = means_m.first().copied().unwrap_or(0.0);
    let follow = |mean_m: f64| {
        at_m = at_m.clamp(mean_m - play_m, mean_m + play_m);
        at_m
    };
    means_m.into_iter().map(follow).collect()
}

/// Estimates the standard deviation of the displacement's noise: the smallest estimate from third, fourth and fifth differences,
/// because fast motion adds to low orders. The median excludes rare corners.
fn noise_of_displacement(displacement_m: &[f64]) -> f64 {
    /// Median of the absolute value of a standard normal variable.
    const MEDIAN: f64 = 0.674_489_750_2;
    let difference = |values: &[f64]| values.windows(2).map(|pair| pair[1] - pair[0]).collect::<Vec<f64>>();
    let mut differences = difference(&difference(displacement_m));
    // Sums of the squared binomial coefficients of the orders.
    let deviations = [20.0_f64, 70.0, 252.0].map(|squares| {
        differences = difference(&differences);
        let mut sizes: Vec<f64> = differences.iter().map(|difference| difference.abs()).collect();
        let middle = sizes.len() / 2;
        if sizes.is_empty() {
            return 0.0;
        }
        let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
        *median / (MEDIAN * squares.sqrt())
    });
    deviations.into_iter().fold(f64::INFINITY, f64::min)
}

/// Draws a sample of the standard normal distribution (Box and Muller 1958).
fn normal(generator: &mut Pcg64Mcg) -> f64 {
    /// 2^-53: the 53 highest bits fill the mantissa.
    const STEP: f64 = 1.0 / (1_u64 << 53) as f64;
    let mut uniform = || (generator.next_u64() >> 11) as f64 * STEP;
    (-2.0 * math::ln(1.0 - uniform())).sqrt() * math::cos(TAU * uniform())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motion_like_the_measured_one_rests_where_the_probe_rests() {
        let mut generator = Pcg64Mcg::seed_from_u64(5);
        let motion_m = |index: u32| 1.0e-6 * f64::from(index.min(1000));
        let x: Vec<f64> = (0..3000).map(|index| motion_m(index) + 2.0e-6 * normal(&mut generator)).collect();
        let found = likeness(&x, 25, 2.0e-6);
        let path_m =
            |places_m: &[f64]| places_m.windows(2).map(|pair| (pair[1] - pair[0]).abs()).sum::<f64>();
        let (rest, means_m) = (1100..2900, moving_mean(&x, 25));
        // The means leave a band of two deviations to each side in one of twenty places, and cross it in fewer.
        assert!(path_m(&found[rest.clone()]) < 0.1 * path_m(&means_m[rest]));
        assert!((found[500] - x[500]).abs() < 1.0e-5, "{}", found[500]);
    }

    #[test]
    fn noise_is_found_under_a_motion() {
        let mut generator = Pcg64Mcg::seed_from_u64(5);
        let motion = |index: u32| 2.0e-3 * (f64::from(index) * 0.05).sin() + f64::from(index) * 1.0e-6;
        let x: Vec<f64> = (0..20_000).map(|index| motion(index) + 2.0e-6 * normal(&mut generator)).collect();
        let found = noise_of_displacement(&x);
        // A median of 20 000 correlated samples has about 1 % of error.
        assert!((found / 2.0e-6 - 1.0).abs() < 0.05, "{found}");
    }
}
