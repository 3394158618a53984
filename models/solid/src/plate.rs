//! A rigid plate bonded to a whole face of a block of finite elements.

use crate::dense::NotPositive;
use crate::dissection::{Stiffness, subtract_forces};
use crate::grid::{Grid, Lame};
use crate::rigid::{MODES, RigidPatch};

/// Stiffness of the face at the upper end of an axis, with the face at its lower end clamped; `X` from the face's centre.
/// Not real-time.
///
/// # Errors
/// [`NotPositive`] if the numbers do not describe a solid.
pub fn plate(grid: &Grid, lame: Lame, axis: usize) -> Result<RigidPatch, NotPositive> {
    let count = grid.node_count();
    let last = grid.nodes_along()[axis] - 1;
    let at_end = |node: usize| grid.index(node)[axis] == last;
    let fixed = (0..count).map(|node| [grid.index(node)[axis] == 0 || at_end(node); 3]).collect();
    let stiffness = Stiffness::new(grid, lame, fixed)?;
    let centre = [0, 1, 2].map(|k| {
        let nodes = &grid.axes[k].nodes_m;
        if k == axis { nodes[last] } else { 0.5 * (nodes[0] + nodes[nodes.len() - 1]) }
    });
    let mut prescribed = vec![0.0; 3 * count * MODES];
    for node in (0..count).filter(|&node| at_end(node)) {
        let position = grid.position_m(node);
        for i in 0..3 {
            let row = &mut prescribed[(3 * node + i) * MODES..(3 * node + i + 1) * MODES];
            row[i] = 1.0;
            for j in (0..3).filter(|&j| j != axis) {
                row[RigidPatch::entry(i, j)] = position[j] - centre[j];
            }
        }
    }
    let mut displacement = vec![0.0; prescribed.len()];
    subtract_forces(grid, lame, &prescribed, &mut displacement, MODES);
    stiffness.solve(&mut displacement, MODES);
    displacement.iter_mut().zip(&prescribed).for_each(|(u, p)| *u += p);
    let mut forces = vec![0.0; prescribed.len()];
    subtract_forces(grid, lame, &displacement, &mut forces, MODES);
    let mut matrix = [[0.0; MODES]; MODES];
    for (moved, reaction) in prescribed.chunks_exact(MODES).zip(forces.chunks_exact(MODES)) {
        for (row, u) in matrix.iter_mut().zip(moved).filter(|(_, u)| **u != 0.0) {
            row.iter_mut().zip(reaction).for_each(|(k, f)| *k -= u * f);
        }
    }
    Ok(RigidPatch { stiffness: symmetric(&matrix) })
}

/// The symmetric part: reciprocity holds for the exact matrix.
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
