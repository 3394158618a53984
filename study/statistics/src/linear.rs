//! Least squares for small designs: residuals of several responses after fitting a set of columns.

/// Matrix in row-major order.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Matrix {
    rows: usize,
    columns: usize,
    values: Vec<f64>,
}

impl Matrix {
    pub(crate) fn from_fn(rows: usize, columns: usize, value: impl Fn(usize, usize) -> f64) -> Self {
        let cells = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
        Self { rows, columns, values: cells.map(|(row, column)| value(row, column)).collect() }
    }

    pub(crate) fn rows(&self) -> usize {
        self.rows
    }

    pub(crate) fn columns(&self) -> usize {
        self.columns
    }

    /// Returns the entry at a position; zero outside the matrix.
    pub(crate) fn at(&self, row: usize, column: usize) -> f64 {
        if column >= self.columns {
            return 0.0;
        }
        self.values.get(row * self.columns + column).copied().unwrap_or(0.0)
    }

    fn column(&self, column: usize) -> Vec<f64> {
        (0..self.rows).map(|row| self.at(row, column)).collect()
    }

    pub(crate) fn times(&self, other: &Self) -> Self {
        Self::from_fn(self.rows, other.columns, |row, column| {
            (0..self.columns).map(|k| self.at(row, k) * other.at(k, column)).sum()
        })
    }

    /// Returns the Kronecker product.
    pub(crate) fn kronecker(&self, other: &Self) -> Self {
        Self::from_fn(self.rows * other.rows, self.columns * other.columns, |row, column| {
            self.at(row / other.rows, column / other.columns)
                * other.at(row % other.rows, column % other.columns)
        })
    }

    /// Concatenates two matrices horizontally.
    pub(crate) fn beside(&self, other: &Self) -> Self {
        Self::from_fn(self.rows.max(other.rows), self.columns + other.columns, |row, column| {
            if column < self.columns { self.at(row, column) } else { other.at(row, column - self.columns) }
        })
    }

    pub(crate) fn trace(&self) -> f64 {
        (0..self.rows.min(self.columns)).map(|k| self.at(k, k)).sum()
    }

    /// Returns the sum of all squared entries; for a symmetric matrix, the trace of its square.
    pub(crate) fn trace_of_square(&self) -> f64 {
        self.values.iter().map(|value| value * value).sum()
    }
}

/// Orthonormal basis of a matrix's columns (Gram-Schmidt, twice: Kahan and Parlett's "twice is enough").
pub(crate) struct Basis {
    columns: Vec<Vec<f64>>,
}

/// Relative length of a residual column below which the column counts as linearly dependent.
const DEPENDENT: f64 = 1.0e-10;

impl Basis {
    pub(crate) fn of(design: &Matrix) -> Self {
        let mut basis = Self { columns: Vec::new() };
        for column in 0..design.columns() {
            let column = design.column(column);
            let least = DEPENDENT * norm(&column);
            basis.extend(column, least);
        }
        basis
    }

    /// Adds the direction of a column's residual; ignores a residual of length `least` or less: the column is dependent.
    fn extend(&mut self, column: Vec<f64>, least: f64) {
        let left = self.residual(column);
        let length = norm(&left);
        if length > least {
            self.columns.push(left.into_iter().map(|value| value / length).collect());
        }
    }

    /// Returns the number of linearly independent columns.
    pub(crate) fn rank(&self) -> usize {
        self.columns.len()
    }

    /// Returns the part of `values` orthogonal to the basis, by two passes of Gram-Schmidt.
    fn residual(&self, mut values: Vec<f64>) -> Vec<f64> {
        for column in self.columns.iter().chain(&self.columns) {
            let share = dot(column, &values);
            values.iter_mut().zip(column).for_each(|(value, unit)| *value -= share * unit);
        }
        values
    }

    /// Returns sums of squares and products of the residuals of each column of `responses`.
    pub(crate) fn residual_products(&self, responses: &Matrix) -> Matrix {
        let left = (0..responses.columns()).map(|column| self.residual(responses.column(column)));
        products(&left.collect::<Vec<_>>())
    }

    /// Returns sums of squares and products explained by this basis beyond `smaller`, which must span a subspace of this basis.
    pub(crate) fn products_beyond(&self, smaller: &Self, responses: &Matrix) -> Matrix {
        let mut extended = Self { columns: smaller.columns.clone() };
        self.columns.iter().for_each(|column| extended.extend(column.clone(), DEPENDENT));
        let beyond = extended.columns.split_off(smaller.rank());
        let shares: Vec<Vec<f64>> = (0..responses.columns())
            .map(|column| {
                // Use residuals of the smaller basis: a large mean would swamp a small effect with rounding errors.
                let response = smaller.residual(responses.column(column));
                beyond.iter().map(|unit| dot(unit, &response)).collect()
            })
            .collect();
        products(&shares)
    }
}

fn products(columns: &[Vec<f64>]) -> Matrix {
    let column = |index: usize| columns.get(index).map_or(&[][..], Vec::as_slice);
    Matrix::from_fn(columns.len(), columns.len(), |row, other| dot(column(row), column(other)))
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn norm(values: &[f64]) -> f64 {
    dot(values, values).sqrt()
}
