//! Psychometric function of counts: a cumulative normal over the level, by maximum likelihood, with intervals of the profile likelihood.
//!
//! The same maximum as `glm(cbind(positive, rest) ~ level, binomial(probit))` of R, in other parameters: the location is the level of 50 %,
//! the spread is the inverse of the slope.

use crate::distribution::{chi_square_above, normal_below, normal_density};
use crate::{StatisticsError, count};
use serde::Serialize;

/// Answers at one level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Counts {
    /// Level of the stimulus.
    pub level: f64,
    /// Number of positive answers; an answer may be half positive.
    pub positive: f64,
    /// Number of answers.
    pub answers: f64,
}

/// Psychometric function.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Probit {
    /// Level with half of the answers positive.
    pub location: f64,
    /// Interval of 95 %; `None` at an end that the answers do not bound.
    pub location_interval: [Option<f64>; 2],
    /// Standard deviation of the cumulative normal: the level rises by 0.674 of it from 50 to 75 %.
    pub spread: f64,
    /// Interval of 95 %; `None` at an end that the answers do not bound.
    pub spread_interval: [Option<f64>; 2],
    /// Deviance from the observed shares.
    pub deviance: f64,
    /// Degrees of freedom of the deviance; 0 for two levels.
    pub df: f64,
    /// p-value of the deviance; `None` for two levels. Approximate for few answers at a level.
    pub p: Option<f64>,
}

/// 95 % quantile of chi-square with one degree of freedom.
const LIKELIHOOD_RATIO: f64 = 3.841_458_820_694_124;
/// Largest spread, in multiples of the range of the levels, of a bounded interval: with a larger spread the function is flat over
/// the levels.
const WIDEST: f64 = 1.0e3;
/// Relative rounding of a log-likelihood: a few hundred roundings of its terms.
const ROUNDING: f64 = 1.0e-13;
/// Number of steps of Fisher scoring, of a search for a maximum, and of a bisection.
const STEPS: u32 = 200;
/// Number of doublings in the search for the end of an interval.
const DOUBLINGS: u32 = 60;

/// Fits a psychometric function.
///
/// # Errors
/// [`StatisticsError::TooFew`] for fewer than two levels with answers, [`StatisticsError::Separated`] if no finite slope fits best,
/// [`StatisticsError::NotRising`] if the share of positive answers does not rise.
pub fn probit(counts: &[Counts]) -> Result<Probit, StatisticsError> {
    let Scaled { counts, first, scale, levels } = Scaled::of(counts)?;
    let (location, spread) = maximum(&counts).ok_or(StatisticsError::NotRising)?;
    let best = log_likelihood(&counts, location, spread);
    let of_location = |location: f64| best_over_spread(&counts, location, spread);
    let of_spread = |log_spread: f64| best_over_location(&counts, libm::exp(log_spread), location);
    let location_interval = ends(location, spread, best, of_location);
    let spread_interval = ends(libm::log(spread), 1.0, best, of_spread);
    let df = count(levels) - 2.0;
    let deviance = (2.0 * (saturated(&counts) - best)).max(0.0);
    Ok(Probit {
        location: first + scale * location,
        location_interval: location_interval.map(|end| end.map(|end| first + scale * end)),
        spread: scale * spread,
        spread_interval: spread_interval
            .map(|end| end.map(libm::exp).filter(|end| *end < WIDEST).map(|end| scale * end)),
        deviance,
        df,
        p: (df > 0.0).then(|| chi_square_above(deviance, df)),
    })
}

/// Fits a psychometric function without intervals; returns its spread. For many simulated studies.
///
/// # Errors
/// Errors of [`probit`].
pub fn spread(counts: &[Counts]) -> Result<f64, StatisticsError> {
    let scaled = Scaled::of(counts)?;
    let (_, spread) = maximum(&scaled.counts).ok_or(StatisticsError::NotRising)?;
    Ok(scaled.scale * spread)
}

/// Checked counts with levels from 0 to 1, so that the steps of a search do not depend on their unit.
struct Scaled {
    counts: Vec<Counts>,
    first: f64,
    scale: f64,
    /// Number of different levels.
    levels: usize,
}

impl Scaled {
    fn of(counts: &[Counts]) -> Result<Self, StatisticsError> {
        let used: Vec<Counts> = counts.iter().copied().filter(|one| one.answers > 0.0).collect();
        for (index, one) in used.iter().enumerate() {
            if ![one.level, one.positive, one.answers].iter().all(|number| number.is_finite()) {
                return Err(StatisticsError::NotFinite { what: "a psychometric function", index });
            }
        }
        let mut levels: Vec<f64> = used.iter().map(|one| one.level).collect();
        levels.sort_by(f64::total_cmp);
        levels.dedup();
        let [first, .., last] = levels[..] else {
            let (what, unit, found) = ("a psychometric function", "levels", levels.len());
            return Err(StatisticsError::TooFew { what, unit, needed: 2, found });
        };
        check_overlap(&used)?;
        let scale = last - first;
        let counts = used.iter().map(|one| Counts { level: (one.level - first) / scale, ..*one }).collect();
        Ok(Self { counts, first, scale, levels: levels.len() })
    }
}

