//! Uncertainty of fitted parameters, and structure of residuals.
//!
//! The residuals of successive cells are correlated: the cells are means over overlapping windows, and the noise of the device
//! may be filtered. Their variance differs as well: noise of the displacement has more effect where the object is stiff. The
//! variance of a coordinate is thus that of the sum of its influences, the rows of `A⁻¹ Jᵀ r` with the normal matrix `A`, as a
//! correlated series: its first-order autoregression is removed (prewhitening, Andrews and Monahan 1992), the autocovariances of
//! the rest are summed with decreasing weights (Newey and West 1987) up to a lag that follows from the autocorrelation (Andrews
//! 1991), and the autoregression is restored. Without prewhitening the sum misses a part of the correlation, and the intervals
//! are too narrow. Each residual is divided by one less its leverage, as in a jackknife (MacKinnon and White 1985): few cells
//! determine the contact, and the fit follows these cells.

use crate::fit::Fit;
use crate::linear_system::invert;
use nalgebra::DMatrix;

/// Quantile of the normal distribution for a two-sided interval of 95 %.
const QUANTILE_95: f64 = 1.959_963_985;
/// Upper limit of the restored autocorrelation of influences: above, the series is close to a random walk.
const MOST_CORRELATION: f64 = 0.97;

/// Returns the half-width of the 95 % interval of each coordinate of the fit; `None` if the measurement does not determine them.
pub(crate) fn half_widths(fit: &Fit, noise_n: f64) -> Option<Vec<f64>> {
    let (count, width) = fit.jacobian_n.shape();
    let weight = 1.0 / (noise_n * noise_n);
    let normal = fit.jacobian_n.tr_mul(&fit.jacobian_n) * weight + DMatrix::from_diagonal(&fit.precisions);
    let inverse = invert(normal)?;
    let gains = &fit.jacobian_n * &inverse * weight;
    let influences = DMatrix::from_fn(count, width, |cell, column| {
        let leverage = gains.row(cell).dot(&fit.jacobian_n.row(cell));
        gains[(cell, column)] * fit.residuals_n[cell] / (1.0 - leverage).max(0.1)
    });
    let of_priors = &inverse * DMatrix::from_diagonal(&fit.precisions) * &inverse;
    let widths = influences.column_iter().enumerate().map(|(column, influence)| {
        let Sum { variance, lags } = variance_of_sum(influence.as_slice());
        let free = (count as f64 - width as f64).max(1.0);
        quantile_95(free / (1.0 + lags as f64)) * (variance + of_priors[(column, column)]).max(0.0).sqrt()
    });
    Some(widths.collect())
}

/// Variance of the sum of a correlated series, and the number of lags used.
struct Sum {
    variance: f64,
    lags: usize,
}

fn variance_of_sum(values: &[f64]) -> Sum {
    let correlation = correlation(values);
    let rest: Vec<f64> = values.windows(2).map(|pair| pair[1] - correlation * pair[0]).collect();
    let lags = bandwidth(&rest).min(values.len() / 4);
    let covariances = (1..=lags).map(|lag| {
        let share = 1.0 - lag as f64 / (lags as f64 + 1.0);
        2.0 * share * autocovariance(&rest, lag)
    });
    let density = autocovariance(&rest, 0) + covariances.sum::<f64>();
    let kept = 1.0 - correlation;
    Sum { variance: density * values.len() as f64 / (kept * kept), lags }
}

/// Structure of residuals: the part that is not noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Structure {
    /// Root mean square of the part of the residuals that persists over some cells, N.
    pub(crate) rms_n: f64,
    /// Mean square of this part over its standard deviation under white noise.
    pub(crate) deviations: f64,
}

/// Measures the structure of residuals: their covariance two and three cells apart, so that the short correlation of filtered
/// noise does not count.
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

/// Returns the autocorrelation at lag one.
fn correlation(values: &[f64]) -> f64 {
    let square = autocovariance(values, 0);
    let ratio = if square > 0.0 { autocovariance(values, 1) / square } else { 0.0 };
    ratio.clamp(-MOST_CORRELATION, MOST_CORRELATION)
}

/// Returns the number of lags for a first-order autocorrelation (Andrews 1991, equations 5.3 and 6.4).
fn bandwidth(values: &[f64]) -> usize {
    let correlation = correlation(values);
    let (minus, plus) = (1.0 - correlation, 1.0 + correlation);
    let alpha = 4.0 * correlation * correlation / (minus * minus * plus * plus);
    let lags = 1.1447 * flotor_hal::math::cbrt(alpha * values.len() as f64);
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
