//! Sparse Cholesky factorisation of a grid or a mesh by nested dissection.
//!
//! A body is cut across its longest side down to single elements. On the way back, the stiffnesses of two neighbours
//! are added and the nodes without a neighbour outside are eliminated, which gives the stiffness of the pair at its
//! border. Each step is a dense matrix, and the elements alone determine the order of all sums: the same bits on every
//! machine, without a search for an ordering and without threads.

use crate::dense::{self, NotPositive};
use crate::grid::{Elements, Grid, Lame};

/// Finite-element model to assemble: elements with their nodes and stiffness matrices.
pub trait Assembly {
    /// Returns the number of nodes.
    fn node_count(&self) -> usize;
    /// Returns the number of elements.
    fn element_count(&self) -> usize;
    /// Returns the nodes of an element.
    fn nodes(&self, element: usize) -> Vec<usize>;
    /// Returns the stiffness matrix of an element, N/m: column-major, three degrees of freedom per node.
    fn stiffness(&self, element: usize) -> Vec<f64>;
    /// Divides a set of two or more elements into two parts, neither of them empty.
    fn halves(&self, elements: Vec<usize>) -> [Vec<usize>; 2];
}

/// Stiffness of a grid of one material, as an [`Assembly`].
#[derive(Clone, Debug)]
pub struct GridStiffness<'a> {
    grid: &'a Grid,
    elements: Elements,
    lame: Lame,
}

impl<'a> GridStiffness<'a> {
    /// Precomputes the element integrals. Not real-time.
    #[must_use]
    pub fn new(grid: &'a Grid, lame: Lame) -> Self {
        Self { grid, elements: Elements::new(grid.order), lame }
    }

    fn index(&self, element: usize) -> [usize; 3] {
        let [nx, ny, _] = self.counts();
        [element % nx, element / nx % ny, element / (nx * ny)]
    }

    fn counts(&self) -> [usize; 3] {
        [0, 1, 2].map(|axis| self.grid.axes[axis].elements())
    }
}

impl Assembly for GridStiffness<'_> {
    fn node_count(&self) -> usize {
        self.grid.node_count()
    }

    fn element_count(&self) -> usize {
        self.counts().iter().product()
    }

    fn nodes(&self, element: usize) -> Vec<usize> {
        self.grid.element_nodes(self.index(element))
    }

    fn stiffness(&self, element: usize) -> Vec<f64> {
        let index = self.index(element);
        let size_m = [0, 1, 2].map(|axis| {
            let borders = &self.grid.axes[axis].borders_m;
            borders[index[axis] + 1] - borders[index[axis]]
        });
        self.elements.stiffness(size_m, self.lame)
    }

    /// Cuts across the side with the most elements.
    fn halves(&self, elements: Vec<usize>) -> [Vec<usize>; 2] {
        let range = |axis: usize| {
            let all = || elements.iter().map(|&element| self.index(element)[axis]);
            (all().min().unwrap_or_default(), all().max().unwrap_or_default() + 1)
        };
        let ranges = [range(0), range(1), range(2)];
        let longest =
            (0..3).max_by_key(|&axis| (ranges[axis].1 - ranges[axis].0, 2 - axis)).unwrap_or_default();
        let middle = ranges[longest].0.midpoint(ranges[longest].1);
        let (lower, upper) = elements.into_iter().partition(|&element| self.index(element)[longest] < middle);
        [lower, upper]
    }
}

/// Dense elimination step: the eliminated unknowns and the border they couple to.
#[derive(Debug)]
struct Front {
    /// Unknowns; the eliminated ones first.
    unknowns: Vec<u32>,
    eliminated: usize,
    /// Eliminated columns of the factor, all rows.
    panel: Vec<f64>,
}

/// Cholesky factors of a stiffness matrix, without the fixed unknowns.
#[derive(Debug)]
pub struct Stiffness {
    fronts: Vec<Front>,
    unknowns: usize,
    /// For each node, the components that are fixed.
    fixed: Vec<[bool; 3]>,
}

/// Stiffness of some elements, condensed to their border (Schur complement).
struct Rest {
    unknowns: Vec<u32>,
    /// Lower triangle, column-major.
    matrix: Vec<f64>,
}

