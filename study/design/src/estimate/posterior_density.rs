//! Posterior of threshold, criterion and lapse rate by quadrature over the whole range of each.
//!
//! A grid with fixed ends would truncate the posterior if the answers carry little information. Here the range of the threshold
//! is determined first: the range in which the posterior exceeds `e^-28` of its maximum.

use super::{Observation, Prior, unit_threshold};
use crate::answer::Judgement;
use flotor_statistics::distribution::normal_below;
use flotor_statistics::quadrature::{Density, Node, gauss_legendre};

/// Half-width of the search for the threshold's range, in standard deviations of the prior; below, the step.
const REACH: i32 = 8;
const STEP: f64 = 0.5;
/// Drop of the log posterior below its maximum at which the range ends.
const NEGLIGIBLE: f64 = 28.0;
/// Upper end of the criterion, in standard deviations above its mode.
const CRITERION_REACH: f64 = 7.0;
/// Half of the 95 % quantile of chi-square with one degree of freedom: drop of the log-likelihood at the ends of a 95 %
/// likelihood-ratio interval.
const BOUND: f64 = 1.920_729_410_347_062;
/// Lower limit of the probability of an answer; prevents underflow.
const LEAST_PROBABILITY: f64 = 1.0e-30;
/// Maximum number of answers per group, so that the product of their probabilities does not underflow.
const EQUAL_MOST: usize = 8;
/// Limit below which a product of probabilities is converted to its logarithm.
const LEAST_PRODUCT: f64 = 1.0e-60;

/// Prior of the lapse rate.
#[derive(Clone, Copy, Debug)]
pub(super) enum LapsePrior {
    /// Known lapse rate.
    Known(f64),
    /// Exponential distribution with this mean, truncated at 1.
    Exponential(f64),
}

/// Number of quadrature nodes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Nodes {
    pub(super) thresholds: usize,
    pub(super) criteria: usize,
    pub(super) lapses: usize,
}

impl Nodes {
    /// Node counts for the search of the range.
    const OF_THE_SEARCH: Self = Self { thresholds: 0, criteria: 12, lapses: 12 };
}

/// Quadrature node of the criterion, with the logarithm of quadrature weight times prior density.
struct Criterion {
    value: f64,
    /// Threshold of an observer with sigma 1 and this criterion.
    unit: f64,
    log_weight: f64,
}

/// Lapse rate at a quadrature node, with the logarithm of its prior density over the square root of the lapse rate.
struct Lapse {
    value: f64,
    node: Node,
    log_density: f64,
}

/// Answers to equal differences, counted by kind.
struct Equal {
    delta: f64,
    counts: [usize; 3],
}

/// Answers, and the quadrature nodes of criterion and lapse rate.
struct Model<'a> {
    prior: &'a Prior,
    answers: Vec<Equal>,
    criteria: Vec<Criterion>,
    lapses: Vec<Lapse>,
}

/// Marginal densities and means of the posterior.
pub(super) struct PosteriorDensity {
    /// Posterior density of the logarithm of the threshold.
    pub(super) log_threshold: Density,
    /// Posterior density of the square root of the lapse rate; `None` if the lapse rate is known.
    pub(super) root_lapse: Option<Density>,
    /// Posterior means: log threshold, log sigma, criterion, lapse rate.
    pub(super) mean_log_threshold: f64,
    pub(super) mean_log_sigma: f64,
    pub(super) mean_criterion: f64,
    pub(super) mean_lapse: f64,
    /// True where the answers alone bound the threshold, `[below, above]`: the limit of a zero or infinite threshold lies
    /// outside the 95 % likelihood-ratio interval.
    pub(super) is_bounded: [bool; 2],
}

