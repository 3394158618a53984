//! Stiffness of a body condensed to a few nodes of a refined region, with the unrefined rest factorised once. Not real-time.
//!
//! The elements of the given mesh form a binary tree of parts, each with its stiffness at its border (nested dissection, as in
//! [`crate::dissection`]). A refined mesh changes some leaves; all other parts are used again. The parts are joined from
//! outside to inside, so that the nodes of the refined region, which are many, are not carried to the root.

use crate::cells::{Geometry, Kind};
use crate::dense::{self, NotPositive};
use crate::grid::Lame;
use crate::mesh::halves;
use crate::refinement::{Refinement, distance_m2, narrow};
use std::borrow::Cow;

/// Stiffness of a part at its border.
#[derive(Clone, Debug, Default)]
pub struct Border {
    /// Nodes in ascending order, with the number of elements of the part at each.
    nodes: Vec<(u32, u32)>,
    /// Stiffness: lower triangle, column after column, three unknowns a node.
    matrix: Vec<f64>,
}

#[derive(Clone, Copy, Debug)]
enum Below {
    Element(u32),
    Parts([usize; 2]),
}

#[derive(Clone, Debug)]
struct Part {
    above: usize,
    below: Below,
    /// Empty for small parts, which are made anew.
    border: Border,
}

/// Factorised body of tetrahedra.
#[derive(Clone, Debug)]
pub struct Condensation {
    /// Refinement without any step.
    pub base: Refinement,
    materials: Vec<Lame>,
    regions: Vec<usize>,
    parts: Vec<Part>,
    /// Leaf of each element.
    leaves: Vec<usize>,
    root: usize,
}

/// Parts of fewer elements are not kept.
const LEAST_KEPT: usize = 6;

/// Coordinates of the points of the rule of second order for a tetrahedron, as exact as a straight element needs.
const RULE: [f64; 2] = [0.585_410_196_624_968_5, 0.138_196_601_125_010_5];

/// Returns the stiffness of a tetrahedron between its free nodes.
fn element(refinement: &Refinement, nodes: &[u32; 10], lame: Lame) -> Border {
    let [far, near] = RULE;
    let rule =
        [[near; 3], [far, near, near], [near, far, near], [near, near, far]].map(|at| (at, 1.0 / 24.0));
    let nodes_m = nodes.map(|node| refinement.nodes_m[node as usize]);
    let geometry = Geometry { kind: Kind::Tetrahedron, nodes_m: &nodes_m };
    let whole = geometry.stiffness_by(&rule, lame);
    let mut order: Vec<usize> = (0..10).filter(|&i| !refinement.fixed[nodes[i] as usize]).collect();
    order.sort_by_key(|&i| nodes[i]);
    let size = 3 * order.len();
    let place = |k: usize| 3 * order[k / 3] + k % 3;
    let column = |column: usize| (column..size).map(move |row| (column, row));
    let matrix = (0..size).flat_map(column).map(|(c, row)| whole[place(c) * 30 + place(row)]).collect();
    Border { nodes: order.into_iter().map(|i| (nodes[i], 1)).collect(), matrix }
}

