//! Remainder: difference between the response of a block and that of a half-space.
//!
//! A force on a face of a block causes the displacement of a half-space behind that face, plus a *remainder* that cancels
//! the half-space's stress on the other free faces and its displacement of the clamped face. The half-space contains the
//! singularity at the force. The remainder varies over the distance to the nearest edge, so that a coarse grid of
//! elements resolves it for a force at any place. The block has two planes of mirror symmetry, and every load is a sum
//! of four loads that are even or odd in each plane: four problems on a quarter of the block.

use crate::basis::{element_points, gauss, lagrange};
use crate::dense::NotPositive;
use crate::dissection::{GridStiffness, Stiffness, subtract_forces};
use crate::grid::{Grid, Lame, Sample, graded};
use crate::half_space::{Block, HalfSpace};

/// Dimensions of a block: top face at `z = 0` about the origin, bottom clamped. Lengths in m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Size {
    /// Half-extent along x, m.
    pub half_x_m: f64,
    /// Half-extent along y, m.
    pub half_y_m: f64,
    /// Height, m.
    pub height_m: f64,
}

/// Touched face, or by mirror symmetry its opposite.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Face {
    /// Plane `z = 0`; coordinates x, y.
    Top,
    /// Plane `x = half_x`; coordinates y, z.
    SideX,
    /// Plane `y = half_y`; coordinates x, z.
    SideY,
}

impl Face {
    /// Returns the indices of the block axes along `p`, `q` (in the face) and `w` (normal to the face), in this order.
    #[must_use]
    pub fn axes(self) -> [usize; 3] {
        match self {
            Self::Top => [0, 1, 2],
            Self::SideX => [1, 2, 0],
            Self::SideY => [0, 2, 1],
        }
    }

    /// Returns the position of the face along its normal, m.
    #[must_use]
    pub fn plane_m(self, size: Size) -> f64 {
        match self {
            Self::Top => 0.0,
            Self::SideX => size.half_x_m,
            Self::SideY => size.half_y_m,
        }
    }

    /// Converts a point of the face to the frame of the block, m.
    #[must_use]
    pub fn point_m(self, size: Size, at_m: [f64; 2]) -> [f64; 3] {
        let [p, q, w] = self.axes();
        let mut point = [0.0; 3];
        point[p] = at_m[0];
        point[q] = at_m[1];
        point[w] = self.plane_m(size);
        point
    }
}

/// Numbers of elements along half a side and along the height, and their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fineness {
    /// Number of elements from the middle to a side.
    pub across: usize,
    /// Number of elements from bottom to top.
    pub high: usize,
    /// Order of the elements.
    pub order: usize,
}

/// Fineness of a preparation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resolution {
    /// Order of the elements.
    pub order: usize,
    /// Number of cells of a contact from its middle to its rim.
    pub rings: i32,
    /// Number of bricks along a side of the square in the middle of a cylinder.
    pub bricks: usize,
}

impl Resolution {
    /// Fastest preparation, largest error.
    pub const QUICK: Self = Self { order: 2, rings: 5, bricks: 4 };
    /// Default resolution.
    pub const STANDARD: Self = Self { order: 3, rings: 6, bricks: 6 };
    /// Slowest preparation, smallest error.
    pub const FINE: Self = Self { order: 4, rings: 8, bricks: 8 };

    /// Returns numbers and order of the elements for the remainder of a block.
    #[must_use]
    pub fn fineness(self) -> Fineness {
        Fineness { across: 4, high: 5, order: self.order }
    }
}

/// Signs of x and y for the four mirror images of a quarter; also the four parities.
const MIRRORS: [[f64; 2]; 4] = [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]];
/// Number of forces solved for at once.
const BATCH: usize = 8;
/// Growth of successive elements from the edges inwards.
const GRADING: f64 = 1.35;

/// Factored stiffness matrices of a quarter of a block, one for each parity.
#[derive(Debug)]
pub struct Remainder {
    size: Size,
    solid: HalfSpace,
    lame: Lame,
    grid: Grid,
    /// Stiffness of each parity, in the order of [`MIRRORS`].
    stiffness: Vec<Stiffness>,
    quadrature: Vec<BoundaryPoint>,
}

