//! Psychometric function of one subject in one condition: threshold and lapse rate with credible intervals, and goodness of
//! fit.
//!
//! The posterior combines the [`Prior`] of the other estimators with an exponential prior of the lapse rate, mean 2 % (as in
//! Kuss, Jäkel and Wichmann 2005). Credible intervals contain 95 % of the posterior.

use super::goodness_of_fit::{self, GoodnessOfFit};
use super::posterior_density::{LapsePrior, Nodes, PosteriorDensity};
use super::{Observation, Prior};
use crate::answer::Judgement;
use flotor_statistics::distribution::binomial_at_least;
use serde::Serialize;

const MEAN_LAPSE: f64 = 0.02;
/// Node counts for quantiles accurate to six digits.
const NODES: Nodes = Nodes { thresholds: 96, criteria: 40, lapses: 48 };

/// Psychometric function of one subject in one condition.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Psychometric {
    /// Number of answers.
    pub answers: usize,
    /// Number of answers other than "I don't know".
    pub named: usize,
    /// Number of wrong answers.
    pub wrong: usize,
    /// p-value of the test for performance below chance: probability of at least [`Self::wrong`] wrong answers among the
    /// [`Self::named`] ones by guessing (binomial, 0.5).
    pub p_chance: f64,
    /// Posterior median of the threshold, as a fraction of the base.
    pub threshold: f64,
    /// 95 % credible interval of the threshold, as fractions of the base; `None` at an end that only the prior bounds.
    pub threshold_interval: [Option<f64>; 2],
    /// Sides on which the answers do not bound the threshold; `None` if the answers bound both sides.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub not_bounded: Option<NotBounded>,
    /// Posterior mean of the criterion, in standard deviations of the noise.
    pub criterion: f64,
    /// Posterior mean of the lapse rate.
    pub lapse: f64,
    /// Upper bound of the lapse rate (97.5 % quantile of the posterior).
    pub lapse_most: f64,
    /// Goodness of fit of the observer with these estimates of threshold, criterion and lapse rate.
    pub fit: GoodnessOfFit,
}

/// Unbounded sides of a threshold's interval: sides on which the 95 % likelihood-ratio interval of the answers is unbounded, so
/// that only the prior bounds the threshold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum NotBounded {
    /// Not bounded below: the answers are compatible with arbitrarily small thresholds.
    Below,
    /// Not bounded above: the answers are compatible with arbitrarily large thresholds.
    Above,
    /// Bounded neither below nor above.
    Both,
}

impl NotBounded {
    /// Converts the flags of the lower and upper end; `None` if both are bounded.
    pub(super) fn of(is_bounded: [bool; 2]) -> Option<Self> {
        match is_bounded {
            [true, true] => None,
            [false, true] => Some(Self::Below),
            [true, false] => Some(Self::Above),
            [false, false] => Some(Self::Both),
        }
    }

    /// Returns a text for tables.
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::Below => "not bounded below by these answers",
            Self::Above => "not bounded above by these answers",
            Self::Both => "not bounded by these answers",
        }
    }
}

/// Estimates the psychometric function of answers; `target` is the value of `P(correct) + P(don't know) / 2` at the threshold.
/// Returns `None` without answers.
#[must_use]
pub fn psychometric(observations: &[Observation], prior: &Prior, target: f64) -> Option<Psychometric> {
    if observations.is_empty() {
        return None;
    }
    let posterior =
        PosteriorDensity::new(observations, prior, target, LapsePrior::Exponential(MEAN_LAPSE), NODES);
    let quantile = |share| libm::exp(posterior.log_threshold.quantile(share));
    let ends = [0.025, 0.975].map(quantile);
    let [is_below, is_above] = posterior.is_bounded;
    let (threshold, lapse) = (quantile(0.5), posterior.mean_lapse);
    let root = posterior.root_lapse.as_ref().map_or(f64::NAN, |density| density.quantile(0.975));
    let fitted = Prior { lapse, ..*prior }.observer(threshold, posterior.mean_criterion, target);
    let count = |judgement| observations.iter().filter(|one| one.judgement == judgement).count();
    let wrong = count(Judgement::Wrong);
    let named = wrong + count(Judgement::Correct);
    Some(Psychometric {
        answers: observations.len(),
        named,
        wrong,
        p_chance: binomial_at_least(wrong, named, 0.5),
        threshold,
        threshold_interval: [is_below.then_some(ends[0]), is_above.then_some(ends[1])],
        not_bounded: NotBounded::of(posterior.is_bounded),
        criterion: posterior.mean_criterion,
        lapse,
        lapse_most: root * root,
        fit: goodness_of_fit::of(observations, &fitted),
    })
}

#[cfg(test)]
mod tests;
