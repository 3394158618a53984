//! Distributions: tail probabilities of the normal, Student's t, Fisher's F, chi-square and binomial distributions, and the quantiles of
//! the first two.

use crate::special::{regularised_beta, upper_gamma};
use std::f64::consts::{PI, SQRT_2};

/// Maximum number of steps of a quantile search; bisection alone needs 60.
const QUANTILE_STEPS_MOST: u32 = 200;

/// Returns the probability density of the standard normal distribution.
#[must_use]
pub fn normal_density(x: f64) -> f64 {
    libm::exp(-0.5 * x * x) / (2.0 * PI).sqrt()
}

/// Returns the cumulative distribution function of the standard normal distribution.
#[must_use]
pub fn normal_below(x: f64) -> f64 {
    0.5 * libm::erfc(-x / SQRT_2)
}

/// Returns the quantile of the standard normal distribution; infinite for a probability of 0 or 1, NaN outside.
#[must_use]
pub fn normal_quantile(probability: f64) -> f64 {
    if !(0.0..=1.0).contains(&probability) {
        return f64::NAN;
    }
    if probability > 0.5 {
        return -normal_quantile(1.0 - probability);
    }
    if probability == 0.0 {
        return f64::NEG_INFINITY;
    }
    // The smallest positive number is the probability below -38.5.
    let (mut low, mut high) = (-40.0, 0.0);
    for _ in 0..QUANTILE_STEPS_MOST {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if normal_below(middle) < probability {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Returns the p-value of a chi-square statistic with `df` degrees of freedom: the upper tail probability.
#[must_use]
pub fn chi_square_above(chi_square: f64, df: f64) -> f64 {
    upper_gamma(0.5 * df, 0.5 * chi_square)
}

/// Returns the two-sided p-value of Student's t with `df` degrees of freedom: the probability of a larger |t|.
#[must_use]
pub fn student_two_sided(t: f64, df: f64) -> f64 {
    if t.is_infinite() {
        return 0.0;
    }
    let square = t * t;
    regularised_beta(0.5 * df, 0.5, df / (df + square), square / (df + square))
}

/// Returns the two-sided quantile of Student's t: for probability 0.05, the half-width of a 95 % interval in standard errors.
/// Infinite for probability 0; NaN for a probability outside 0 to 1, or `df` not above 0.
#[must_use]
pub fn student_two_sided_quantile(probability: f64, df: f64) -> f64 {
    if !(0.0..=1.0).contains(&probability) || df.is_nan() || df <= 0.0 {
        return f64::NAN;
    }
    if probability == 0.0 {
        return f64::INFINITY;
    }
    // The tail falls with t: double until the quantile is bracketed, then bisect.
    let mut high = 1.0;
    while student_two_sided(high, df) > probability && high < f64::MAX / 4.0 {
        high *= 2.0;
    }
    let mut low = 0.0;
    for _ in 0..QUANTILE_STEPS_MOST {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if student_two_sided(middle, df) > probability {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Returns the probability of at least `successes` in `trials` independent trials with success probability `probability`: the
/// p-value of the one-sided binomial test.
#[must_use]
pub fn binomial_at_least(successes: usize, trials: usize, probability: f64) -> f64 {
    if successes == 0 {
        return 1.0;
    }
    if successes > trials {
        return 0.0;
    }
    let (k, n) = (crate::count(successes), crate::count(trials));
    regularised_beta(k, n - k + 1.0, probability, 1.0 - probability)
}

/// Returns the p-value of an F statistic with `df` and `error_df` degrees of freedom, not necessarily integers: the upper tail
/// probability.
#[must_use]
pub fn fisher_above(f: f64, df: f64, error_df: f64) -> f64 {
    if f.is_infinite() {
        return 0.0;
    }
    if f <= 0.0 {
        return 1.0;
    }
    let sum = error_df + df * f;
    regularised_beta(0.5 * error_df, 0.5 * df, error_df / sum, df * f / sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(found: f64, exact: f64, bound: f64) {
        assert!((found / exact - 1.0).abs() < bound, "{found} for {exact}");
    }

    /// With two degrees of freedom t has a closed form, with one it is Cauchy's.
    #[test]
    fn student_closed_forms() {
        for t in [1.0e-3_f64, 0.5, 1.0, 4.3, 60.0, 1.0e5] {
            let root = (t * t + 2.0).sqrt();
            near(student_two_sided(t, 2.0), 2.0 / (root * (root + t)), 1.0e-12);
            near(student_two_sided(t, 1.0), 2.0 / PI * (1.0 / t).atan(), 1.0e-12);
        }
    }

    #[test]
    fn fisher_is_the_square_of_student_and_quantiles_turn_back() {
        for df in [1.0, 3.5, 15.0, 154.0] {
            for t in [0.1, 1.0, 3.3, 12.0] {
                near(fisher_above(t * t, 1.0, df), student_two_sided(t, df), 1.0e-12);
                let probability = student_two_sided(t, df);
                near(student_two_sided_quantile(probability, df), t, 1.0e-11);
            }
        }
    }

    /// Chi-square with one degree of freedom is the square of a normal number, with two exponential.
    #[test]
    fn normal_quantiles_turn_back_and_chi_square_is_a_square() {
        for x in [-12.0, -3.0, -0.2, 0.0, 0.7, 2.0] {
            assert!((normal_quantile(normal_below(x)) - x).abs() < 1.0e-9 * (1.0 + x.abs()));
        }
        near(normal_quantile(0.975), 1.959_963_984_540_054, 1.0e-12);
        for x in [0.3_f64, 1.0, 2.5, 5.0] {
            near(chi_square_above(x * x, 1.0), 2.0 * normal_below(-x), 1.0e-12);
            near(chi_square_above(x, 2.0), (-0.5 * x).exp(), 1.0e-12);
        }
        assert_eq!((normal_quantile(0.0), normal_quantile(1.0)), (f64::NEG_INFINITY, f64::INFINITY));
        assert!(normal_quantile(1.1).is_nan());
    }

    #[test]
    fn binomial_tails_are_sums() {
        near(binomial_at_least(3, 4, 0.5), 5.0 / 16.0, 1.0e-13);
        near(binomial_at_least(48, 48, 0.5), libm::exp2(-48.0), 1.0e-12);
        near(binomial_at_least(1, 3, 0.2), 1.0 - 0.8 * 0.8 * 0.8, 1.0e-13);
        assert_eq!((binomial_at_least(0, 3, 0.2), binomial_at_least(4, 3, 0.2)), (1.0, 0.0));
    }
}
