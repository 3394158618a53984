//! Distributions: tail probabilities of the normal, Student's t, Fisher's F and binomial distributions, and quantiles of the
//! first two.

use crate::special::regularised_beta;
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

/// Returns the quantile of the standard normal distribution; infinite at probabilities 0 and 1, NaN outside this range.
///
/// Acklam's rational approximation (relative error 1.2e-9), refined by two steps of Halley's method.
#[must_use]
pub fn normal_quantile(probability: f64) -> f64 {
    if !(0.0..=1.0).contains(&probability) {
        return f64::NAN;
    }
    if probability == 0.0 {
        return f64::NEG_INFINITY;
    }
    if probability > 0.5 {
        // Exact by Sterbenz: 1 - p is representable for p in [1/2, 1].
        return -normal_quantile(1.0 - probability);
    }
    let mut x = acklam_lower(probability);
    for _ in 0..2 {
        let error = (normal_below(x) - probability) / normal_density(x);
        if error.is_finite() {
            x -= error / (1.0 + 0.5 * x * error);
        }
    }
    x
}

/// Returns Acklam's approximation of the normal quantile for probabilities up to 0.5.
fn acklam_lower(probability: f64) -> f64 {
    const TAIL: f64 = 0.024_25;
    const CENTRE_NUMERATOR: [f64; 6] = [
        -3.969_683_028_665_376e1,
        2.209_460_984_245_205e2,
        -2.759_285_104_469_687e2,
        1.383_577_518_672_69e2,
        -3.066_479_806_614_716e1,
        2.506_628_277_459_239,
    ];
    const CENTRE_DENOMINATOR: [f64; 6] = [
        -5.447_609_879_822_406e1,
        1.615_858_368_580_409e2,
        -1.556_989_798_598_866e2,
        6.680_131_188_771_972e1,
        -1.328_068_155_288_572e1,
        1.0,
    ];
    const TAIL_NUMERATOR: [f64; 6] = [
        -7.784_894_002_430_293e-3,
        -3.223_964_580_411_365e-1,
        -2.400_758_277_161_838,
        -2.549_732_539_343_734,
        4.374_664_141_464_968,
        2.938_163_982_698_783,
    ];
    const TAIL_DENOMINATOR: [f64; 5] = [
        7.784_695_709_041_462e-3,
        3.224_671_290_700_398e-1,
        2.445_134_137_142_996,
        3.754_408_661_907_416,
        1.0,
    ];
    let horner = |coefficients: &[f64], x: f64| coefficients.iter().fold(0.0, |sum, c| sum * x + c);
    if probability < TAIL {
        let q = (-2.0 * libm::log(probability)).sqrt();
        horner(&TAIL_NUMERATOR, q) / horner(&TAIL_DENOMINATOR, q)
    } else {
        let q = probability - 0.5;
        let r = q * q;
        q * horner(&CENTRE_NUMERATOR, r) / horner(&CENTRE_DENOMINATOR, r)
    }
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

    #[test]
    fn binomial_tails_are_sums() {
        near(binomial_at_least(3, 4, 0.5), 5.0 / 16.0, 1.0e-13);
        near(binomial_at_least(48, 48, 0.5), libm::exp2(-48.0), 1.0e-12);
        near(binomial_at_least(1, 3, 0.2), 1.0 - 0.8 * 0.8 * 0.8, 1.0e-13);
        assert_eq!((binomial_at_least(0, 3, 0.2), binomial_at_least(4, 3, 0.2)), (1.0, 0.0));
    }

    #[test]
    fn normal_quantile_turns_back_in_both_tails() {
        for x in [-37.0, -8.0, -2.5, -0.3, 0.3, 1.959_963_984_540_054, 5.0] {
            near(normal_quantile(normal_below(x)), x, 1.0e-9);
        }
        assert_eq!(normal_quantile(0.5), 0.0);
        assert!(normal_quantile(1.5).is_nan());
    }
}
