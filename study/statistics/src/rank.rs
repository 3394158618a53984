//! Tests by ranks, without an assumption on the distribution: as `wilcox.test`, `friedman.test` and `kruskal.test` of R.

use crate::distribution::{chi_square_above, normal_below};
use crate::{StatisticsError, check, check_lengths, count};
use serde::Serialize;

/// Result of Wilcoxon's test of pairs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SignedRank {
    /// Sum of the ranks of positive differences.
    pub v: f64,
    /// Number of differences other than 0.
    pub n: usize,
    /// Two-sided p-value.
    pub p: f64,
    /// Source of the p-value.
    pub by: TailBy,
}

/// Source of a p-value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum TailBy {
    /// Distribution over all assignments of signs.
    Counting,
    /// Normal approximation with the corrections for ties and for continuity.
    Normal,
}

/// Result of a test of several groups or conditions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RankTest {
    /// Statistic, chi-square distributed for many values.
    pub chi_square: f64,
    /// Degrees of freedom.
    pub df: f64,
    /// p-value.
    pub p: f64,
}

/// Largest number of differences without ties whose signs are counted.
const COUNTED_MOST: usize = 49;

/// Returns the ranks of values, from 1; tied values have their mean rank. Also returns the sum of `t^3 - t` over the groups of `t` ties.
fn ranks(values: &[f64]) -> (Vec<f64>, f64) {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut ranks = vec![0.0; values.len()];
    let (mut start, mut ties) = (0, 0.0);
    while start < order.len() {
        let same = order[start..].iter().take_while(|index| values[**index] == values[order[start]]).count();
        let t = count(same);
        // Ranks start + 1 to start + t, with their mean.
        let mean = count(start) + 0.5 * (t + 1.0);
        order[start..start + same].iter().for_each(|index| ranks[*index] = mean);
        ties += t * t * t - t;
        start += same;
    }
    (ranks, ties)
}

/// Tests whether the differences of pairs, first minus second, are symmetric about 0 (Wilcoxon 1945).
///
/// # Errors
/// If the lists differ in length, are empty, or have a value that is not finite; [`StatisticsError::NoDifference`] if all differences
/// are 0.
pub fn signed_rank(first: &[f64], second: &[f64]) -> Result<SignedRank, StatisticsError> {
    const WHAT: &str = "Wilcoxon's test";
    check_lengths(WHAT, first.len(), second.len())?;
    check(WHAT, first, 1)?;
    check(WHAT, second, 1)?;
    let all = first.iter().zip(second).map(|(first, second)| first - second);
    let differences: Vec<f64> = all.filter(|difference| *difference != 0.0).collect();
    if differences.is_empty() {
        return Err(StatisticsError::NoDifference);
    }
    let magnitudes: Vec<f64> = differences.iter().map(|difference| difference.abs()).collect();
    let (ranks, ties) = ranks(&magnitudes);
    let positive = ranks.iter().zip(&differences).filter(|(_, one)| **one > 0.0);
    // A fold from 0, because the sum of no numbers is -0.
    let v = positive.fold(0.0, |sum, (rank, _)| sum + rank);
    let n = differences.len();
    let is_counted = ties == 0.0 && n == first.len() && n <= COUNTED_MOST;
    let p = if is_counted { counted_tail(v, n) } else { normal_tail(v, count(n), ties) };
    let by = if is_counted { TailBy::Counting } else { TailBy::Normal };
    Ok(SignedRank { v, n, p, by })
}

/// Returns the two-sided p-value by counting the sums of ranks over all signs.
fn counted_tail(v: f64, n: usize) -> f64 {
    let most = n * (n + 1) / 2;
    // Shares of the signs with each sum, one rank after the other.
    let mut shares = vec![0.0; most + 1];
    shares[0] = 1.0;
    for rank in 1..=n {
        for sum in (0..=most).rev() {
            let with = if sum >= rank { shares[sum - rank] } else { 0.0 };
            shares[sum] = 0.5 * (shares[sum] + with);
        }
    }
    // The distribution is symmetric: the tail on the side of v is the lower tail of the smaller of both sums.
    let smaller = v.min(count(most) - v);
    let tail: f64 =
        shares.iter().enumerate().filter(|(sum, _)| count(*sum) <= smaller).map(|(_, share)| share).sum();
    (2.0 * tail).min(1.0)
}

fn normal_tail(v: f64, n: f64, ties: f64) -> f64 {
    let z = v - n * (n + 1.0) / 4.0;
    let variance = n * (n + 1.0) * (2.0 * n + 1.0) / 24.0 - ties / 48.0;
    let correction = if z == 0.0 { 0.0 } else { 0.5 * z.signum() };
    let z = (z - correction) / variance.sqrt();
    (2.0 * normal_below(-z.abs())).min(1.0)
}

