//! Splines through tables: twice continuously differentiable cubics in one and three variables.

use crate::jet::Jet;

/// End condition of a spline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// Zero slope, as on a mirror plane.
    Level,
    /// Slope of the parabola through the three nodes nearest to the end.
    Parabola,
}

/// Returns the slopes at the nodes (at least three) of the cubic spline with continuous second derivatives. Not real-time.
#[must_use]
pub fn slopes(nodes: &[f64], values: &[f64], ends: [End; 2]) -> Vec<f64> {
    let last = nodes.len() - 1;
    let chord = |i: usize| (values[i + 1] - values[i]) / (nodes[i + 1] - nodes[i]);
    let parabola = |near: usize, far: usize, step: f64, beside: f64| {
        let (a, b) = (chord(near), chord(far));
        a + (a - b) * step / (step + beside)
    };
    let width = |i: usize| nodes[i + 1] - nodes[i];
    let first = match ends[0] {
        End::Level => 0.0,
        End::Parabola => parabola(0, 1, width(0), width(1)),
    };
    let final_slope = match ends[1] {
        End::Level => 0.0,
        End::Parabola => parabola(last - 1, last - 2, width(last - 1), width(last - 2)),
    };
    // Thomas's elimination of: s[i-1]/h[i-1] + 2 s[i] (1/h[i-1] + 1/h[i]) + s[i+1]/h[i] = 3 (c[i-1]/h[i-1] + c[i]/h[i]).
    let (mut upper, mut right) = (vec![0.0; last + 1], vec![0.0; last + 1]);
    right[0] = first;
    for i in 1..last {
        let (low, high) = (1.0 / width(i - 1), 1.0 / width(i));
        let pivot = 2.0 * (low + high) - low * upper[i - 1];
        upper[i] = high / pivot;
        right[i] = (3.0 * (chord(i - 1) * low + chord(i) * high) - low * right[i - 1]) / pivot;
    }
    right[last] = final_slope;
    for i in (1..last).rev() {
        right[i] -= upper[i] * right[i + 1];
    }
    right
}

/// Returns the cell of a coordinate inside the nodes. Real-time: bounded, no allocation.
fn cell(nodes: &[f64], at: f64) -> usize {
    nodes[1..nodes.len() - 1].iter().take_while(|&&node| node <= at).count()
}

/// Returns Hermite's four functions and their derivatives: factors of the values at the lower and upper node, then of the slopes.
fn hermite(nodes: &[f64], index: usize, at: f64) -> ([f64; 4], [f64; 4]) {
    let width = nodes[index + 1] - nodes[index];
    let s = (at - nodes[index]) / width;
    let r = 1.0 - s;
    (
        [r * r * (1.0 + 2.0 * s), s * s * (1.0 + 2.0 * r), width * s * r * r, -width * s * s * r],
        [-6.0 * s * r / width, 6.0 * s * r / width, r * (1.0 - 3.0 * s), s * (3.0 * s - 2.0)],
    )
}

/// Cubic spline in one variable.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    nodes: Vec<f64>,
    values: Vec<f64>,
    slopes: Vec<f64>,
}

impl Curve {
    /// Interpolates values at ascending nodes, at least three. Not real-time.
    #[must_use]
    pub fn new(nodes: Vec<f64>, values: Vec<f64>, ends: [End; 2]) -> Self {
        let slopes = slopes(&nodes, &values, ends);
        Self { nodes, values, slopes }
    }

    /// Appends count, nodes and values, for [`Self::from_numbers`]. Not real-time.
    pub fn write_numbers(&self, numbers: &mut Vec<f64>) {
        numbers.push(self.nodes.len() as f64);
        numbers.extend(&self.nodes);
        numbers.extend(&self.values);
    }

    /// Removes count, nodes and values from the front and restores the spline; `None` if they are incomplete, or the count is not
    /// from 3 to 1000. Not real-time.
    #[must_use]
    pub fn from_numbers(numbers: &mut &[f64], ends: [End; 2]) -> Option<Self> {
        let count = whole(take(numbers, 1)?[0])?;
        let nodes = take(numbers, count)?.to_vec();
        Some(Self::new(nodes, take(numbers, count)?.to_vec(), ends))
    }

