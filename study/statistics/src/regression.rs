//! Simple linear regression.

use crate::describe::{mean, sum_of_squares};
use crate::distribution::{fisher_above, student_two_sided, student_two_sided_quantile};
use crate::{StatisticsError, check, check_lengths, count};
use serde::Serialize;

/// Straight line fitted by least squares.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Line {
    /// Ordinate of the line at abscissa zero.
    pub intercept: f64,
    /// Change of the ordinate per unit of the abscissa.
    pub slope: f64,
    /// Standard error of the intercept.
    pub intercept_se: f64,
    /// Standard error of the slope.
    pub slope_se: f64,
    /// 95 % confidence interval of the slope.
    pub slope_interval: [f64; 2],
    /// p-value of the slope: two-sided t-test against a true slope of zero.
    pub slope_p: f64,
    /// R²: fraction of the variance of the ordinates explained by the line; 0 if the ordinates do not vary.
    pub r_squared: f64,
    /// Standard deviation of the residuals, with [`Self::error_df`] as divisor.
    pub residual_sd: f64,
    /// F statistic of the slope, with 1 and [`Self::error_df`] degrees of freedom.
    pub f: f64,
    /// p-value of F, equal to [`Self::slope_p`] up to rounding.
    pub p: f64,
    /// Degrees of freedom of the residuals.
    pub error_df: f64,
}

/// Fits a straight line to the points `(x, y)` by least squares.
///
/// # Errors
/// If there are fewer than three points, the lists differ in length, a value is not finite, or the abscissae do not vary.
pub fn line(x: &[f64], y: &[f64]) -> Result<Line, StatisticsError> {
    const WHAT: &str = "a line";
    check(WHAT, x, 3)?;
    check(WHAT, y, 3)?;
    check_lengths(WHAT, x.len(), y.len())?;
    let (x_mean, y_mean) = (mean(x), mean(y));
    let (xx, yy) = (sum_of_squares(x), sum_of_squares(y));
    if xx == 0.0 {
        return Err(StatisticsError::Constant { what: WHAT });
    }
    let xy: f64 = x.iter().zip(y).map(|(x, y)| (x - x_mean) * (y - y_mean)).sum();
    let slope = xy / xx;
    // Sum the squared residuals directly: a difference of sums cancels for a good fit.
    let residual = |(x, y): (&f64, &f64)| (y - y_mean) - slope * (x - x_mean);
    let residual_squares: f64 = x.iter().zip(y).map(residual).map(|r| r * r).sum();
    let n = count(x.len());
    let error_df = n - 2.0;
    let variance = residual_squares / error_df;
    let slope_se = (variance / xx).sqrt();
    let half = slope_se * student_two_sided_quantile(0.05, error_df);
    let f = slope * slope * xx / variance;
    Ok(Line {
        intercept: y_mean - slope * x_mean,
        slope,
        intercept_se: (variance * (1.0 / n + x_mean * x_mean / xx)).sqrt(),
        slope_se,
        slope_interval: [slope - half, slope + half],
        slope_p: student_two_sided(slope / slope_se, error_df),
        r_squared: if yy > 0.0 { slope * slope * xx / yy } else { 0.0 },
        residual_sd: variance.sqrt(),
        f,
        p: fisher_above(f, 1.0, error_df),
        error_df,
    })
}
