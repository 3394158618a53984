//! Sparse Cholesky factorisation of a grid by nested dissection.
//!
//! A box of elements is cut across its longest side until single elements are left. On the way back, the stiffness of two
//! neighbours is added, the nodes that touch nothing outside are eliminated, and what is left is the stiffness of the pair
//! to its border. Each step is a dense matrix, and the order of all sums follows from the grid alone: the same bits on every
//! machine, with no search for an ordering and no threads.

use crate::dense::{self, NotPositive};
use crate::grid::{Elements, Grid, Lame};

/// One dense step: some unknowns, and those of the border they couple to.
#[derive(Debug)]
struct Front {
    /// Unknowns; the eliminated ones first.
    unknowns: Vec<u32>,
    eliminated: usize,
    /// Columns of the factor, all rows.
    panel: Vec<f64>,
}

/// A factored stiffness matrix of a grid with fixed unknowns.
#[derive(Debug)]
pub struct Stiffness {
    fronts: Vec<Front>,
    unknowns: usize,
    /// Three unknowns to a node: where each is fixed.
    fixed: Vec<[bool; 3]>,
}

/// What is left of a box of elements: its border.
struct Rest {
    unknowns: Vec<u32>,
    /// Lower triangle by columns.
    matrix: Vec<f64>,
}

struct Builder<'a> {
    grid: &'a Grid,
    elements: Elements,
    lame: Lame,
    fixed: &'a [[bool; 3]],
    fronts: Vec<Front>,
    /// Position of an unknown in the front that is being built.
    place: Vec<u32>,
}

/// Range of elements along each axis.
type Region = [(usize, usize); 3];

impl Stiffness {
    /// Assembles and factors. `fixed` says of each node which displacements are prescribed. Not real-time.
    ///
    /// # Errors
    /// [`NotPositive`] if the block can move freely, or the material is none.
    pub fn new(grid: &Grid, lame: Lame, fixed: Vec<[bool; 3]>) -> Result<Self, NotPositive> {
        let unknowns = 3 * grid.node_count();
        let mut builder = Builder {
            grid,
            elements: Elements::new(grid.order),
            lame,
            fixed: &fixed,
            fronts: Vec::new(),
            place: vec![0; unknowns],
        };
        builder.build([0, 1, 2].map(|axis| (0, grid.axes[axis].elements())))?;
        let fronts = builder.fronts;
        Ok(Self { fronts, unknowns, fixed })
    }

    /// Numbers the factor holds: what a solve reads twice.
    #[must_use]
    pub fn factor_size(&self) -> usize {
        self.fronts.iter().map(|front| front.panel.len()).sum()
    }

    /// Solves for `columns` right sides at once, in place: force in, displacement out, all columns of an unknown side by
    /// side. Fixed unknowns come out as zero. Not real-time.
    pub fn solve(&self, values: &mut [f64], columns: usize) {
        for (node, fixed) in self.fixed.iter().enumerate() {
            for (component, _) in fixed.iter().enumerate().filter(|(_, fixed)| **fixed) {
                let unknown = 3 * node + component;
                values[unknown * columns..(unknown + 1) * columns].fill(0.0);
            }
        }
        debug_assert_eq!(values.len(), self.unknowns * columns);
        let mut local = Vec::new();
        for front in &self.fronts {
            front.gather(values, columns, &mut local);
            front.forward(&mut local, columns);
            front.scatter(values, columns, &local, front.unknowns.len());
        }
        for front in self.fronts.iter().rev() {
            front.gather(values, columns, &mut local);
            front.backward(&mut local, columns);
            front.scatter(values, columns, &local, front.eliminated);
        }
    }
}

impl Front {
    fn gather(&self, values: &[f64], columns: usize, local: &mut Vec<f64>) {
        local.clear();
        for &unknown in &self.unknowns {
            let start = unknown as usize * columns;
            local.extend_from_slice(&values[start..start + columns]);
        }
    }

