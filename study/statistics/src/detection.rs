//! Sensitivity and criterion of yes/no answers (signal detection with equal variances).

use crate::distribution::{normal_density, normal_quantile};
use crate::{StatisticsError, count};
use serde::Serialize;

/// Sensitivity and criterion with confidence intervals of 95 %.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Detection {
    /// Number of trials with the signal.
    pub signals: usize,
    /// Number of signals reported.
    pub hits: usize,
    /// Number of trials without the signal.
    pub noises: usize,
    /// Number of signals reported without one.
    pub false_alarms: usize,
    /// Sensitivity: d' = z(H) - z(F).
    pub d_prime: f64,
    /// Confidence interval of the sensitivity.
    pub d_prime_interval: [f64; 2],
    /// Criterion: c = -(z(H) + z(F)) / 2; positive for a subject who says yes rarely.
    pub criterion: f64,
    /// Confidence interval of the criterion.
    pub criterion_interval: [f64; 2],
}

/// Computes sensitivity and criterion. Rates have the log-linear correction (Hautus 1995: half a count added to both answers), so that
/// rates of 0 and 1 have finite values; the variance of each z is that of Gourevitch and Galanter (1967) at the corrected rate.
///
/// # Errors
/// If there is no trial with or without the signal, or more reports than trials.
pub fn detection(
    [hits, signals]: [usize; 2],
    [false_alarms, noises]: [usize; 2],
) -> Result<Detection, StatisticsError> {
    let what = "sensitivity (d')";
    for (found, unit) in [(signals, "trials with the signal"), (noises, "trials without the signal")] {
        if found == 0 {
            return Err(StatisticsError::TooFew { what, unit, needed: 1, found });
        }
    }
    if hits > signals || false_alarms > noises {
        let (left, right) = if hits > signals { (hits, signals) } else { (false_alarms, noises) };
        return Err(StatisticsError::Lengths { what, left, right });
    }
    let z_and_variance = |reports: usize, trials: usize| {
        let rate = (count(reports) + 0.5) / (count(trials) + 1.0);
        let z = normal_quantile(rate);
        let density = normal_density(z);
        (z, rate * (1.0 - rate) / (count(trials) * density * density))
    };
    let ((z_hit, of_hit), (z_false, of_false)) =
        (z_and_variance(hits, signals), z_and_variance(false_alarms, noises));
    let half = -normal_quantile(0.025) * (of_hit + of_false).sqrt();
    let (d_prime, criterion) = (z_hit - z_false, -0.5 * (z_hit + z_false));
    Ok(Detection {
        signals,
        hits,
        noises,
        false_alarms,
        d_prime,
        d_prime_interval: [d_prime - half, d_prime + half],
        criterion,
        criterion_interval: [criterion - 0.5 * half, criterion + 0.5 * half],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 16 of 20 and 4 of 20: symmetric, so that the criterion is 0 and d' twice the z of the corrected rate.
    #[test]
    fn symmetric_answers_have_no_criterion() {
        let found = detection([16, 20], [4, 20]).expect("both kinds of trials");
        let z = normal_quantile(16.5 / 21.0);
        assert!((found.d_prime - 2.0 * z).abs() < 1.0e-12 && found.criterion.abs() < 1.0e-12);
        let [low, high] = found.d_prime_interval;
        assert!(low < found.d_prime && found.d_prime < high);
        // The criterion is half a sum of the same two numbers.
        assert!(
            ((found.criterion_interval[1] - found.criterion_interval[0]) * 2.0 - (high - low)).abs()
                < 1.0e-12
        );
    }

    #[test]
    fn rates_of_0_and_1_are_finite_and_impossible_counts_refused() {
        let found = detection([20, 20], [0, 20]).expect("both kinds of trials");
        assert!(found.d_prime.is_finite() && found.d_prime > 3.0);
        assert!(detection([0, 0], [1, 2]).is_err() && detection([1, 2], [0, 0]).is_err());
        assert!(detection([3, 2], [0, 2]).is_err() && detection([1, 2], [3, 2]).is_err());
    }
}
