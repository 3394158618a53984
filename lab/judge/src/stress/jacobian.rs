//! Derivative of the wrench with respect to the pose, from finite differences, with its uncertainty.
//!
//! Coordinates are translations of the handle and small rotations in the model frame (from the left, as angular
//! velocity), with angles as lengths and torques as forces at the device's lever arm: every entry is a stiffness in
//! N/m.

use super::LEVER_M;
use crate::subject::Subject;
use flotor_hal::{DVec3, Pose, Wrench, orientation_from_rotation_vector};

/// Matrix of 6 x 6, by rows.
pub(super) type Matrix = [[f64; 6]; 6];

/// Half steps to try, m: short ones lose to rounding, long ones to curvature; the best one depends on the model and on
/// the pose.
const STEPS_M: [f64; 3] = [1.0e-4, 1.0e-5, 1.0e-6];

/// Relative difference up to which two answers at one pose count as equal: residual of solvers.
const SAME: f64 = 1.0e-6;
/// Number of columns of the derivative.
const COLUMNS: f64 = 6.0;

/// Returns the magnitude of a wrench with its torque at the lever arm, N.
pub(super) fn size_n(wrench: &Wrench) -> f64 {
    wrench.force().length() + wrench.torque().length() / LEVER_M
}

/// Largest central differences along each coordinate, over all steps, N/m: measured gains, with or without a
/// derivative.
#[derive(Clone, Copy, Default)]
pub(super) struct Chords {
    /// Change of the wrench over the motion.
    gains: [f64; 6],
    /// Change of the wrench's component against the motion.
    against: [f64; 6],
}

impl Chords {
    fn include(&mut self, differences: &Matrix) {
        for (column, entries) in transposed(differences).iter().enumerate() {
            let gain = entries.iter().map(|entry| entry * entry).sum::<f64>().sqrt();
            self.gains[column] = self.gains[column].max(gain);
            self.against[column] = self.against[column].max(-entries[column]);
        }
    }

    /// Returns the largest gain, N/m.
    pub(super) fn gain(&self) -> f64 {
        self.gains.into_iter().fold(0.0, f64::max)
    }

    /// Returns the largest stiffness along a coordinate, N/m; 0 where the wrench opposes no motion.
    pub(super) fn stiffness(&self) -> f64 {
        self.against.into_iter().fold(0.0, f64::max)
    }

    /// Returns an upper bound of gain and stiffness in every direction: the Frobenius norm of the gains, N/m.
    pub(super) fn bound(&self) -> f64 {
        self.gains.into_iter().map(|gain| gain * gain).sum::<f64>().sqrt()
    }
}

/// Derivative at a pose.
pub(super) struct Jacobian {
    /// Entries, N/m at the lever arm; row: component of force, then torque; column: translation, then rotation.
    pub(super) entries: Matrix,
    /// Estimated error, Frobenius norm, N/m; infinite where the answer depends on the path to the pose.
    pub(super) error: f64,
    /// Differences along the coordinates.
    pub(super) chords: Chords,
    /// Wrench at the pose.
    pub(super) wrench: Wrench,
}

impl Jacobian {
    /// Computes central differences of fourth order, with the step of least uncertainty; `None` if the model gives no
    /// answer around the pose.
    pub(super) fn at(subject: &mut Subject<'_>, pose: Pose) -> Option<Self> {
        let wrench = subject.answer_at(pose).ok()?.wrench;
        let (mut tried, mut apart_n) = (Vec::with_capacity(STEPS_M.len()), 0.0);
        let mut chords = Chords::default();
        for step_m in STEPS_M {
            let coarse = central(subject, pose, step_m)?;
            let fine = central(subject, pose, 0.5 * step_m)?;
            [coarse, fine].iter().for_each(|differences| chords.include(differences));
            // Richardson extrapolation: the error of second order cancels, and its size bounds the remainder.
            let entries = combine(&fine, 4.0 / 3.0, &coarse, -1.0 / 3.0);
            let error = norm(&combine(&entries, 1.0, &fine, -1.0));
            tried.push((step_m, Self { entries, error, chords, wrench }));
            let again = subject.answer_at(pose).ok()?.wrench;
            apart_n = f64::max(apart_n, size_n(&(again - wrench)));
        }
        // A model with memory may have switched to another solution meanwhile: then there is no derivative here.
        let is_one_answer = apart_n <= SAME * size_n(&wrench).max(SAME);
        let with_noise = |(step_m, jacobian): (f64, Self)| {
            // The residual of a solver over the step is an uncertainty of each column.
            let noise = if is_one_answer { COLUMNS * apart_n / step_m } else { f64::INFINITY };
            Self { error: jacobian.error + noise, chords, ..jacobian }
        };
        tried.into_iter().map(with_noise).min_by(|a, b| a.error.total_cmp(&b.error))
    }

