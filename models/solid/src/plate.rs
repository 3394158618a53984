//! Rigid plate bonded to a face of a body of finite elements.

use crate::dense::NotPositive;
use crate::dissection::{Assembly, GridStiffness, Stiffness, subtract_forces};
use crate::grid::{Grid, Lame, graded};
use crate::rigid::{MODES, RigidPatch};

/// Box-shaped body under a plate: the upper end of one axis is touched, the lower end clamped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PlateBox {
    /// Lower and upper end of each axis, m.
    pub(crate) ends_m: [[f64; 2]; 3],
    /// Axis normal to the touched face.
    pub(crate) axis: usize,
    /// Number of elements along half of each axis, finer towards both ends.
    pub(crate) halves: [usize; 3],
    /// Number of uniform cells along each axis, for linear tetrahedra.
    pub(crate) cells: [usize; 3],
}

impl PlateBox {
    /// Returns the grid with elements of this order.
    pub(crate) fn grid(&self, order: usize) -> Grid {
        let borders = [0, 1, 2].map(|k| {
            let ([near, far], half) = (self.ends_m[k], self.halves[k]);
            let middle = 0.5 * (near + far);
            let mut borders = graded(near, middle, half, 1.5);
            borders.extend(graded(far, middle, half, 1.5).into_iter().skip(1));
            borders
        });
        Grid::new(borders, order)
    }

    /// Solves with elements of `order` and of one order less; returns the first result, and its [`difference`] from the second. Not
    /// real-time.
    pub(crate) fn solve(&self, lame: Lame, order: usize) -> Result<(RigidPatch, f64), NotPositive> {
        let solve = |order| plate(&self.grid(order), lame, self.axis);
        let ((fine, _), (coarse, _)) = (solve(order)?, solve(order - 1)?);
        let error = difference(&coarse, &fine);
        Ok((fine, error))
    }
}

/// Returns the largest relative difference between the diagonal entries of a stiffness matrix and of the matrix of a finer
/// solution.
pub(crate) fn difference(coarse: &RigidPatch, fine: &RigidPatch) -> f64 {
    (0..MODES)
        .filter(|&i| fine.stiffness[i][i] > 0.0)
        .map(|i| (coarse.stiffness[i][i] / fine.stiffness[i][i] - 1.0).abs())
        .fold(0.0, f64::max)
}

/// Solves for a plate on the face at the upper end of `axis`, with the face at the lower end clamped; also returns the
/// displacement of all nodes under each mode. `X` of [`RigidPatch`] is relative to the centre of the touched face. Not real-time.
///
/// # Errors
/// [`NotPositive`] if the parameters do not describe an elastic solid.
pub fn plate(grid: &Grid, lame: Lame, axis: usize) -> Result<(RigidPatch, Vec<f64>), NotPositive> {
    let last = grid.nodes_along()[axis] - 1;
    let centre = [0, 1, 2].map(|k| {
        let nodes = &grid.axes[k].nodes_m;
        if k == axis { nodes[last] } else { 0.5 * (nodes[0] + nodes[nodes.len() - 1]) }
    });
    let hold = |node: usize| {
        let index = grid.index(node);
        if index[axis] == last {
            let position = grid.position_m(node);
            let mut from_centre = [0, 1, 2].map(|k| position[k] - centre[k]);
            from_centre[axis] = 0.0;
            return Hold::Plate(from_centre);
        }
        if index[axis] == 0 { Hold::Fixed } else { Hold::Free }
    };
    plate_on(&GridStiffness::new(grid, lame), hold)
}

/// Support of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Hold {
    /// No support.
    Free,
    /// Zero displacement.
    Fixed,
    /// Bond to the plate; position of the node from the plate's centre, m.
    Plate([f64; 3]),
}

/// Solves for a plate bonded to some nodes of any body; also returns the displacement of all nodes under each mode. `hold`:
/// support of each node. Not real-time.
///
/// # Errors
/// [`NotPositive`] if the parameters do not describe an elastic solid.
pub fn plate_on(
    assembly: &impl Assembly,
    hold: impl Fn(usize) -> Hold,
) -> Result<(RigidPatch, Vec<f64>), NotPositive> {
    let count = assembly.node_count();
    let fixed = (0..count).map(|node| [hold(node) != Hold::Free; 3]).collect();
    let stiffness = Stiffness::new(assembly, fixed)?;
    let mut prescribed = vec![0.0; 3 * count * MODES];
    for node in 0..count {
        let Hold::Plate(from_centre) = hold(node) else { continue };
        for i in 0..3 {
            let row = &mut prescribed[(3 * node + i) * MODES..(3 * node + i + 1) * MODES];
            row[i] = 1.0;
            for (j, x) in from_centre.into_iter().enumerate() {
                row[RigidPatch::entry(i, j)] = x;
            }
        }
    }
    let mut displacement = vec![0.0; prescribed.len()];
    subtract_forces(assembly, &prescribed, &mut displacement, MODES);
    stiffness.solve(&mut displacement, MODES);
    displacement.iter_mut().zip(&prescribed).for_each(|(u, p)| *u += p);
    let mut forces = vec![0.0; prescribed.len()];
    subtract_forces(assembly, &displacement, &mut forces, MODES);
    let mut matrix = [[0.0; MODES]; MODES];
    for (moved, reaction) in prescribed.chunks_exact(MODES).zip(forces.chunks_exact(MODES)) {
        for (row, u) in matrix.iter_mut().zip(moved).filter(|(_, u)| **u != 0.0) {
            row.iter_mut().zip(reaction).for_each(|(k, f)| *k -= u * f);
        }
    }
    Ok((RigidPatch { stiffness: symmetric(&matrix) }, displacement))
}

/// Returns the symmetric part of a stiffness matrix: by reciprocity the exact matrix is symmetric.
#[must_use]
pub fn symmetric(matrix: &[[f64; MODES]; MODES]) -> [[f64; MODES]; MODES] {
    let mut result = *matrix;
    for i in 0..MODES {
        for j in 0..MODES {
            result[i][j] = 0.5 * (matrix[i][j] + matrix[j][i]);
        }
    }
    result
}
