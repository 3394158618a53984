//! Errors of fitted parameters, and structure of residuals.
//!
//! The residuals of successive cells are correlated where the law is not exact or the noise is filtered. The covariance of the
//! coordinates is `A⁻¹ B A⁻¹` with the normal matrix `A`, and with `B` from the residuals themselves: products over neighbouring cells
//! with falling weights (Newey and West 1987), as many as the first autocorrelation asks for (Andrews 1991).

use crate::fit::Fit;
use crate::linear_system::invert;
use crate::measurement::mean;
use nalgebra::DMatrix;

/// Quantile of the normal distribution for a two-sided interval of 95 %.
const QUANTILE_95: f64 = 1.959_963_985;

/// Returns the half width of the 95 % interval of each coordinate of the fit; `None` if the measurement does not determine them.
pub(crate) fn half_widths(fit: &Fit, noise_n: f64) -> Option<Vec<f64>> {
    let (count, width) = fit.jacobian_n.shape();
    let weight = 1.0 / (noise_n * noise_n);
    let normal = fit.jacobian_n.tr_mul(&fit.jacobian_n) * weight + DMatrix::from_diagonal(&fit.precisions);
    let inverse = invert(normal)?;
    let scores = DMatrix::from_fn(count, width, |cell, column| {
        fit.jacobian_n[(cell, column)] * fit.residuals_n[cell] * weight
    });
    let mut middle = scores.tr_mul(&scores);
    let lags = bandwidth(&fit.residuals_n).min(count / 4);
    for lag in 1..=lags {
        let share = 1.0 - lag as f64 / (lags as f64 + 1.0);
        let product = scores.rows(lag, count - lag).tr_mul(&scores.rows(0, count - lag));
        middle += (&product + product.transpose()) * share;
    }
    let free = (count as f64 - width as f64).max(1.0);
    let middle = middle * (count as f64 / free) + DMatrix::from_diagonal(&fit.precisions);
    let covariance = &inverse * middle * &inverse;
    let quantile = quantile_95(free / (1.0 + lags as f64));
    Some(covariance.diagonal().iter().map(|variance| quantile * variance.max(0.0).sqrt()).collect())
}

/// Structure of residuals, which noise does not have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Structure {
    /// Root mean square of the part of the residuals that persists over some cells, N.
    pub(crate) rms_n: f64,
    /// The same mean square over its standard deviation under white noise.
    pub(crate) deviations: f64,
}

/// Measures the structure of residuals: their covariance two and three cells apart, so that the short correlation of a filtered noise
/// does not count.
pub(crate) fn structure(residuals_n: &[f64]) -> Structure {
    let count = residuals_n.len() as f64;
    let square = autocovariance(residuals_n, 0);
    let persistent = 0.5 * (autocovariance(residuals_n, 2) + autocovariance(residuals_n, 3));
    let deviation = square / (2.0 * count).sqrt();
    Structure {
        rms_n: persistent.max(0.0).sqrt(),
        deviations: if deviation > 0.0 { persistent / deviation } else { 0.0 },
    }
}

fn autocovariance(values: &[f64], lag: usize) -> f64 {
    let products: f64 = values.iter().zip(values.iter().skip(lag)).map(|(one, other)| one * other).sum();
    products / values.len() as f64
}

/// Returns the number of neighbours for a first-order autocorrelation (Andrews 1991, equations 5.3 and 6.4).
fn bandwidth(residuals: &[f64]) -> usize {
    let centre = mean(residuals);
    let centred: Vec<f64> = residuals.iter().map(|residual| residual - centre).collect();
    let square = autocovariance(&centred, 0);
    let correlation =
        if square > 0.0 { (autocovariance(&centred, 1) / square).clamp(-0.97, 0.97) } else { 0.0 };
    let (minus, plus) = (1.0 - correlation, 1.0 + correlation);
    let alpha = 4.0 * correlation * correlation / (minus * minus * plus * plus);
    let lags = 1.1447 * flotor_hal::math::cbrt(alpha * residuals.len() as f64);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // below the number of cells
    let lags = lags.floor() as usize;
    lags
}

/// Returns the two-sided 95 % quantile of Student's distribution (expansion of Cornish and Fisher).
fn quantile_95(freedom: f64) -> f64 {
    let (z, n) = (QUANTILE_95, freedom.max(2.0));
    let (z3, z5) = (z * z * z, z * z * z * z * z);
    z + (z3 + z) / (4.0 * n) + (5.0 * z5 + 16.0 * z3 + 3.0 * z) / (96.0 * n * n)
}
