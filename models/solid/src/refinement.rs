//! Refinement of a mesh of quadratic tetrahedra around points, by bisection of longest edges. Not real-time.
//!
//! A tetrahedron is halved at the middle of its longest edge together with all others at this edge; where the edge is not the
//! longest of another one, that one is halved first (M. C. Rivara, *Int. J. Numer. Meth. Engng* 40 (1997) 3313-3324). The mesh
//! has no hanging nodes, and a curved element keeps its map: the halves are quadratic and cover the same volume.

use crate::cells::Kind;
use crate::mesh::{Mesh, sorted};
use std::collections::{BTreeSet, HashMap};

/// Quadratic tetrahedron of a refined mesh.
#[derive(Clone, Copy, Debug)]
pub struct Tetrahedron {
    /// Corners, counterclockwise as in [`Kind::Tetrahedron`].
    pub corners: [u32; 4],
    /// True for each face, opposite to a corner, on the touched surface.
    touched: [bool; 4],
    /// Number of the element of the given mesh.
    pub parent: u32,
    is_leaf: bool,
}

/// Desired size of elements: `grade` times the distance from the nearest point, at least `grade * least_m`.
#[derive(Clone, Debug)]
pub struct Grading {
    /// Points of the surface.
    pub points_m: Vec<[f64; 3]>,
    /// Distance within which the size is even, m.
    pub least_m: f64,
    /// Size over distance.
    pub grade: f64,
}

/// Mesh of tetrahedra that can be refined.
#[derive(Clone, Debug)]
pub struct Refinement {
    /// Positions of the nodes, m; those of the given mesh are the first.
    pub nodes_m: Vec<[f64; 3]>,
    /// True for a node that does not move.
    pub fixed: Vec<bool>,
    pub(crate) tetrahedra: Vec<Tetrahedron>,
    middles: HashMap<[u32; 2], u32>,
    around: HashMap<[u32; 2], Vec<u32>>,
}

fn edge(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// Returns the squared distance of two points.
pub(crate) fn distance_m2(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]) * (a[k] - b[k])).sum()
}

#[allow(clippy::cast_possible_truncation)] // some hundred thousand
pub(crate) fn narrow(index: usize) -> u32 {
    index as u32
}