/// Joins two parts and eliminates the nodes whose elements are all in them, unless they are kept.
fn join(parts: [&Border; 2], around: &[u32], is_kept: &[bool]) -> Result<Border, NotPositive> {
    let [a, b] = parts.map(|part| &part.nodes[..]);
    let mut nodes: Vec<(u32, u32)> = a.iter().chain(b).copied().collect();
    nodes.sort_unstable();
    nodes.dedup_by(|later, first| {
        let same = later.0 == first.0;
        first.1 += if same { later.1 } else { 0 };
        same
    });
    let (inside, border): (Vec<_>, Vec<_>) = nodes
        .into_iter()
        .partition(|&(node, count)| count == around[node as usize] && !is_kept[node as usize]);
    let (eliminated, size) = (3 * inside.len(), 3 * (inside.len() + border.len()));
    let place = |node: u32| match inside.binary_search_by_key(&node, |n| n.0) {
        Ok(i) => 3 * i,
        Err(_) => eliminated + 3 * border.binary_search_by_key(&node, |n| n.0).unwrap_or_default(),
    };
    let mut matrix = vec![0.0; size * size];
    for part in parts {
        let places: Vec<usize> = part.nodes.iter().map(|(node, _)| place(*node)).collect();
        let count = 3 * places.len();
        let mut values = part.matrix.iter();
        for column in 0..count {
            let to_column = places[column / 3] + column % 3;
            for (row, value) in (column..count).zip(&mut values) {
                let to_row = places[row / 3] + row % 3;
                let (low, high) = (to_column.min(to_row), to_column.max(to_row));
                matrix[low * size + high] += value;
            }
        }
    }
    dense::factor(&mut matrix, size, eliminated)?;
    let column = |column: usize| &matrix[column * size + column..(column + 1) * size];
    let schur = (eliminated..size).flat_map(column).copied().collect();
    Ok(Border { nodes: border, matrix: schur })
}

/// Returns the middle of an element, m.
fn middle(refinement: &Refinement, nodes: &[u32; 10]) -> [f64; 3] {
    [0, 1, 2].map(|k| nodes[..4].iter().map(|n| 0.25 * refinement.nodes_m[*n as usize][k]).sum())
}

/// Refined mesh on its way to a condensed stiffness.
struct Place<'a> {
    body: &'a Condensation,
    refined: &'a Refinement,
    around: Vec<u32>,
    is_kept: Vec<bool>,
    /// True for a part with new elements.
    changed: Vec<bool>,
}

/// New element: its nodes, its given element, and its distance from the kept nodes, m².
type Piece = ([u32; 10], u32, f64);

/// Number of new elements that are not split into near and far.
const NEAREST: usize = 400;
/// Number of kept nodes from which distances are measured.
const SAMPLES: usize = 48;

impl Condensation {
    /// Factorises a body; `materials`: of each region, `regions`: of each element.
    ///
    /// # Errors
    /// [`NotPositive`] if the parameters do not describe an elastic solid.
    pub fn new(base: Refinement, materials: Vec<Lame>, regions: Vec<usize>) -> Result<Self, NotPositive> {
        let nodes: Vec<[u32; 10]> = base.elements().map(|(_, nodes)| nodes).collect();
        let count = nodes.len();
        let mut body = Self { base, materials, regions, parts: Vec::new(), leaves: vec![0; count], root: 0 };
        let around = counts(&body.base);
        let is_kept = vec![false; around.len()];
        body.root = body.build((0..count).collect(), &nodes, &around, &is_kept)?.0;
        Ok(body)
    }

    fn build(
        &mut self,
        elements: Vec<usize>,
        nodes: &[[u32; 10]],
        around: &[u32],
        is_kept: &[bool],
    ) -> Result<(usize, Border), NotPositive> {
        let count = elements.len();
        let (below, border) = if let [one] = elements[..] {
            self.leaves[one] = self.parts.len();
            let lame = self.materials[self.regions[one]];
            (Below::Element(narrow(one)), element(&self.base, &nodes[one], lame))
        } else {
            let [a, b] = halves(elements, |&e| (middle(&self.base, &nodes[e]), e));
            let (a, b) = (self.build(a, nodes, around, is_kept)?, self.build(b, nodes, around, is_kept)?);
            (Below::Parts([a.0, b.0]), join([&a.1, &b.1], around, is_kept)?)
        };
        let number = self.parts.len();
        let kept = if count < LEAST_KEPT { Border::default() } else { border.clone() };
        self.parts.push(Part { above: usize::MAX, below, border: kept });
        if let Below::Parts(two) = below {
            two.into_iter().for_each(|part| self.parts[part].above = number);
        }
        Ok((number, border))
    }

