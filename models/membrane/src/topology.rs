//! Topology of a mesh file from the positions of its corners. Not real-time.
//!
//! Programs write one sheet in many ways: a vertex once for each face, texture or normal, vertices in another order,
//! faces flipped, twice or without area. Connections therefore follow from positions alone, and vertices are numbered
//! by position: one sheet gives the same numbers, and the same bits of force, from each of these files.

use crate::obj::Obj;
use flotor_hal::{DVec3, TextProblem};
use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};

/// Distance at which vertices are merged, over the largest coordinate: some roundings in single precision.
const SAME_PLACE: f64 = 1.0e-6;
/// Largest distance of a border vertex from a border edge at which they form a crack, over the length of the edge.
const CRACK: f64 = 1.0e-3;
/// Maximum number of distinct vertices: those of the finest sheet.
const MOST_PLACES: usize = 40_000;

/// Distinct vertices with their connections.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Topology {
    /// Positions of the vertices, sorted by x, then y, then z, m.
    pub(crate) places_m: Vec<DVec3>,
    /// Corners of each face, at least three, as indices of vertices.
    pub(crate) faces: Vec<Vec<usize>>,
    /// Number of faces of each edge, 0 for a segment of a line; the key is the edge's ends in ascending order.
    pub(crate) edges: BTreeMap<[usize; 2], usize>,
}

impl Topology {
    /// Merges the vertices of an OBJ file by position. Omits vertices without a face or a line, repeated faces, and faces with
    /// fewer than three distinct corners.
    ///
    /// # Errors
    /// A [`TextProblem`] with the place of a crack, or with the number of vertices if there are too many.
    pub(crate) fn of(obj: &Obj) -> Result<Self, TextProblem> {
        let (places_m, place_of) = joined(obj);
        if places_m.len() > MOST_PLACES {
            let problem = format!(
                "the mesh has {} different vertices, above the limit of {MOST_PLACES}; use a coarser mesh",
                places_m.len()
            );
            return Err(TextProblem::of_file(problem));
        }
        let mut topology = Self { places_m, ..Self::default() };
        let mut known = BTreeSet::new();
        for face in &obj.faces {
            let mut corners: Vec<usize> = face.iter().map(|&vertex| place_of[vertex]).collect();
            corners.dedup();
            if corners.len() > 1 && corners.first() == corners.last() {
                corners.pop();
            }
            let mut sorted = corners.clone();
            sorted.sort_unstable();
            if corners.len() >= 3 && known.insert(sorted) {
                topology.add_face(corners);
            }
        }
        for [a, b] in obj.segments.iter().map(|ends| ends.map(|vertex| place_of[vertex])) {
            if a != b {
                topology.edges.entry([a.min(b), a.max(b)]).or_default();
            }
        }
        match topology.crack_m() {
            Some(at_m) => Err(TextProblem::of_file(format!(
                "at {} a vertex of the border lies on an edge of the border that does not end there; merge the vertices \
                 there (\"merge by distance\"), split the edge at the vertex, or move them apart",
                in_mm(at_m)
            ))),
            None => Ok(topology),
        }
    }

    fn add_face(&mut self, corners: Vec<usize>) {
        for (index, &from) in corners.iter().enumerate() {
            let to = corners[(index + 1) % corners.len()];
            *self.edges.entry([from.min(to), from.max(to)]).or_default() += 1;
        }
        self.faces.push(corners);
    }

    /// Returns the vertices at the ends of all edges with a single face.
    #[must_use]
    pub(crate) fn border(&self) -> BTreeSet<usize> {
        self.border_edges().flatten().collect()
    }

    fn border_edges(&self) -> impl Iterator<Item = [usize; 2]> {
        self.edges.iter().filter(|(_, faces)| **faces == 1).map(|(ends, _)| *ends)
    }

    /// Returns the position, m, of one vertex in a connected part without any vertex of `held`; `None` if every part has a vertex
    /// of `held`.
    #[must_use]
    pub(crate) fn part_without(&self, held: &BTreeSet<usize>) -> Option<DVec3> {
        let mut neighbours = vec![Vec::new(); self.places_m.len()];
        for &[a, b] in self.edges.keys() {
            neighbours[a].push(b);
            neighbours[b].push(a);
        }
        let mut reached = vec![false; self.places_m.len()];
        held.iter().for_each(|&vertex| reached[vertex] = true);
        let mut next: Vec<usize> = held.iter().copied().collect();
        while let Some(vertex) = next.pop() {
            for &other in &neighbours[vertex] {
                if !std::mem::replace(&mut reached[other], true) {
                    next.push(other);
                }
            }
        }
        reached.iter().position(|reached| !reached).map(|vertex| self.places_m[vertex])
    }