impl Refinement {
    /// Prepares the refinement of a mesh; `None` if an element is not a tetrahedron.
    #[must_use]
    pub fn new(mesh: &Mesh) -> Option<Self> {
        let touched: BTreeSet<Vec<usize>> =
            mesh.touched.iter().map(|facet| sorted(&facet.nodes[..facet.corners])).collect();
        let mut all = Self {
            nodes_m: mesh.nodes_m.clone(),
            fixed: mesh.fixed.clone(),
            tetrahedra: Vec::new(),
            middles: HashMap::new(),
            around: HashMap::new(),
        };
        for (parent, element) in mesh.elements.iter().enumerate() {
            if element.kind != Kind::Tetrahedron {
                return None;
            }
            let corners = [0, 1, 2, 3].map(|k| narrow(element.nodes[k]));
            for (k, [a, b]) in Kind::Tetrahedron.edges().iter().enumerate() {
                all.middles.insert(edge(corners[*a], corners[*b]), narrow(element.nodes[4 + k]));
            }
            let touched = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]
                .map(|face| touched.contains(&sorted(&face.map(|k| element.nodes[k]))));
            all.add(Tetrahedron { corners, touched, parent: narrow(parent), is_leaf: true });
        }
        Some(all)
    }

    fn add(&mut self, tetrahedron: Tetrahedron) {
        let number = narrow(self.tetrahedra.len());
        for [a, b] in Kind::Tetrahedron.edges() {
            let key = edge(tetrahedron.corners[*a], tetrahedron.corners[*b]);
            self.around.entry(key).or_default().push(number);
        }
        self.tetrahedra.push(tetrahedron);
    }

    /// Returns the elements of the refined mesh with their ten nodes.
    pub fn elements(&self) -> impl Iterator<Item = (&Tetrahedron, [u32; 10])> {
        self.tetrahedra.iter().filter(|t| t.is_leaf).map(|t| (t, self.nodes(t.corners)))
    }

    /// Returns the ten nodes of a tetrahedron.
    pub(crate) fn nodes(&self, corners: [u32; 4]) -> [u32; 10] {
        let mut nodes = [0; 10];
        nodes[..4].copy_from_slice(&corners);
        for (node, [a, b]) in nodes[4..].iter_mut().zip(Kind::Tetrahedron.edges()) {
            *node = self.middles[&edge(corners[*a], corners[*b])];
        }
        nodes
    }

    /// Returns the nodes of the touched faces of a leaf: corners, counterclockwise from outside, then middles.
    pub fn touched(&self, leaf: &Tetrahedron) -> impl Iterator<Item = [u32; 6]> {
        let corners = leaf.corners;
        let faces = Kind::Tetrahedron
            .faces()
            .iter()
            .filter(move |face| (0..4).any(|k| !face.contains(&k) && leaf.touched[k]));
        faces.map(move |face| {
            let [a, b, c] = [corners[face[0]], corners[face[1]], corners[face[2]]];
            [a, b, c, self.middles[&edge(a, b)], self.middles[&edge(b, c)], self.middles[&edge(c, a)]]
        })
    }

    fn length_m2(&self, [a, b]: [u32; 2]) -> f64 {
        distance_m2(self.nodes_m[a as usize], self.nodes_m[b as usize])
    }

    /// Returns the longest edge; of equal ones, that of the largest node numbers.
    fn longest(&self, corners: [u32; 4]) -> [u32; 2] {
        let mut best = ([0; 2], -1.0);
        for [a, b] in Kind::Tetrahedron.edges() {
            let key = edge(corners[*a], corners[*b]);
            let length = self.length_m2(key);
            if length > best.1 || length == best.1 && key > best.0 {
                best = (key, length);
            }
        }
        best.0
    }

    /// Halves elements until each is as small as the grading says.
    pub fn refine(&mut self, grading: &Grading) {
        let mut next = 0;
        while next < self.tetrahedra.len() {
            let Tetrahedron { corners, is_leaf, .. } = self.tetrahedra[next];
            let at = |node: &u32| self.nodes_m[*node as usize];
            let near_m2 = corners
                .iter()
                .flat_map(|node| grading.points_m.iter().map(move |point| distance_m2(at(node), *point)))
                .fold(f64::INFINITY, f64::min);
            let longest = self.longest(corners);
            let size_m = grading.grade * near_m2.sqrt().max(grading.least_m);
            if is_leaf && self.length_m2(longest) > size_m * size_m {
                self.halve(next, longest);
            } else {
                next += 1;
            }
        }
    }

    /// Halves an element at its longest edge, and before it all others that have to be.
    fn halve(&mut self, number: usize, longest: [u32; 2]) {
        let mut path = vec![(number, longest)];
        while let Some(&(_, at)) = path.last() {
            let other = self.around[&at]
                .iter()
                .map(|&other| (other as usize, self.longest(self.tetrahedra[other as usize].corners)))
                .find(|(_, own)| *own != at);
            if let Some(other) = other {
                path.push(other);
            } else {
                self.bisect(at);
                path.pop();
            }
        }
    }

    /// Halves all elements at an edge.
    fn bisect(&mut self, [a, b]: [u32; 2]) {
        let middle = self.middles[&[a, b]];
        for end in [a, b] {
            let other = if end == a { b } else { a };
            self.middle(end, middle, &[(end, 0.375), (other, -0.125), (middle, 0.75)]);
        }
        for number in self.around.remove(&[a, b]).unwrap_or_default() {
            let old = self.tetrahedra[number as usize];
            self.tetrahedra[number as usize].is_leaf = false;
            for [p, q] in Kind::Tetrahedron.edges() {
                if let Some(list) = self.around.get_mut(&edge(old.corners[*p], old.corners[*q])) {
                    list.retain(|other| *other != number);
                }
            }
            for &c in old.corners.iter().filter(|c| **c != a && **c != b) {
                // The quadratic map of the face a, b, c at a quarter of a, a quarter of b and half of c.
                let (ac, bc) = (self.middles[&edge(a, c)], self.middles[&edge(b, c)]);
                let shares = [(a, -0.125), (b, -0.125), (middle, 0.25), (ac, 0.5), (bc, 0.5)];
                self.middle(middle, c, &shares);
            }
            for (kept, replaced) in [(a, b), (b, a)] {
                let mut new = Tetrahedron { is_leaf: true, ..old };
                for k in 0..4 {
                    if old.corners[k] == replaced {
                        new.corners[k] = middle;
                    } else if old.corners[k] == kept {
                        new.touched[k] = false; // the cut
                    }
                }
                self.add(new);
            }
        }
    }

    /// Makes the node at the middle of a new edge, unless it exists; a node is fixed where all it lies between are.
    fn middle(&mut self, a: u32, b: u32, shares: &[(u32, f64)]) {
        let next = narrow(self.nodes_m.len());
        if *self.middles.entry(edge(a, b)).or_insert(next) == next {
            let at = [0, 1, 2].map(|k| shares.iter().map(|(n, s)| s * self.nodes_m[*n as usize][k]).sum());
            let fixed = shares.iter().all(|(n, _)| self.fixed[*n as usize]);
            self.nodes_m.push(at);
            self.fixed.push(fixed);
        }
    }
}