/// Tests whether conditions differ within subjects (Friedman 1937), from a row of all conditions for each subject.
///
/// # Errors
/// If there are fewer than two subjects or conditions, rows differ in length, or a value is not finite; [`StatisticsError::Tied`] if all
/// conditions are tied in every subject.
pub fn friedman(rows: &[Vec<f64>]) -> Result<RankTest, StatisticsError> {
    const WHAT: &str = "Friedman's test";
    let conditions = rows.first().map_or(0, Vec::len);
    for (found, unit) in [(rows.len(), "subjects"), (conditions, "conditions")] {
        if found < 2 {
            return Err(StatisticsError::TooFew { what: WHAT, unit, needed: 2, found });
        }
    }
    let (mut sums, mut ties) = (vec![0.0; conditions], 0.0);
    for row in rows {
        check_lengths(WHAT, row.len(), conditions)?;
        check(WHAT, row, 2)?;
        let (ranks, tied) = ranks(row);
        sums.iter_mut().zip(ranks).for_each(|(sum, rank)| *sum += rank);
        ties += tied;
    }
    let (n, k) = (count(rows.len()), count(conditions));
    let deviations: f64 =
        sums.iter().map(|sum| (sum - 0.5 * n * (k + 1.0)) * (sum - 0.5 * n * (k + 1.0))).sum();
    let scale = n * k * (k + 1.0) - ties / (k - 1.0);
    if scale <= 0.0 {
        return Err(StatisticsError::Tied);
    }
    let (chi_square, df) = (12.0 * deviations / scale, k - 1.0);
    Ok(RankTest { chi_square, df, p: chi_square_above(chi_square, df) })
}

/// Tests whether groups differ (Kruskal and Wallis 1952).
///
/// # Errors
/// If there are fewer than two groups, a group is empty, or a value is not finite; [`StatisticsError::Tied`] if all values are equal.
pub fn kruskal_wallis(groups: &[Vec<f64>]) -> Result<RankTest, StatisticsError> {
    const WHAT: &str = "Kruskal and Wallis's test";
    if groups.len() < 2 {
        return Err(StatisticsError::TooFew { what: WHAT, unit: "groups", needed: 2, found: groups.len() });
    }
    for group in groups {
        check(WHAT, group, 1)?;
    }
    let (ranks, ties) = ranks(&groups.concat());
    let n = count(ranks.len());
    let share = 1.0 - ties / (n * n * n - n);
    if share <= 0.0 || n < 2.0 {
        return Err(StatisticsError::Tied);
    }
    let (mut start, mut sum) = (0, 0.0);
    for group in groups {
        let total: f64 = ranks[start..start + group.len()].iter().sum();
        sum += total * total / count(group.len());
        start += group.len();
    }
    let chi_square = (12.0 * sum / (n * (n + 1.0)) - 3.0 * (n + 1.0)) / share;
    let df = count(groups.len()) - 1.0;
    Ok(RankTest { chi_square, df, p: chi_square_above(chi_square, df) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(found: f64, exact: f64) {
        assert!((found / exact - 1.0).abs() < 1.0e-9, "{found} for {exact}");
    }

    /// All differences positive: of the 2^n signs one has this sum, and one the opposite.
    #[test]
    fn signs_are_counted() {
        for n in [1_u32, 5, 12, 30] {
            let first: Vec<f64> = (1..=n).map(f64::from).collect();
            let found = signed_rank(&first, &vec![0.0; n as usize]).expect("pairs");
            near(found.p, libm::exp2(1.0 - f64::from(n)));
            assert_eq!(found.by, TailBy::Counting);
            near(found.v, f64::from(n * (n + 1)) / 2.0);
        }
        assert_eq!(signed_rank(&[1.0, 2.0], &[1.0, 2.0]), Err(StatisticsError::NoDifference));
        let none = signed_rank(&[0.0, 1.0], &[1.0, 3.0]).expect("pairs").v;
        assert!(none == 0.0 && none.is_sign_positive(), "{none}");
    }

    /// Many differences: counting and the normal approximation agree to a percent.
    #[test]
    fn the_approximation_is_close_to_the_count() {
        for v in [100.0, 150.0, 200.0] {
            let (counted, normal) = (counted_tail(v, 30), normal_tail(v, 30.0, 0.0));
            assert!((counted - normal).abs() < 0.01, "{v}: {counted} {normal}");
        }
    }

    /// Two conditions: Friedman's statistic is that of the sign test, (a - b)^2 / (a + b).
    #[test]
    fn two_conditions_are_the_sign_test() {
        let rows: Vec<Vec<f64>> =
            (0..10).map(|index| vec![0.0, if index < 8 { 1.0 } else { -1.0 }]).collect();
        let found = friedman(&rows).expect("conditions");
        near(found.chi_square, 36.0 / 10.0);
        assert_eq!(friedman(&[vec![1.0, 1.0], vec![2.0, 2.0]]), Err(StatisticsError::Tied));
    }

    /// Ties have their mean rank.
    #[test]
    fn tied_values_share_their_rank() {
        assert_eq!(ranks(&[3.0, 1.0, 3.0, 2.0, 3.0]), (vec![4.0, 1.0, 4.0, 2.0, 4.0], 24.0));
        assert_eq!(kruskal_wallis(&[vec![1.0], vec![1.0]]), Err(StatisticsError::Tied));
    }
}
