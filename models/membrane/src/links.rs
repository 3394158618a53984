//! Springs in runs: consecutive masses, each linked to another mass at the same index distance.
//!
//! A sheet numbered row by row has two such distances, one and a row; a run is then a row. A run is a plain loop over
//! slices, which the compiler vectorises; an irregular mesh has short runs and is only slower. Products and sums have
//! one fixed order and are never contracted, so every instruction set gives the same bits.

use crate::mesh::Link;
use crate::regions::{BLOCK, Regions};
use crate::vectors::Vectors;
use std::ops::Range;

/// Springs from consecutive masses, beginning with `first`, each to the mass `distance` indices later.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Run {
    first: usize,
    distance: usize,
    /// Indices of the run's springs in the arrays.
    springs: Range<usize>,
}

/// All springs of a network, in runs.
#[derive(Clone, Debug)]
pub(crate) struct Links {
    runs: Vec<Run>,
    rest_m: Vec<f64>,
    stiffness_n_per_m: Vec<f64>,
    /// Forces of the springs of one run on their first masses, N.
    scratch: Vectors,
}

impl Links {
    /// Sorts springs by index distance into runs that end at each block. Not real-time.
    pub(crate) fn new(links: &[Link]) -> Self {
        let mut sorted: Vec<Link> = links.to_vec();
        sorted.sort_by_key(|link| (link.ends[1] - link.ends[0], link.ends[0]));
        let mut runs: Vec<Run> = Vec::new();
        for (index, link) in sorted.iter().enumerate() {
            let [first, second] = link.ends;
            let distance = second - first;
            // A run stays inside one block of masses, so that it is inactive together with the block.
            let continued = runs.last_mut().filter(|run| {
                let next = run.first + run.springs.len();
                run.distance == distance && next == first && !first.is_multiple_of(BLOCK)
            });
            match continued {
                Some(run) => run.springs.end += 1,
                None => runs.push(Run { first, distance, springs: index..index + 1 }),
            }
        }
        Self {
            runs,
            rest_m: sorted.iter().map(|link| link.rest_m).collect(),
            stiffness_n_per_m: sorted.iter().map(|link| link.stiffness_n_per_m).collect(),
            scratch: Vectors::zero(BLOCK),
        }
    }

    /// Returns the two blocks of each spring's ends; the blocks may be equal, and pairs repeat. Not real-time.
    pub(crate) fn joined_blocks(&self) -> impl Iterator<Item = [usize; 2]> + '_ {
        self.runs.iter().flat_map(|run| {
            let ends = run.first..run.first + run.springs.len();
            ends.map(|end| [end / BLOCK, (end + run.distance) / BLOCK])
        })
    }

    /// Adds the forces of the springs of every run with an end in an active block to `forces_n`. Real-time: bounded, no
    /// allocation.
    #[inline]
    pub(crate) fn add_forces(&mut self, positions_m: &Vectors, forces_n: &mut Vectors, regions: &Regions) {
        for run in &self.runs {
            let (first, second) = (run.first, run.first + run.distance);
            let count = run.springs.len();
            let last = second + count - 1;
            if !(regions.is_active(first / BLOCK)
                || regions.is_active(second / BLOCK)
                || regions.is_active(last / BLOCK))
            {
                continue;
            }
            let springs = run.springs.clone();
            self.scratch.pull(
                positions_m,
                first..first + count,
                second..second + count,
                &self.rest_m[springs.clone()],
                &self.stiffness_n_per_m[springs],
            );
            forces_n.add(first..first + count, &self.scratch, 1.0);
            forces_n.add(second..second + count, &self.scratch, -1.0);
        }
    }
}

impl Vectors {
    /// Computes the forces of springs on their `first` masses, into the first entries of `self`.
    #[inline]
    fn pull(
        &mut self,
        positions_m: &Vectors,
        first: Range<usize>,
        second: Range<usize>,
        rest_m: &[f64],
        stiffness_n_per_m: &[f64],
    ) {
        /// Floor of a squared length, m²: two masses in one place give no force.
        const LEAST_SQUARE: f64 = 1.0e-300;
        let count = rest_m.len();
        // Slices of equal length: no bounds checks in the loop below.
        let [ax, ay, az] = positions_m.slices(first);
        let [bx, by, bz] = positions_m.slices(second);
        let [fx, fy, fz] = self.slices_mut(0..count);
        let k = &stiffness_n_per_m[..count];
        for i in 0..count {
            let (dx, dy, dz) = (bx[i] - ax[i], by[i] - ay[i], bz[i] - az[i]);
            let square = (dx * dx + dy * dy + dz * dz).max(LEAST_SQUARE);
            let pull = k[i] - k[i] * rest_m[i] / square.sqrt();
            fx[i] = pull * dx;
            fy[i] = pull * dy;
            fz[i] = pull * dz;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Mesh, Sheet};

    #[test]
    fn a_row_is_a_run_unless_a_block_ends_in_it() {
        let sheet =
            Sheet { nodes_per_side: 45, side_m: 0.1, mass_kg: 0.01, stiffness_n_per_m: 1.0, stretch: 1.0 };
        let mesh = Mesh::sheet(&sheet);
        let links = Links::new(&mesh.links);
        assert_eq!(links.rest_m.len(), 2 * 43 * 44);
        assert_eq!(links.runs.iter().map(|run| run.springs.len()).sum::<usize>(), 2 * 43 * 44);
        // 43 rows and 44 columns' steps, and one more run for each of the 31 block ends inside one.
        assert!(links.runs.len() <= 43 + 44 + 2 * 31, "{}", links.runs.len());
    }

    #[test]
    fn a_stretched_spring_pulls_its_ends_together_and_two_masses_in_one_place_do_nothing() {
        let mut links = Links::new(&[
            Link { ends: [0, 1], rest_m: 1.0, stiffness_n_per_m: 10.0 },
            Link { ends: [1, 2], rest_m: 1.0, stiffness_n_per_m: 10.0 },
        ]);
        let mut positions = Vectors::zero(3);
        (positions.x[1], positions.x[2]) = (1.5, 1.5);
        let mut forces = Vectors::zero(3);
        links.add_forces(&positions, &mut forces, &Regions::all_active(3));
        assert_eq!(forces.x, [5.0, -5.0, 0.0]);
        assert!(forces.y.iter().chain(&forces.z).all(|force| *force == 0.0));
    }
}
