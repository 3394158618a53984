//! Vectors and symmetric matrices of six rows.
// Every index is from 0 to 5 into an array of six; loops over indices read as in textbooks.
#![allow(clippy::indexing_slicing, clippy::needless_range_loop)]

/// Number of coordinates of a rigid motion.
pub(crate) const ROWS: usize = 6;
/// Vector of six coordinates.
pub(crate) type Vector6 = [f64; ROWS];
/// Symmetric matrix: only the triangle below the diagonal, and the diagonal, are used.
pub(crate) type Symmetric6 = [Vector6; ROWS];

/// Zero matrix.
pub(crate) const ZERO: Symmetric6 = [[0.0; ROWS]; ROWS];
/// Unit matrix.
pub(crate) const IDENTITY: Symmetric6 = {
    let mut matrix = ZERO;
    let mut row = 0;
    while row < ROWS {
        matrix[row][row] = 1.0;
        row += 1;
    }
    matrix
};

/// Returns the scalar product.
#[inline]
pub(crate) fn dot(a: &Vector6, b: &Vector6) -> f64 {
    // Two independent sums of three products, for two lanes of a register.
    let even = a[0] * b[0] + a[2] * b[2] + a[4] * b[4];
    let odd = a[1] * b[1] + a[3] * b[3] + a[5] * b[5];
    even + odd
}

/// Adds a multiple of another vector.
#[inline]
pub(crate) fn add(to: &mut Vector6, vector: &Vector6, factor: f64) {
    for (to, part) in to.iter_mut().zip(vector) {
        *to += factor * part;
    }
}

/// Adds `factor` times the outer product of a vector with itself.
#[inline]
pub(crate) fn add_square(to: &mut Symmetric6, vector: &Vector6, factor: f64) {
    for row in 0..ROWS {
        let scaled = factor * vector[row];
        for column in 0..=row {
            to[row][column] += scaled * vector[column];
        }
    }
}

/// Solves `matrix x = right` for a matrix with eigenvalues of at least 1 (Cholesky's decomposition without roots).
#[inline]
pub(crate) fn solve(mut matrix: Symmetric6, right: &Vector6) -> Vector6 {
    let mut x = *right;
    let mut inverse = [0.0; ROWS];
    for row in 0..ROWS {
        for column in 0..row {
            let mut sum = matrix[row][column];
            for before in 0..column {
                sum -= matrix[row][before] * matrix[column][before];
            }
            // Store the entry without division by the pivot: the products above use it undivided.
            matrix[row][column] = sum;
        }
        let mut pivot = matrix[row][row];
        for before in 0..row {
            let undivided = matrix[row][before];
            let divided = undivided * inverse[before];
            pivot -= undivided * divided;
            matrix[row][before] = divided;
            x[row] -= divided * x[before];
        }
        // Exact pivots are at least 1; a rounded pivot may be smaller.
        inverse[row] = 1.0 / if pivot > 0.5 { pivot } else { 0.5 };
    }
    for row in (0..ROWS).rev() {
        x[row] *= inverse[row];
        for below in row + 1..ROWS {
            x[row] -= matrix[below][row] * x[below];
        }
    }
    x
}

/// Largest number of sweeps over all pairs of rows. Convergence is quadratic: six reach rounding error.
const SWEEPS: usize = 12;

/// Returns the eigenvalues, and the eigenvectors in the same order (Jacobi's method, G. Golub, C. Van Loan, "Matrix
/// Computations", 4th edition, section 8.5.3). Real-time: bounded, no allocation.
pub(crate) fn eigen(symmetric: &Symmetric6) -> (Vector6, [Vector6; ROWS]) {
    let mut matrix = *symmetric;
    for row in 0..ROWS {
        for column in 0..row {
            matrix[column][row] = matrix[row][column];
        }
    }
    let mut vectors = IDENTITY;
    for _ in 0..SWEEPS {
        let mut is_diagonal = true;
        for p in 0..ROWS {
            for q in p + 1..ROWS {
                let (diagonal, beside) = (matrix[p][p].abs() + matrix[q][q].abs(), matrix[p][q]);
                if beside.abs() <= 0.01 * f64::EPSILON * diagonal {
                    continue;
                }
                is_diagonal = false;
                let theta = (matrix[q][q] - matrix[p][p]) / (2.0 * beside);
                let tangent = 1.0 / (theta.abs() + (theta * theta + 1.0).sqrt());
                let tangent = if theta < 0.0 { -tangent } else { tangent };
                let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
                let sine = tangent * cosine;
                for row in &mut matrix {
                    (row[p], row[q]) = (cosine * row[p] - sine * row[q], sine * row[p] + cosine * row[q]);
                }
                for column in 0..ROWS {
                    let (first, second) = (matrix[p][column], matrix[q][column]);
                    matrix[p][column] = cosine * first - sine * second;
                    matrix[q][column] = sine * first + cosine * second;
                    let (first, second) = (vectors[p][column], vectors[q][column]);
                    vectors[p][column] = cosine * first - sine * second;
                    vectors[q][column] = sine * first + cosine * second;
                }
            }
        }
        if is_diagonal {
            break;
        }
    }
    let mut values = [0.0; ROWS];
    for row in 0..ROWS {
        values[row] = matrix[row][row];
    }
    (values, vectors)
}
