//! Connectivity of a mesh: neighbours, orientation and closed bodies.

use crate::weld::{Mesh, Numbers, mix};
use flotor_hal::{DVec3, math};
use std::collections::BTreeMap;

/// Reference to an edge of a triangle, or to none: three times the triangle plus the edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub struct EdgeRef(u32);

impl EdgeRef {
    /// No neighbour: the edge is on a border.
    pub const NONE: Self = Self(u32::MAX);

    /// Builds the reference to edge `edge` of `triangle`.
    #[must_use]
    #[allow(clippy::cast_possible_truncation)] // fewer than 2^32 edges
    pub fn new(triangle: usize, edge: usize) -> Self {
        Self((3 * triangle + edge) as u32)
    }

    /// Returns the code for [`Self::from_code`].
    pub(crate) fn code(self) -> u32 {
        self.0
    }

    /// Builds the reference with a code.
    pub(crate) fn from_code(code: u32) -> Self {
        Self(code)
    }

    /// Returns triangle and edge; `None` on a border.
    #[inline]
    #[must_use]
    pub fn get(self) -> Option<(usize, usize)> {
        (self != Self::NONE).then_some((self.0 as usize / 3, self.0 as usize % 3))
    }
}

/// Connected part of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Component {
    /// True if the part encloses a body.
    pub is_closed: bool,
    /// Enclosed signed volume, m³.
    pub volume_m3: f64,
    /// Position of a corner of the part, m.
    pub place_m: DVec3,
}

/// Neighbours of each triangle, and its component.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Topology {
    /// Neighbour over each edge.
    pub neighbours: Vec<[EdgeRef; 3]>,
    /// Component of each triangle.
    pub component: Vec<u32>,
    /// Components.
    pub components: Vec<Component>,
    /// Number of edges with three or more faces.
    pub crowded_edges: usize,
    /// Number of triangles with reversed orientation.
    pub turned: usize,
}

/// Error: mesh without a consistent orientation, with the midpoint of an edge where orientations conflict, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OneSided(pub DVec3);

/// Angle between two faces below which the faces coincide, rad.
const FOLDED_RAD: f64 = 1.0e-6;

/// Pairs the faces at each edge; at an edge with more than two faces, the faces of the same body. Returns the neighbours and the
/// number of edges with more than two faces.
#[allow(clippy::cast_possible_truncation)] // fewer than 2^32 edges
fn pair_edges(mesh: &Mesh) -> (Vec<[EdgeRef; 3]>, usize) {
    let triangles = &mesh.triangles;
    let mut neighbours = vec![[EdgeRef::NONE; 3]; triangles.len()];
    let place = |number: u32| (number as usize / 3, number as usize % 3);
    let ends = |number: u32| {
        let (t, e) = place(number);
        let (a, b) = (triangles[t][e], triangles[t][(e + 1) % 3]);
        (a.min(b), a.max(b))
    };
    let join = |neighbours: &mut Vec<[EdgeRef; 3]>, one: u32, other: u32| {
        let (a, b) = (place(one), place(other));
        neighbours[a.0][a.1] = EdgeRef::new(b.0, b.1);
        neighbours[b.0][b.1] = EdgeRef::new(a.0, a.1);
    };
    let mut numbers = Numbers::new(3 * triangles.len() / 2 + 16);
    let mut crowded: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for number in 0..3 * triangles.len() as u32 {
        let key = ends(number);
        let hash = mix(&[u64::from(key.0) << 32 | u64::from(key.1)]);
        let first = numbers.find_or_insert(hash, number, |other| ends(other) == key);
        if first == number {
            continue;
        }
        let (t, e) = place(first);
        if let Some(all) = crowded.get_mut(&first) {
            all.push(number);
        } else if let Some((other, edge)) = neighbours[t][e].get() {
            (neighbours[t][e], neighbours[other][edge]) = (EdgeRef::NONE, EdgeRef::NONE);
            crowded.insert(first, vec![first, (3 * other + edge) as u32, number]);
        } else {
            join(&mut neighbours, first, number);
        }
    }
    for all in crowded.values() {
        for (one, other) in bodies_about(mesh, all) {
            join(&mut neighbours, one, other);
        }
    }
    (neighbours, crowded.len())
}

