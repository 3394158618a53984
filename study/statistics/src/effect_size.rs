//! Effect sizes with confidence intervals, by inverting the noncentral t and F distributions (Steiger and Fouladi 1997).

use crate::distribution::normal_below;
use crate::special::{beta_step, regularised_beta};
use crate::t_test::TTest;
use serde::Serialize;

/// Effect size with its 95 % confidence interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[must_use]
pub struct EffectSize {
    /// Point estimate.
    pub value: f64,
    /// Lower and upper confidence limits (95 %). A limit with a noncentrality beyond 1000 (t) or 10^6 (F) is infinite for
    /// Cohen's d and 1 for partial omega squared; the opposite limit is then conservative.
    pub interval: [f64; 2],
}

/// Largest magnitude of the noncentrality of t in the search.
const MOST_OF_T: f64 = 1.0e3;
/// Largest noncentrality of F in the search.
const MOST_OF_F: f64 = 1.0e6;
/// Probability beyond each confidence limit.
const TAIL: f64 = 0.025;
/// Maximum number of steps of a root search; ten to twenty are usual.
const STEPS_MOST: usize = 200;
/// Tolerance of a root: relative above 1, absolute below.
const WIDTH: f64 = 1.0e-13;

/// Returns Cohen's d of pairs with its confidence interval: the mean difference divided by the standard deviation of the
/// differences. `t` is the result of the paired t-test, and determines the sign.
pub fn of_pairs(t: &TTest) -> EffectSize {
    let root_n = (t.df + 1.0).sqrt();
    let [low, high] = [1.0 - TAIL, TAIL].map(|below| noncentrality_of_t(t.value, t.df, below));
    let ends = [low.min(MOST_OF_T), high.max(-MOST_OF_T)];
    EffectSize { value: t.value / root_n, interval: ends.map(|end| end / root_n) }
}

/// Returns partial omega squared with its confidence interval for an F with `df` and `error_df` degrees of freedom: the fraction
/// of the variance of effect and error in the population that the effect explains.
///
/// The value follows from the noncentrality `df (F - 1)`, for which the mean F of many error degrees of freedom equals the
/// observed F; the interval of the noncentrality is converted by the same formula. Eta squared is larger on average and may lie
/// outside this interval. An F below 1 gives the value 0.
pub fn partial_omega_squared(f: f64, df: f64, error_df: f64) -> EffectSize {
    let share = |noncentrality: f64| {
        if noncentrality.is_finite() { noncentrality / (noncentrality + df + error_df + 1.0) } else { 1.0 }
    };
    let [low, high] = [1.0 - TAIL, TAIL].map(|below| noncentrality_of_f(f, df, error_df, below));
    EffectSize { value: share((df * (f - 1.0)).max(0.0)), interval: [low.min(MOST_OF_F), high].map(share) }
}

/// Returns the noncentrality for which a smaller t has probability `below`; infinite if beyond the range of the search.
fn noncentrality_of_t(t: f64, df: f64, below: f64) -> f64 {
    // The probability falls as the noncentrality rises.
    let of = |delta: f64| noncentral_t_below(t, df, delta) - below;
    let (mut low, mut high) = (t - 1.0, t + 1.0);
    let mut width = 2.0;
    while of(low) < 0.0 {
        if low <= -MOST_OF_T {
            return f64::NEG_INFINITY;
        }
        width *= 2.0;
        (high, low) = (low, (low - width).max(-MOST_OF_T));
    }
    while of(high) > 0.0 {
        if high >= MOST_OF_T {
            return f64::INFINITY;
        }
        width *= 2.0;
        (low, high) = (high, (high + width).min(MOST_OF_T));
    }
    falling_root(of, low, high)
}

/// Returns the noncentrality for which a smaller F has probability `below`; 0 if the probability is smaller for every
/// noncentrality, infinite if beyond the range of the search.
fn noncentrality_of_f(f: f64, df: f64, error_df: f64, below: f64) -> f64 {
    let of = |lambda: f64| noncentral_f_below(f, df, error_df, lambda) - below;
    let (mut low, mut high) = (0.0, 1.0_f64.max(f * df).min(MOST_OF_F));
    if of(low) <= 0.0 {
        return 0.0;
    }
    while of(high) > 0.0 {
        if high >= MOST_OF_F {
            return f64::INFINITY;
        }
        (low, high) = (high, (2.0 * high).min(MOST_OF_F));
    }
    falling_root(of, low, high)
}

