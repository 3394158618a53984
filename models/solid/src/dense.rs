//! Dense symmetric matrices: partial Cholesky factorisation of a front, and triangular solves.
//!
//! Every sum has one fixed order: tiles are arrays of eight that a compiler may put into registers of any width, and
//! products are rounded before they are added, so the result is the same to the bit at any width.

/// Columns of a panel: a panel of a front of 2000 rows fits the second-level cache.
const PANEL: usize = 48;
/// Rows and columns of a tile of the update.
const TILE: usize = 8;

/// Error for a pivot that is not positive: the matrix is not positive definite.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotPositive {
    /// Index of the pivot, from 0.
    pub pivot: usize,
}

/// Eliminates the first `eliminated` of `size` unknowns of a symmetric matrix, of which the lower triangle is given,
/// column-major: its first columns become the Cholesky factor, the rest the Schur complement; entries above the
/// diagonal are overwritten. Not real-time.
///
/// # Errors
/// [`NotPositive`] with the first pivot that is zero, negative or NaN.
pub fn factor(matrix: &mut [f64], size: usize, eliminated: usize) -> Result<(), NotPositive> {
    let mut packed = Vec::new();
    let mut first = 0;
    while first < eliminated {
        let last = (first + PANEL).min(eliminated);
        factor_panel(matrix, size, first, last)?;
        update_rest(matrix, size, first, last, &mut packed);
        first = last;
    }
    Ok(())
}

fn factor_panel(matrix: &mut [f64], size: usize, first: usize, last: usize) -> Result<(), NotPositive> {
    for column in first..last {
        let (before, rest) = matrix.split_at_mut(column * size);
        let current = &mut rest[column..size];
        for earlier in first..column {
            let other = &before[earlier * size + column..(earlier + 1) * size];
            let scale = other[0];
            current.iter_mut().zip(other).for_each(|(value, &o)| *value -= scale * o);
        }
        let pivot = current[0];
        // NaN counts as not positive.
        if pivot.is_nan() || pivot <= 0.0 {
            return Err(NotPositive { pivot: column });
        }
        let root = pivot.sqrt();
        current[0] = root;
        let inverse = 1.0 / root;
        current[1..].iter_mut().for_each(|value| *value *= inverse);
    }
    Ok(())
}

/// Updates the trailing submatrix: subtracts the product of the panel and its transpose (lower triangle only).
fn update_rest(matrix: &mut [f64], size: usize, first: usize, last: usize, packed: &mut Vec<[f64; TILE]>) {
    let (width, rows) = (last - first, size - last);
    let tiles = rows.div_ceil(TILE);
    packed.clear();
    packed.resize(tiles * width, [0.0; TILE]);
    for (k, column) in (first..last).enumerate() {
        for (row, &value) in matrix[column * size + last..(column + 1) * size].iter().enumerate() {
            packed[(row / TILE) * width + k][row % TILE] = value;
        }
    }
    pulp::Arch::new().dispatch(Update { matrix, packed, size, last, width });
}

/// Update of a trailing submatrix, in registers of any width: the same sums, and the same bits.
struct Update<'a> {
    matrix: &'a mut [f64],
    packed: &'a [[f64; TILE]],
    size: usize,
    last: usize,
    width: usize,
}

impl pulp::WithSimd for Update<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, simd: S) {
        let Self { matrix, packed, size, last, width } = self;
        let rows = size - last;
        for (column_tile, right) in packed.chunks_exact(width).enumerate() {
            for (row_tile, left) in packed.chunks_exact(width).enumerate().skip(column_tile) {
                let mut product = [[0.0; TILE]; TILE];
                for part in 0..TILE / S::F64_LANES {
                    let mut sums = [simd.splat_f64s(0.0); TILE];
                    for (l, r) in left.iter().zip(right) {
                        let value = S::as_simd_f64s(l).0[part];
                        for (sum, scale) in sums.iter_mut().zip(r) {
                            *sum = simd.add_f64s(*sum, simd.mul_f64s(value, simd.splat_f64s(*scale)));
                        }
                    }
                    for (column, sum) in product.iter_mut().zip(sums) {
                        S::as_mut_simd_f64s(column).0[part] = sum;
                    }
                }
                let height = TILE.min(rows - row_tile * TILE);
                for (c, sums) in product.iter().enumerate().take(rows - column_tile * TILE) {
                    let start = (last + column_tile * TILE + c) * size + last + row_tile * TILE;
                    matrix[start..start + height].iter_mut().zip(sums).for_each(|(v, s)| *v -= s);
                }
            }
        }
    }
}

/// Solves `A x = b` for one right-hand side, in place, with the complete Cholesky factor of `A`. Not real-time.
pub fn solve(factor: &[f64], size: usize, right: &mut [f64]) {
    for column in 0..size {
        let value = right[column] / factor[column * size + column];
        right[column] = value;
        let below = &factor[column * size + column + 1..(column + 1) * size];
        right[column + 1..size].iter_mut().zip(below).for_each(|(r, l)| *r -= l * value);
    }
    for column in (0..size).rev() {
        let below = &factor[column * size + column + 1..(column + 1) * size];
        let mut sum = right[column];
        for (l, r) in below.iter().zip(&right[column + 1..size]) {
            sum -= l * r;
        }
        right[column] = sum / factor[column * size + column];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A positive definite matrix without structure: entries of a quadratic residue sequence, a heavy diagonal.
    fn sample(size: usize) -> Vec<f64> {
        let mut matrix = vec![0.0; size * size];
        for column in 0..size {
            for row in column..size {
                let value = ((row * row + 3 * column + row * column) % 17) as f64 / 17.0;
                matrix[column * size + row] = if row == column { size as f64 + value } else { value };
            }
        }
        matrix
    }

    #[test]
    fn a_solve_gives_back_what_was_multiplied() {
        let size = 101; // neither a multiple of the panel nor of the tile
        let matrix = sample(size);
        let wanted: Vec<f64> = (0..size).map(|i| (i as f64 * 0.7).sin()).collect();
        let mut right = vec![0.0; size];
        for column in 0..size {
            for row in 0..size {
                let entry = matrix[row.min(column) * size + row.max(column)];
                right[row] += entry * wanted[column];
            }
        }
        let mut factored = matrix;
        factor(&mut factored, size, size).expect("positive definite");
        solve(&factored, size, &mut right);
        for (got, wanted) in right.iter().zip(&wanted) {
            assert!((got - wanted).abs() < 1.0e-12, "{got} {wanted}");
        }
    }

    #[test]
    fn eliminating_in_two_parts_is_eliminating_at_once() {
        let (size, part) = (77, 50);
        let mut whole = sample(size);
        factor(&mut whole, size, size).expect("positive definite");
        let mut half = sample(size);
        factor(&mut half, size, part).expect("positive definite");
        let rest = size - part;
        let mut schur = vec![0.0; rest * rest];
        for column in 0..rest {
            for row in column..rest {
                schur[column * rest + row] = half[(part + column) * size + part + row];
            }
        }
        factor(&mut schur, rest, rest).expect("positive definite");
        for column in 0..rest {
            for row in column..rest {
                let (a, b) = (schur[column * rest + row], whole[(part + column) * size + part + row]);
                assert!((a - b).abs() < 1.0e-12, "{a} {b}");
            }
        }
    }

    #[test]
    fn an_indefinite_matrix_names_its_pivot() {
        let mut matrix = vec![1.0, 2.0, 0.0, 1.0];
        assert_eq!(factor(&mut matrix, 2, 2), Err(NotPositive { pivot: 1 }));
    }
}
