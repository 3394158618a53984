//! Corrections for multiple tests, which keep the family-wise error rate at or below the level of a single test.

/// Returns p-values after Holm's correction (1979): the smallest p is multiplied by the number of tests, the next by one less,
/// and so on; each corrected p is at least the previous one, and at most 1. Keeps the order of the list. Values that are not
/// finite do not count as tests and are returned unchanged.
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