/// Quadrature point of the quarter's free faces.
#[derive(Debug)]
struct BoundaryPoint {
    position_m: [f64; 3],
    /// Axis of the outward normal (0, 1: a side; 2: the top).
    normal: usize,
    /// Quadrature weight: area that the point represents.
    area_m2: f64,
    /// Shape functions that are not zero at the point.
    shape: Sample,
}

/// Returns the sign of a parity under a mirror.
fn character(parity: usize, mirror: usize) -> f64 {
    let mut sign = 1.0;
    for axis in 0..2 {
        if MIRRORS[parity][axis] < 0.0 {
            sign *= MIRRORS[mirror][axis];
        }
    }
    sign
}

fn mirror_sign(mirror: usize, axis: usize) -> f64 {
    if axis < 2 { MIRRORS[mirror][axis] } else { 1.0 }
}

impl Remainder {
    /// Factorises the stiffness matrices of the four problems. Not real-time.
    ///
    /// # Errors
    /// [`NotPositive`] if the parameters do not describe an elastic solid.
    pub fn new(size: Size, solid: HalfSpace, fineness: Fineness) -> Result<Self, NotPositive> {
        let Fineness { across, high, order } = fineness;
        let grid = Grid::new(
            [
                graded(size.half_x_m, 0.0, across, GRADING),
                graded(size.half_y_m, 0.0, across, GRADING),
                graded(0.0, -size.height_m, high, GRADING),
            ],
            order,
        );
        let lame = Lame::new(solid.youngs_modulus_pa, solid.poisson_ratio);
        let stiffness = (0..4)
            .map(|parity| {
                let fixed = (0..grid.node_count()).map(|node| fixed(&grid, node, parity)).collect();
                Stiffness::new(&GridStiffness::new(&grid, lame), fixed)
            })
            .collect::<Result<_, _>>()?;
        let quadrature = boundary(&grid);
        Ok(Self { size, solid, lame, grid, stiffness, quadrature })
    }

    /// Solves for the remainder at `targets_m` under unit forces at `sources_m`, m/N. All are points `p, q` of a face in the
    /// quarter of positive x and y. Indices of the result: source, target, mirror image of the target. Not real-time.
    #[must_use]
    pub fn responses(
        &self,
        face: Face,
        sources_m: &[[f64; 2]],
        targets_m: &[[f64; 2]],
    ) -> Vec<Vec<[Block; 4]>> {
        let samples: Vec<Sample> =
            targets_m.iter().map(|&at| self.grid.sample(face.point_m(self.size, at))).collect();
        sources_m.chunks(BATCH).flat_map(|batch| self.respond(face, batch, &samples)).collect()
    }

    fn respond(&self, face: Face, sources_m: &[[f64; 2]], samples: &[Sample]) -> Vec<Vec<[Block; 4]>> {
        let columns = 3 * sources_m.len();
        let length = 3 * self.grid.node_count() * columns;
        let mut forces: Vec<Vec<f64>> = vec![vec![0.0; length]; 4];
        self.add_tractions(face, sources_m, &mut forces);
        let mut answers = vec![vec![[[[0.0; 3]; 3]; 4]; samples.len()]; sources_m.len()];
        for (parity, mut values) in forces.into_iter().enumerate() {
            let prescribed = self.prescribed(face, sources_m, parity);
            subtract_forces(&GridStiffness::new(&self.grid, self.lame), &prescribed, &mut values, columns);
            self.stiffness[parity].solve(&mut values, columns);
            values.iter_mut().zip(&prescribed).for_each(|(u, p)| *u += p);
            for (target, sample) in samples.iter().enumerate() {
                for (source, answer) in answers.iter_mut().enumerate() {
                    self.add_sample(face, parity, sample, &values, source, columns, &mut answer[target]);
                }
            }
        }
        answers
    }

