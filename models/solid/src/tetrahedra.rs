//! Linear tetrahedra, common in deformable models: for comparison only, because they lock in bending.

use crate::dense::NotPositive;
use crate::dissection::{Assembly, GridStiffness};
use crate::grid::{Grid, Lame};
use crate::plate::{Hold, PlateBox, difference, plate_on};
use crate::rigid::RigidPatch;

/// Solves for a plate on a body of uniform cells, six tetrahedra each; also returns the largest relative difference from the
/// solution with cells of half the edge length. Not real-time.
///
/// # Errors
/// [`NotPositive`] if the parameters do not describe an elastic solid.
pub(crate) fn plate(under: &PlateBox, lame: Lame) -> Result<(RigidPatch, f64), NotPositive> {
    let PlateBox { ends_m, axis, cells, .. } = *under;
    let even = |[from, to]: [f64; 2], count: usize| -> Vec<f64> {
        (0..=count).map(|i| from + (to - from) * i as f64 / count as f64).collect()
    };
    let centre = [0, 1, 2].map(|k| if k == axis { 0.0 } else { 0.5 * (ends_m[k][0] + ends_m[k][1]) });
    let solve = |finer: usize| {
        let grid = Grid::new([0, 1, 2].map(|k| even(ends_m[k], finer * cells[k])), 1);
        let hold = |node: usize| {
            let at = grid.position_m(node);
            match grid.index(node)[axis] {
                0 => Hold::Fixed,
                last if last == finer * cells[axis] => Hold::Plate([0, 1, 2].map(|k| at[k] - centre[k])),
                _ => Hold::Free,
            }
        };
        plate_on(&Tetrahedra::new(&grid, lame), hold).map(|(patch, _)| patch)
    };
    let (own, finer) = (solve(1)?, solve(2)?);
    let error = difference(&own, &finer);
    Ok((own, error))
}

/// Grid of order one whose cells are divided into six tetrahedra each, about one diagonal.
#[derive(Clone, Debug)]
pub struct Tetrahedra<'a> {
    cells: GridStiffness<'a>,
    grid: &'a Grid,
    lame: Lame,
}

/// Corners of a cell along the edges from the first to the last, for six permutations of the axes; bit `k` is the axis.
const PATHS: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 1, 5, 7], [0, 2, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 4, 6, 7]];

impl<'a> Tetrahedra<'a> {
    /// Divides the cells of a grid of order one into tetrahedra. Not real-time.
    #[must_use]
    pub fn new(grid: &'a Grid, lame: Lame) -> Self {
        Self { cells: GridStiffness::new(grid, lame), grid, lame }
    }
}

impl Assembly for Tetrahedra<'_> {
    fn node_count(&self) -> usize {
        self.cells.node_count()
    }

    fn element_count(&self) -> usize {
        self.cells.element_count()
    }

    fn nodes(&self, element: usize) -> Vec<usize> {
        self.cells.nodes(element)
    }

    fn halves(&self, elements: Vec<usize>) -> [Vec<usize>; 2] {
        self.cells.halves(elements)
    }

    fn stiffness(&self, element: usize) -> Vec<f64> {
        let corners: Vec<[f64; 3]> =
            self.nodes(element).into_iter().map(|node| self.grid.position_m(node)).collect();
        let sides_m = [0, 1, 2].map(|axis| corners[7][axis] - corners[0][axis]);
        let volume_m3 = sides_m[0] * sides_m[1] * sides_m[2] / 6.0;
        let mut matrix = vec![0.0; 24 * 24];
        for path in PATHS {
            // A shape function grows along one edge of the path and falls along the next: edges lie along the axes.
            let mut slopes = [[0.0; 3]; 4];
            for step in 0..3 {
                let axis = (path[step] ^ path[step + 1]).trailing_zeros() as usize;
                slopes[step][axis] -= 1.0 / sides_m[axis];
                slopes[step + 1][axis] += 1.0 / sides_m[axis];
            }
            for (a, one) in path.iter().zip(slopes) {
                for (b, other) in path.iter().zip(slopes) {
                    let both: f64 = one.iter().zip(other).map(|(x, y)| x * y).sum();
                    for i in 0..3 {
                        for j in 0..3 {
                            let own = if i == j { self.lame.mu_pa * both } else { 0.0 };
                            let value =
                                self.lame.lambda_pa * one[i] * other[j] + self.lame.mu_pa * one[j] * other[i];
                            matrix[(3 * b + j) * 24 + 3 * a + i] += volume_m3 * (value + own);
                        }
                    }
                }
            }
        }
        matrix
    }
}
