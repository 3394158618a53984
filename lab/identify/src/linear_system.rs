//! Symmetric positive definite systems with unknowns of different units.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Solves a system; `None` if the matrix is not positive definite.
pub(crate) fn solve(matrix: DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    let (factor, scale) = factor(&matrix)?;
    Some(factor.solve(&right.component_div(&scale)).component_div(&scale))
}

/// Inverts a matrix; `None` if it is not positive definite.
pub(crate) fn invert(matrix: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let (factor, scale) = factor(&matrix)?;
    let inverse = factor.inverse();
    Some(DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |row, column| {
        inverse[(row, column)] / (scale[row] * scale[column])
    }))
}

/// Factors a matrix whose diagonal is scaled to one, and returns the scales.
fn factor(matrix: &DMatrix<f64>) -> Option<(Cholesky<f64, Dyn>, DVector<f64>)> {
    let scale = matrix.diagonal().map(|entry| entry.max(f64::MIN_POSITIVE).sqrt());
    let scaled = DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |row, column| {
        matrix[(row, column)] / (scale[row] * scale[column])
    });
    Some((scaled.cholesky()?, scale))
}