    /// Returns the position of a vertex of the border that touches an edge of the border without being its end, m.
    fn crack_m(&self) -> Option<DVec3> {
        let axis = longest_axis(&self.places_m);
        let along = |vertex: usize| self.places_m[vertex][axis];
        let mut border: Vec<usize> = self.border().into_iter().collect();
        border.sort_by(|&a, &b| along(a).total_cmp(&along(b)));
        self.border_edges().find_map(|[a, b]| {
            let (from_m, to_m) = (self.places_m[a], self.places_m[b]);
            let near_m = CRACK * from_m.distance(to_m);
            let (low, high) = (along(a).min(along(b)) - near_m, along(a).max(along(b)) + near_m);
            let first = border.partition_point(|&vertex| along(vertex) < low);
            let candidates = border[first..].iter().take_while(|&&vertex| along(vertex) <= high);
            let mut others = candidates.filter(|&&vertex| vertex != a && vertex != b);
            let touching =
                others.find(|&&vertex| distance_to_segment_m(self.places_m[vertex], from_m, to_m) <= near_m);
            touching.map(|&vertex| self.places_m[vertex])
        })
    }
}

/// Formats a position, m, in millimetres.
pub(crate) fn in_mm(at_m: DVec3) -> String {
    let [x, y, z] = (at_m * 1.0e3).to_array();
    format!("({x:.3}, {y:.3}, {z:.3}) mm")
}

/// Returns the distinct positions of the vertices in use, sorted, and the index of each vertex's position.
fn joined(obj: &Obj) -> (Vec<DVec3>, Vec<usize>) {
    let used: BTreeSet<usize> =
        obj.faces.iter().flatten().chain(obj.segments.iter().flatten()).copied().collect();
    let mut order: Vec<usize> = used.into_iter().collect();
    order.sort_by(|&a, &b| by_position(obj.vertices_m[a], obj.vertices_m[b]));
    let largest_m =
        order.iter().map(|&vertex| obj.vertices_m[vertex].abs().max_element()).fold(0.0, f64::max);
    let near_m = SAME_PLACE * largest_m;

    // Cells as wide as the distance: near vertices lie in the same or in neighbouring cells.
    #[allow(clippy::cast_possible_truncation)] // at most a million cells from the origin
    let cell =
        |at_m: DVec3| (at_m / near_m.max(f64::MIN_POSITIVE)).floor().to_array().map(|index| index as i64);
    let mut places_in: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
    let mut places_m: Vec<DVec3> = Vec::new();
    let mut place_of = vec![0; obj.vertices_m.len()];
    for vertex in order {
        let at_m = obj.vertices_m[vertex] + DVec3::ZERO; // merges -0 and 0
        let [x, y, z] = cell(at_m);
        let cells = (0..27).map(|index| [x + index % 3 - 1, y + index / 3 % 3 - 1, z + index / 9 - 1]);
        let near = cells.filter_map(|cell| places_in.get(&cell)).flatten();
        let found = near.copied().find(|&place| places_m[place].distance(at_m) <= near_m);
        place_of[vertex] = found.unwrap_or_else(|| {
            places_m.push(at_m);
            places_in.entry([x, y, z]).or_default().push(places_m.len() - 1);
            places_m.len() - 1
        });
    }
    (places_m, place_of)
}

fn by_position(a: DVec3, b: DVec3) -> Ordering {
    let [a, b] = [a, b].map(|at| (at + DVec3::ZERO).to_array());
    a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])).then(a[2].total_cmp(&b[2]))
}

fn longest_axis(places_m: &[DVec3]) -> usize {
    let low = places_m.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = places_m.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let sides = high - low;
    (0..3).fold(0, |longest, axis| if sides[axis] > sides[longest] { axis } else { longest })
}

fn distance_to_segment_m(at_m: DVec3, from_m: DVec3, to_m: DVec3) -> f64 {
    let along = to_m - from_m;
    let share = ((at_m - from_m).dot(along) / along.length_squared()).clamp(0.0, 1.0);
    at_m.distance(from_m + along * share)
}