    /// Returns value and derivative at a coordinate between the first and last node. Real-time: bounded, no allocation.
    #[must_use]
    pub fn at(&self, coordinate: f64) -> (f64, f64) {
        let i = cell(&self.nodes, coordinate);
        let (h, d) = hermite(&self.nodes, i, coordinate);
        let data = [self.values[i], self.values[i + 1], self.slopes[i], self.slopes[i + 1]];
        let sum = |shares: [f64; 4]| shares.iter().zip(&data).map(|(s, v)| s * v).sum();
        (sum(h), sum(d))
    }

    /// Returns the second derivative at a coordinate between the first and last node. Real-time: bounded, no allocation.
    #[must_use]
    pub fn curvature(&self, coordinate: f64) -> f64 {
        let i = cell(&self.nodes, coordinate);
        let width = self.nodes[i + 1] - self.nodes[i];
        let s = (coordinate - self.nodes[i]) / width;
        let bend = (self.values[i + 1] - self.values[i]) * (6.0 - 12.0 * s) / width;
        let turn = self.slopes[i] * (6.0 * s - 4.0) + self.slopes[i + 1] * (6.0 * s - 2.0);
        (bend + turn) / width
    }
}

/// Removes `count` numbers from the front and returns them; `None` if there are fewer.
pub(crate) fn take<'a>(numbers: &mut &'a [f64], count: usize) -> Option<&'a [f64]> {
    let (front, rest) = numbers.split_at_checked(count)?;
    *numbers = rest;
    Some(front)
}

/// Converts to a number of nodes; `None` unless whole and from 3 to 1000.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 3 to 1000
pub(crate) fn whole(number: f64) -> Option<usize> {
    (number.fract() == 0.0 && (3.0..=1000.0).contains(&number)).then_some(number as usize)
}

/// Tricubic spline: at each node the value and seven partial derivatives, at most of first order along each axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Volume {
    nodes: [Vec<f64>; 3],
    /// Values by node, first axis first; bit `k` of the inner index: derivative along axis `k`.
    data: Vec<[f64; 8]>,
}

impl Volume {
    /// Interpolates values at ascending nodes, at least three along each axis; the index of the first axis varies fastest. Not
    /// real-time.
    #[must_use]
    pub fn new(nodes: [Vec<f64>; 3], values: &[f64], ends: [[End; 2]; 3]) -> Self {
        let counts = [0, 1, 2].map(|axis| nodes[axis].len());
        let mut data: Vec<[f64; 8]> = values
            .iter()
            .map(|&value| {
                let mut all = [0.0; 8];
                all[0] = value;
                all
            })
            .collect();
        let strides = [1, counts[0], counts[0] * counts[1]];
        for axis in 0..3 {
            for known in (0..1_usize << axis).collect::<Vec<_>>() {
                for start in 0..values.len() {
                    if start / strides[axis] % counts[axis] != 0 {
                        continue;
                    }
                    let at = |i: usize| start + i * strides[axis];
                    let line: Vec<f64> = (0..counts[axis]).map(|i| data[at(i)][known]).collect();
                    // A derivative along another axis has the same end condition as the value.
                    for (i, slope) in slopes(&nodes[axis], &line, ends[axis]).into_iter().enumerate() {
                        data[at(i)][known | 1 << axis] = slope;
                    }
                }
            }
        }
        Self { nodes, data }
    }

    /// Appends counts, nodes and values, for [`Self::from_numbers`]. Not real-time.
    pub fn write_numbers(&self, numbers: &mut Vec<f64>) {
        numbers.extend(self.nodes.iter().map(|nodes| nodes.len() as f64));
        self.nodes.iter().for_each(|nodes| numbers.extend(nodes));
        numbers.extend(self.data.iter().map(|data| data[0]));
    }

    /// Removes counts, nodes and values from the front and restores the spline; `None` if they are incomplete, or a count is not
    /// from 3 to 1000. Not real-time.
    #[must_use]
    pub fn from_numbers(numbers: &mut &[f64], ends: [[End; 2]; 3]) -> Option<Self> {
        let mut counts = [0; 3];
        for (count, number) in counts.iter_mut().zip(take(numbers, 3)?) {
            *count = whole(*number)?;
        }
        let nodes = [
            take(numbers, counts[0])?.to_vec(),
            take(numbers, counts[1])?.to_vec(),
            take(numbers, counts[2])?.to_vec(),
        ];
        let values = take(numbers, counts.iter().product())?;
        Some(Self::new(nodes, values, ends))
    }