/// Pairs the faces about an edge with more than two faces: faces with a body between them, the smallest angles first.
fn bodies_about(mesh: &Mesh, all: &[u32]) -> Vec<(u32, u32)> {
    // Direction of each face away from the edge, and true if the face has the edge in its direction.
    let corners = |number: u32| {
        let (p, e) = (mesh.corners_m(number as usize / 3), number as usize % 3);
        (p[e], p[(e + 1) % 3], p[(e + 2) % 3])
    };
    let (from, to, _) = corners(all[0]);
    let along = (to - from).normalize_or_zero();
    let faces = all.iter().map(|&number| {
        let (start, end, apex) = corners(number);
        let away = apex - start;
        (number, (end - start).dot(along) > 0.0, (away - along * away.dot(along)).normalize_or_zero())
    });
    let faces: Vec<(u32, bool, DVec3)> = faces.collect();
    let mut pairs: Vec<(f64, u32, u32)> = Vec::new();
    for (one, _, d) in faces.iter().filter(|face| face.1) {
        for (other, _, e) in faces.iter().filter(|face| !face.1) {
            // The body lies clockwise of a face in the direction of the edge; coincident faces enclose no body.
            let angle_rad = math::atan2(e.cross(*d).dot(along), e.dot(*d));
            let angle_rad =
                if angle_rad < FOLDED_RAD { angle_rad + std::f64::consts::TAU } else { angle_rad };
            pairs.push((angle_rad, *one, *other));
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut chosen: Vec<(u32, u32)> = Vec::new();
    for (_, one, other) in pairs {
        if !chosen.iter().any(|pair| pair.0 == one || pair.1 == other) {
            chosen.push((one, other));
        }
    }
    chosen
}

/// Finds neighbours and makes the orientation consistent, outward for closed bodies; a body inside another one (a cavity) keeps
/// the orientation of the file. Not real-time.
///
/// # Errors
/// [`OneSided`] for a surface like a Moebius strip.
#[allow(clippy::cast_possible_truncation)] // fewer than 2^32 faces
pub fn connect(mesh: &mut Mesh) -> Result<Topology, OneSided> {
    let (neighbours, crowded_edges) = pair_edges(mesh);
    let count = mesh.triangles.len();
    let mut topology =
        Topology { neighbours, component: vec![u32::MAX; count], crowded_edges, ..Topology::default() };
    let mut is_turned = vec![false; count];
    let mut members: Vec<Vec<u32>> = Vec::new();
    for seed in 0..count {
        if topology.component[seed] != u32::MAX {
            continue;
        }
        let number = members.len() as u32;
        topology.component[seed] = number;
        let mut found = vec![seed as u32];
        let mut next = 0;
        while next < found.len() {
            let t = found[next] as usize;
            next += 1;
            for e in 0..3 {
                let Some((other, edge)) = topology.neighbours[t][e].get() else { continue };
                // Faces of equal orientation have their common edge in opposite directions.
                let same_way = mesh.triangles[t][e] == mesh.triangles[other][edge];
                let turned = is_turned[t] != same_way;
                if topology.component[other] == u32::MAX {
                    topology.component[other] = number;
                    is_turned[other] = turned;
                    found.push(other as u32);
                } else if is_turned[other] != turned {
                    let [p, q, _] = mesh.corners_m(t);
                    return Err(OneSided((p + q) * 0.5));
                }
            }
        }
        members.push(found);
    }
    topology.finish(mesh, &is_turned, &members);
    Ok(topology)
}

impl Topology {
    fn finish(&mut self, mesh: &mut Mesh, is_turned: &[bool], members: &[Vec<u32>]) {
        let mut turned: Vec<bool> = is_turned.to_vec();
        for found in members {
            // Keep the orientation of the majority of the faces.
            let count = found.iter().filter(|t| is_turned[**t as usize]).count();
            let mostly = 2 * count > found.len();
            let is_closed = self.is_closed(mesh, found);
            let place_m = mesh.corners_m(found[0] as usize)[0];
            let sign = |t: &u32| if is_turned[*t as usize] == mostly { 1.0 } else { -1.0 };
            let six: f64 = found
                .iter()
                .map(|t| {
                    let [p, q, r] = mesh.corners_m(*t as usize).map(|corner| corner - place_m);
                    sign(t) * p.dot(q.cross(r))
                })
                .sum();
            found.iter().for_each(|t| turned[*t as usize] = is_turned[*t as usize] != mostly);
            self.components.push(Component { is_closed, volume_m3: six / 6.0, place_m });
        }
        for (number, found) in members.iter().enumerate() {
            let component = self.components[number];
            if component.is_closed
                && component.volume_m3 < 0.0
                && !self.is_inside_another(mesh, members, number)
            {
                self.components[number].volume_m3 = -component.volume_m3;
                found.iter().for_each(|t| turned[*t as usize] = !turned[*t as usize]);
            }
        }
        self.turn(mesh, &turned);
    }

    /// Reverses the orientation of triangles; edge 0 stays, the other two swap.
    fn turn(&mut self, mesh: &mut Mesh, turned: &[bool]) {
        self.turned = turned.iter().filter(|t| **t).count();
        if self.turned == 0 {
            return;
        }
        let place = |t: usize, e: usize| if turned[t] { [0, 2, 1][e] } else { e };
        let old = std::mem::take(&mut self.neighbours);
        self.neighbours = (0..old.len())
            .map(|t| {
                let mut new = [EdgeRef::NONE; 3];
                for e in 0..3 {
                    new[place(t, e)] = match old[t][e].get() {
                        Some((other, edge)) => EdgeRef::new(other, place(other, edge)),
                        None => EdgeRef::NONE,
                    };
                }
                new
            })
            .collect();
        for (t, triangle) in mesh.triangles.iter_mut().enumerate().filter(|(t, _)| turned[*t]) {
            let _ = t;
            triangle.swap(0, 1);
        }
    }

    /// Returns true if each edge of these faces has equally many faces in both directions.
    fn is_closed(&self, mesh: &Mesh, found: &[u32]) -> bool {
        let open: Vec<(u32, u32)> = found
            .iter()
            .flat_map(|t| (0..3).map(move |e| (*t as usize, e)))
            .filter(|(t, e)| self.neighbours[*t][*e] == EdgeRef::NONE)
            .map(|(t, e)| (mesh.triangles[t][e], mesh.triangles[t][(e + 1) % 3]))
            .collect();
        if open.is_empty() {
            return true;
        }
        let mut edges: Vec<(u32, u32)> = open.iter().map(|(a, b)| (*a.min(b), *a.max(b))).collect();
        edges.sort_unstable();
        edges.chunk_by(|a, b| a == b).all(|chunk| chunk.len() % 2 == 0)
    }

    /// Returns true if a component lies inside another closed one: an upward ray crosses the other one an odd number of times.
    fn is_inside_another(&self, mesh: &Mesh, members: &[Vec<u32>], number: usize) -> bool {
        let from = self.components[number].place_m;
        (0..members.len()).filter(|&other| other != number && self.components[other].is_closed).any(|other| {
            let crossings =
                members[other].iter().filter(|t| is_above(mesh.corners_m(**t as usize), from)).count();
            crossings % 2 == 1
        })
    }
}

/// Returns true if a vertical ray from `from` upwards meets a triangle. A ray through an edge counts for one of the two triangles:
/// it is moved by infinitesimal distances, more along x than along y (Edelsbrunner and Muecke 1990, ACM Trans. Graphics 9, 66-104).
fn is_above([p, q, r]: [DVec3; 3], from: DVec3) -> bool {
    let side = |a: DVec3, b: DVec3| (b.x - a.x) * (from.y - a.y) - (b.y - a.y) * (from.x - a.x);
    // Both triangles of an edge compute one number with opposite signs.
    let edge = |a: DVec3, b: DVec3| if (a.x, a.y) <= (b.x, b.y) { side(a, b) } else { -side(b, a) };
    let is_left = |a: DVec3, b: DVec3, u: f64| match u == 0.0 {
        true if a.y == b.y => b.x > a.x,
        true => b.y < a.y,
        false => u > 0.0,
    };
    let (u, v, w) = (edge(q, r), edge(r, p), edge(p, q));
    let area = u + v + w;
    let sides = [is_left(q, r, u), is_left(r, p, v), is_left(p, q, w)];
    if area == 0.0 || sides.iter().any(|left| *left != sides[0]) {
        return false;
    }
    (u * p.z + v * q.z + w * r.z) / area > from.z
}
