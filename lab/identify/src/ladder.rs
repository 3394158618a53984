//! Choice of a law by cross-validation.
//!
//! The measurement is divided into segments, each left out in turn and predicted from the rest. The fit without a fold is one
//! Gauss-Newton step from the fit of all cells, which is exact for a law linear in its parameters.

use crate::fit::Fit;
use crate::linear_system::solve;
use crate::measurement::mean;
use nalgebra::{DMatrix, DVector};

/// Number of folds.
const FOLDS: usize = 8;
/// Maximum number of segments.
const MOST_SEGMENTS: usize = 64;
/// Minimum number of cells in a segment, if there are enough for one segment per fold.
const LEAST_CELLS: usize = 6;

/// Prediction error of a law in cells left out of its fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Score {
    /// Mean of the squared errors, N².
    pub(crate) mean_square: f64,
    /// Standard error of this mean over the segments, N².
    pub(crate) standard_error: f64,
}

/// Scores a fit; `noise_n` is the scale of the priors.
pub(crate) fn score(fit: &Fit, noise_n: f64) -> Option<Score> {
    let count = fit.residuals_n.len();
    let segments = (count / LEAST_CELLS).clamp(FOLDS, MOST_SEGMENTS);
    let segment_of = |cell: usize| cell * segments / count;
    let weight = 1.0 / (noise_n * noise_n);
    let normal = |rows: &DMatrix<f64>| rows.tr_mul(rows) * weight;
    let whole = normal(&fit.jacobian_n) + DMatrix::from_diagonal(&fit.precisions);
    let mut squares: Vec<Vec<f64>> = vec![Vec::new(); segments];
    for fold in 0..FOLDS {
        let out: Vec<usize> = (0..count).filter(|cell| segment_of(*cell) % FOLDS == fold).collect();
        let rows = fit.jacobian_n.select_rows(&out);
        let residuals = DVector::from_iterator(out.len(), out.iter().map(|cell| fit.residuals_n[*cell]));
        let gradient = rows.tr_mul(&residuals) * weight;
        let step = solve(&whole - normal(&rows), &gradient)?;
        let errors = residuals + &rows * step;
        for (cell, error) in out.iter().zip(&errors) {
            squares[segment_of(*cell)].push(error * error);
        }
    }
    let means: Vec<f64> =
        squares.iter().filter(|squares| !squares.is_empty()).map(|squares| mean(squares)).collect();
    let mean_square = mean(&means);
    let spread: f64 = means.iter().map(|one| (one - mean_square) * (one - mean_square)).sum();
    let segments = means.len() as f64;
    let standard_error = (spread / (segments - 1.0) / segments).sqrt();
    mean_square.is_finite().then_some(Score { mean_square, standard_error })
}

/// Returns the index of the chosen law (one-standard-error rule, Breiman et al. 1984): among the laws within one standard error
/// of the best score, the law with the fewest parameters, and among these the one with the best score. Errors below `least_n`
/// count as equal.
pub(crate) fn choice(candidates: &[(usize, Score)], least_n: f64) -> Option<usize> {
    let (_, best) =
        candidates.iter().min_by(|(_, one), (_, other)| one.mean_square.total_cmp(&other.mean_square))?;
    let most = best.mean_square + best.standard_error + least_n * least_n;
    let within = candidates.iter().enumerate().filter(|(_, (_, score))| score.mean_square <= most);
    let simplest = within.min_by(|(_, (one_size, one)), (_, (other_size, other))| {
        one_size.cmp(other_size).then(one.mean_square.total_cmp(&other.mean_square))
    });
    simplest.map(|(index, _)| index)
}
