//! Contact solver of a frictionless rigid sphere on a deformed face, on a patch of cells that follows the sphere.
//!
//! Each cell carries a pressure along the normal of the sphere *at the displaced cell*, and no cell penetrates: `|X + u(X) - c| >=
//! R`, `p >= 0`, one of the two with equality. The displacement is that of a half-space under uniform loads on square cells, a
//! table inversely proportional to the side of a cell, plus the remainder of the block. A solve alternates between the pressures
//! for given normals (an active set and a Cholesky factorisation) and the normals for given pressures.

use crate::dense::{self, NotPositive};
use crate::half_space::{Block, HalfSpace, add_scaled};

/// Cells of a round patch, with the half-space's compliance between any two cells.
#[derive(Clone, Debug)]
pub struct Patch {
    /// Number of cells from the middle to the rim.
    pub(crate) rings: i32,
    /// Positions of the cells, in units of a cell.
    cells: Vec<[i32; 2]>,
    /// Displacement under a unit force on a cell of side one, by offset of the target from the source.
    kernel: Vec<Block>,
}

/// Contact problem. Lengths in m; the unit of force follows from the half-space's modulus.
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a> {
    /// Radius of the sphere, m.
    pub radius_m: f64,
    /// Depth of the undisplaced face inside the sphere, m.
    pub depth_m: f64,
    /// Side of a cell, m.
    pub cell_m: f64,
    /// For each cell, true if the cell is on the face; empty: all cells are.
    pub on_face: &'a [bool],
    /// Remainder of the block's compliance (see [`crate::remainder`]) for each pair of cells, m per unit of force, by target, then
    /// source; empty: none.
    pub smooth: &'a [Block],
}

/// Solution of a contact problem, and initial guess of the next solution.
#[derive(Clone, Debug, PartialEq)]
pub struct Contact {
    /// Stored energy, J.
    pub energy_j: f64,
    /// Force on the sphere, along `p`, `q`, `w`, N.
    pub force_n: [f64; 3],
    /// Distance of the farthest cell in contact from the middle, in cells.
    pub reach: f64,
    /// Largest change of a unit normal in the last step; below 1e-8, or below 1e-4 after the maximum number of iterations.
    pub residual: f64,
    normals: Vec<[f64; 3]>,
    active: Vec<bool>,
}

/// Error of a contact whose iteration has not converged, or whose compliance is not positive definite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NotConverged {
    /// Depth of the contact, in radii of the sphere.
    pub depth: f64,
}

/// Maximum number of iterations.
const MOST_STEPS: usize = 300;
/// Largest rotation of a normal at convergence, rad.
const TOLERANCE: f64 = 1.0e-8;
/// Largest rotation of a normal in the last of [`MOST_STEPS`] iterations, rad: with a larger one the contact alternates between
/// sets of cells, or snaps through.
const LARGEST_RESIDUAL: f64 = 1.0e-4;

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn times(block: &Block, v: [f64; 3]) -> [f64; 3] {
    [dot(block[0], v), dot(block[1], v), dot(block[2], v)]
}

impl Patch {
    /// Builds a disc of cells and tabulates the half-space's compliance between them. Not real-time.
    #[must_use]
    pub fn new(solid: &HalfSpace, rings: i32) -> Self {
        let side = -rings..=rings;
        let cells: Vec<[i32; 2]> = side
            .clone()
            .flat_map(|j| side.clone().map(move |i| [i, j]))
            .filter(|[i, j]| i * i + j * j <= rings * rings)
            .collect();
        let span = -2 * rings..=2 * rings;
        let kernel = span
            .clone()
            .flat_map(|j| span.clone().map(move |i| [f64::from(i), f64::from(j)]))
            .map(|[i, j]| {
                // Corners of the source relative to the target.
                let corner = |x: f64, y: f64| [x - i, y - j];
                solid.polygon(&[corner(-0.5, -0.5), corner(0.5, -0.5), corner(0.5, 0.5), corner(-0.5, 0.5)])
            })
            .collect();
        Self { rings, cells, kernel }
    }

