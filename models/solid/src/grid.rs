//! Grid of box-shaped finite elements of any order in a block.
//!
//! Elements of order 2 are the quadratic bricks of 27 nodes. Orders above 1 do not lock: bending needs a strain that
//! varies over the element, and near incompressibility more degrees of freedom than constraints.

use crate::basis::{Rule, element_points, gauss, lagrange, lagrange_slopes};

/// Element borders and nodes along an axis of a grid.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Borders of the elements, m, ascending.
    pub borders_m: Vec<f64>,
    /// Positions of all nodes, m, ascending; `order` nodes per element and one more.
    pub nodes_m: Vec<f64>,
}

impl Axis {
    /// Places the nodes of elements between borders, m. Not real-time.
    #[must_use]
    pub fn new(borders_m: Vec<f64>, order: usize) -> Self {
        let points = element_points(order);
        let mut nodes_m = vec![borders_m[0]];
        for pair in borders_m.windows(2) {
            let (middle, half) = (0.5 * (pair[0] + pair[1]), 0.5 * (pair[1] - pair[0]));
            nodes_m.extend(points[1..order].iter().map(|point| middle + half * point));
            nodes_m.push(pair[1]);
        }
        Self { borders_m, nodes_m }
    }

    /// Returns the number of elements.
    #[must_use]
    pub fn elements(&self) -> usize {
        self.borders_m.len() - 1
    }

    /// Finds the element of a coordinate (the nearest, outside) and the local coordinate: -1 at the lower border, 1 at the upper.
    #[must_use]
    pub fn locate(&self, coordinate_m: f64) -> (usize, f64) {
        let last = self.elements() - 1;
        let element = self.borders_m[1..=last].iter().take_while(|&&border| border <= coordinate_m).count();
        let (low, high) = (self.borders_m[element], self.borders_m[element + 1]);
        (element, ((2.0 * coordinate_m - low - high) / (high - low)).clamp(-1.0, 1.0))
    }
}

/// Returns the borders of elements between `near` and `far`, ascending; from `near` on, each element is longer than the element
/// before by the factor `ratio`.
#[must_use]
pub fn graded(near: f64, far: f64, elements: usize, ratio: f64) -> Vec<f64> {
    let mut step = 1.0;
    let mut sums = vec![0.0];
    for _ in 0..elements {
        sums.push(sums[sums.len() - 1] + step);
        step *= ratio;
    }
    let total = sums[elements];
    let mut borders: Vec<f64> = sums.iter().map(|sum| near + (far - near) * sum / total).collect();
    borders[elements] = far;
    if near > far {
        borders.reverse();
    }
    borders
}

/// Block of box-shaped elements. Nodes are numbered x first, then y, then z.
#[derive(Clone, Debug)]
pub struct Grid {
    /// Order of the elements.
    pub order: usize,
    /// Axes x, y, z.
    pub axes: [Axis; 3],
}

/// Lamé's constants of a material, Pa.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lame {
    /// Lamé's first constant, Pa.
    pub lambda_pa: f64,
    /// Shear modulus, Pa.
    pub mu_pa: f64,
}

impl Lame {
    /// Computes the constants from Young's modulus and Poisson's ratio (below 0.5).
    #[must_use]
    pub fn new(youngs_modulus_pa: f64, poisson_ratio: f64) -> Self {
        Self {
            lambda_pa: youngs_modulus_pa * poisson_ratio
                / ((1.0 + poisson_ratio) * (1.0 - 2.0 * poisson_ratio)),
            mu_pa: youngs_modulus_pa / (2.0 * (1.0 + poisson_ratio)),
        }
    }
}

/// Interpolation at a point of a grid: nodes around the point with their weights.
#[derive(Clone, Debug)]
pub struct Sample {
    /// Indices of the nodes.
    pub nodes: Vec<usize>,
    /// Values of the shape functions of the nodes at the point.
    pub shares: Vec<f64>,
}

