//! Linear trend of an effect within subjects.

use crate::describe::{mean, sum_of_squares};
use crate::distribution::fisher_above;
use crate::regression;
use crate::t_test::one_sample;
use crate::{Outcome, ROUNDING, StatisticsError, check_lengths, count};
use serde::Serialize;

/// Least-squares line through the means at the levels of a within-subject factor.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LinearTrend {
    /// Change of the mean response per unit of the factor.
    pub slope: f64,
    /// Value of the line at zero.
    pub intercept: f64,
    /// R² of the trend: fraction of the variance of the means explained by the line.
    pub r_squared: f64,
    /// Test of the linear contrast; not testable for a single subject, or if the contrast is equal in all subjects.
    #[serde(flatten)]
    pub test: Outcome<ContrastTest>,
}

/// F-test of a contrast; the error is the variation of the contrast between subjects.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ContrastTest {
    /// F statistic of the contrast.
    pub f: f64,
    /// Degrees of freedom of the contrast: 1.
    pub df: f64,
    /// Degrees of freedom of the error: number of subjects minus 1.
    pub error_df: f64,
    /// p-value: probability of a larger F without a trend.
    pub p: f64,
}

/// Fits a line to the means of `responses[subject][level]` over the values `levels` of a factor, and tests the linear contrast.
///
/// # Errors
/// If there are fewer than three levels or no responses, a row has the wrong length, a value is not finite, or the levels or the
/// means do not vary.
pub fn linear(levels: &[f64], responses: &[Vec<f64>]) -> Result<LinearTrend, StatisticsError> {
    const WHAT: &str = "a linear trend";
    responses.iter().try_for_each(|row| check_lengths(WHAT, levels.len(), row.len()))?;
    let column =
        |level: usize| responses.iter().filter_map(|row| row.get(level).copied()).collect::<Vec<_>>();
    let means: Vec<f64> = (0..levels.len()).map(|level| mean(&column(level))).collect();
    let line = regression::line(levels, &means)?;
    let squares = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
    if sum_of_squares(&means) <= ROUNDING * squares(&means) {
        return Err(StatisticsError::EqualMeans);
    }
    let centre = mean(levels);
    let weighted = |row: &Vec<f64>| levels.iter().zip(row).map(|(x, y)| (x - centre) * y).collect::<Vec<_>>();
    let contrasts: Vec<f64> = responses.iter().map(|row| weighted(row).iter().sum()).collect();
    let rounding = ROUNDING * responses.iter().map(|row| squares(&weighted(row))).sum::<f64>();
    let test = if responses.len() > 1 && sum_of_squares(&contrasts) <= rounding {
        Err(StatisticsError::SameDifference)
    } else {
        one_sample(&contrasts, 0.0)
    };
    let error_df = count(responses.len()) - 1.0;
    let test = test.map(|test| {
        let f = test.value * test.value;
        ContrastTest { f, df: 1.0, error_df, p: fisher_above(f, 1.0, error_df) }
    });
    let test = test.into();
    Ok(LinearTrend { slope: line.slope, intercept: line.intercept, r_squared: line.r_squared, test })
}
