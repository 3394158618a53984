//! Correction of the bias from noise of the displacement.
//!
//! Noise of the displacement reduces the estimated dependence of the force on the velocity, however many samples there are. A fit of
//! the same measurement with as much noise again has that bias twice, and the difference is the correction (simulation and
//! extrapolation, Cook and Stefanski 1994). Pairs of opposite noise remove what is linear in it.

use crate::cells::Cells;
use crate::fit::{Device, Fit, Problem};
use flotor_hal::math;
use nalgebra::DVector;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::f64::consts::TAU;

/// Pairs of opposite noise.
const PAIRS: u64 = 2;

/// Returns the coordinates of a fit without the bias from noise of the displacement.
pub(crate) fn corrected(fit: &Fit, cells: &Cells<'_>, device: Device) -> Option<DVector<f64>> {
    let deviation_m = noise_of_displacement(cells.measurement().displacement_m());
    let rest = Problem::of(fit, cells, device, cells.scales()).step()?;
    let mut bias = DVector::zeros(fit.coordinates.len());
    for pair in 0..PAIRS {
        let mut generator = Pcg64Mcg::seed_from_u64(pair);
        let noise_m: Vec<f64> =
            (0..cells.time_s().len()).map(|_| deviation_m * normal(&mut generator)).collect();
        for sign in [1.0, -1.0] {
            let noisy = cells.measurement().displaced(noise_m.iter().map(|noise_m| sign * noise_m));
            let noisy = cells.of_same_size(&noisy)?;
            let problem = Problem::of(fit, &noisy, device, cells.scales());
            bias += (problem.step()? - &rest) / (2 * PAIRS) as f64;
        }
    }
    Some(&fit.coordinates + rest - bias)
}

/// Estimates the standard deviation of the displacement's noise: from third, fourth and fifth differences, the smallest, because a fast
/// motion adds to low orders, and rare corners to none (the median).
fn noise_of_displacement(displacement_m: &[f64]) -> f64 {
    /// Median of the absolute value of a normal variable over its standard deviation.
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
    fn noise_is_found_under_a_motion() {
        let mut generator = Pcg64Mcg::seed_from_u64(5);
        let motion = |index: u32| 2.0e-3 * (f64::from(index) * 0.05).sin() + f64::from(index) * 1.0e-6;
        let x: Vec<f64> = (0..20_000).map(|index| motion(index) + 2.0e-6 * normal(&mut generator)).collect();
        let found = noise_of_displacement(&x);
        // A median of 20 000 correlated samples has about 1 % of error.
        assert!((found / 2.0e-6 - 1.0).abs() < 0.05, "{found}");
    }
}