impl<'a> Model<'a> {
    fn new(
        observations: &[Observation],
        prior: &'a Prior,
        target: f64,
        lapse_prior: LapsePrior,
        nodes: Nodes,
    ) -> Self {
        let most = prior.criterion_mode + CRITERION_REACH * prior.criterion_spread;
        let criterion = |node: Node| Criterion {
            value: node.at,
            unit: unit_threshold(node.at, target),
            log_weight: libm::log(node.weight)
                + prior.log_density(libm::log(prior.threshold_median), node.at),
        };
        let criteria = gauss_legendre(nodes.criteria, [0.0, most]).into_iter().map(criterion).collect();
        let lapses = match lapse_prior {
            LapsePrior::Known(value) => {
                vec![Lapse { value, node: Node { at: value.sqrt(), weight: 1.0 }, log_density: 0.0 }]
            }
            LapsePrior::Exponential(mean) => {
                let lapse = |node: Node| {
                    let value = node.at * node.at;
                    Lapse { value, node, log_density: libm::log(2.0 * node.at) - value / mean }
                };
                gauss_legendre(nodes.lapses, [0.0, 1.0]).into_iter().map(lapse).collect()
            }
        };
        Self { prior, answers: equal(observations), criteria, lapses }
    }

    fn log_prior(&self, log_threshold: f64) -> f64 {
        self.prior.log_density(log_threshold, self.prior.criterion_mode)
    }

    /// Returns the logarithms of likelihood times prior density for each criterion and lapse rate (lapse rate fastest); the
    /// quadrature weight of the lapse rate is not included.
    fn cells(&self, log_threshold: f64) -> Vec<f64> {
        let threshold = libm::exp(log_threshold);
        let mut cells = Vec::with_capacity(self.criteria.len() * self.lapses.len());
        for criterion in &self.criteria {
            let of_answer = |answer: &Equal| {
                let evidence = answer.delta * criterion.unit / threshold;
                let named = [1.0, -1.0].map(|sign| normal_below(sign * evidence - criterion.value));
                (named, answer.counts)
            };
            let attentive: Vec<_> = self.answers.iter().map(of_answer).collect();
            for lapse in &self.lapses {
                let log = criterion.log_weight + lapse.log_density;
                cells.push(log + log_likelihood(&attentive, lapse.value));
            }
        }
        cells
    }

    /// Returns the log-likelihood of a threshold, marginalised over criterion and lapse rate, up to a constant.
    fn log_likelihood(&self, log_threshold: f64) -> f64 {
        let cells = self.cells(log_threshold);
        let most = cells.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let weights = self.lapses.iter().map(|lapse| lapse.node.weight).cycle();
        most + libm::log(
            cells.iter().zip(weights).map(|(cell, weight)| weight * libm::exp(cell - most)).sum(),
        )
    }
}

/// Returns the log-likelihood of answers, from the probabilities without lapses and the lapse rate.
fn log_likelihood(attentive: &[([f64; 2], [usize; 3])], lapse: f64) -> f64 {
    let (mut log, mut product) = (0.0, 1.0);
    for ([correct, wrong], counts) in attentive {
        let unsure = 1.0 - correct - wrong;
        let kept = 1.0 - lapse;
        let shares = [kept * correct + 0.5 * lapse, kept * wrong + 0.5 * lapse, kept * unsure];
        for (share, count) in shares.into_iter().zip(counts) {
            for _ in 0..*count {
                product *= share.max(LEAST_PROBABILITY);
            }
        }
        if product < LEAST_PRODUCT {
            log += libm::log(product);
            product = 1.0;
        }
    }
    log + libm::log(product)
}

/// Groups answers to equal differences, at most [`EQUAL_MOST`] per group.
fn equal(observations: &[Observation]) -> Vec<Equal> {
    let mut sorted = observations.to_vec();
    sorted.sort_by(|a, b| a.delta.total_cmp(&b.delta));
    let alike = sorted.chunk_by(|a, b| a.delta == b.delta).flat_map(|same| same.chunks(EQUAL_MOST));
    let group = |same: &[Observation]| {
        let count = |judgement| same.iter().filter(|one| one.judgement == judgement).count();
        let delta = same.first().map_or(0.0, |one| one.delta);
        Equal { delta, counts: Judgement::ALL.map(count) }
    };
    alike.map(group).collect()
}