    fn scatter(&self, values: &mut [f64], columns: usize, local: &[f64], count: usize) {
        for (&unknown, row) in self.unknowns[..count].iter().zip(local.chunks_exact(columns)) {
            let start = unknown as usize * columns;
            values[start..start + columns].copy_from_slice(row);
        }
    }

    fn forward(&self, local: &mut [f64], columns: usize) {
        let size = self.unknowns.len();
        for k in 0..self.eliminated {
            let column = &self.panel[k * size..(k + 1) * size];
            let (done, below) = local.split_at_mut((k + 1) * columns);
            let row = &mut done[k * columns..];
            let inverse = 1.0 / column[k];
            row.iter_mut().for_each(|value| *value *= inverse);
            for (target, &scale) in below.chunks_exact_mut(columns).zip(&column[k + 1..]) {
                target.iter_mut().zip(&*row).for_each(|(t, r)| *t -= scale * r);
            }
        }
    }

    fn backward(&self, local: &mut [f64], columns: usize) {
        let size = self.unknowns.len();
        for k in (0..self.eliminated).rev() {
            let column = &self.panel[k * size..(k + 1) * size];
            let (head, below) = local.split_at_mut((k + 1) * columns);
            let row = &mut head[k * columns..];
            for (source, &scale) in below.chunks_exact(columns).zip(&column[k + 1..]) {
                row.iter_mut().zip(source).for_each(|(r, s)| *r -= scale * s);
            }
            let inverse = 1.0 / column[k];
            row.iter_mut().for_each(|value| *value *= inverse);
        }
    }
}

impl Builder<'_> {
    fn build(&mut self, region: Region) -> Result<Rest, NotPositive> {
        let longest =
            (0..3).max_by_key(|&axis| (region[axis].1 - region[axis].0, 2 - axis)).unwrap_or_default();
        let (from, to) = region[longest];
        let parts = if to - from == 1 {
            vec![self.element(region.map(|(first, _)| first))]
        } else {
            let middle = from.midpoint(to);
            [(from, middle), (middle, to)]
                .into_iter()
                .map(|part| {
                    let mut half = region;
                    half[longest] = part;
                    self.build(half)
                })
                .collect::<Result<_, _>>()?
        };
        self.eliminate(region, parts)
    }

    /// Stiffness of one element, without what is fixed.
    fn element(&self, element: [usize; 3]) -> Rest {
        let size_m = [0, 1, 2].map(|axis| {
            let borders = &self.grid.axes[axis].borders_m;
            borders[element[axis] + 1] - borders[element[axis]]
        });
        let whole = self.elements.stiffness(size_m, self.lame);
        let nodes = self.grid.element_nodes(element);
        let size = 3 * nodes.len();
        let free: Vec<(usize, u32)> = (0..size)
            .filter(|&local| !self.fixed[nodes[local / 3]][local % 3])
            .map(|local| (local, narrow(3 * nodes[local / 3] + local % 3)))
            .collect();
        let count = free.len();
        let mut matrix = vec![0.0; count * count];
        for (column, &(from, _)) in free.iter().enumerate() {
            for (row, &(to, _)) in free.iter().enumerate().skip(column) {
                matrix[column * count + row] = whole[from * size + to];
            }
        }
        Rest { unknowns: free.into_iter().map(|(_, unknown)| unknown).collect(), matrix }
    }

    /// True if all elements around a node are in the region.
    fn is_inside(&self, node: usize, region: Region) -> bool {
        let index = self.grid.index(node);
        (0..3).all(|axis| {
            let order = self.grid.order;
            let all = self.grid.axes[axis].elements();
            let (first, rest) = (index[axis] / order, index[axis] % order);
            let low = if rest == 0 { first.saturating_sub(1) } else { first };
            let high = first.min(all - 1);
            region[axis].0 <= low && high < region[axis].1
        })
    }

    fn eliminate(&mut self, region: Region, parts: Vec<Rest>) -> Result<Rest, NotPositive> {
        let mut unknowns: Vec<u32> = parts.iter().flat_map(|part| part.unknowns.iter().copied()).collect();
        unknowns.sort_unstable();
        unknowns.dedup();
        let (inside, border): (Vec<u32>, Vec<u32>) =
            unknowns.iter().partition(|&&unknown| self.is_inside(unknown as usize / 3, region));
        let eliminated = inside.len();
        let unknowns: Vec<u32> = inside.into_iter().chain(border.iter().copied()).collect();
        let size = unknowns.len();
        for (place, &unknown) in unknowns.iter().enumerate() {
            self.place[unknown as usize] = narrow(place);
        }
        let mut matrix = vec![0.0; size * size];
        for part in parts {
            let count = part.unknowns.len();
            let places: Vec<usize> =
                part.unknowns.iter().map(|&unknown| self.place[unknown as usize] as usize).collect();
            for (column, &to_column) in places.iter().enumerate() {
                for (row, &to_row) in places.iter().enumerate().skip(column) {
                    let (low, high) = (to_column.min(to_row), to_column.max(to_row));
                    matrix[low * size + high] += part.matrix[column * count + row];
                }
            }
        }
        dense::factor(&mut matrix, size, eliminated)?;
        let rest = size - eliminated;
        let mut schur = vec![0.0; rest * rest];
        for column in 0..rest {
            let start = (eliminated + column) * size + eliminated;
            schur[column * rest + column..(column + 1) * rest]
                .copy_from_slice(&matrix[start + column..start + rest]);
        }
        matrix.truncate(size * eliminated);
        matrix.shrink_to_fit();
        if eliminated > 0 {
            self.fronts.push(Front { unknowns, eliminated, panel: matrix });
        }
        Ok(Rest { unknowns: border, matrix: schur })
    }
}