    /// Returns the norm of `J - J^T` after correction for the coordinates: rotations do not commute, so even the
    /// derivative of an energy's torque by rotations is symmetric only after half the torque's cross product is
    /// subtracted. (With the rotation `d` from this pose the generalised torque is `M(d) - d x M / 2` to first order.)
    pub(super) fn asymmetry(&self) -> f64 {
        let half_torque = self.wrench.torque() * (0.5 / (LEVER_M * LEVER_M));
        let mut entries = self.entries;
        for (axis, unit) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
            let taken_off = unit.cross(half_torque).to_array();
            for (row, value) in taken_off.into_iter().enumerate() {
                entries[3 + row][3 + axis] -= value;
            }
        }
        norm(&combine(&entries, 1.0, &transposed(&entries), -1.0))
    }

    /// Returns the Frobenius norm, N/m.
    pub(super) fn norm(&self) -> f64 {
        norm(&self.entries)
    }

    /// Returns the largest gain, N/m: the largest singular value.
    pub(super) fn gain(&self) -> f64 {
        largest_singular_value(&self.entries)
    }

    /// Returns the largest stiffness in any direction, N/m: the largest eigenvalue of the symmetric part of `-J`; 0
    /// where the wrench opposes no motion. Non-commuting rotations contribute to the antisymmetric part only.
    pub(super) fn stiffness(&self) -> f64 {
        let symmetric = combine(&self.entries, -0.5, &transposed(&self.entries), -0.5);
        largest_eigenvalue(symmetric).max(0.0)
    }

    /// Returns the largest gain of one block (0 linear, 1 angular), N/m at the lever arm.
    pub(super) fn block_stiffness(&self, rows: usize, columns: usize) -> f64 {
        let inside = |row: usize, column: usize| row / 3 == rows && column / 3 == columns;
        let block: Matrix = std::array::from_fn(|row| {
            std::array::from_fn(|column| if inside(row, column) { self.entries[row][column] } else { 0.0 })
        });
        largest_singular_value(&block)
    }
}

fn central(subject: &mut Subject<'_>, pose: Pose, step_m: f64) -> Option<Matrix> {
    let mut by_column = [[0.0; 6]; 6];
    for (column, slopes) in by_column.iter_mut().enumerate() {
        let mut ask =
            |step_m: f64| subject.answer_at(moved(pose, column, step_m)).ok().map(|answer| answer.wrench);
        let (up, down) = (ask(step_m)?, ask(-step_m)?);
        let slope = (up + down * -1.0) * (0.5 / step_m);
        let components = slope.force().to_array().into_iter().chain((slope.torque() / LEVER_M).to_array());
        for (to, component) in slopes.iter_mut().zip(components) {
            *to = component;
        }
    }
    Some(transposed(&by_column))
}

fn moved(pose: Pose, column: usize, step_m: f64) -> Pose {
    let unit = [DVec3::X, DVec3::Y, DVec3::Z][column % 3];
    if column < 3 {
        return Pose::new(pose.position() + unit * step_m, pose.orientation());
    }
    let turn = orientation_from_rotation_vector(unit * (step_m / LEVER_M));
    Pose::new(pose.position(), turn * pose.orientation())
}

fn combine(a: &Matrix, by: f64, b: &Matrix, and_by: f64) -> Matrix {
    std::array::from_fn(|row| std::array::from_fn(|column| a[row][column] * by + b[row][column] * and_by))
}

fn transposed(matrix: &Matrix) -> Matrix {
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[column][row]))
}

fn norm(matrix: &Matrix) -> f64 {
    matrix.iter().flatten().map(|entry| entry * entry).sum::<f64>().sqrt()
}

fn largest_singular_value(matrix: &Matrix) -> f64 {
    let square: Matrix = std::array::from_fn(|i| {
        std::array::from_fn(|j| (0..6).map(|row| matrix[row][i] * matrix[row][j]).sum())
    });
    largest_eigenvalue(square).max(0.0).sqrt()
}

/// Returns the largest eigenvalue by Jacobi rotations: a dozen sweeps converge.
fn largest_eigenvalue(mut symmetric: Matrix) -> f64 {
    for _ in 0..12 {
        for p in 0..6 {
            for q in p + 1..6 {
                rotate(&mut symmetric, p, q);
            }
        }
    }
    (0..6).map(|i| symmetric[i][i]).fold(f64::NEG_INFINITY, f64::max)
}

/// Applies one rotation of Jacobi's method (Golub and Van Loan, section 8.5).
fn rotate(matrix: &mut Matrix, p: usize, q: usize) {
    if matrix[p][q] == 0.0 {
        return;
    }
    let theta = (matrix[q][q] - matrix[p][p]) / (2.0 * matrix[p][q]);
    let tangent = theta.signum() / (theta.abs() + (1.0 + theta * theta).sqrt());
    let cosine = 1.0 / (1.0 + tangent * tangent).sqrt();
    let sine = tangent * cosine;
    for row in matrix.iter_mut() {
        (row[p], row[q]) = (cosine * row[p] - sine * row[q], sine * row[p] + cosine * row[q]);
    }
    let (row_p, row_q) = (matrix[p], matrix[q]);
    matrix[p] = std::array::from_fn(|k| cosine * row_p[k] - sine * row_q[k]);
    matrix[q] = std::array::from_fn(|k| sine * row_p[k] + cosine * row_q[k]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_singular_value_of_a_known_matrix() {
        // A rotation in each block does not change singular values: 5 in the first plane, 3 in the last.
        let (sine, cosine) = 0.7_f64.sin_cos();
        let mut matrix = [[0.0; 6]; 6];
        for (at, value) in [(0, 5.0), (4, 3.0)] {
            matrix[at][at] = value * cosine;
            matrix[at][at + 1] = -value * sine;
            matrix[at + 1][at] = value * sine;
            matrix[at + 1][at + 1] = value * cosine;
        }
        assert!((largest_singular_value(&matrix) - 5.0).abs() < 1.0e-14);
        assert_eq!(largest_singular_value(&[[0.0; 6]; 6]), 0.0);
    }
}