    #[allow(clippy::too_many_arguments)] // one place calls it
    fn add_sample(
        &self,
        face: Face,
        parity: usize,
        sample: &Sample,
        values: &[f64],
        source: usize,
        columns: usize,
        blocks: &mut [Block; 4],
    ) {
        let axes = face.axes();
        for (i, &axis) in axes.iter().enumerate() {
            for force in 0..3 {
                let value: f64 = sample
                    .nodes
                    .iter()
                    .zip(&sample.shares)
                    .map(|(node, share)| share * values[(3 * node + axis) * columns + 3 * source + force])
                    .sum();
                for (mirror, block) in blocks.iter_mut().enumerate() {
                    block[i][force] += character(parity, mirror) * mirror_sign(mirror, axis) * value;
                }
            }
        }
    }

    /// Adds, for each parity, the nodal forces of the tractions that cancel those of the half-space on the free faces.
    fn add_tractions(&self, face: Face, sources_m: &[[f64; 2]], forces: &mut [Vec<f64>]) {
        let columns = 3 * sources_m.len();
        let mut tractions = vec![[0.0; 3]; columns];
        let mut parts = vec![vec![[0.0; 3]; columns]; 4];
        for point in &self.quadrature {
            parts.iter_mut().for_each(|part| part.fill([0.0; 3]));
            for mirror in 0..4 {
                if !self.traction(face, sources_m, point, mirror, &mut tractions) {
                    continue;
                }
                for (parity, part) in parts.iter_mut().enumerate() {
                    let share = 0.25 * point.area_m2 * character(parity, mirror);
                    for (sum, traction) in part.iter_mut().zip(&tractions) {
                        for axis in 0..3 {
                            sum[axis] += share * mirror_sign(mirror, axis) * traction[axis];
                        }
                    }
                }
            }
            for (part, force) in parts.iter().zip(forces.iter_mut()) {
                for (node, share) in point.shape.nodes.iter().zip(&point.shape.shares) {
                    for axis in 0..3 {
                        let start = (3 * node + axis) * columns;
                        let row = &mut force[start..start + columns];
                        row.iter_mut().zip(part).for_each(|(f, t)| *f += share * t[axis]);
                    }
                }
            }
        }
    }

    /// Computes the tractions that cancel those of the half-space at a mirror image of a point, Pa/N, one per force.
    /// Returns false on the face of the force, where the half-space has no tractions.
    fn traction(
        &self,
        face: Face,
        sources_m: &[[f64; 2]],
        point: &BoundaryPoint,
        mirror: usize,
        tractions: &mut [[f64; 3]],
    ) -> bool {
        let [p, q, w] = face.axes();
        let sign = mirror_sign(mirror, point.normal);
        if point.normal == w && sign > 0.0 {
            return false;
        }
        let position = [0, 1, 2].map(|axis| mirror_sign(mirror, axis) * point.position_m[axis]);
        for (source, at) in sources_m.iter().enumerate() {
            let local = [position[p] - at[0], position[q] - at[1], position[w] - face.plane_m(self.size)];
            let u = self.solid.field(local).displacement;
            for force in 0..3 {
                let trace = self.lame.lambda_pa * (0..3).map(|k| u[k][force].slope[k]).sum::<f64>();
                let normal = face.axes().iter().position(|&axis| axis == point.normal).unwrap_or_default();
                let traction = &mut tractions[3 * source + force];
                for (i, &axis) in face.axes().iter().enumerate() {
                    let shear = self.lame.mu_pa * (u[i][force].slope[normal] + u[normal][force].slope[i]);
                    traction[axis] = -sign * (shear + if i == normal { trace } else { 0.0 });
                }
            }
        }
        true
    }