/// Numbers of unknowns fit: a grid with more than 2^32 of them fits no machine.
#[allow(clippy::cast_possible_truncation)]
fn narrow(index: usize) -> u32 {
    index as u32
}

/// Subtracts the forces `K u` of a displacement from `forces`, N: with `u` prescribed at fixed nodes, the right side of a
/// problem whose fixed nodes move; with the whole `u`, the reactions. Elements without displacement are skipped. Not
/// real-time.
pub fn subtract_forces(grid: &Grid, lame: Lame, displacement: &[f64], forces: &mut [f64], columns: usize) {
    let elements = Elements::new(grid.order);
    let counts = [0, 1, 2].map(|axis| grid.axes[axis].elements());
    for e in 0..counts[0] * counts[1] * counts[2] {
        let element = [e % counts[0], e / counts[0] % counts[1], e / (counts[0] * counts[1])];
        let nodes = grid.element_nodes(element);
        let moved = |node: &usize| {
            displacement[3 * node * columns..3 * (node + 1) * columns].iter().any(|u| *u != 0.0)
        };
        if !nodes.iter().any(moved) {
            continue;
        }
        let size_m = [0, 1, 2].map(|axis| {
            let borders = &grid.axes[axis].borders_m;
            borders[element[axis] + 1] - borders[element[axis]]
        });
        let matrix = elements.stiffness(size_m, lame);
        let size = 3 * nodes.len();
        for (b, node) in nodes.iter().enumerate().filter(|(_, node)| moved(node)) {
            for j in 0..3 {
                let from = &displacement[(3 * node + j) * columns..(3 * node + j + 1) * columns];
                for (a, target) in nodes.iter().enumerate() {
                    for i in 0..3 {
                        let scale = matrix[(3 * b + j) * size + 3 * a + i];
                        let to = (3 * target + i) * columns;
                        forces[to..to + columns].iter_mut().zip(from).for_each(|(f, u)| *f -= scale * u);
                    }
                }
            }
        }
    }
}
