//! Several tests of one question: the probability of any wrong yes stays what a single one has.

/// Holm's correction (1979): the smallest p is multiplied by the number of tests, the next by one less, and so on; none is
/// smaller than one before it, and none above 1. In the order given; what is no probability stays as it is and is not counted.
#[must_use]
pub fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).filter(|index| p[*index].is_finite()).collect();
    order.sort_by(|a, b| p[*a].total_cmp(&p[*b]));
    let mut corrected = p.to_vec();
    let (mut largest, count) = (0.0_f64, order.len());
    for (rank, index) in order.into_iter().enumerate() {
        largest = largest.max(p[index] * crate::count(count - rank)).min(1.0);
        corrected[index] = largest;
    }
    corrected
}
