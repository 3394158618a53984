//! Systems of six linear equations, for six coils and the six components of a wrench.

/// Vector of six numbers.
pub(crate) type Vector6 = [f64; 6];

/// Matrix of six rows.
pub(crate) type Matrix6 = [Vector6; 6];

/// Smallest pivot, relative to the largest entry of the matrix; below that the rows are linearly dependent. Far above
/// rounding (1e-16), far below the 0.06 of a well-built device.
const LEAST_PIVOT: f64 = 1.0e-6;

/// Returns the inverse, or `None` if the rows are linearly dependent (or contain a NaN): Gauss-Jordan elimination with
/// partial pivoting.
///
/// Real-time: bounded, no allocation.
pub(crate) fn inverse(matrix: &Matrix6) -> Option<Matrix6> {
    let scale = matrix.iter().flatten().fold(0.0_f64, |largest, entry| largest.max(entry.abs()));
    let (mut left, mut right) = (*matrix, [[0.0; 6]; 6]);
    for (index, row) in right.iter_mut().enumerate() {
        row[index] = 1.0;
    }
    for column in 0..6 {
        let pivot = (column..6).max_by(|a, b| left[*a][column].abs().total_cmp(&left[*b][column].abs()))?;
        left.swap(column, pivot);
        right.swap(column, pivot);
        let (size, least) = (left[column][column].abs(), LEAST_PIVOT * scale);
        if size <= least || size.is_nan() {
            return None;
        }
        let factor = 1.0 / left[column][column];
        let upper = [left[column].map(|entry| entry * factor), right[column].map(|entry| entry * factor)];
        [left[column], right[column]] = upper;
        for row in (0..6).filter(|row| *row != column) {
            let factor = left[row][column];
            for entry in 0..6 {
                left[row][entry] -= factor * upper[0][entry];
                right[row][entry] -= factor * upper[1][entry];
            }
        }
    }
    Some(right)
}

/// Returns `matrix x`. Real-time: bounded, no allocation.
pub(crate) fn product(matrix: &Matrix6, vector: &Vector6) -> Vector6 {
    // A loop instead of `map`, whose closure is not always inlined: this runs twice a tick.
    let mut sums = [0.0; 6];
    for (sum, row) in sums.iter_mut().zip(matrix) {
        for (a, b) in row.iter().zip(vector) {
            *sum += a * b;
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of no particular order, the first with a zero where elimination would like its pivot.
    const SAMPLE: Matrix6 = [
        [0.0, 2.0, -1.0, 0.5, 3.0, 1.0],
        [1.0, -4.0, 0.0, 2.0, 0.1, -1.0],
        [2.0, 1.0, 5.0, -0.3, 0.0, 0.7],
        [-1.0, 0.0, 2.0, 6.0, 1.0, 0.2],
        [0.4, 1.5, -2.0, 0.0, 4.0, -3.0],
        [1.0, 1.0, 1.0, 1.0, 1.0, 8.0],
    ];

    #[test]
    fn an_inverse_inverts() {
        let expected = [1.0, -2.0, 0.25, 4.0, -0.5, 3.0];
        let back = product(&inverse(&SAMPLE).expect("independent rows"), &product(&SAMPLE, &expected));
        for (x, y) in expected.iter().zip(back) {
            // Rounding times a condition number below a hundred.
            assert!((x - y).abs() < 1.0e-13, "{x} {y}");
        }
    }

    #[test]
    fn dependent_rows_and_nan_have_no_inverse() {
        let mut dependent = SAMPLE;
        dependent[3] = SAMPLE[1].map(|entry| 2.0 * entry);
        assert_eq!(inverse(&dependent), None);
        let mut poisoned = SAMPLE;
        poisoned[2][2] = f64::NAN;
        assert_eq!(inverse(&poisoned), None);
    }
}