/// Checks that positive answers occur below the highest level with another answer: otherwise the steepest slope fits best.
fn check_overlap(counts: &[Counts]) -> Result<(), StatisticsError> {
    let positive = counts.iter().filter(|one| one.positive > 0.0).map(|one| one.level);
    let other = counts.iter().filter(|one| one.positive < one.answers).map(|one| one.level);
    let lowest_positive = positive.clone().fold(f64::INFINITY, f64::min);
    let highest_positive = positive.fold(f64::NEG_INFINITY, f64::max);
    let lowest_other = other.clone().fold(f64::INFINITY, f64::min);
    let highest_other = other.fold(f64::NEG_INFINITY, f64::max);
    if lowest_positive.is_infinite() || lowest_other.is_infinite() || highest_positive <= lowest_other {
        return Err(StatisticsError::NotRising);
    }
    if highest_other <= lowest_positive { Err(StatisticsError::Separated) } else { Ok(()) }
}

/// Returns location and spread of maximum likelihood by Fisher scoring; `None` if the slope is not positive.
fn maximum(counts: &[Counts]) -> Option<(f64, f64)> {
    // The line of the corrected shares is close enough to begin with.
    let (mut intercept, mut slope) = (0.0, 0.0);
    let likelihood = |intercept: f64, slope: f64| -> f64 {
        counts.iter().map(|one| log_share(one, intercept + slope * one.level)).sum()
    };
    let mut before = likelihood(intercept, slope);
    for _ in 0..STEPS {
        let (mut weight, mut first, mut second) = (0.0, 0.0, 0.0);
        let (mut score, mut of_slope) = (0.0, 0.0);
        for one in counts {
            let eta = intercept + slope * one.level;
            let (below, above, density) = (normal_below(eta), normal_below(-eta), normal_density(eta));
            if below * above <= 0.0 {
                continue;
            }
            let information = one.answers * density * density / (below * above);
            let residual = (one.positive - one.answers * below) * density / (below * above);
            weight += information;
            first += information * one.level;
            second += information * one.level * one.level;
            score += residual;
            of_slope += residual * one.level;
        }
        let determinant = weight * second - first * first;
        if determinant <= 0.0 {
            break;
        }
        let steps = [
            (second * score - first * of_slope) / determinant,
            (weight * of_slope - first * score) / determinant,
        ];
        // Halve the step until the likelihood falls by no more than its rounding: at the maximum a step of 1e-8 changes only its last
        // digits, and scoring has to go on to the zero of the score.
        let least = before - ROUNDING * (1.0 + before.abs());
        let mut share = 1.0;
        let mut now = likelihood(intercept + steps[0], slope + steps[1]);
        while now < least && share > 1.0e-9 {
            share *= 0.5;
            now = likelihood(intercept + share * steps[0], slope + share * steps[1]);
        }
        if now < least {
            break;
        }
        intercept += share * steps[0];
        slope += share * steps[1];
        let is_settled =
            steps.iter().all(|step| step.abs() <= 1.0e-13 * (1.0 + intercept.abs() + slope.abs()));
        before = now;
        if is_settled {
            break;
        }
    }
    (slope > 1.0e-9).then(|| (-intercept / slope, 1.0 / slope))
}

/// Returns the logarithm of the probability of the answers at a level.
fn log_share(one: &Counts, eta: f64) -> f64 {
    let term = |number: f64, probability: f64| {
        if number == 0.0 { 0.0 } else { number * libm::log(probability.max(f64::MIN_POSITIVE)) }
    };
    term(one.positive, normal_below(eta)) + term(one.answers - one.positive, normal_below(-eta))
}

fn log_likelihood(counts: &[Counts], location: f64, spread: f64) -> f64 {
    counts.iter().map(|one| log_share(one, (one.level - location) / spread)).sum()
}

/// Returns the log-likelihood of the observed shares.
fn saturated(counts: &[Counts]) -> f64 {
    let term = |number: f64, all: f64| if number == 0.0 { 0.0 } else { number * libm::log(number / all) };
    counts
        .iter()
        .map(|one| term(one.positive, one.answers) + term(one.answers - one.positive, one.answers))
        .sum()
}

/// Returns the largest log-likelihood at a location. With a fixed location it is concave in the slope.
fn best_over_spread(counts: &[Counts], location: f64, spread: f64) -> f64 {
    let at = |log_spread: f64| log_likelihood(counts, location, libm::exp(log_spread));
    largest(libm::log(spread) - 12.0, libm::log(spread) + 12.0, at)
}

/// Returns the largest log-likelihood at a spread. With a fixed spread it is concave in the location.
fn best_over_location(counts: &[Counts], spread: f64, location: f64) -> f64 {
    let reach = 1.0 + location.abs() + 8.0 * spread;
    largest(location - reach, location + reach, |location| log_likelihood(counts, location, spread))
}

