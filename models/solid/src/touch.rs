//! Contact of a rigid frictionless ball with the surface of a condensed body, at one place of its centre. Not real-time.
//!
//! Cells are the triangles of the refined surface, each with an even load. No cell's mean distance from the centre of the ball,
//! displaced, is below the radius; a load pushes along the mean direction from the centre, as the gradient of that distance
//! does, so the force is the exact derivative of the stored energy. A solve alternates between the loads of the active cells
//! for given directions (a Cholesky factorisation) and the directions and active cells for given loads.

use crate::condensation::Condensation;
use crate::dense::{self, NotPositive};
use crate::facet::SurfacePoint;
use crate::mesh::Facet;
use crate::refinement::{Grading, Refinement, distance_m2};
use std::collections::BTreeMap;

/// Triangle of the surface.
#[derive(Clone, Debug)]
struct Cell {
    /// Positions, m, with their shares of the area.
    points: Vec<([f64; 3], f64)>,
    /// Nodes with their shares of the mean displacement.
    nodes: [(u32, f64); 6],
}

/// Part of the surface that the ball may touch, with its compliance.
#[derive(Clone, Debug)]
pub struct Zone {
    cells: Vec<Cell>,
    /// Mean displacement of a cell under an even unit load on a cell, m/N; three components a cell, symmetric.
    compliance: Vec<f64>,
}

/// Contact at one place of the centre.
#[derive(Clone, Debug, Default)]
pub struct Touch {
    /// Stored energy, J.
    pub energy_j: f64,
    /// Force on the ball, N.
    pub force_n: [f64; 3],
    /// Number of cells in contact.
    pub cells: usize,
    /// Mean displacement of each cell, m.
    displaced_m: Vec<[f64; 3]>,
    active: Vec<bool>,
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Cell {
    fn new(nodes_m: &[[f64; 3]], nodes: [u32; 6]) -> Self {
        let facet = Facet { corners: 3, nodes: nodes.map(|node| node as usize).to_vec() };
        let points = facet.points(nodes_m);
        let size = |point: &SurfacePoint| dot(point.normal_m2, point.normal_m2).sqrt();
        let area: f64 = points.iter().map(size).sum();
        let mut all = nodes.map(|node| (node, 0.0));
        for point in &points {
            let share = size(point) / area;
            all.iter_mut().zip(&point.shares).for_each(|(node, shape)| node.1 += share * shape);
        }
        let points = points.iter().map(|point| (point.position_m, size(point) / area)).collect();
        Self { points, nodes: all }
    }

    /// Returns the mean distance from a point, and its gradient over the displacement.
    fn distance(&self, displaced_m: [f64; 3], centre_m: [f64; 3]) -> (f64, [f64; 3]) {
        let (mut mean, mut slope) = (0.0, [0.0; 3]);
        for (at, share) in &self.points {
            let away = [0, 1, 2].map(|k| at[k] + displaced_m[k] - centre_m[k]);
            let length = dot(away, away).sqrt();
            mean += share * length;
            slope.iter_mut().zip(away).for_each(|(sum, c)| *sum += share * c / length);
        }
        (mean, slope)
    }
}

/// Largest number of steps of a contact.
const MOST_STEPS: usize = 80;
/// Largest remaining overlap, in radii.
const TOLERANCE: f64 = 1.0e-8;

impl Zone {
    /// Refines the body as the grading says and condenses it to the cells within `reach_m` of one of the points `centres_m`.
    ///
    /// # Errors
    /// [`NotPositive`] if an element is too flat.
    pub fn new(
        body: &Condensation,
        grading: &Grading,
        centres_m: &[[f64; 3]],
        reach_m: f64,
    ) -> Result<Self, NotPositive> {
        let mut refined: Refinement = body.base.clone();
        refined.refine(grading);
        let cells: Vec<Cell> = refined
            .elements()
            .flat_map(|(leaf, _)| refined.touched(leaf))
            .map(|nodes| Cell::new(&refined.nodes_m, nodes))
            .filter(|cell| {
                let near = |at: [f64; 3]| centres_m.iter().any(|c| distance_m2(at, *c) < reach_m * reach_m);
                cell.points.iter().any(|point| near(point.0))
            })
            .collect();
        let free = cells.iter().flat_map(|c| c.nodes).filter(|n| !refined.fixed[n.0 as usize]);
        let mut places: BTreeMap<u32, usize> = free.map(|n| (n.0, 0)).collect();
        let kept: Vec<u32> = places.keys().copied().collect();
        places.values_mut().enumerate().for_each(|(i, place)| *place = i);
        let stiffness = body.condense(&refined, &kept)?;
        // The Schur complement of the stiffness in this matrix is minus the compliance of the loads.
        let (inner, loads) = (3 * kept.len(), 3 * cells.len());
        let size = inner + loads;
        let mut matrix = vec![0.0; size * size];
        let mut values = stiffness.into_iter();
        for column in 0..inner {
            let target = &mut matrix[column * size + column..column * size + inner];
            target.iter_mut().zip(&mut values).for_each(|(t, value)| *t = value);
        }
        for (row, cell) in cells.iter().enumerate() {
            for (node, share) in cell.nodes {
                // A fixed node does not move, so it has no part in the mean displacement.
                let Some(place) = places.get(&node) else { continue };
                for k in 0..3 {
                    matrix[(3 * place + k) * size + inner + 3 * row + k] = share;
                }
            }
        }
        dense::factor(&mut matrix, size, inner)?;
        let mut compliance = vec![0.0; loads * loads];
        for column in 0..loads {
            for row in column..loads {
                let value = -matrix[(inner + column) * size + inner + row];
                compliance[column * loads + row] = value;
                compliance[row * loads + column] = value;
            }
        }
        Ok(Self { cells, compliance })
    }