    /// Returns the displacement that cancels the half-space's at the clamped nodes, m/N; zero elsewhere.
    fn prescribed(&self, face: Face, sources_m: &[[f64; 2]], parity: usize) -> Vec<f64> {
        let [p, q, w] = face.axes();
        let columns = 3 * sources_m.len();
        let [nx, ny, _] = self.grid.nodes_along();
        let mut values = vec![0.0; 3 * self.grid.node_count() * columns];
        for node in 0..nx * ny {
            for mirror in 0..4 {
                let at = self.grid.position_m(node);
                let position = [0, 1, 2].map(|axis| mirror_sign(mirror, axis) * at[axis]);
                for (source, at) in sources_m.iter().enumerate() {
                    let local =
                        [position[p] - at[0], position[q] - at[1], position[w] - face.plane_m(self.size)];
                    let u = self.solid.field(local).displacement;
                    for (i, &axis) in face.axes().iter().enumerate() {
                        let share = 0.25 * character(parity, mirror) * mirror_sign(mirror, axis);
                        for (force, jet) in u[i].iter().enumerate() {
                            values[(3 * node + axis) * columns + 3 * source + force] -= share * jet.value;
                        }
                    }
                }
            }
        }
        values
    }
}

/// Returns the prescribed components of a node: all at the bottom; on a mirror plane, the component normal to the plane for an
/// even load, and the components in the plane for an odd load.
fn fixed(grid: &Grid, node: usize, parity: usize) -> [bool; 3] {
    let index = grid.index(node);
    let mut fixed = [index[2] == 0; 3];
    for axis in 0..2 {
        if index[axis] == 0 {
            let even = MIRRORS[parity][axis] > 0.0;
            for (component, is_fixed) in fixed.iter_mut().enumerate() {
                *is_fixed |= (component == axis) == even;
            }
        }
    }
    fixed
}

/// Returns the quadrature points on top and sides of the quarter: four parts per element face, for peaks of near forces.
fn boundary(grid: &Grid) -> Vec<BoundaryPoint> {
    let rule = gauss(grid.order + 2);
    let side = grid.order + 1;
    let points = element_points(grid.order);
    // Points and weights over an element, -1..1, in two halves, with the shape functions.
    let line: Vec<(f64, f64, Vec<f64>)> = [-0.5, 0.5]
        .iter()
        .flat_map(|middle| {
            rule.points.iter().zip(&rule.weights).map(move |(x, weight)| (middle + 0.5 * x, 0.5 * weight))
        })
        .map(|(x, weight)| {
            let mut values = vec![0.0; side];
            lagrange(&points, x, &mut values);
            (x, weight, values)
        })
        .collect();
    let mut found = Vec::new();
    for normal in 0..3 {
        let [u, v] = [[1, 2], [0, 2], [0, 1]][normal];
        let last = grid.axes[normal].elements();
        for eu in 0..grid.axes[u].elements() {
            for ev in 0..grid.axes[v].elements() {
                let span = |axis: usize, element: usize| {
                    let borders = &grid.axes[axis].borders_m;
                    (
                        0.5 * (borders[element] + borders[element + 1]),
                        0.5 * (borders[element + 1] - borders[element]),
                    )
                };
                let ((middle_u, half_u), (middle_v, half_v)) = (span(u, eu), span(v, ev));
                for (x, weight_x, shape_x) in &line {
                    for (y, weight_y, shape_y) in &line {
                        let mut position_m = [0.0; 3];
                        position_m[normal] = grid.axes[normal].borders_m[last];
                        position_m[u] = middle_u + half_u * x;
                        position_m[v] = middle_v + half_v * y;
                        let mut shape = Sample { nodes: Vec::new(), shares: Vec::new() };
                        for (j, sy) in shape_y.iter().enumerate() {
                            for (i, sx) in shape_x.iter().enumerate() {
                                let mut index = [0; 3];
                                index[normal] = last * grid.order;
                                index[u] = eu * grid.order + i;
                                index[v] = ev * grid.order + j;
                                shape.nodes.push(grid.node(index));
                                shape.shares.push(sx * sy);
                            }
                        }
                        let area_m2 = weight_x * weight_y * half_u * half_v;
                        found.push(BoundaryPoint { position_m, normal, area_m2, shape });
                    }
                }
            }
        }
    }
    found
}
