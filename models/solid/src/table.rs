//! Remainder of a face between any two points: values for the pairs of points of a grid, with cubic interpolation.

use crate::half_space::{Block, add_scaled};
use crate::remainder::{Face, Remainder};

/// Remainder of a face for all pairs of points of a grid.
#[derive(Clone, Debug)]
#[must_use]
pub struct Table {
    /// Grid coordinates along `p` and `q`, m, ascending.
    nodes_m: [Vec<f64>; 2],
    /// Displacement at a target under a unit force at a source, m/N; by source, then target, `p` first.
    blocks: Vec<Block>,
}

/// Interpolation nodes around a coordinate with their weights: four nodes (cubic), or all nodes if there are fewer.
#[derive(Clone, Copy, Debug)]
pub struct Window {
    first: usize,
    shares: [f64; 4],
}

/// Returns the weights of the cubic through the four nodes around a coordinate, which is clamped to the first and last node.
#[must_use]
pub fn window(nodes: &[f64], coordinate: f64) -> Window {
    let count = nodes.len().min(4);
    let at = coordinate.clamp(nodes[0], nodes[nodes.len() - 1]);
    let below = nodes.iter().take_while(|&&node| node <= at).count();
    let first = below.saturating_sub(2).min(nodes.len() - count);
    let mut shares = [0.0; 4];
    for (i, share) in shares.iter_mut().enumerate().take(count) {
        *share = 1.0;
        for j in (0..count).filter(|&j| j != i) {
            *share *= (at - nodes[first + j]) / (nodes[first + i] - nodes[first + j]);
        }
    }
    Window { first, shares }
}

/// Returns both signs of non-negative coordinates, ascending.
pub(crate) fn mirrored(half: &[f64]) -> Vec<f64> {
    let negative = half.iter().rev().filter(|&&x| x > 0.0).map(|x| -x);
    negative.chain(half.iter().copied()).collect()
}

impl Table {
    /// Solves for the remainder of all pairs of grid points. `half_m`: coordinates along `p` and `q`, ascending. The coordinates
    /// along `p`, and on the top also along `q`, begin at zero and are mirrored. Not real-time.
    pub fn new(remainder: &Remainder, face: Face, half_m: [&[f64]; 2]) -> Self {
        let quarter: Vec<[f64; 2]> =
            half_m[1].iter().flat_map(|&q| half_m[0].iter().map(move |&p| [p, q])).collect();
        let answers = remainder.responses(face, &quarter, &quarter);
        let nodes_m =
            [mirrored(half_m[0]), if face == Face::Top { mirrored(half_m[1]) } else { half_m[1].to_vec() }];
        let count = [nodes_m[0].len(), nodes_m[1].len()];
        // Returns index in the quarter and sign of a signed coordinate.
        let fold = |k: usize, index: usize| {
            let zeros = count[k] - half_m[k].len();
            if index >= zeros { (index - zeros, 1.0) } else { (half_m[k].len() - 1 - index, -1.0) }
        };
        let total = count[0] * count[1];
        let mut blocks = vec![[[0.0; 3]; 3]; total * total];
        for source in 0..total {
            let (sp, flip_p) = fold(0, source % count[0]);
            let (sq, flip_q) = fold(1, source / count[0]);
            for target in 0..total {
                let (tp, side_p) = fold(0, target % count[0]);
                let (tq, side_q) = fold(1, target / count[0]);
                // Mirror both so that the source lies in the quarter; the target may then lie in another.
                let (x, y) = match face {
                    Face::Top => (flip_p * side_p, flip_q * side_q),
                    Face::SideX => (1.0, flip_p * side_p),
                    Face::SideY => (flip_p * side_p, 1.0),
                };
                let mirror = usize::from(x < 0.0) + 2 * usize::from(y < 0.0);
                let block = answers[sq * half_m[0].len() + sp][tq * half_m[0].len() + tp][mirror];
                let flip = [flip_p, flip_q, 1.0];
                for i in 0..3 {
                    for j in 0..3 {
                        blocks[source * total + target][i][j] = flip[i] * flip[j] * block[i][j];
                    }
                }
            }
        }
        let mut table = Self { nodes_m, blocks };
        table.make_reciprocal();
        table
    }

    /// Builds a table from compliances for all pairs of points of a grid, and makes it reciprocal. The index of `p` varies fastest;
    /// `answers[source][target]` is the displacement of the target per force at the source, m/N. Not real-time.
    pub fn of(nodes_m: [Vec<f64>; 2], answers: &[Vec<Block>]) -> Self {
        let mut table = Self { nodes_m, blocks: answers.concat() };
        table.make_reciprocal();
        table
    }

    fn make_reciprocal(&mut self) {
        let total = self.nodes_m[0].len() * self.nodes_m[1].len();
        let blocks = &mut self.blocks;
        // Betti's reciprocity: the mutual displacements are equal. Elements and quadrature violate it slightly; take the mean.
        for source in 0..total {
            for target in 0..=source {
                let (one, two) = (blocks[source * total + target], blocks[target * total + source]);
                for i in 0..3 {
                    for j in 0..3 {
                        let mean = 0.5 * (one[i][j] + two[j][i]);
                        blocks[source * total + target][i][j] = mean;
                        blocks[target * total + source][j][i] = mean;
                    }
                }
            }
        }
    }

    /// Interpolates the remainder between all pairs of points, m/N, by target, then source. Not real-time.
    #[must_use]
    pub fn among(&self, points_m: &[[f64; 2]]) -> Vec<Block> {
        let count = self.nodes_m[0].len();
        let total = count * self.nodes_m[1].len();
        let windows: Vec<[Window; 2]> =
            points_m.iter().map(|at| [0, 1].map(|k| window(&self.nodes_m[k], at[k]))).collect();
        // Collect only nodes that some point needs.
        let mut used = vec![usize::MAX; total];
        let mut nodes = Vec::new();
        let mut shares: Vec<Vec<(usize, f64)>> = Vec::with_capacity(points_m.len());
        for [p, q] in &windows {
            let mut own = Vec::with_capacity(16);
            for (j, sq) in q.shares.iter().enumerate().filter(|(_, s)| **s != 0.0) {
                for (i, sp) in p.shares.iter().enumerate().filter(|(_, s)| **s != 0.0) {
                    let node = (q.first + j) * count + p.first + i;
                    if used[node] == usize::MAX {
                        used[node] = nodes.len();
                        nodes.push(node);
                    }
                    own.push((used[node], sp * sq));
                }
            }
            shares.push(own);
        }
        // Interpolate over the sources first, then over the targets.
        let mut half = vec![[[0.0; 3]; 3]; nodes.len() * points_m.len()];
        for (node, &target) in nodes.iter().enumerate() {
            for (point, own) in shares.iter().enumerate() {
                let sum = &mut half[node * points_m.len() + point];
                for &(source, share) in own {
                    add_scaled(sum, &self.blocks[nodes[source] * total + target], share);
                }
            }
        }
        let mut all = vec![[[0.0; 3]; 3]; points_m.len() * points_m.len()];
        for (target, own) in shares.iter().enumerate() {
            for &(node, share) in own {
                for source in 0..points_m.len() {
                    let part = half[node * points_m.len() + source];
                    add_scaled(&mut all[target * points_m.len() + source], &part, share);
                }
            }
        }
        all
    }
}
