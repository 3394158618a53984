//! Least squares for small designs: what is left of several responses after a set of columns is fitted.

/// A matrix, row by row.
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

    /// The value at a place; zero outside, so that no index can fail.
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

    /// Every product of an entry of `self` with one of `other`, in blocks.
    pub(crate) fn kronecker(&self, other: &Self) -> Self {
        Self::from_fn(self.rows * other.rows, self.columns * other.columns, |row, column| {
            self.at(row / other.rows, column / other.columns)
                * other.at(row % other.rows, column % other.columns)
        })
    }

    /// Side by side.
    pub(crate) fn beside(&self, other: &Self) -> Self {
        Self::from_fn(self.rows.max(other.rows), self.columns + other.columns, |row, column| {
            if column < self.columns { self.at(row, column) } else { other.at(row, column - self.columns) }
        })
    }

    pub(crate) fn trace(&self) -> f64 {
        (0..self.rows.min(self.columns)).map(|k| self.at(k, k)).sum()
    }

    /// Trace of the square of a symmetric matrix: the sum of the squares of all its numbers, as of any other.
    pub(crate) fn trace_of_square(&self) -> f64 {
        self.values.iter().map(|value| value * value).sum()
    }
}

/// Columns made orthonormal, one after the other (Gram-Schmidt, twice: Kahan and Parlett's "twice is enough").
pub(crate) struct Basis {
    columns: Vec<Vec<f64>>,
}

/// Below this share of its length, what is left of a column is rounding: the column adds nothing.
const DEPENDENT: f64 = 1.0e-10;

impl Basis {
    pub(crate) fn of(design: &Matrix) -> Self {
        let mut basis = Self { columns: Vec::new() };
        for column in 0..design.columns() {
            let original = design.column(column);
            let left = basis.residual(basis.residual(original.clone()));
            let length = norm(&left);
            if length > DEPENDENT * norm(&original) {
                basis.columns.push(left.into_iter().map(|value| value / length).collect());
            }
        }
        basis
    }

    /// How many columns are independent.
    pub(crate) fn rank(&self) -> usize {
        self.columns.len()
    }

    fn residual(&self, mut values: Vec<f64>) -> Vec<f64> {
        for column in &self.columns {
            let share = dot(column, &values);
            values.iter_mut().zip(column).for_each(|(value, unit)| *value -= share * unit);
        }
        values
    }

    /// Sums of squares and products of what the basis leaves of each column of `responses`.
    pub(crate) fn residual_products(&self, responses: &Matrix) -> Matrix {
        let left: Vec<Vec<f64>> = (0..responses.columns())
            .map(|column| self.residual(self.residual(responses.column(column))))
            .collect();
        products(&left)
    }

    /// Sums of squares and products of what this basis explains beyond a smaller one: its columns beyond those of
    /// `smaller`, which must span a part of what it spans.
    pub(crate) fn products_beyond(&self, smaller: &Self, responses: &Matrix) -> Matrix {
        let mut extended = Self { columns: smaller.columns.clone() };
        let mut beyond = Vec::new();
        for column in &self.columns {
            let left = extended.residual(extended.residual(column.clone()));
            let length = norm(&left);
            if length > DEPENDENT {
                let unit: Vec<f64> = left.into_iter().map(|value| value / length).collect();
                extended.columns.push(unit.clone());
                beyond.push(unit);
            }
        }
        let shares: Vec<Vec<f64>> = (0..responses.columns())
            .map(|column| {
                // Without what the smaller basis explains: a large mean would drown a small effect in rounding.
                let response = smaller.residual(smaller.residual(responses.column(column)));
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