/// Returns the root of a decreasing function in a bracket (Dowell and Jarratt 1971, the Illinois method).
fn falling_root(of: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let (mut at_low, mut at_high) = (of(low), of(high));
    let mut last_raised_low = None;
    let mut root = low;
    for _ in 0..STEPS_MOST {
        let next = low + (high - low) * at_low / (at_low - at_high);
        let is_found = (next - root).abs() <= WIDTH * next.abs().max(1.0);
        root = next;
        let at = of(root);
        if is_found || at == 0.0 {
            break;
        }
        let raises_low = at > 0.0;
        if raises_low {
            (low, at_low) = (root, at);
        } else {
            (high, at_high) = (root, at);
        }
        // Illinois method: halve the value at an end that has stayed for two steps.
        match (last_raised_low == Some(raises_low), raises_low) {
            (true, true) => at_high *= 0.5,
            (true, false) => at_low *= 0.5,
            (false, _) => {}
        }
        last_raised_low = Some(raises_low);
    }
    root
}

/// Sums `weight(j) I_x(a + j, b)` over the counts j with significant Poisson weight; the weights of all other counts add up to
/// less than 1e-17.
///
/// `first` returns the weight of the first count, `ratio(j)` the ratio of the weights of j + 1 and j.
fn mixture(
    mean: f64,
    first: impl Fn(f64) -> f64,
    ratio: impl Fn(f64) -> f64,
    (a, b): (f64, f64),
    (x, y): (f64, f64),
) -> f64 {
    let reach = 9.0 * mean.sqrt() + 30.0;
    let (mut j, most) = ((mean - reach).floor().max(0.0), mean + reach);
    let (mut weight, mut beta, mut step) = (first(j), regularised_beta(a + j, b, x, y), 0.0);
    let mut sum = 0.0;
    while j <= most {
        sum += weight * beta;
        // A step that has underflowed may grow again.
        step = if step > f64::MIN_POSITIVE {
            step * x * (a + j - 1.0 + b) / (a + j)
        } else {
            beta_step(a + j, b, x, y)
        };
        beta = (beta - step).max(0.0);
        weight *= ratio(j);
        j += 1.0;
    }
    sum
}

/// Returns the cumulative distribution function of the noncentral F distribution: a Poisson mixture of incomplete beta
/// functions.
fn noncentral_f_below(f: f64, df: f64, error_df: f64, lambda: f64) -> f64 {
    let parts = (df * f / (df * f + error_df), error_df / (df * f + error_df));
    let half = 0.5 * lambda;
    mixture(half, |j| poisson(half, j), |j| half / (j + 1.0), (0.5 * df, 0.5 * error_df), parts)
}

/// Returns the cumulative distribution function of the noncentral t distribution (Lenth 1989, AS 243, summed about the largest
/// weights).
fn noncentral_t_below(t: f64, df: f64, delta: f64) -> f64 {
    if t < 0.0 {
        return 1.0 - noncentral_t_below(-t, df, -delta);
    }
    let parts = (t * t / (t * t + df), df / (t * t + df));
    let half = 0.5 * delta * delta;
    let even = mixture(half, |j| poisson(half, j), |j| half / (j + 1.0), (0.5, 0.5 * df), parts);
    // Gamma(j + 1) / Gamma(j + 3/2) converts a weight of the even part to one of the odd part.
    let odd = |j: f64| poisson(half, j) * libm::exp(libm::lgamma(j + 1.0) - libm::lgamma(j + 1.5));
    let odd = mixture(half, odd, |j| half / (j + 1.5), (1.0, 0.5 * df), parts);
    (normal_below(-delta) + 0.5 * (even + delta / std::f64::consts::SQRT_2 * odd)).clamp(0.0, 1.0)
}

/// Returns the probability of `count` in a Poisson distribution.
fn poisson(mean: f64, count: f64) -> f64 {
    if mean == 0.0 {
        return if count == 0.0 { 1.0 } else { 0.0 };
    }
    libm::exp(count * libm::log(mean) - mean - libm::lgamma(count + 1.0))
}