impl Grid {
    /// Builds elements between borders along x, y and z, m. Not real-time.
    #[must_use]
    pub fn new(borders_m: [Vec<f64>; 3], order: usize) -> Self {
        Self { order, axes: borders_m.map(|borders| Axis::new(borders, order)) }
    }

    /// Returns the number of nodes along x, y and z.
    #[must_use]
    pub fn nodes_along(&self) -> [usize; 3] {
        [0, 1, 2].map(|axis| self.axes[axis].nodes_m.len())
    }

    /// Returns the total number of nodes.
    #[must_use]
    pub fn node_count(&self) -> usize {
        self.nodes_along().iter().product()
    }

    /// Returns the index of the node from its indices along x, y and z.
    #[must_use]
    pub fn node(&self, index: [usize; 3]) -> usize {
        let [nx, ny, _] = self.nodes_along();
        (index[2] * ny + index[1]) * nx + index[0]
    }

    /// Returns the indices of a node along x, y and z.
    #[must_use]
    pub fn index(&self, node: usize) -> [usize; 3] {
        let [nx, ny, _] = self.nodes_along();
        [node % nx, node / nx % ny, node / (nx * ny)]
    }

    /// Returns the position of a node, m.
    #[must_use]
    pub fn position_m(&self, node: usize) -> [f64; 3] {
        let index = self.index(node);
        [0, 1, 2].map(|axis| self.axes[axis].nodes_m[index[axis]])
    }

    /// Returns the nodes of an element, x first.
    #[must_use]
    pub fn element_nodes(&self, element: [usize; 3]) -> Vec<usize> {
        let side = self.order + 1;
        let mut nodes = Vec::with_capacity(side * side * side);
        for k in 0..side {
            for j in 0..side {
                for i in 0..side {
                    nodes.push(self.node([
                        element[0] * self.order + i,
                        element[1] * self.order + j,
                        element[2] * self.order + k,
                    ]));
                }
            }
        }
        nodes
    }

    /// Returns the nodes of the element at a point, with the values of their shape functions there; a point outside is clamped to
    /// the block. Not real-time.
    #[must_use]
    pub fn sample(&self, position_m: [f64; 3]) -> Sample {
        let points = element_points(self.order);
        let side = self.order + 1;
        let located = [0, 1, 2].map(|axis| self.axes[axis].locate(position_m[axis]));
        let values = located.map(|(_, local)| {
            let mut values = vec![0.0; side];
            lagrange(&points, local, &mut values);
            values
        });
        let nodes = self.element_nodes(located.map(|(element, _)| element));
        let mut shares = Vec::with_capacity(nodes.len());
        for k in 0..side {
            for j in 0..side {
                for i in 0..side {
                    shares.push(values[0][i] * values[1][j] * values[2][k]);
                }
            }
        }
        Sample { nodes, shares }
    }
}

/// Stiffness matrices of single elements, from precomputed integrals along each axis.
#[derive(Clone, Debug)]
pub struct Elements {
    order: usize,
    /// `int N_a N_b`, `int N'_a N_b`, `int N'_a N'_b` over -1..1.
    mass: Vec<f64>,
    mixed: Vec<f64>,
    slope: Vec<f64>,
}

impl Elements {
    /// Computes the integrals for elements of this order. Not real-time.
    #[must_use]
    pub fn new(order: usize) -> Self {
        let side = order + 1;
        let points = element_points(order);
        let Rule { points: at, weights } = gauss(side);
        let [mut mass, mut mixed, mut slope] = [(); 3].map(|()| vec![0.0; side * side]);
        let (mut n, mut d) = (vec![0.0; side], vec![0.0; side]);
        for (&x, &weight) in at.iter().zip(&weights) {
            lagrange(&points, x, &mut n);
            lagrange_slopes(&points, x, &mut d);
            for a in 0..side {
                for b in 0..side {
                    mass[a * side + b] += weight * n[a] * n[b];
                    mixed[a * side + b] += weight * d[a] * n[b];
                    slope[a * side + b] += weight * d[a] * d[b];
                }
            }
        }
        Self { order, mass, mixed, slope }
    }