struct Builder<'a, A> {
    assembly: &'a A,
    fixed: &'a [[bool; 3]],
    fronts: Vec<Front>,
    /// Position of an unknown in the front that is being built.
    place: Vec<u32>,
    /// Number of elements around each node: in the whole body, and in the part that is being built.
    around: Vec<u32>,
    inside: Vec<u32>,
}

impl Stiffness {
    /// Assembles and factorises the stiffness matrix. `fixed`: for each node, true for each prescribed component. Not real-time.
    ///
    /// # Errors
    /// [`NotPositive`] if the body can move as a rigid body, or the material is not elastic.
    pub fn new(assembly: &impl Assembly, fixed: Vec<[bool; 3]>) -> Result<Self, NotPositive> {
        let nodes = assembly.node_count();
        let elements: Vec<usize> = (0..assembly.element_count()).collect();
        let mut around = vec![0; nodes];
        for &element in &elements {
            assembly.nodes(element).into_iter().for_each(|node| around[node] += 1);
        }
        let mut builder = Builder {
            assembly,
            fixed: &fixed,
            fronts: Vec::new(),
            place: vec![0; 3 * nodes],
            around,
            inside: vec![0; nodes],
        };
        builder.build(elements)?;
        let fronts = builder.fronts;
        Ok(Self { fronts, unknowns: 3 * nodes, fixed })
    }

    /// Solves for `columns` right-hand sides at once, in place: replaces forces, N, by displacements, m. The values of an
    /// unknown in all right-hand sides are adjacent in memory. Fixed unknowns become zero. Not real-time.
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

impl<A: Assembly> Builder<'_, A> {
    fn build(&mut self, elements: Vec<usize>) -> Result<Rest, NotPositive> {
        let mut nodes: Vec<usize> =
            elements.iter().flat_map(|&element| self.assembly.nodes(element)).collect();
        let parts = if let [element] = elements[..] {
            vec![self.element(element)]
        } else {
            self.assembly
                .halves(elements)
                .into_iter()
                .map(|half| self.build(half))
                .collect::<Result<_, _>>()?
        };
        nodes.iter().for_each(|&node| self.inside[node] += 1);
        let rest = self.eliminate(parts);
        nodes.drain(..).for_each(|node| self.inside[node] = 0);
        rest
    }

    /// Returns the stiffness of one element without its fixed unknowns.
    fn element(&self, element: usize) -> Rest {
        let whole = self.assembly.stiffness(element);
        let nodes = self.assembly.nodes(element);
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

    fn eliminate(&mut self, parts: Vec<Rest>) -> Result<Rest, NotPositive> {
        let mut unknowns: Vec<u32> = parts.iter().flat_map(|part| part.unknowns.iter().copied()).collect();
        unknowns.sort_unstable();
        unknowns.dedup();
        // Nodes whose elements are all in this part have no neighbour outside.
        let (inside, border): (Vec<u32>, Vec<u32>) = unknowns.iter().partition(|&&unknown| {
            let node = unknown as usize / 3;
            self.inside[node] == self.around[node]
        });
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

/// Narrows an index to 32 bits: no machine holds a body with more than 2^32 unknowns.
#[allow(clippy::cast_possible_truncation)]
fn narrow(index: usize) -> u32 {
    index as u32
}

/// Subtracts the forces `K u` of a displacement from `forces`, N. With `u` prescribed at fixed nodes, this gives the
/// right-hand side of a problem whose fixed nodes move; with the whole `u`, the reactions. Elements without
/// displacement are skipped. Not real-time.
pub fn subtract_forces(assembly: &impl Assembly, displacement: &[f64], forces: &mut [f64], columns: usize) {
    for element in 0..assembly.element_count() {
        let nodes = assembly.nodes(element);
        let moved = |node: &usize| {
            displacement[3 * node * columns..3 * (node + 1) * columns].iter().any(|u| *u != 0.0)
        };
        if !nodes.iter().any(moved) {
            continue;
        }
        let matrix = assembly.stiffness(element);
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