    /// Returns the number of cells.
    #[must_use]
    pub fn count(&self) -> usize {
        self.cells.len()
    }

    /// Returns the positions of the cells relative to the middle, m.
    #[must_use]
    pub fn points_m(&self, cell_m: f64) -> Vec<[f64; 2]> {
        self.cells.iter().map(|cell| cell.map(|c| f64::from(c) * cell_m)).collect()
    }

    #[allow(clippy::cast_sign_loss)] // offsets lie within twice the rings
    fn between(&self, target: usize, source: usize) -> &Block {
        let [i, j] =
            [0, 1].map(|k| (self.cells[target][k] - self.cells[source][k] + 2 * self.rings) as usize);
        &self.kernel[j * (4 * self.rings as usize + 1) + i]
    }

    /// Solves a contact problem with a nearby solution as initial guess. Without a guess the iteration starts from the undeformed
    /// face, and does not converge for a sphere deeper than about half its radius. Not real-time.
    ///
    /// # Errors
    /// [`NotConverged`] if the last iteration changes a normal by 1e-4 rad or more, or has no pressures.
    pub fn solve(&self, problem: &Problem<'_>, start: Option<&Contact>) -> Result<Contact, NotConverged> {
        let count = self.cells.len();
        let points = self.points_m(problem.cell_m);
        let height = problem.radius_m - problem.depth_m;
        let compliance: Vec<Block> = (0..count * count)
            .map(|pair| {
                let mut block =
                    self.between(pair / count, pair % count).map(|row| row.map(|u| u / problem.cell_m));
                if let Some(extra) = problem.smooth.get(pair) {
                    add_scaled(&mut block, extra, 1.0);
                }
                block
            })
            .collect();
        let on_face = |cell: usize| problem.on_face.get(cell).copied().unwrap_or(true);
        let away: Vec<[f64; 3]> = points.iter().map(|p| [p[0], p[1], -height]).collect();
        let (mut normals, mut active) = start.map_or_else(
            || {
                let half_chord = 0.7 * (problem.radius_m * problem.depth_m).sqrt();
                let near = |a: &[f64; 3]| (a[0] * a[0] + a[1] * a[1]).sqrt() < half_chord;
                let normals = away.iter().map(|a| a.map(|c| c / dot(*a, *a).sqrt())).collect();
                (normals, away.iter().map(near).collect())
            },
            |start| (start.normals.clone(), start.active.clone()),
        );
        (0..count).filter(|&cell| !on_face(cell)).for_each(|cell| active[cell] = false);
        let mut displaced = vec![[0.0; 3]; count];
        let mut contact = Contact {
            energy_j: 0.0,
            force_n: [0.0; 3],
            reach: 0.0,
            residual: f64::INFINITY,
            normals: Vec::new(),
            active: Vec::new(),
        };
        let mut is_solved = false;
        let mut relaxation = 1.0;
        for step in 0..MOST_STEPS {
            let forces = pressures(&compliance, count, &normals, &away, problem.radius_m, &mut active);
            for (target, u) in displaced.iter_mut().enumerate() {
                *u = [0.0; 3];
                for (source, force) in forces.iter().flatten() {
                    let part = times(&compliance[target * count + source], *force);
                    u.iter_mut().zip(part).for_each(|(sum, p)| *sum += p);
                }
            }
            let mut joined = 0;
            let mut residual: f64 = 0.0;
            for cell in 0..count {
                let out = [0, 1, 2].map(|k| away[cell][k] + displaced[cell][k]);
                let distance = dot(out, out).sqrt();
                let turned = out.map(|c| c / distance);
                if active[cell] {
                    let change = [0, 1, 2].map(|k| turned[k] - normals[cell][k]);
                    residual = residual.max(dot(change, change).sqrt());
                } else if on_face(cell) && distance < problem.radius_m * (1.0 - 1.0e-9) {
                    active[cell] = true;
                    joined += 1;
                }
                let mixed = [0, 1, 2].map(|k| normals[cell][k] + relaxation * (turned[k] - normals[cell][k]));
                let length = dot(mixed, mixed).sqrt();
                normals[cell] = mixed.map(|c| c / length);
            }
            if residual > contact.residual && step > 3 {
                relaxation = (0.8 * relaxation).max(0.2);
            }
            contact.residual = residual;
            if joined == 0 && residual < TOLERANCE || step + 1 == MOST_STEPS {
                is_solved = forces.is_ok() && residual < LARGEST_RESIDUAL;
                contact.energy_j = 0.5
                    * forces.iter().flatten().map(|(cell, force)| dot(*force, displaced[*cell])).sum::<f64>();
                for (_, force) in forces.iter().flatten() {
                    contact.force_n.iter_mut().zip(force).for_each(|(sum, f)| *sum -= f);
                }
                break;
            }
        }
        contact.reach = (0..count)
            .filter(|&cell| active[cell])
            .map(|cell| self.cells[cell].map(f64::from))
            .map(|[i, j]| (i * i + j * j).sqrt())
            .fold(0.0, f64::max);
        contact.normals = normals;
        contact.active = active;
        let depth = problem.depth_m / problem.radius_m;
        if is_solved { Ok(contact) } else { Err(NotConverged { depth }) }
    }
}

