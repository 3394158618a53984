//! Cubic spline over a lattice of points in space, fitted to values and gradients at scattered points.
//!
//! The fit minimises the weighted squares of the misses and a small multiple of the squared third differences, so that gaps
//! between the points are bridged by parabolas (P. H. C. Eilers, B. D. Marx, *Statist. Sci.* 11 (1996) 89-121, in three
//! dimensions), with conjugate gradients.

use crate::jet::Jet;

/// Spline with continuous second derivatives: coefficients of uniform cubic B-splines.
#[derive(Clone, Debug, PartialEq)]
pub struct Lattice {
    /// First point, m.
    pub low_m: [f64; 3],
    /// Distance of neighbours, m.
    pub step_m: f64,
    /// Number of points along each axis, at least 6.
    pub counts: [usize; 3],
    /// Coefficients, first axis first.
    pub values: Vec<f64>,
}

/// Miss that the fit makes small.
#[derive(Clone, Copy, Debug)]
pub struct Datum {
    /// Point, m.
    pub at_m: [f64; 3],
    /// Value, and its derivatives along the axes, per m.
    pub target: Jet,
    /// Weight of the value, and of each derivative times the step.
    pub weights: [f64; 2],
}

/// Factor of the third differences.
const STIFFNESS: f64 = 1.0e-3;
/// Largest number of iterations of a fit.
const MOST_STEPS: usize = 100;
/// Decrease of the residual at which a fit ends.
const TOLERANCE: f64 = 1.0e-6;

