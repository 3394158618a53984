//! Elements of a body of any shape: quadratic tetrahedra of 10 nodes and bricks of 20.
//!
//! Nodes are numbered as in Gmsh: corners first, then the middles of the edges. Both elements have more degrees of
//! freedom than a nearly incompressible material has constraints, so they do not lock; bricks of 20 nodes stiffen
//! slightly above a Poisson's ratio of 0.45.

use crate::basis::gauss;
use crate::grid::Lame;

/// Shape of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Quadratic tetrahedron of 10 nodes.
    Tetrahedron,
    /// Quadratic brick of 20 nodes.
    Brick,
}

/// Quadrature point: coordinates in the reference element, and weight.
pub type Point<const N: usize> = ([f64; N], f64);

const TETRAHEDRON_EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [0, 2], [0, 3], [2, 3], [1, 3]];
const BRICK_EDGES: [[usize; 2]; 12] =
    [[0, 1], [0, 3], [0, 4], [1, 2], [1, 5], [2, 3], [2, 6], [3, 7], [4, 5], [4, 7], [5, 6], [6, 7]];
const TETRAHEDRON_FACES: [&[usize]; 4] = [&[0, 2, 1], &[0, 1, 3], &[0, 3, 2], &[1, 2, 3]];
const BRICK_FACES: [&[usize]; 6] =
    [&[0, 3, 2, 1], &[4, 5, 6, 7], &[0, 1, 5, 4], &[1, 2, 6, 5], &[2, 3, 7, 6], &[3, 0, 4, 7]];