/// Returns the largest value of a function with one maximum, by golden section.
fn largest(mut low: f64, mut high: f64, of: impl Fn(f64) -> f64) -> f64 {
    const SHARE: f64 = 0.618_033_988_749_894_8;
    let (mut left, mut right) = (high - SHARE * (high - low), low + SHARE * (high - low));
    let (mut of_left, mut of_right) = (of(left), of(right));
    for _ in 0..STEPS {
        if of_left >= of_right {
            (high, right, of_right) = (right, left, of_left);
            left = high - SHARE * (high - low);
            of_left = of(left);
        } else {
            (low, left, of_left) = (left, right, of_right);
            right = low + SHARE * (high - low);
            of_right = of(right);
        }
        if high - low <= 1.0e-12 * (1.0 + low.abs() + high.abs()) {
            break;
        }
    }
    of_left.max(of_right)
}

/// Returns the two places around an estimate where the profile of the log-likelihood is lower by half the 95 % quantile of chi-square;
/// `None` where it never is.
fn ends(estimate: f64, unit: f64, best: f64, profile: impl Fn(f64) -> f64) -> [Option<f64>; 2] {
    let is_inside = |place: f64| 2.0 * (best - profile(place)) < LIKELIHOOD_RATIO;
    [-1.0, 1.0].map(|side| {
        let mut step = 0.1 * unit;
        let mut doublings = 0;
        while is_inside(estimate + side * step) {
            step *= 2.0;
            doublings += 1;
            if doublings == DOUBLINGS || step > 1.0e3 * unit.max(1.0) {
                return None;
            }
        }
        let (mut inside, mut outside) = (0.0, step);
        for _ in 0..STEPS {
            let middle = 0.5 * (inside + outside);
            if middle <= inside || middle >= outside {
                break;
            }
            if is_inside(estimate + side * middle) {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        Some(estimate + side * 0.5 * (inside + outside))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(rows: &[(f64, f64, f64)]) -> Vec<Counts> {
        rows.iter().map(|&(level, positive, answers)| Counts { level, positive, answers }).collect()
    }

    /// Two levels are fitted without a remainder: the line through both z values.
    #[test]
    fn two_levels_are_fitted_exactly() {
        let z = crate::distribution::normal_quantile(0.8);
        let found = probit(&counts(&[(-1.0, 20.0, 100.0), (1.0, 80.0, 100.0)])).expect("a function");
        assert!(found.location.abs() < 1.0e-9 && (found.spread - 1.0 / z).abs() < 1.0e-9, "{found:?}");
        assert!(found.deviance < 1.0e-9 && found.p.is_none());
        let [Some(low), Some(high)] = found.location_interval else { panic!("{found:?}") };
        assert!((low + high).abs() < 1.0e-6 && high > 0.0, "symmetric: {low} {high}");
    }

    /// Another unit of the levels changes only the unit of the results.
    #[test]
    fn the_unit_of_the_levels_does_not_matter() {
        let rows = [(0.0, 2.0, 20.0), (1.0, 6.0, 20.0), (2.0, 13.0, 20.0), (3.0, 19.0, 20.0)];
        let found = probit(&counts(&rows)).expect("a function");
        let other =
            probit(&counts(&rows.map(|(level, yes, all)| (1000.0 + 50.0 * level, yes, all)))).expect("one");
        assert!((other.location - (1000.0 + 50.0 * found.location)).abs() < 1.0e-6);
        assert!((other.spread - 50.0 * found.spread).abs() < 1.0e-6);
        let [Some(low), Some(high)] = other.spread_interval else { panic!("{other:?}") };
        assert!(low < other.spread && other.spread < high);
    }

    /// Answers that hardly rise with the level do not bound the spread from above.
    #[test]
    fn a_flat_function_has_no_widest_spread() {
        let found =
            probit(&counts(&[(0.0, 2.0, 6.0), (1.0, 3.0, 6.0), (2.0, 3.0, 6.0)])).expect("a function");
        let [Some(narrow), None] = found.spread_interval else { panic!("{found:?}") };
        assert!(narrow < found.spread);
    }

    #[test]
    fn answers_without_a_function_are_refused() {
        let separated = counts(&[(0.0, 0.0, 5.0), (1.0, 2.0, 5.0), (2.0, 5.0, 5.0)]);
        assert_eq!(probit(&separated), Err(StatisticsError::Separated));
        let falling = counts(&[(0.0, 4.0, 5.0), (1.0, 3.0, 5.0), (2.0, 1.0, 5.0)]);
        assert_eq!(probit(&falling), Err(StatisticsError::NotRising));
        let never = counts(&[(0.0, 0.0, 5.0), (1.0, 0.0, 5.0)]);
        assert_eq!(probit(&never), Err(StatisticsError::NotRising));
        assert!(matches!(probit(&counts(&[(1.0, 2.0, 5.0)])), Err(StatisticsError::TooFew { found: 1, .. })));
    }
}