/// Returns the forces that put each active cell onto the sphere along its normal; cells that would pull are deactivated.
///
/// # Errors
/// [`NotPositive`] if the compliance of the active cells is not positive definite.
fn pressures(
    compliance: &[Block],
    count: usize,
    normals: &[[f64; 3]],
    away: &[[f64; 3]],
    radius_m: f64,
    active: &mut [bool],
) -> Result<Vec<(usize, [f64; 3])>, NotPositive> {
    loop {
        let cells: Vec<usize> = (0..count).filter(|&cell| active[cell]).collect();
        let size = cells.len();
        let mut matrix = vec![0.0; size * size];
        for (column, &source) in cells.iter().enumerate() {
            for (row, &target) in cells.iter().enumerate().skip(column) {
                let moved = times(&compliance[target * count + source], normals[source]);
                matrix[column * size + row] = dot(normals[target], moved);
            }
        }
        let mut pressures: Vec<f64> =
            cells.iter().map(|&cell| radius_m - dot(normals[cell], away[cell])).collect();
        dense::factor(&mut matrix, size, size)?;
        dense::solve(&matrix, size, &mut pressures);
        let mut pulling = false;
        for (&cell, &pressure) in cells.iter().zip(&pressures) {
            if pressure < 0.0 {
                active[cell] = false;
                pulling = true;
            }
        }
        if !pulling {
            let force = |(&cell, &pressure): (&usize, &f64)| (cell, normals[cell].map(|c| c * pressure));
            return Ok(cells.iter().zip(&pressures).map(force).collect());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Solves a contact of radius one on a half-space with an additional normal compliance, which is equal for all pairs of cells.
    fn solve(depth_m: f64, extra: f64) -> Result<Contact, NotConverged> {
        let rings = 4;
        let patch = Patch::new(&HalfSpace { youngs_modulus_pa: 1.0, poisson_ratio: 0.3 }, rings);
        let cell_m = 1.25 * depth_m.sqrt() / (1.0 + 0.12 * depth_m) / f64::from(rings);
        let mut block = Block::default();
        block[2][2] = extra;
        let smooth = vec![block; patch.count() * patch.count()];
        patch.solve(&Problem { radius_m: 1.0, depth_m, cell_m, on_face: &[], smooth: &smooth }, None)
    }

    /// Without pressures nothing is displaced, so no normal changed: that was a contact of residual 0 and no force.
    #[test]
    fn a_contact_of_negative_compliance_is_an_error() {
        assert_eq!(solve(0.5, -4.0), Err(NotConverged { depth: 0.5 }));
    }

    #[test]
    fn a_contact_whose_normals_still_turn_is_an_error() {
        assert_eq!(solve(0.9, -1.03), Err(NotConverged { depth: 0.9 }));
        assert!(solve(0.9, 0.0).is_ok_and(|contact| contact.energy_j > 0.0));
    }
}