/// Coordinates of the corners of a brick in the reference element.
const BRICK_CORNERS: [[f64; 3]; 8] = [
    [-1.0, -1.0, -1.0],
    [1.0, -1.0, -1.0],
    [1.0, 1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
    [1.0, -1.0, 1.0],
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
];

impl Kind {
    /// Returns the number of corners: 4 of a tetrahedron, 8 of a brick.
    #[must_use]
    pub fn corners(self) -> usize {
        match self {
            Self::Tetrahedron => 4,
            Self::Brick => 8,
        }
    }

    /// Returns the two corners of each edge; the middle of edge `i` is node `corners + i`.
    #[must_use]
    pub fn edges(self) -> &'static [[usize; 2]] {
        match self {
            Self::Tetrahedron => &TETRAHEDRON_EDGES,
            Self::Brick => &BRICK_EDGES,
        }
    }

    /// Returns the corners of each face, counterclockwise seen from outside.
    #[must_use]
    pub fn faces(self) -> &'static [&'static [usize]] {
        match self {
            Self::Tetrahedron => &TETRAHEDRON_FACES,
            Self::Brick => &BRICK_FACES,
        }
    }

    /// Returns the coordinates of the corners in the reference element.
    #[must_use]
    pub fn corner_places(self) -> Vec<[f64; 3]> {
        match self {
            Self::Tetrahedron => vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            Self::Brick => BRICK_CORNERS.to_vec(),
        }
    }

    /// Returns the coordinates of all nodes in the reference element.
    #[must_use]
    pub fn node_places(self) -> Vec<[f64; 3]> {
        let corners = self.corner_places();
        let middle = |[a, b]: &[usize; 2]| [0, 1, 2].map(|k| 0.5 * (corners[*a][k] + corners[*b][k]));
        corners.iter().copied().chain(self.edges().iter().map(middle)).collect()
    }

    /// Returns the number of nodes: 10 of a tetrahedron, 20 of a brick.
    #[must_use]
    pub fn nodes(self) -> usize {
        self.corners() + self.edges().len()
    }

    /// Returns the nodes of a face: corners, then middles of its edges, the first between the first two corners.
    #[must_use]
    pub fn face_nodes(self, face: usize) -> Vec<usize> {
        let corners = self.faces()[face];
        let mut nodes = corners.to_vec();
        for (i, &from) in corners.iter().enumerate() {
            let to = corners[(i + 1) % corners.len()];
            let edge = self.edges().iter().position(|e| *e == [from, to] || *e == [to, from]);
            nodes.push(self.corners() + edge.unwrap_or_default());
        }
        nodes
    }

    /// Returns the shape functions of all nodes at a point of the reference element, with their gradients. The corners of the
    /// reference tetrahedron are the origin and the unit points; the reference brick extends over -1..1 along each axis.
    #[must_use]
    pub fn shapes(self, at: [f64; 3]) -> Vec<(f64, [f64; 3])> {
        match self {
            Self::Tetrahedron => {
                let share = [1.0 - at[0] - at[1] - at[2], at[0], at[1], at[2]];
                let slope = [[-1.0, -1.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
                let corner = |i: usize| {
                    let s = share[i];
                    (s * (2.0 * s - 1.0), slope[i].map(|d| (4.0 * s - 1.0) * d))
                };
                let middle = |[a, b]: [usize; 2]| {
                    let slopes = [0, 1, 2].map(|k| 4.0 * (share[a] * slope[b][k] + share[b] * slope[a][k]));
                    (4.0 * share[a] * share[b], slopes)
                };
                (0..4).map(corner).chain(TETRAHEDRON_EDGES.into_iter().map(middle)).collect()
            }
            Self::Brick => {
                let corner = |signs: [f64; 3]| {
                    let f = [0, 1, 2].map(|k| 1.0 + at[k] * signs[k]);
                    let sum = at[0] * signs[0] + at[1] * signs[1] + at[2] * signs[2] - 2.0;
                    let slopes = [0, 1, 2].map(|k| {
                        let (a, b) = (f[(k + 1) % 3], f[(k + 2) % 3]);
                        0.125 * signs[k] * a * b * (sum + f[k])
                    });
                    (0.125 * f[0] * f[1] * f[2] * sum, slopes)
                };
                let middle = |[a, b]: [usize; 2]| {
                    let signs = [0, 1, 2].map(|k| 0.5 * (BRICK_CORNERS[a][k] + BRICK_CORNERS[b][k]));
                    let f = [0, 1, 2]
                        .map(|k| if signs[k] == 0.0 { 1.0 - at[k] * at[k] } else { 1.0 + at[k] * signs[k] });
                    let d = [0, 1, 2].map(|k| if signs[k] == 0.0 { -2.0 * at[k] } else { signs[k] });
                    let slopes = [0, 1, 2].map(|k| 0.25 * d[k] * f[(k + 1) % 3] * f[(k + 2) % 3]);
                    (0.25 * f[0] * f[1] * f[2], slopes)
                };
                BRICK_CORNERS.into_iter().map(corner).chain(BRICK_EDGES.into_iter().map(middle)).collect()
            }
        }
    }

    /// Returns quadrature points of the reference element, exact for the stiffness of a tetrahedron with straight edges and of a
    /// brick with parallel edges.
    #[must_use]
    pub fn rule(self) -> Vec<Point<3>> {
        let line = gauss(3);
        let pairs = || line.points.iter().copied().zip(line.weights.iter().copied());
        let mut points = Vec::with_capacity(27);
        for (x, wx) in pairs() {
            for (y, wy) in pairs() {
                for (z, wz) in pairs() {
                    points.push(match self {
                        Self::Brick => ([x, y, z], wx * wy * wz),
                        Self::Tetrahedron => {
                            // Duffy transformation of the cube into the tetrahedron.
                            let [a, b, c] = [x, y, z].map(|v| 0.5 * (1.0 + v));
                            let (left, area) = (1.0 - a, (1.0 - a) * (1.0 - b));
                            ([a, b * left, c * area], 0.125 * wx * wy * wz * left * area)
                        }
                    });
                }
            }
        }
        points
    }
}

/// Kind and node positions of an element.
pub struct Geometry<'a> {
    /// Shape of the element.
    pub kind: Kind,
    /// Position of each node, m.
    pub nodes_m: &'a [[f64; 3]],
}