    /// Returns the number of cells.
    #[must_use]
    pub fn count(&self) -> usize {
        self.cells.len()
    }

    /// Solves for the contact with the ball centred at `centre_m`, from a contact nearby or from [`Touch::default`]; `None` if
    /// it does not converge.
    #[must_use]
    pub fn solve(&self, centre_m: [f64; 3], radius_m: f64, from: &Touch) -> Option<Touch> {
        let count = self.cells.len();
        let mut touch = from.clone();
        touch.displaced_m.resize(count, [0.0; 3]);
        touch.active.resize(count, false);
        let gaps = |displaced_m: &[[f64; 3]]| -> Vec<(f64, [f64; 3])> {
            let each = self.cells.iter().zip(displaced_m);
            each.map(|(cell, u)| cell.distance(*u, centre_m)).map(|(d, n)| (d - radius_m, n)).collect()
        };
        let mut gap = gaps(&touch.displaced_m);
        touch.active.iter_mut().zip(&gap).for_each(|(active, g)| *active |= g.0 < 0.0);
        for step in 0..MOST_STEPS {
            let loads = self.loads(&gap, &mut touch)?;
            touch.displaced_m = self.displace(&loads, &gap);
            touch.energy_j = 0.5
                * loads
                    .iter()
                    .map(|(cell, load)| load * dot(gap[*cell].1, touch.displaced_m[*cell]))
                    .sum::<f64>();
            touch.force_n =
                [0, 1, 2].map(|k| -loads.iter().map(|(c, load)| load * gap[*c].1[k]).sum::<f64>());
            touch.cells = loads.len();
            gap = gaps(&touch.displaced_m);
            let worst = loads.iter().map(|(cell, _)| gap[*cell].0.abs()).fold(0.0, f64::max);
            let mut joined = false;
            for (active, g) in touch.active.iter_mut().zip(&gap) {
                if !*active && g.0 < -TOLERANCE * radius_m {
                    // Towards the end a cell that joins and leaves by turns stays out.
                    (*active, joined) = (step < MOST_STEPS / 2, true);
                }
            }
            if worst < TOLERANCE * radius_m && (!joined || step >= MOST_STEPS / 2) {
                return touch.energy_j.is_finite().then_some(touch);
            }
        }
        None
    }

    /// Returns the loads that close the gaps of the active cells; cells that would pull are deactivated.
    fn loads(&self, gap: &[(f64, [f64; 3])], touch: &mut Touch) -> Option<Vec<(usize, f64)>> {
        let wide = 3 * self.cells.len();
        loop {
            let cells: Vec<usize> = (0..self.cells.len()).filter(|&cell| touch.active[cell]).collect();
            let size = cells.len();
            let mut matrix = vec![0.0; size * size];
            for (column, &source) in cells.iter().enumerate() {
                let n = gap[source].1;
                for (row, &target) in cells.iter().enumerate().skip(column) {
                    let line = |k: usize| &self.compliance[(3 * target + k) * wide + 3 * source..][..3];
                    let moved = [0, 1, 2].map(|k| dot([line(k)[0], line(k)[1], line(k)[2]], n));
                    matrix[column * size + row] = dot(gap[target].1, moved);
                }
            }
            let mut loads: Vec<f64> =
                cells.iter().map(|&cell| dot(gap[cell].1, touch.displaced_m[cell]) - gap[cell].0).collect();
            dense::factor(&mut matrix, size, size).ok()?;
            dense::solve(&matrix, size, &mut loads);
            let pulls: Vec<usize> = (0..size).filter(|&i| loads[i] < 0.0).collect();
            if pulls.is_empty() {
                return Some(cells.into_iter().zip(loads).collect());
            }
            pulls.into_iter().for_each(|i| touch.active[cells[i]] = false);
        }
    }

    fn displace(&self, loads: &[(usize, f64)], gap: &[(f64, [f64; 3])]) -> Vec<[f64; 3]> {
        let wide = 3 * self.cells.len();
        let mut displaced_m = vec![[0.0; 3]; self.cells.len()];
        for (source, load) in loads {
            for j in 0..3 {
                let column = &self.compliance[(3 * source + j) * wide..][..wide];
                let push = load * gap[*source].1[j];
                displaced_m.as_flattened_mut().iter_mut().zip(column).for_each(|(u, c)| *u += push * c);
            }
        }
        displaced_m
    }
}
