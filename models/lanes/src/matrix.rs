//! Factorisation `L D Lᵀ` of a small symmetric matrix, with the number of its negative eigenvalues.
//!
//! By Sylvester's law of inertia as many pivots `D` as eigenvalues are negative. The number of negative eigenvalues of a
//! second variation is the Morse index of the equilibrium: zero if the equilibrium is stable.
//!
//! Source: Golub and Van Loan, *Matrix Computations*, 4.1 and 8.1.5. Without pivoting: a definite matrix needs none, and of
//! an indefinite matrix the caller uses only the number of negative pivots, then shifts the matrix until it is definite.

/// Steps of inverse iteration: they give the smallest eigenvalue to a few percent.
const INVERSE_ITERATIONS: u32 = 3;

/// Factors `L D Lᵀ` of a symmetric matrix of order `N`.
///
/// The triangle `L` is stored by columns and by rows, each padded with zeros: both substitutions then read consecutive
/// memory over a length known to the compiler.
#[derive(Clone, Debug, PartialEq)]
pub struct Factored<const N: usize> {
    column: [[f64; N]; N],
    row: [[f64; N]; N],
    inverse_pivot: [f64; N],
    negative: usize,
}

flotor_hal::restorable!([const N: usize] Factored<N> { column, row, inverse_pivot, negative });

impl<const N: usize> Factored<N> {
    /// Returns the factors of the unit matrix.
    pub fn unit() -> Self {
        Self { column: [[0.0; N]; N], row: [[0.0; N]; N], inverse_pivot: [1.0; N], negative: 0 }
    }

    /// Factorises `matrix + shift * unit` and counts the negative pivots; reads only the lower triangle. A zero pivot gives
    /// non-finite factors. Real-time: bounded, no allocation.
    pub fn new(matrix: &[[f64; N]; N], shift: f64) -> Self {
        let mut rest = *matrix;
        let mut factored = Self::unit();
        for j in 0..N {
            let pivot = rest[j][j] + shift;
            factored.negative += usize::from(pivot < 0.0);
            let inverse = 1.0 / pivot;
            factored.inverse_pivot[j] = inverse;
            let mut column = [0.0; N];
            for i in j + 1..N {
                column[i] = rest[i][j];
            }
            for i in j + 1..N {
                let factor = column[i] * inverse;
                factored.column[j][i] = factor;
                factored.row[i][j] = factor;
                // Zeros up to j preserve finished entries; those beyond i are never read again.
                for (entry, above) in rest[i].iter_mut().zip(&column) {
                    *entry -= factor * above;
                }
            }
        }
        factored
    }

    /// Returns an upper bound of the smallest eigenvalue of a positive definite matrix, within a few percent, by
    /// inverse iteration from the direction of the smallest pivot. Real-time: bounded, no allocation.
    pub fn smallest_eigenvalue(&self) -> f64 {
        let largest = |(a, x): (usize, f64), (b, y): (usize, f64)| if y > x { (b, y) } else { (a, x) };
        let (softest, _) = self.inverse_pivot.iter().copied().enumerate().fold((0, 0.0), largest);
        let mut direction = [0.0; N];
        direction[softest] = 1.0;
        let mut inverse = 0.0;
        for _ in 0..INVERSE_ITERATIONS {
            direction = self.solve(&direction);
            inverse = length(&direction);
            direction = direction.map(|entry| entry / inverse);
        }
        1.0 / inverse
    }

    /// Returns the number of negative eigenvalues of the shifted matrix, counted by the negative pivots. Real-time: bounded, no
    /// allocation.
    pub fn negative(&self) -> usize {
        self.negative
    }

    /// Returns the Newton step for the gradient `slope`: minus the solution of [`Self::solve`]. Real-time: bounded, no allocation.
    #[inline]
    pub fn step_down(&self, slope: &[f64; N]) -> [f64; N] {
        let mut step = self.solve(slope);
        for entry in &mut step {
            *entry = -*entry;
        }
        step
    }

    /// Solves the linear system of the factorised matrix for the right-hand side `right`. Real-time: bounded, no allocation.
    #[inline]
    pub fn solve(&self, right: &[f64; N]) -> [f64; N] {
        let mut x = *right;
        for j in 0..N {
            let known = x[j];
            for (entry, factor) in x.iter_mut().zip(&self.column[j]) {
                *entry -= factor * known;
            }
        }
        for (entry, inverse) in x.iter_mut().zip(&self.inverse_pivot) {
            *entry *= inverse;
        }
        for i in (0..N).rev() {
            let known = x[i];
            for (entry, factor) in x.iter_mut().zip(&self.row[i]) {
                *entry -= factor * known;
            }
        }
        x
    }
}

/// Returns the product of a matrix and a vector.
#[inline]
pub fn product<const N: usize, const R: usize>(matrix: &[[f64; N]; R], vector: &[f64; N]) -> [f64; R] {
    std::array::from_fn(|row| dot(&matrix[row], vector))
}

/// Returns the inner product, summed in two lanes.
#[inline(always)]
pub fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    let mut lanes = [0.0; 2];
    let (pairs_a, rest_a) = a.as_chunks::<2>();
    let (pairs_b, rest_b) = b.as_chunks::<2>();
    for (a, b) in pairs_a.iter().zip(pairs_b) {
        lanes[0] += a[0] * b[0];
        lanes[1] += a[1] * b[1];
    }
    let mut sum = lanes[0] + lanes[1];
    for (a, b) in rest_a.iter().zip(rest_b) {
        sum += a * b;
    }
    sum
}

/// Returns the Euclidean length.
#[inline(always)]
pub fn length<const N: usize>(vector: &[f64; N]) -> f64 {
    dot(vector, vector).sqrt()
}

/// Returns `sum + factor * vector`.
#[inline(always)]
pub fn added<const N: usize>(sum: &[f64; N], factor: f64, vector: &[f64; N]) -> [f64; N] {
    let mut result = *sum;
    for (entry, addend) in result.iter_mut().zip(vector) {
        *entry += factor * addend;
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Diagonal turned by a Householder reflection: eigenvalues known, nothing sparse.
    fn turned(eigenvalues: [f64; 5]) -> [[f64; 5]; 5] {
        let v = [0.5, -0.3, 0.2, 0.7, 0.1];
        let scale = 2.0 / dot(&v, &v);
        let reflect = |i: usize, j: usize| f64::from(i == j) - scale * v[i] * v[j];
        let mut matrix = [[0.0; 5]; 5];
        for (i, row) in matrix.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate() {
                *entry = (0..5).map(|k| reflect(i, k) * eigenvalues[k] * reflect(j, k)).sum();
            }
        }
        matrix
    }

    #[test]
    fn solves_and_counts() {
        for (eigenvalues, negative) in [
            ([1.0, 2.0, 3.0, 4.0, 5.0], 0),
            ([-1.0, 2.0, 3.0, 4.0, 5.0], 1),
            ([-1.0, -1.0, 3.0, 4.0, -1e-6], 3),
        ] {
            let matrix = turned(eigenvalues);
            let factored = Factored::new(&matrix, 0.0);
            assert_eq!(factored.negative(), negative);
            let x = [0.3, -1.0, 0.7, 2.0, -0.1];
            let found = factored.solve(&product(&matrix, &x));
            for i in 0..5 {
                // Rounding times the condition number, 5e6 at worst.
                assert!((found[i] - x[i]).abs() < 1e-8);
            }
            assert_eq!(Factored::new(&matrix, 1.5).negative(), 0, "shifted past the lowest eigenvalue");
        }
    }
}