impl PosteriorDensity {
    /// Computes the posterior given the answers.
    pub(super) fn new(
        observations: &[Observation],
        prior: &Prior,
        target: f64,
        lapse_prior: LapsePrior,
        nodes: Nodes,
    ) -> Self {
        let (range, is_bounded) =
            range(&Model::new(observations, prior, target, lapse_prior, Nodes::OF_THE_SEARCH));
        let model = Model::new(observations, prior, target, lapse_prior, nodes);
        let thresholds = gauss_legendre(nodes.thresholds, range);
        let rows: Vec<Vec<f64>> = thresholds
            .iter()
            .map(|node| {
                let before = model.log_prior(node.at);
                model.cells(node.at).into_iter().map(|cell| cell + before).collect()
            })
            .collect();
        let most = rows.iter().flatten().copied().fold(f64::NEG_INFINITY, f64::max);
        let mut by_threshold = vec![0.0; thresholds.len()];
        let mut by_criterion = vec![0.0; model.criteria.len()];
        let mut by_lapse = vec![0.0; model.lapses.len()];
        for ((node, row), threshold) in thresholds.iter().zip(&rows).zip(&mut by_threshold) {
            for (cells, criterion) in row.chunks(model.lapses.len()).zip(&mut by_criterion) {
                for ((cell, lapse), sum) in cells.iter().zip(&model.lapses).zip(&mut by_lapse) {
                    let density = libm::exp(cell - most);
                    *threshold += lapse.node.weight * density;
                    *criterion += node.weight * lapse.node.weight * density;
                    *sum += node.weight * density;
                }
            }
        }
        let total: f64 = by_criterion.iter().sum();
        let mean = |weights: &mut dyn Iterator<Item = (f64, f64)>| {
            weights.map(|(value, weight)| value * weight).sum::<f64>() / total
        };
        let of_threshold = |value: fn(&Node) -> f64| {
            let weighted = thresholds.iter().zip(&by_threshold);
            mean(&mut weighted.map(|(node, density)| (value(node), node.weight * density)))
        };
        let of_criterion = |value: fn(&Criterion) -> f64| {
            mean(&mut model.criteria.iter().zip(&by_criterion).map(|(one, weight)| (value(one), *weight)))
        };
        let lapses = model.lapses.iter().zip(&by_lapse);
        let mean_lapse = mean(&mut lapses.map(|(one, density)| (one.value, one.node.weight * density)));
        let mean_log_threshold = of_threshold(|node| node.at);
        let roots: Vec<Node> = model.lapses.iter().map(|lapse| lapse.node).collect();
        Self {
            log_threshold: Density::new(&thresholds, range, &by_threshold),
            root_lapse: matches!(lapse_prior, LapsePrior::Exponential(_))
                .then(|| Density::new(&roots, [0.0, 1.0], &by_lapse)),
            mean_log_threshold,
            // Sigma is the threshold over the criterion's unit threshold.
            mean_log_sigma: mean_log_threshold - of_criterion(|one| libm::log(one.unit)),
            mean_criterion: of_criterion(|one| one.value),
            mean_lapse,
            is_bounded,
        }
    }
}

/// Returns the range of the log threshold outside which the posterior is negligible, and for each end of the search whether the
/// likelihood there is below the bound of the 95 % likelihood-ratio interval.
fn range(model: &Model<'_>) -> ([f64; 2], [bool; 2]) {
    let (median, spread) = (libm::log(model.prior.threshold_median), model.prior.threshold_spread);
    let at = |step: i32| median + spread * STEP * f64::from(step);
    let ends = REACH * 2;
    let steps: Vec<i32> = (-ends..=ends).collect();
    let likelihoods: Vec<f64> = steps.iter().map(|step| model.log_likelihood(at(*step))).collect();
    let posterior: Vec<f64> =
        steps.iter().zip(&likelihoods).map(|(step, likely)| likely + model.log_prior(at(*step))).collect();
    let largest = |list: &[f64]| list.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let least = largest(&posterior) - NEGLIGIBLE;
    let matters = steps.iter().zip(&posterior).filter(|(_, log)| **log > least).map(|(step, _)| *step);
    let (low, high) = (matters.clone().min().unwrap_or(-ends), matters.max().unwrap_or(ends));
    let bound = largest(&likelihoods) - BOUND;
    let falls_off = |likelihood: Option<&f64>| likelihood.is_some_and(|likelihood| *likelihood < bound);
    ([at(low - 1), at(high + 1)], [falls_off(likelihoods.first()), falls_off(likelihoods.last())])
}
