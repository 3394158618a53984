//! Student's t-tests: one sample, pairs, two groups.

use crate::describe::{deviation, mean, sum_of_squares};
use crate::distribution::{student_two_sided, student_two_sided_quantile};
use crate::{ROUNDING, StatisticsError, check, check_lengths, count};
use serde::Serialize;

/// Result of a two-sided t-test.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TTest {
    /// Degrees of freedom; in general not an integer with [`Variances::Separate`].
    pub df: f64,
    /// t statistic.
    pub value: f64,
    /// Two-sided p-value: probability of a larger |t| if the true difference is zero.
    pub p: f64,
    /// Estimated difference: first minus second mean, or mean minus expected value.
    pub difference: f64,
    /// 95 % confidence interval of the difference.
    pub interval: [f64; 2],
}

impl TTest {
    fn new(what: &'static str, difference: f64, se: f64, df: f64) -> Result<Self, StatisticsError> {
        if se == 0.0 {
            return Err(StatisticsError::Constant { what });
        }
        let value = difference / se;
        let half = se * student_two_sided_quantile(0.05, df);
        let interval = [difference - half, difference + half];
        Ok(Self { df, value, p: student_two_sided(value, df), difference, interval })
    }
}

/// Tests whether the mean of a sample differs from `expected`.
///
/// # Errors
/// If there are fewer than two values, the values do not vary, or one is not finite.
pub fn one_sample(values: &[f64], expected: f64) -> Result<TTest, StatisticsError> {
    const WHAT: &str = "a t-test";
    check(WHAT, values, 2)?;
    let n = count(values.len());
    TTest::new(WHAT, mean(values) - expected, deviation(values) / n.sqrt(), n - 1.0)
}

/// Tests whether the mean difference of pairs is zero. The difference is `first` minus `second`.
///
/// # Errors
/// Errors of [`one_sample`], or lists of different length; [`StatisticsError::NoDifference`] or
/// [`StatisticsError::SameDifference`] if the differences vary by rounding errors only.
pub fn paired(first: &[f64], second: &[f64]) -> Result<TTest, StatisticsError> {
    check_lengths("a paired t-test", first.len(), second.len())?;
    let differences: Vec<f64> = first.iter().zip(second).map(|(first, second)| first - second).collect();
    let squares = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
    let rounding = ROUNDING * (squares(first) + squares(second));
    if differences.len() > 1 && sum_of_squares(&differences) <= rounding {
        let is_none = squares(&differences) <= rounding;
        return Err(if is_none { StatisticsError::NoDifference } else { StatisticsError::SameDifference });
    }
    one_sample(&differences, 0.0)
}

/// Assumption on the variances of two groups.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variances {
    /// Equal variances, estimated from both groups together (Student).
    Pooled,
    /// Separate variances (Welch 1947), with Satterthwaite's degrees of freedom.
    Separate,
}

/// Tests whether the means of two groups differ. The difference is `first` minus `second`.
///
/// # Errors
/// If a group has fewer than two values, neither group varies, or a value is not finite.
pub fn two_groups(first: &[f64], second: &[f64], variances: Variances) -> Result<TTest, StatisticsError> {
    const WHAT: &str = "a t-test of two groups";
    check(WHAT, first, 2)?;
    check(WHAT, second, 2)?;
    let (n1, n2) = (count(first.len()), count(second.len()));
    let (squares1, squares2) = (sum_of_squares(first), sum_of_squares(second));
    let difference = mean(first) - mean(second);
    match variances {
        Variances::Pooled => {
            let df = n1 + n2 - 2.0;
            let variance = (squares1 + squares2) / df;
            TTest::new(WHAT, difference, (variance * (1.0 / n1 + 1.0 / n2)).sqrt(), df)
        }
        Variances::Separate => {
            let (part1, part2) = (squares1 / (n1 - 1.0) / n1, squares2 / (n2 - 1.0) / n2);
            let sum = part1 + part2;
            let df = sum * sum / (part1 * part1 / (n1 - 1.0) + part2 * part2 / (n2 - 1.0));
            TTest::new(WHAT, difference, sum.sqrt(), df)
        }
    }
}
