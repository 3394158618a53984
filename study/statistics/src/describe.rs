//! A list of numbers in a few.

use crate::distribution::student_two_sided_quantile;
use crate::{StatisticsError, check, count};
use serde::Serialize;

/// Mean by the corrected two-pass rule: the mean of the differences from a first mean takes back what rounding left,
/// also where the numbers are large and their differences small. NaN for an empty list.
#[must_use]
pub fn mean(values: &[f64]) -> f64 {
    let n = count(values.len());
    let first = values.iter().sum::<f64>() / n;
    first + values.iter().map(|value| value - first).sum::<f64>() / n
}

/// Sum of squared differences from the mean.
#[must_use]
pub fn sum_of_squares(values: &[f64]) -> f64 {
    let mean = mean(values);
    values.iter().map(|value| (value - mean) * (value - mean)).sum()
}

/// Standard deviation of a sample (n - 1); NaN for fewer than two values.
#[must_use]
pub fn deviation(values: &[f64]) -> f64 {
    (sum_of_squares(values) / (count(values.len()) - 1.0)).sqrt()
}

/// A mean and how well it is known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MeanInterval {
    /// Mean.
    pub mean: f64,
    /// Standard deviation of the values.
    pub sd: f64,
    /// Standard error of the mean.
    pub se: f64,
    /// Lower and upper end of the confidence interval.
    pub interval: [f64; 2],
    /// How many values.
    pub n: usize,
}

/// Mean with its confidence interval by Student's t.
///
/// # Errors
/// Fewer than two values, or one that is not finite.
pub fn mean_interval(values: &[f64], confidence: f64) -> Result<MeanInterval, StatisticsError> {
    check("a confidence interval", values, 2)?;
    let (mean, sd) = (mean(values), deviation(values));
    let se = sd / count(values.len()).sqrt();
    let half = se * student_two_sided_quantile(1.0 - confidence, count(values.len() - 1));
    Ok(MeanInterval { mean, sd, se, interval: [mean - half, mean + half], n: values.len() })
}

/// The value below which this share of a list lies, by linear interpolation (type 7 of Hyndman and Fan, as R and
/// NumPy do). NaN for an empty list.
#[must_use]
pub fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let place = share.clamp(0.0, 1.0) * count(last);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between 0 and the last index
    let below = place.floor() as usize;
    let low = sorted.get(below).copied().unwrap_or(f64::NAN);
    let high = sorted.get(below + 1).copied().unwrap_or(low);
    low + (place - place.floor()) * (high - low)
}