    /// Returns the element stiffness matrix of a box-shaped element with sides `size_m`, N/m: column-major, three degrees of
    /// freedom per node, node index varying fastest along x, then y, then z.
    #[must_use]
    pub fn stiffness(&self, size_m: [f64; 3], lame: Lame) -> Vec<f64> {
        let side = self.order + 1;
        let count = side * side * side;
        let size = 3 * count;
        let half = size_m.map(|s| 0.5 * s);
        let split = |node: usize| [node % side, node / side % side, node / (side * side)];
        let mut matrix = vec![0.0; size * size];
        for a in 0..count {
            let at = split(a);
            for b in 0..count {
                let bt = split(b);
                let pair = |axis: usize| at[axis] * side + bt[axis];
                let mass = [0, 1, 2].map(|axis| self.mass[pair(axis)] * half[axis]);
                let slope = [0, 1, 2].map(|axis| self.slope[pair(axis)] / half[axis]);
                // d_i N_a d_j N_b
                let mut products = [[0.0; 3]; 3];
                for (i, row) in products.iter_mut().enumerate() {
                    for (j, product) in row.iter_mut().enumerate() {
                        *product = if i == j {
                            slope[i] * mass[(i + 1) % 3] * mass[(i + 2) % 3]
                        } else {
                            self.mixed[pair(i)] * self.mixed[bt[j] * side + at[j]] * mass[3 - i - j]
                        };
                    }
                }
                let trace = products[0][0] + products[1][1] + products[2][2];
                for i in 0..3 {
                    for j in 0..3 {
                        let mut value = lame.lambda_pa * products[i][j] + lame.mu_pa * products[j][i];
                        if i == j {
                            value += lame.mu_pa * trace;
                        }
                        matrix[(3 * b + j) * size + 3 * a + i] = value;
                    }
                }
            }
        }
        matrix
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_element_carries_rigid_motion_and_even_strain_exactly() {
        let size_m = [0.3, 0.2, 0.5];
        let lame = Lame::new(1.0e3, 0.3);
        for order in [2, 3, 4] {
            let grid = Grid::new([vec![0.0, 0.3], vec![0.0, 0.2], vec![0.0, 0.5]], order);
            let matrix = Elements::new(order).stiffness(size_m, lame);
            let size = 3 * grid.node_count();
            let gradient = [[0.01, 0.02, -0.03], [0.005, -0.02, 0.04], [0.03, 0.01, 0.02]];
            let mut u = vec![0.0; size];
            for node in 0..grid.node_count() {
                let x = grid.position_m(node);
                for i in 0..3 {
                    u[3 * node + i] = 0.7 + (0..3).map(|j| gradient[i][j] * x[j]).sum::<f64>();
                }
            }
            let mut energy_j = 0.0;
            for column in 0..size {
                for row in 0..size {
                    energy_j += 0.5 * u[row] * matrix[column * size + row] * u[column];
                }
            }
            let strain = |i: usize, j: usize| 0.5 * (gradient[i][j] + gradient[j][i]);
            let trace: f64 = (0..3).map(|i| strain(i, i)).sum();
            let square: f64 = (0..9).map(|k| strain(k / 3, k % 3) * strain(k / 3, k % 3)).sum();
            let exact = 0.03 * (0.5 * lame.lambda_pa * trace * trace + lame.mu_pa * square);
            assert!((energy_j - exact).abs() < 1.0e-11 * exact.max(1.0), "{order}: {energy_j} {exact}");
        }
    }

    #[test]
    fn a_graded_axis_ends_where_it_should() {
        assert_eq!(graded(0.0, 1.0, 2, 3.0), vec![0.0, 0.25, 1.0]);
        assert_eq!(graded(1.0, 0.0, 2, 3.0), vec![0.0, 0.75, 1.0]);
    }
}