    /// Returns the first and last node of an axis.
    #[must_use]
    pub fn range(&self, axis: usize) -> (f64, f64) {
        let nodes = &self.nodes[axis];
        (nodes[0], nodes[nodes.len() - 1])
    }

    /// Returns the value, with its gradient, at coordinates between first and last nodes. Real-time: bounded, no allocation.
    pub fn at(&self, coordinates: [Jet; 3]) -> Jet {
        let cells = [0, 1, 2].map(|axis| cell(&self.nodes[axis], coordinates[axis].value));
        let shares = [0, 1, 2].map(|axis| hermite(&self.nodes[axis], cells[axis], coordinates[axis].value));
        let counts = [self.nodes[0].len(), self.nodes[1].len()];
        let (mut value, mut partial) = (0.0, [0.0; 3]);
        for corner in 0..8_usize {
            let bit = |axis: usize| corner >> axis & 1;
            let node = ((cells[2] + bit(2)) * counts[1] + cells[1] + bit(1)) * counts[0] + cells[0] + bit(0);
            for (kind, number) in self.data[node].iter().enumerate() {
                let pick = |axis: usize| bit(axis) + 2 * (kind >> axis & 1);
                let share = |axis: usize| shares[axis].0[pick(axis)];
                let slope = |axis: usize| shares[axis].1[pick(axis)];
                value += number * share(0) * share(1) * share(2);
                partial[0] += number * slope(0) * share(1) * share(2);
                partial[1] += number * share(0) * slope(1) * share(2);
                partial[2] += number * share(0) * share(1) * slope(2);
            }
        }
        let mut slope = [0.0; 3];
        for (axis, jet) in coordinates.iter().enumerate() {
            slope.iter_mut().zip(jet.slope).for_each(|(sum, s)| *sum += partial[axis] * s);
        }
        Jet { value, slope }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_itself() {
        let nodes = vec![0.0, 0.3, 1.0, 1.2, 2.0];
        let values: Vec<f64> = nodes.iter().map(|x| 1.0 + 2.0 * x * x).collect();
        let curve = Curve::new(nodes, values, [End::Level, End::Parabola]);
        for i in 0..20 {
            let x = 0.1 * f64::from(i);
            let (value, slope) = curve.at(x);
            assert!((value - 1.0 - 2.0 * x * x).abs() < 1.0e-13 && (slope - 4.0 * x).abs() < 1.0e-12);
        }
    }

    #[test]
    fn a_product_of_parabolas_is_itself_and_so_is_its_gradient() {
        let nodes = [vec![0.0, 0.4, 1.0, 1.5], vec![-1.0, 0.0, 0.7, 1.0], vec![0.0, 0.5, 2.0]];
        let f = |x: f64, y: f64, z: f64| (1.0 + x * x) * (2.0 - y + y * y) * (z - 0.3 * z * z);
        let mut values = Vec::new();
        for z in &nodes[2] {
            for y in &nodes[1] {
                for x in &nodes[0] {
                    values.push(f(*x, *y, *z));
                }
            }
        }
        let ends = [[End::Level, End::Parabola], [End::Parabola; 2], [End::Parabola; 2]];
        let volume = Volume::new(nodes, &values, ends);
        let at = [0.8, 0.3, 1.1];
        let jet = volume.at([0, 1, 2].map(|axis| Jet::variable(at[axis], axis)));
        assert!((jet.value - f(at[0], at[1], at[2])).abs() < 1.0e-12);
        for axis in 0..3 {
            let (mut up, mut down, h) = (at, at, 1.0e-5);
            up[axis] += h;
            down[axis] -= h;
            let difference = (f(up[0], up[1], up[2]) - f(down[0], down[1], down[2])) / (2.0 * h);
            assert!((jet.slope[axis] - difference).abs() < 1.0e-9);
        }
    }
}
