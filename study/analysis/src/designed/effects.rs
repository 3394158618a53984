//! Effects of the factors of a designed study.

use super::record::DesignRecord;
use flotor_statistics::anova::{BetweenFactor, Design as Model, Effect, SumOfSquares, WithinFactor, analyse};
use flotor_statistics::describe::mean;
use flotor_statistics::multiple::holm;
use flotor_statistics::rank::{RankTest, SignedRank, friedman, kruskal_wallis, signed_rank};
use flotor_statistics::{Outcome, StatisticsError};
use flotor_study_design::design::Design;
use flotor_study_design::factor::{Factor, Vary, combinations};
use serde::Serialize;

/// Effects of the factors.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DesignEffects {
    /// Number of subjects with a measure in every condition.
    pub subjects: usize,
    /// Analysis of variance (sums of squares of type III), or the reason for its absence.
    pub anova: Outcome<Vec<Effect>>,
    /// Tests by ranks: Friedman's of each factor within subjects, Kruskal and Wallis's of each factor between subjects, over the mean of
    /// each subject at each level.
    pub ranks: Vec<RankEffect>,
    /// Comparisons of the levels of each factor within subjects by Wilcoxon's test, with Holm's correction for each factor.
    pub pairs: Vec<LevelPair>,
}

/// Test by ranks of one factor.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RankEffect {
    /// Name of the factor.
    pub factor: String,
    /// Test, or the reason for its absence.
    pub test: Outcome<RankTest>,
}

/// Comparison of two levels of a factor.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LevelPair {
    /// Compared levels, as minuend and subtrahend: `delay 40 - 0`.
    pub comparison: String,
    /// Test, or the reason for its absence.
    pub test: Outcome<SignedRank>,
    /// p-value after Holm's correction; a comparison that cannot be tested counts with 1.
    pub p_holm: f64,
}

impl DesignEffects {
    /// Computes the effects from a row of measures for each subject, over the conditions within subjects with the last factor varying
    /// fastest.
    #[must_use]
    pub fn of(design: &Design, rows: &[(&DesignRecord, Vec<f64>)]) -> Self {
        let within: Vec<&Factor> = design.factors().iter().filter(|one| one.vary == Vary::Within).collect();
        let between: Vec<&Factor> = design.factors().iter().filter(|one| one.vary != Vary::Within).collect();
        let responses: Vec<Vec<f64>> = rows.iter().map(|(_, row)| row.clone()).collect();
        let counts: Vec<usize> = within.iter().map(|factor| factor.values.len()).collect();
        let groups: Vec<(&Factor, Vec<usize>)> =
            between.iter().map(|factor| (*factor, groups(factor, rows))).collect();
        let mut ranks: Vec<RankEffect> = Vec::new();
        let mut pairs: Vec<LevelPair> = Vec::new();
        for (index, factor) in within.iter().enumerate().filter(|(_, factor)| factor.values.len() > 1) {
            let levels = level_means(&responses, &counts, index);
            ranks.push(RankEffect { factor: factor.name.clone(), test: friedman(&levels).into() });
            pairs.extend(compare(factor, &levels));
        }
        for (factor, groups) in groups.iter().filter(|(factor, _)| factor.values.len() > 1) {
            let of_group = |group: usize| -> Vec<f64> {
                let members = groups.iter().zip(&responses).filter(|(own, _)| **own == group);
                members.map(|(_, row)| mean(row)).collect()
            };
            let split: Vec<Vec<f64>> = (0..factor.values.len()).map(of_group).collect();
            ranks.push(RankEffect { factor: factor.name.clone(), test: kruskal_wallis(&split).into() });
        }
        let anova = anova(&within, &groups, &responses).into();
        Self { subjects: rows.len(), anova, ranks, pairs }
    }
}

/// Returns the level of a factor between subjects of each subject, as an index.
fn groups(factor: &Factor, rows: &[(&DesignRecord, Vec<f64>)]) -> Vec<usize> {
    let level = |record: &DesignRecord| {
        let own = record.trials.first().and_then(|answered| answered.trial.condition.get(&factor.name));
        factor.values.iter().position(|value| Some(value) == own).unwrap_or(0)
    };
    rows.iter().map(|(record, _)| level(record)).collect()
}

fn anova(
    within: &[&Factor],
    between: &[(&Factor, Vec<usize>)],
    responses: &[Vec<f64>],
) -> Result<Vec<Effect>, StatisticsError> {
    let has_levels = |factor: &&&Factor| factor.values.len() > 1;
    let within: Vec<WithinFactor> = within
        .iter()
        .filter(has_levels)
        .map(|factor| WithinFactor { name: factor.name.clone(), levels: factor.values.len() })
        .collect();
    let between: Vec<BetweenFactor> = between
        .iter()
        .filter(|(factor, _)| factor.values.len() > 1)
        .map(|(factor, groups)| BetweenFactor { name: factor.name.clone(), groups: groups.clone() })
        .collect();
    if within.is_empty() && between.is_empty() {
        return Err(StatisticsError::Design("no factor has two levels, so there is no effect".to_owned()));
    }
    Ok(analyse(&Model::new(between, within, responses)?, SumOfSquares::Three))
}

/// Returns the mean of each subject at each level of the factor with this index, over all other conditions.
fn level_means(responses: &[Vec<f64>], counts: &[usize], index: usize) -> Vec<Vec<f64>> {
    let levels = counts.get(index).copied().unwrap_or(0);
    let cells = combinations(counts);
    let of_row = |row: &Vec<f64>| {
        let at = |level: usize| {
            let here = cells.iter().zip(row).filter(|(cell, _)| cell.get(index) == Some(&level));
            mean(&here.map(|(_, value)| *value).collect::<Vec<_>>())
        };
        (0..levels).map(at).collect()
    };
    responses.iter().map(of_row).collect()
}

/// Compares each pair of levels, the later minus the earlier one.
fn compare(factor: &Factor, levels: &[Vec<f64>]) -> Vec<LevelPair> {
    let column = |level: usize| levels.iter().filter_map(|row| row.get(level).copied()).collect::<Vec<f64>>();
    let count = factor.values.len();
    let pairs = (0..count).flat_map(|low| (low + 1..count).map(move |high| (low, high)));
    let tested: Vec<(String, Result<SignedRank, StatisticsError>)> = pairs
        .map(|(low, high)| {
            let name = |level: usize| factor.values.get(level).map_or(String::new(), ToString::to_string);
            let comparison = format!("{} {} - {}", factor.name, name(high), name(low));
            (comparison, signed_rank(&column(high), &column(low)))
        })
        .collect();
    let p: Vec<f64> = tested.iter().map(|(_, test)| test.as_ref().map_or(1.0, |test| test.p)).collect();
    let pair = |((comparison, test), p_holm): ((String, Result<SignedRank, StatisticsError>), f64)| {
        LevelPair { comparison, test: test.into(), p_holm }
    };
    tested.into_iter().zip(holm(&p)).map(pair).collect()
}
