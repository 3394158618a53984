//! Which conditions differ: paired t-tests, corrected for how many there are, with the size of each difference.

use flotor_statistics::effect_size::{EffectSize, of_pairs};
use flotor_statistics::multiple::holm;
use flotor_statistics::t_test::{TTest, paired};
use serde::Serialize;

/// One comparison of two conditions, over subjects.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PostHoc {
    /// What is compared: `h - vh, base 26`.
    pub comparison: String,
    /// Paired t-test of the difference.
    pub t: TTest,
    /// Its p-value after Holm's correction for all comparisons of the same kind.
    pub p_holm: f64,
    /// Cohen's d of the pairs, with its 95 % interval.
    pub d: EffectSize,
}

/// Comparisons of one kind, each the responses under its two conditions, subject by subject. A difference that does not vary
/// between subjects cannot be tested and is left out.
pub(super) fn compare(pairs: impl IntoIterator<Item = (String, Vec<f64>, Vec<f64>)>) -> Vec<PostHoc> {
    let tested = pairs
        .into_iter()
        .filter_map(|(comparison, first, second)| paired(&first, &second).ok().map(|t| (comparison, t)));
    let tested: Vec<(String, TTest)> = tested.collect();
    let corrected = holm(&tested.iter().map(|(_, t)| t.p).collect::<Vec<_>>());
    let of = |((comparison, t), p_holm)| PostHoc { comparison, t, p_holm, d: of_pairs(&t) };
    tested.into_iter().zip(corrected).map(of).collect()
}

/// The modalities at each level, of `responses[subject][modality by level]`.
pub(super) fn modalities(name: &str, levels: &[f64], responses: &[Vec<f64>]) -> Vec<PostHoc> {
    let column = |index: usize| responses.iter().filter_map(|row| row.get(index).copied()).collect();
    compare(levels.iter().enumerate().map(|(index, level)| {
        (
            format!("h - vh, {name} {}", (level * 1.0e4).round() / 1.0e4),
            column(levels.len() + index),
            column(index),
        )
    }))
}

/// Each pair of levels, of `responses[subject][level]`.
pub(super) fn levels(name: &str, levels: &[f64], responses: &[Vec<f64>]) -> Vec<PostHoc> {
    let column =
        |index: usize| responses.iter().filter_map(|row| row.get(index).copied()).collect::<Vec<_>>();
    let pair = |(low, high): (usize, usize)| {
        let text = format!("{name} {} - {}", levels[high], levels[low]);
        (text, column(high), column(low))
    };
    let pairs = (0..levels.len()).flat_map(|low| (low + 1..levels.len()).map(move |high| (low, high)));
    compare(pairs.map(pair))
}