    /// Returns the stiffness of a refined mesh of this body condensed to its nodes `kept` (ascending): lower triangle, column
    /// after column.
    ///
    /// # Errors
    /// [`NotPositive`] if an element is too flat.
    pub fn condense(&self, refined: &Refinement, kept: &[u32]) -> Result<Vec<f64>, NotPositive> {
        let mut pieces: Vec<Piece> = Vec::new();
        let mut changed = vec![false; self.parts.len()];
        let at = |node: &u32| refined.nodes_m[*node as usize];
        let samples: Vec<[f64; 3]> = kept.iter().step_by(1 + kept.len() / SAMPLES).map(at).collect();
        for (leaf, nodes) in refined.elements() {
            let is_new = leaf.corners != self.base.tetrahedra[leaf.parent as usize].corners;
            if is_new || nodes.iter().any(|n| kept.binary_search(n).is_ok()) {
                let middle_m = middle(refined, &nodes);
                let far = samples.iter().map(|s| distance_m2(*s, middle_m)).fold(f64::INFINITY, f64::min);
                pieces.push((nodes, leaf.parent, far));
                let mut part = self.leaves[leaf.parent as usize];
                while changed.get(part) == Some(&false) {
                    changed[part] = true;
                    part = self.parts[part].above;
                }
            }
        }
        let mut is_kept = vec![false; refined.nodes_m.len()];
        kept.iter().for_each(|&node| is_kept[node as usize] = true);
        let place = Place { body: self, refined, around: counts(refined), is_kept, changed };
        pieces.sort_by(|a, b| b.2.total_cmp(&a.2));
        let outside = place.outside(self.root)?.map(Cow::into_owned).unwrap_or_default();
        let whole = place.inwards(pieces, outside)?;
        debug_assert!(whole.nodes.iter().map(|n| n.0).eq(kept.iter().copied()));
        Ok(whole.matrix)
    }
}

/// Returns the number of elements at each node.
fn counts(refinement: &Refinement) -> Vec<u32> {
    let mut around = vec![0; refinement.nodes_m.len()];
    refinement.elements().flat_map(|(_, nodes)| nodes).for_each(|node| around[node as usize] += 1);
    around
}

impl Place<'_> {
    fn join(&self, parts: [&Border; 2]) -> Result<Border, NotPositive> {
        join(parts, &self.around, &self.is_kept)
    }

    fn element(&self, nodes: &[u32; 10], given: u32) -> Border {
        element(self.refined, nodes, self.body.materials[self.body.regions[given as usize]])
    }

    /// Joins the elements that are not new; `None` if there are none.
    fn outside(&self, part: usize) -> Result<Option<Cow<'_, Border>>, NotPositive> {
        let Part { below, border, .. } = &self.body.parts[part];
        if !self.changed[part] && !border.nodes.is_empty() {
            return Ok(Some(Cow::Borrowed(border)));
        }
        Ok(match *below {
            Below::Element(_) if self.changed[part] => None,
            Below::Element(given) => {
                let nodes = self.refined.nodes(self.body.base.tetrahedra[given as usize].corners);
                Some(Cow::Owned(self.element(&nodes, given)))
            }
            Below::Parts([a, b]) => match (self.outside(a)?, self.outside(b)?) {
                (Some(a), Some(b)) => Some(Cow::Owned(self.join([&a, &b])?)),
                (a, b) => a.or(b),
            },
        })
    }

    /// Joins new elements, the farthest first, to all others.
    fn inwards(&self, mut pieces: Vec<Piece>, outside: Border) -> Result<Border, NotPositive> {
        if pieces.len() < NEAREST {
            return self.join([&outside, &self.pieces(pieces)?]);
        }
        let near = pieces.split_off(pieces.len() / 2);
        let joined = self.join([&outside, &self.pieces(pieces)?])?;
        self.inwards(near, joined)
    }

    fn pieces(&self, elements: Vec<Piece>) -> Result<Border, NotPositive> {
        if let [(nodes, given, _)] = &elements[..] {
            return self.join([&self.element(nodes, *given), &Border::default()]);
        }
        let [a, b] = halves(elements, |piece| (middle(self.refined, &piece.0), 0));
        self.join([&self.pieces(a)?, &self.pieces(b)?])
    }
}