impl Geometry<'_> {
    /// Returns the gradients of the shape functions, 1/m, and the Jacobian determinant, m³ (zero or negative in an
    /// inverted element), at reference coordinates.
    #[must_use]
    pub fn slopes(&self, at: [f64; 3]) -> (Vec<[f64; 3]>, f64) {
        let shapes = self.kind.shapes(at);
        let mut jacobian = [[0.0; 3]; 3]; // d x_i / d at_j
        for (position, (_, slope)) in self.nodes_m.iter().zip(&shapes) {
            for i in 0..3 {
                for j in 0..3 {
                    jacobian[i][j] += position[i] * slope[j];
                }
            }
        }
        let minor = |i: usize, j: usize| {
            let ([a, b], [c, d]) = ([(i + 1) % 3, (i + 2) % 3], [(j + 1) % 3, (j + 2) % 3]);
            jacobian[a][c] * jacobian[b][d] - jacobian[a][d] * jacobian[b][c]
        };
        let determinant = (0..3).map(|j| jacobian[0][j] * minor(0, j)).sum::<f64>();
        let slopes = shapes
            .iter()
            .map(|(_, slope)| {
                [0, 1, 2].map(|i| (0..3).map(|j| minor(i, j) * slope[j]).sum::<f64>() / determinant)
            })
            .collect();
        (slopes, determinant)
    }

    /// Returns the stiffness matrix of the element, N/m: column-major, three degrees of freedom per node.
    #[must_use]
    pub fn stiffness(&self, lame: Lame) -> Vec<f64> {
        self.stiffness_by(&self.kind.rule(), lame)
    }

    /// Returns the stiffness matrix as [`Self::stiffness`], integrated with other points.
    pub(crate) fn stiffness_by(&self, rule: &[Point<3>], lame: Lame) -> Vec<f64> {
        let count = self.kind.nodes();
        let size = 3 * count;
        let mut matrix = vec![0.0; size * size];
        for &(at, weight) in rule {
            let (slopes, determinant) = self.slopes(at);
            let volume = weight * determinant;
            for (b, db) in slopes.iter().enumerate() {
                for (a, da) in slopes.iter().enumerate() {
                    let trace = lame.mu_pa * volume * (da[0] * db[0] + da[1] * db[1] + da[2] * db[2]);
                    for j in 0..3 {
                        let column = &mut matrix[(3 * b + j) * size + 3 * a..(3 * b + j) * size + 3 * a + 3];
                        for (i, value) in column.iter_mut().enumerate() {
                            *value += volume * (lame.lambda_pa * da[i] * db[j] + lame.mu_pa * da[j] * db[i]);
                            if i == j {
                                *value += trace;
                            }
                        }
                    }
                }
            }
        }
        matrix
    }
}

/// Returns the shape functions of a face (3 corners or 4, then the middles of its edges) with their gradients, at a point of the
/// reference face. The corners of the triangle are the origin and the unit points; the square extends over -1..1.
#[must_use]
pub fn face_shapes(corners: usize, at: [f64; 2]) -> Vec<(f64, [f64; 2])> {
    let [x, y] = at;
    if corners == 3 {
        let share = [1.0 - x - y, x, y];
        let slope = [[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]];
        let corner =
            |i: usize| (share[i] * (2.0 * share[i] - 1.0), slope[i].map(|d| (4.0 * share[i] - 1.0) * d));
        let middle = |i: usize| {
            let j = (i + 1) % 3;
            let slopes = [0, 1].map(|k| 4.0 * (share[i] * slope[j][k] + share[j] * slope[i][k]));
            (4.0 * share[i] * share[j], slopes)
        };
        return (0..3).map(corner).chain((0..3).map(middle)).collect();
    }
    let signs = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0_f64]];
    let corner = |s: [f64; 2]| {
        let (a, b, sum) = (1.0 + x * s[0], 1.0 + y * s[1], x * s[0] + y * s[1] - 1.0);
        (0.25 * a * b * sum, [0.25 * s[0] * b * (sum + a), 0.25 * s[1] * a * (sum + b)])
    };
    let middle = |i: usize| {
        let s = [0, 1].map(|k| 0.5 * (signs[i][k] + signs[(i + 1) % 4][k]));
        if s[0] == 0.0 {
            let b = 1.0 + y * s[1];
            (0.5 * (1.0 - x * x) * b, [-x * b, 0.5 * (1.0 - x * x) * s[1]])
        } else {
            let a = 1.0 + x * s[0];
            (0.5 * (1.0 - y * y) * a, [0.5 * (1.0 - y * y) * s[0], -y * a])
        }
    };
    signs.into_iter().map(corner).chain((0..4).map(middle)).collect()
}

