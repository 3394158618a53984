//! How large an effect is, with a confidence interval: by inverting the noncentral t and F (Steiger and Fouladi 1997).

use crate::distribution::{normal_below, student_two_sided};
use crate::special::regularised_beta;
use crate::t_test::TTest;
use serde::Serialize;

/// An effect size with its 95 % confidence interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct EffectSize {
    /// The estimate.
    pub value: f64,
    /// Lower and upper end.
    pub interval: [f64; 2],
    /// How far the interval was searched for.
    #[serde(skip_serializing_if = "Reach::is_whole")]
    pub reach: Reach,
}

/// Whether both ends of an interval were found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reach {
    /// They were.
    Whole,
    /// An end is where the search ends ([`MOST_OF_T`], [`MOST_OF_F`]), and the true one lies farther out.
    OrWider,
}

impl Reach {
    fn of(ends: [f64; 2], most: f64) -> Self {
        // A bisection ends within an ulp.
        if ends.iter().any(|end| end.abs() > most * (1.0 - 1.0e-12)) { Self::OrWider } else { Self::Whole }
    }

    #[allow(clippy::trivially_copy_pass_by_ref)] // as serde asks
    fn is_whole(&self) -> bool {
        *self == Self::Whole
    }
}

/// Largest noncentrality of a t that is searched: beyond, the series underflows in doubles.
pub const MOST_OF_T: f64 = 37.0;
/// Largest noncentrality of an F that is searched, for the same reason.
pub const MOST_OF_F: f64 = 1400.0;

/// Tail of each side of an interval.
const TAIL: f64 = 0.025;
/// Halvings of a bisection: to the last bit of a double.
const HALVINGS: usize = 200;
/// Terms of a series: the noncentralities of experiments need hundreds.
const TERMS: u32 = 5000;

/// Cohen's d of pairs: the mean difference in standard deviations of the differences.
#[must_use]
pub fn of_pairs(t: &TTest) -> EffectSize {
    let root_n = (t.df + 1.0).sqrt();
    let ends = [1.0 - TAIL, TAIL].map(|below| noncentrality_of_t(t.value, t.df, below));
    let reach = Reach::of(ends, MOST_OF_T);
    EffectSize { value: t.value / root_n, interval: ends.map(|end| end / root_n), reach }
}

/// Partial eta squared of an F.
#[must_use]
pub fn partial_eta_squared(f: f64, df: f64, error_df: f64) -> EffectSize {
    let share = |noncentrality: f64| noncentrality / (noncentrality + df + error_df + 1.0);
    let ends = [1.0 - TAIL, TAIL].map(|below| noncentrality_of_f(f, df, error_df, below));
    let reach = Reach::of(ends, MOST_OF_F);
    EffectSize { value: f * df / (f * df + error_df), interval: ends.map(share), reach }
}

/// The noncentrality at which a t is as small as this with a probability.
fn noncentrality_of_t(t: f64, df: f64, below: f64) -> f64 {
    // The distribution moves up with the noncentrality.
    bisect([-MOST_OF_T, MOST_OF_T], |delta| noncentral_t_below(t, df, delta) > below)
}

/// The noncentrality at which an F is as small as this with a probability; 0 if it is never that large.
fn noncentrality_of_f(f: f64, df: f64, error_df: f64, below: f64) -> f64 {
    if noncentral_f_below(f, df, error_df, 0.0) <= below {
        return 0.0;
    }
    bisect([0.0, MOST_OF_F], |lambda| noncentral_f_below(f, df, error_df, lambda) > below)
}

/// Where a condition that holds at the lower end begins to fail.
fn bisect([mut low, mut high]: [f64; 2], holds: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if holds(middle) { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Probability of a noncentral F below a value: central ones, weighted by Poisson.
fn noncentral_f_below(f: f64, df: f64, error_df: f64, lambda: f64) -> f64 {
    let (x, y) = (df * f / (df * f + error_df), error_df / (df * f + error_df));
    let (half, mut sum) = (0.5 * lambda, 0.0);
    let mut weight = libm::exp(-half);
    for term in 0..TERMS {
        let term = f64::from(term);
        sum += weight * regularised_beta(0.5 * df + term, 0.5 * error_df, x, y);
        weight *= half / (term + 1.0);
        if term > half && weight < 1.0e-17 {
            break;
        }
    }
    sum
}

/// Probability of a noncentral t below a value (Lenth 1989, AS 243).
fn noncentral_t_below(t: f64, df: f64, delta: f64) -> f64 {
    if t < 0.0 {
        return 1.0 - noncentral_t_below(-t, df, -delta);
    }
    if delta == 0.0 {
        return 1.0 - 0.5 * student_two_sided(t, df);
    }
    let (x, y) = (t * t / (t * t + df), df / (t * t + df));
    let half = 0.5 * delta * delta;
    let mut even = libm::exp(-half);
    // delta / (sqrt(2) gamma(3/2)): gamma(3/2) is half of the root of pi.
    let mut odd = delta * even / (std::f64::consts::SQRT_2 * 0.5 * std::f64::consts::PI.sqrt());
    let mut sum = 0.0;
    for term in 0..TERMS {
        let term = f64::from(term);
        sum += even * regularised_beta(term + 0.5, 0.5 * df, x, y)
            + odd * regularised_beta(term + 1.0, 0.5 * df, x, y);
        even *= half / (term + 1.0);
        odd *= half / (term + 1.5);
        if term > half && even.max(odd.abs()) < 1.0e-17 {
            break;
        }
    }
    (normal_below(-delta) + 0.5 * sum).clamp(0.0, 1.0)
}