/// Returns the four B-splines at a share of a cell, and their derivatives.
fn basis(s: f64) -> ([f64; 4], [f64; 4]) {
    let r = 1.0 - s;
    let value = [
        r * r * r / 6.0,
        (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0,
        (3.0 * r * r * r - 6.0 * r * r + 4.0) / 6.0,
        s * s * s / 6.0,
    ];
    (value, [-0.5 * r * r, 1.5 * s * s - 2.0 * s, 2.0 * r - 1.5 * r * r, 0.5 * s * s])
}

/// Differences of third order: weight of the square, reach along the axes, and offsets with factors.
#[allow(clippy::type_complexity)] // used once
fn differences([_, sy, sz]: [usize; 3]) -> Vec<(f64, [usize; 3], Vec<(usize, f64)>)> {
    let line: [&[f64]; 4] = [&[1.0], &[-1.0, 1.0], &[1.0, -2.0, 1.0], &[-1.0, 3.0, -3.0, 1.0]];
    let orders = (0..4).flat_map(|i| (0..4 - i).map(move |j| [i, j, 3 - i - j]));
    let one = |[i, j, k]: [usize; 3]| {
        let mut places = Vec::new();
        for (x, a) in line[i].iter().enumerate() {
            for (y, b) in line[j].iter().enumerate() {
                places.extend(line[k].iter().enumerate().map(|(z, c)| (x + y * sy + z * sz, a * b * c)));
            }
        }
        let ways = [1.0, 1.0, 2.0, 6.0];
        (STIFFNESS * 6.0 / (ways[i] * ways[j] * ways[k]), [i, j, k], places)
    };
    orders.map(one).collect()
}

/// Rows of the fit at one point: first coefficient, and the factors of 64 coefficients for value and derivatives.
struct Row {
    first: usize,
    factors: [[f64; 64]; 4],
    right: [f64; 4],
    scale: [f64; 4],
}

impl Lattice {
    fn strides(&self) -> [usize; 3] {
        [1, self.counts[0], self.counts[0] * self.counts[1]]
    }

    /// Returns the position of a point of the lattice, m.
    #[must_use]
    pub fn place_m(&self, index: usize) -> [f64; 3] {
        let [nx, ny, _] = self.counts;
        let at = [index % nx, index / nx % ny, index / (nx * ny)];
        [0, 1, 2].map(|k| self.low_m[k] + self.step_m * at[k] as f64)
    }

    /// Returns cell and share of the cell along an axis, limited to the cells with all coefficients.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // limited to the counts
    #[inline]
    fn cell(&self, axis: usize, at_m: f64) -> (usize, f64) {
        let most = (self.counts[axis] - 2) as f64;
        let x = ((at_m - self.low_m[axis]) / self.step_m).max(1.0).min(most);
        let cell = (x as usize).min(self.counts[axis] - 3);
        (cell, x - cell as f64)
    }

    /// Returns the value with its gradient; at the border of the box beyond it. Real-time: bounded, no allocation.
    pub fn at(&self, at_m: [f64; 3]) -> Jet {
        let cells = [0, 1, 2].map(|k| self.cell(k, at_m[k]));
        let [x, y, z] = cells.map(|cell| basis(cell.1));
        let strides = self.strides();
        let first = cells[0].0 - 1 + (cells[1].0 - 1) * strides[1] + (cells[2].0 - 1) * strides[2];
        let (mut value, mut slope) = (0.0, [0.0; 3]);
        for k in 0..4 {
            let (mut plane, mut along) = (0.0, [0.0; 2]);
            for j in 0..4 {
                let row = &self.values[first + j * strides[1] + k * strides[2]..][..4];
                let (mut line, mut steep) = (0.0, 0.0);
                for i in 0..4 {
                    line += x.0[i] * row[i];
                    steep += x.1[i] * row[i];
                }
                plane += y.0[j] * line;
                along[0] += y.0[j] * steep;
                along[1] += y.1[j] * line;
            }
            value += z.0[k] * plane;
            slope[0] += z.0[k] * along[0];
            slope[1] += z.0[k] * along[1];
            slope[2] += z.1[k] * plane;
        }
        Jet { value, slope: slope.map(|s| s / self.step_m) }
    }

    /// Returns the value between eight points of a list that belongs to this lattice. Real-time: bounded, no allocation.
    #[must_use]
    pub fn between(&self, list: &[f32], at_m: [f64; 3]) -> f64 {
        let cells = [0, 1, 2].map(|k| self.cell(k, at_m[k]));
        let strides = self.strides();
        (0..8_usize)
            .map(|corner| {
                let bit = |k: usize| corner >> k & 1;
                let index: usize = (0..3).map(|k| (cells[k].0 + bit(k)) * strides[k]).sum();
                let share = |k: usize| if bit(k) == 1 { cells[k].1 } else { 1.0 - cells[k].1 };
                let weight = share(0) * share(1) * share(2);
                if weight > 0.0 { weight * f64::from(list[index]) } else { 0.0 }
            })
            .sum()
    }

    fn row(&self, datum: &Datum) -> Row {
        let cells = [0, 1, 2].map(|k| self.cell(k, datum.at_m[k]));
        let shares = cells.map(|cell| basis(cell.1));
        let strides = self.strides();
        let mut factors = [[0.0; 64]; 4];
        for (d, line) in factors.iter_mut().enumerate() {
            for (n, factor) in line.iter_mut().enumerate() {
                let of = |k: usize| if d == k + 1 { &shares[k].1 } else { &shares[k].0 };
                *factor = of(0)[n % 4] * of(1)[n / 4 % 4] * of(2)[n / 16];
            }
        }
        let slope = datum.target.slope.map(|s| s * self.step_m);
        let [value, steep] = datum.weights.map(|w| w * w);
        Row {
            first: (0..3).map(|k| (cells[k].0 - 1) * strides[k]).sum(),
            factors,
            right: [datum.target.value, slope[0], slope[1], slope[2]],
            scale: [value, steep, steep, steep],
        }
    }

    /// Fits the spline, from its present values. Not real-time.
    pub fn fit(&mut self, data: &[Datum]) {
        let rows: Vec<Row> = data.iter().map(|datum| self.row(datum)).collect();
        let [_, sy, sz] = self.strides();
        let offsets: Vec<usize> = (0..64).map(|n| n % 4 + n / 4 % 4 * sy + n / 16 * sz).collect();
        let stencils = differences(self.strides());
        let counts = self.counts;
        let apply = |x: &[f64]| -> Vec<f64> {
            let mut out = vec![0.0; x.len()];
            for row in &rows {
                for (factors, scale) in row.factors.iter().zip(row.scale).filter(|(_, scale)| *scale > 0.0) {
                    let sum: f64 = factors.iter().zip(&offsets).map(|(f, o)| f * x[row.first + o]).sum();
                    factors.iter().zip(&offsets).for_each(|(f, o)| out[row.first + o] += scale * sum * f);
                }
            }
            for (weight, reach, places) in &stencils {
                for k in 0..counts[2] - reach[2] {
                    for j in 0..counts[1] - reach[1] {
                        for first in k * sz + j * sy..k * sz + j * sy + counts[0] - reach[0] {
                            let sum: f64 = places.iter().map(|(o, f)| f * x[first + o]).sum();
                            places.iter().for_each(|(o, f)| out[first + o] += weight * sum * f);
                        }
                    }
                }
            }
            out
        };
        let mut right = vec![0.0; self.values.len()];
        for row in &rows {
            for ((factors, scale), target) in row.factors.iter().zip(row.scale).zip(row.right) {
                factors.iter().zip(&offsets).for_each(|(f, o)| right[row.first + o] += scale * target * f);
            }
        }
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let image = apply(&self.values);
        let mut rest: Vec<f64> = right.iter().zip(&image).map(|(b, a)| b - a).collect();
        let mut step = rest.clone();
        let mut size = dot(&rest, &rest);
        let end = TOLERANCE * TOLERANCE * dot(&right, &right);
        for _ in 0..MOST_STEPS {
            if size <= end {
                break;
            }
            let image = apply(&step);
            let length = size / dot(&step, &image);
            self.values.iter_mut().zip(&step).for_each(|(v, s)| *v += length * s);
            rest.iter_mut().zip(&image).for_each(|(r, i)| *r -= length * i);
            let next = dot(&rest, &rest);
            step.iter_mut().zip(&rest).for_each(|(s, r)| *s = r + next / size * *s);
            size = next;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_between_its_points_is_itself() {
        let counts = [9, 8, 10];
        let mut lattice = Lattice {
            low_m: [-1.0, 0.0, 2.0],
            step_m: 0.5,
            counts,
            values: vec![0.0; counts.iter().product()],
        };
        let f = |[x, y, z]: [f64; 3]| Jet { value: 1.0 + x * y - 0.3 * z * z, slope: [y, x, -0.6 * z] };
        let points =
            (0..64).map(|n| [0, 1, 2].map(|k| lattice.low_m[k] + 0.6 + 0.7 * f64::from(n >> (2 * k) & 3)));
        let data: Vec<Datum> =
            points.map(|at_m| Datum { at_m, target: f(at_m), weights: [1.0, 1.0] }).collect();
        for _ in 0..20 {
            lattice.fit(&data);
        }
        for at in [[0.3, 2.2, 4.1], [1.6, 0.8, 2.9]] {
            let (found, exact) = (lattice.at(at), f(at));
            assert!((found.value - exact.value).abs() < 1.0e-3, "{} {}", found.value, exact.value);
            for k in 0..3 {
                assert!((found.slope[k] - exact.slope[k]).abs() < 2.0e-3, "{k}");
                let (mut up, mut down) = (at, at);
                (up[k], down[k]) = (at[k] + 1.0e-5, at[k] - 1.0e-5);
                let difference = (lattice.at(up).value - lattice.at(down).value) / 2.0e-5;
                assert!((found.slope[k] - difference).abs() < 1.0e-8, "{k}");
            }
        }
    }
}