/// Returns the quadrature points of a reference face with 3 or 4 corners, in four parts to resolve the peaks of nearby forces.
#[must_use]
pub fn face_rule(corners: usize) -> Vec<Point<2>> {
    let line = gauss(4);
    let pairs = || line.points.iter().copied().zip(line.weights.iter().copied());
    let mut points = Vec::with_capacity(64);
    for (x, wx) in pairs() {
        for (y, wy) in pairs() {
            if corners == 3 {
                let (a, b) = (0.5 * (1.0 + x), 0.25 * (1.0 + y) * (1.0 - x));
                let weight = 0.125 * wx * wy * (1.0 - x);
                for corner in [[0.0, 0.0], [0.5, 0.0], [0.0, 0.5]] {
                    points.push(([corner[0] + 0.5 * a, corner[1] + 0.5 * b], 0.25 * weight));
                }
                points.push(([0.5 - 0.5 * a, 0.5 - 0.5 * b], 0.25 * weight));
            } else {
                for (u, v) in [(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)] {
                    points.push(([u + 0.5 * x, v + 0.5 * y], 0.25 * wx * wy));
                }
            }
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Corners and middles of an element that is skewed but straight.
    fn skewed(kind: Kind) -> Vec<[f64; 3]> {
        let place =
            |c: [f64; 3]| [0.3 * c[0] + 0.1 * c[1], 0.4 * c[1] - 0.05 * c[2], 0.2 * c[0] + 0.5 * c[2] + 1.0];
        let mut nodes: Vec<[f64; 3]> = kind.corner_places().into_iter().map(place).collect();
        for [a, b] in kind.edges() {
            nodes.push([0, 1, 2].map(|k| 0.5 * (nodes[*a][k] + nodes[*b][k])));
        }
        nodes
    }

    #[test]
    fn an_element_carries_even_strain_exactly_and_no_force_when_it_only_moves() {
        let lame = Lame::new(1.0e3, 0.3);
        let gradient = [[0.01, 0.02, -0.03], [0.005, -0.02, 0.04], [0.03, 0.01, 0.02]];
        for kind in [Kind::Tetrahedron, Kind::Brick] {
            let nodes_m = skewed(kind);
            let geometry = Geometry { kind, nodes_m: &nodes_m };
            let matrix = geometry.stiffness(lame);
            let size = 3 * kind.nodes();
            let volume: f64 = kind.rule().iter().map(|(at, w)| w * geometry.slopes(*at).1).sum();
            let field = |gradient: [[f64; 3]; 3]| -> Vec<f64> {
                (0..size)
                    .map(|k| 0.7 + (0..3).map(|j| gradient[k % 3][j] * nodes_m[k / 3][j]).sum::<f64>())
                    .collect()
            };
            let energy = |u: &[f64]| -> f64 {
                (0..size * size).map(|k| 0.5 * u[k / size] * matrix[k] * u[k % size]).sum()
            };
            let strain = |i: usize, j: usize| 0.5 * (gradient[i][j] + gradient[j][i]);
            let trace: f64 = (0..3).map(|i| strain(i, i)).sum();
            let square: f64 = (0..9).map(|k| strain(k / 3, k % 3) * strain(k / 3, k % 3)).sum();
            let exact = volume * (0.5 * lame.lambda_pa * trace * trace + lame.mu_pa * square);
            assert!((energy(&field(gradient)) / exact - 1.0).abs() < 1.0e-11, "{kind:?}");
            let turned = [[0.0, 0.1, -0.2], [-0.1, 0.0, 0.3], [0.2, -0.3, 0.0]];
            assert!(energy(&field(turned)).abs() < 1.0e-12 * lame.mu_pa, "{kind:?}");
        }
    }

    /// A face of an element has the shape functions of the element, and its normal points out.
    #[test]
    fn faces_fit_their_elements() {
        for kind in [Kind::Tetrahedron, Kind::Brick] {
            let nodes_m = skewed(kind);
            let middle = [0, 1, 2]
                .map(|k| nodes_m[..kind.corners()].iter().map(|p| p[k]).sum::<f64>() / kind.corners() as f64);
            for face in 0..kind.faces().len() {
                let nodes = kind.face_nodes(face);
                let corners = kind.faces()[face].len();
                for (k, node) in nodes.iter().enumerate().skip(corners) {
                    let (a, b) = (nodes[k - corners], nodes[(k - corners + 1) % corners]);
                    for axis in 0..3 {
                        let half = 0.5 * (nodes_m[a][axis] + nodes_m[b][axis]);
                        assert!((nodes_m[*node][axis] - half).abs() < 1.0e-14, "{kind:?} {face}");
                    }
                }
                let mut area = 0.0;
                for (at, weight) in face_rule(corners) {
                    let shapes = face_shapes(corners, at);
                    let sum: f64 = shapes.iter().map(|s| s.0).sum();
                    assert!((sum - 1.0).abs() < 1.0e-13);
                    area += weight;
                }
                assert!((area - if corners == 3 { 0.5 } else { 4.0 }).abs() < 1.0e-13);
                let [a, b, c] = [0, 1, 2].map(|i| nodes_m[nodes[i]]);
                let (u, v) = ([0, 1, 2].map(|k| b[k] - a[k]), [0, 1, 2].map(|k| c[k] - a[k]));
                let out: f64 = (0..3)
                    .map(|k| {
                        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                        (u[i] * v[j] - u[j] * v[i]) * (a[k] - middle[k])
                    })
                    .sum();
                assert!(out > 0.0, "{kind:?} {face}");
            }
        }
    }
}
