//! Descriptive statistics of a list of numbers.

use crate::distribution::student_two_sided_quantile;
use crate::{StatisticsError, check, count};
use serde::Serialize;

/// Returns the arithmetic mean by the corrected two-pass algorithm: adding the mean deviation from a first mean removes the
/// rounding error of that mean, also for large numbers with small differences. NaN for an empty list.
#[must_use]
pub fn mean(values: &[f64]) -> f64 {
    let n = count(values.len());
    let first = values.iter().sum::<f64>() / n;
    first + values.iter().map(|value| value - first).sum::<f64>() / n
}

/// Returns the sum of squared deviations from the mean; zero for an empty list.
#[must_use]
pub fn sum_of_squares(values: &[f64]) -> f64 {
    let mean = mean(values);
    values.iter().map(|value| (value - mean) * (value - mean)).sum()
}

/// Returns the sample standard deviation (divisor n - 1); NaN for a single value, zero for an empty list.
#[must_use]
pub fn deviation(values: &[f64]) -> f64 {
    (sum_of_squares(values) / (count(values.len()) - 1.0)).sqrt()
}

/// Mean with its standard error and confidence interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MeanInterval {
    /// Mean of the values.
    pub mean: f64,
    /// Sample standard deviation of the values.
    pub sd: f64,
    /// Standard error of the mean.
    pub se: f64,
    /// Lower and upper confidence limits, at the requested confidence level.
    pub interval: [f64; 2],
    /// Number of values.
    pub n: usize,
}

/// Computes the mean and its two-sided confidence interval by Student's t; `confidence` is the level, for example 0.95.
///
/// # Errors
/// If there are fewer than two values, or one is not finite.
pub fn mean_interval(values: &[f64], confidence: f64) -> Result<MeanInterval, StatisticsError> {
    check("a confidence interval", values, 2)?;
    let (mean, sd) = (mean(values), deviation(values));
    let se = sd / count(values.len()).sqrt();
    let half = se * student_two_sided_quantile(1.0 - confidence, count(values.len() - 1));
    Ok(MeanInterval { mean, sd, se, interval: [mean - half, mean + half], n: values.len() })
}
