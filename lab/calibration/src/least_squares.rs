//! Least squares for a handful of unknowns, by Householder reflections (Golub and Van Loan, section 5.3).

/// Maximum number of unknowns: eight coefficients and a weight.
pub(super) const MAX_UNKNOWNS: usize = 9;

/// Least-squares solution of `rows x = values`.
#[derive(Clone, Debug)]
pub(super) struct Solution {
    pub(super) x: Vec<f64>,
    /// Sum of the squared residuals.
    pub(super) residual_squares: f64,
    /// Upper triangular factor `R` of `rows = Q R`, row by row: the covariance of `x` is `s² (RᵀR)⁻¹`.
    triangle: Vec<Vec<f64>>,
}

/// Solves the least-squares problem by QR decomposition; `None` if the rows do not determine every unknown, or for more than
/// [`MAX_UNKNOWNS`] unknowns.
pub(super) fn solve(rows: &[Vec<f64>], values: &[f64]) -> Option<Solution> {
    /// Ratio of a diagonal entry of `R` to the largest one at or below which the rows count as rank-deficient; above rounding
    /// errors.
    const RANK_TOLERANCE: f64 = 1.0e-12;
    let unknowns = rows.first()?.len();
    if rows.len() < unknowns || unknowns > MAX_UNKNOWNS || rows.len() != values.len() {
        return None;
    }
    // Append each value to its row as a last column, so that the reflections transform both.
    let mut table: Vec<Vec<f64>> =
        rows.iter().zip(values).map(|(row, value)| row.iter().copied().chain([*value]).collect()).collect();
    for column in 0..unknowns {
        reflect(&mut table, column)?;
    }
    let diagonal = |k: usize| table.get(k).and_then(|row| row.get(k)).copied().unwrap_or(0.0).abs();
    let largest = (0..unknowns).map(diagonal).fold(0.0, f64::max);
    if (0..unknowns).any(|k| diagonal(k) <= RANK_TOLERANCE * largest) {
        return None;
    }
    let residual_squares = table.iter().skip(unknowns).filter_map(|row| row.last()).map(|r| r * r).sum();
    let right: Vec<f64> = table.iter().take(unknowns).filter_map(|row| row.last().copied()).collect();
    let triangle: Vec<Vec<f64>> =
        table.into_iter().take(unknowns).map(|row| row.into_iter().take(unknowns).collect()).collect();
    let x = back_substitute(&triangle, &right);
    Some(Solution { x, residual_squares, triangle })
}

impl Solution {
    /// Returns the variance of `directionᵀ x` for residuals of unit variance: `|R⁻ᵀ direction|²`.
    pub(super) fn unit_variance(&self, direction: &[f64]) -> f64 {
        let mut y: Vec<f64> = Vec::with_capacity(direction.len());
        for (k, wanted) in direction.iter().enumerate() {
            let column = |j: usize| self.triangle.get(j).and_then(|row| row.get(k)).copied().unwrap_or(0.0);
            let known: f64 = y.iter().enumerate().map(|(j, value)| column(j) * value).sum();
            y.push((wanted - known) / column(k));
        }
        y.iter().map(|value| value * value).sum()
    }
}

/// Zeroes a column below the diagonal; `None` if the column is zero or not finite.
fn reflect(table: &mut [Vec<f64>], column: usize) -> Option<()> {
    let at = |row: &Vec<f64>| row.get(column).copied().unwrap_or(0.0);
    let length = table.iter().skip(column).map(|row| at(row) * at(row)).sum::<f64>().sqrt();
    let first = at(table.get(column)?);
    if !(length.is_finite() && length > 0.0) {
        return None;
    }
    // Reflect away from the first entry, so that nothing cancels.
    let target = if first > 0.0 { -length } else { length };
    let mut mirror: Vec<f64> = table.iter().skip(column).map(at).collect();
    *mirror.first_mut()? -= target;
    let squares: f64 = mirror.iter().map(|value| value * value).sum();
    let width = table.first()?.len();
    for k in column..width {
        let below = table.iter().skip(column).map(|row| row.get(k).copied().unwrap_or(0.0));
        let dot: f64 = below.zip(&mirror).map(|(value, v)| value * v).sum();
        for (row, v) in table.iter_mut().skip(column).zip(&mirror) {
            if let Some(cell) = row.get_mut(k) {
                *cell -= 2.0 * dot / squares * v;
            }
        }
    }
    Some(())
}

fn back_substitute(triangle: &[Vec<f64>], right: &[f64]) -> Vec<f64> {
    let mut x = vec![0.0; right.len()];
    for (k, (row, value)) in triangle.iter().zip(right).enumerate().rev() {
        let known: f64 = row.iter().zip(&x).skip(k + 1).map(|(a, b)| a * b).sum();
        if let (Some(slot), Some(diagonal)) = (x.get_mut(k), row.get(k)) {
            *slot = (value - known) / diagonal;
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_through_four_points_is_the_textbook_one() {
        let rows: Vec<Vec<f64>> = [1.0, 2.0, 3.0, 4.0].map(|x| vec![1.0, x]).to_vec();
        let solution = solve(&rows, &[6.0, 5.0, 7.0, 10.0]).unwrap();
        // y = 3.5 + 1.4 x, squares 4.2 (the example of every textbook).
        assert!((solution.x[0] - 3.5).abs() < 1.0e-12 && (solution.x[1] - 1.4).abs() < 1.0e-12);
        assert!((solution.residual_squares - 4.2).abs() < 1.0e-12);
        // Variance of the slope: 1 / sum (x - 2.5)^2 = 1/5; of the mean height: 1/4.
        assert!((solution.unit_variance(&[0.0, 1.0]) - 0.2).abs() < 1.0e-12);
        assert!((solution.unit_variance(&[1.0, 2.5]) - 0.25).abs() < 1.0e-12);
    }

    #[test]
    fn what_is_not_determined_is_refused() {
        assert!(solve(&[vec![1.0, 2.0], vec![2.0, 4.0], vec![3.0, 6.0]], &[1.0, 2.0, 3.0]).is_none());
        assert!(solve(&[vec![1.0, 2.0]], &[1.0]).is_none());
        assert!(solve(&[], &[]).is_none());
        assert!(solve(&[vec![f64::NAN], vec![1.0]], &[1.0, 1.0]).is_none());
    }
}
