//! Post-hoc comparisons of conditions: paired t-tests with a correction for multiple tests, and effect sizes.

use super::column;
use flotor_statistics::effect_size::{EffectSize, of_pairs};
use flotor_statistics::multiple::holm;
use flotor_statistics::t_test::{TTest, paired};
use flotor_statistics::{Outcome, StatisticsError};
use serde::Serialize;

/// Comparison of two conditions over subjects.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PostHoc {
    /// Compared conditions, as minuend and subtrahend: `h - vh, base 26`.
    pub comparison: String,
    /// Test of the difference.
    #[serde(flatten)]
    pub test: Outcome<PairTest>,
}

/// Test of the difference between two conditions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PairTest {
    /// Paired t-test of the difference.
    pub t: TTest,
    /// p-value after Holm's correction over all comparisons of the same kind (modalities, or levels).
    pub p_holm: f64,
    /// Cohen's d of the pairs with its 95 % confidence interval.
    pub d: EffectSize,
}

/// Compares pairs of conditions, each given by its name and the responses of all subjects in the first and in the second
/// condition; differences are first minus second. A difference that does not vary between subjects cannot be tested; it counts
/// in the family with a p of 1, so that a tie does not lower the p of another comparison.
pub(super) fn compare(pairs: impl IntoIterator<Item = (String, Vec<f64>, Vec<f64>)>) -> Vec<PostHoc> {
    let tested = pairs.into_iter().map(|(comparison, first, second)| (comparison, paired(&first, &second)));
    let tested: Vec<(String, Result<TTest, StatisticsError>)> = tested.collect();
    let p: Vec<f64> = tested.iter().map(|(_, test)| test.as_ref().map_or(1.0, |t| t.p)).collect();
    let of = |((comparison, test), p_holm): ((String, Result<TTest, _>), f64)| PostHoc {
        comparison,
        test: test.map(|t| PairTest { t, p_holm, d: of_pairs(&t) }).into(),
    };
    tested.into_iter().zip(holm(&p)).map(of).collect()
}

/// Compares the modalities at each level (haptics alone minus vision and haptics), from
/// `responses[subject][modality by level]`.
pub(super) fn modalities(name: &str, levels: &[f64], responses: &[Vec<f64>]) -> Vec<PostHoc> {
    compare(levels.iter().enumerate().map(|(index, level)| {
        let text = format!("h - vh, {name} {}", (level * 1.0e4).round() / 1.0e4);
        (text, column(responses, levels.len() + index), column(responses, index))
    }))
}

/// Compares each pair of levels (higher minus lower index), from `responses[subject][level]`.
pub(super) fn levels(name: &str, levels: &[f64], responses: &[Vec<f64>]) -> Vec<PostHoc> {
    let pair = |(low, high): (usize, usize)| {
        let text = format!("{name} {} - {}", levels[high], levels[low]);
        (text, column(responses, high), column(responses, low))
    };
    let pairs = (0..levels.len()).flat_map(|low| (low + 1..levels.len()).map(move |high| (low, high)));
    compare(pairs.map(pair))
}
