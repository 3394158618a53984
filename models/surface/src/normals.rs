//! Normals at corners, sharp edges, and tangents of the curves between corners.
//!
//! Normals are weighted means of the normals of faces about a corner, with the weights of Max (1999, J. Graphics Tools 4(2),
//! 1-6), which are exact on a sphere and on a cylinder. Only faces between two sharp edges are averaged. A flat region much
//! larger than its curved neighbours has its own normal up to its border, so that planes stay planes; the strips of a cylinder
//! are as large as their neighbours.

use crate::patch::Frame;
use crate::topology::Topology;
use crate::weld::Mesh;
use flotor_hal::{DVec3, math};

/// Largest angle between two faces of one plane, rad: rounding error of binary32 on faces of a thousandth of the object.
const FLAT_RAD: f64 = 2.0e-5;
/// Smallest ratio of the area of a plane to that of a curved neighbour for which the plane is a flat region.
const FLAT_AREA: f64 = 6.0;
/// Sine of the angle between two normals below which the direction of their intersection is not used.
const CREASE: f64 = 0.1;
/// Cosine of the angle between curve and chord below which the edge stays straight.
const STEEP: f64 = 0.5;
/// Displacement below which a curve is straight, relative to its chord.
const STRAIGHT: f64 = 1.0e-9;

/// Normals and sharp edges of a mesh.
#[derive(Clone, Debug)]
pub struct Normals {
    /// Unit normal of each face at each of its corners.
    pub corners: Vec<[DVec3; 3]>,
    /// True for each edge of each face that is sharp.
    pub sharp: Vec<[bool; 3]>,
}

fn face_normals(mesh: &Mesh) -> Vec<DVec3> {
    (0..mesh.triangles.len())
        .map(|t| {
            let [p, q, r] = mesh.corners_m(t);
            (q - p).cross(r - p).normalize_or_zero()
        })
        .collect()
}

/// Returns the angle between two unit vectors, rad, accurate for small angles.
fn angle_rad(a: DVec3, b: DVec3) -> f64 {
    math::atan2(a.cross(b).length(), a.dot(b))
}

/// Returns the representative of a set (union-find with path halving).
fn root(parent: &mut [u32], mut i: u32) -> u32 {
    while parent[i as usize] != i {
        parent[i as usize] = parent[parent[i as usize] as usize];
        i = parent[i as usize];
    }
    i
}

/// Returns for each face the number of its plane; `None` unless the plane has several faces and is much larger than the adjacent
/// faces.
#[allow(clippy::cast_possible_truncation)] // fewer than 2^32 faces
fn flat_regions(mesh: &Mesh, topology: &Topology, faces: &[DVec3], sharp: &[[bool; 3]]) -> Vec<Option<u32>> {
    let count = faces.len();
    let mut parent: Vec<u32> = (0..count as u32).collect();
    let smooth = |t: usize| {
        let edges = (0..3).filter(move |e| !sharp[t][*e]);
        edges.filter_map(move |e| topology.neighbours[t][e].get().map(|(other, _)| other))
    };
    for t in 0..count {
        for other in smooth(t).filter(|other| *other > t) {
            if faces[t].dot(faces[other]) > 0.0 && faces[t].cross(faces[other]).length() <= FLAT_RAD {
                let (a, b) = (root(&mut parent, t as u32), root(&mut parent, other as u32));
                parent[a.max(b) as usize] = a.min(b);
            }
        }
    }
    let (mut sizes, mut areas) = (vec![0_u32; count], vec![0.0_f64; count]);
    for t in 0..count {
        let plane = root(&mut parent, t as u32) as usize;
        let [p, q, r] = mesh.corners_m(t);
        sizes[plane] += 1;
        areas[plane] += (q - p).cross(r - p).length();
    }
    (0..count)
        .map(|t| {
            let plane = root(&mut parent, t as u32);
            let mut largest = 0.0_f64;
            for other in smooth(t) {
                let theirs = root(&mut parent, other as u32);
                if theirs != plane {
                    largest = largest.max(areas[theirs as usize]);
                }
            }
            let is_flat =
                sizes[plane as usize] > 1 && largest > 0.0 && areas[plane as usize] >= FLAT_AREA * largest;
            is_flat.then_some(plane)
        })
        .collect()
}

impl Normals {
    /// Computes sharp edges (angle above `edge_angle_rad`) and normals. Not real-time.
    #[must_use]
    pub fn new(mesh: &Mesh, topology: &Topology, edge_angle_rad: f64) -> Self {
        let faces = face_normals(mesh);
        let cosine = math::cos(edge_angle_rad);
        let sharp: Vec<[bool; 3]> = (0..faces.len())
            .map(|t| {
                topology.neighbours[t].map(|edge| {
                    edge.get().is_some_and(|(other, _)| {
                        // Near the limit the cosine is inaccurate: compare the angle.
                        faces[t].dot(faces[other]) < cosine + 1.0e-6
                            && angle_rad(faces[t], faces[other]) > edge_angle_rad
                    })
                })
            })
            .collect();
        let flat = flat_regions(mesh, topology, &faces, &sharp);
        let mut normals = Self { corners: vec![[DVec3::ZERO; 3]; faces.len()], sharp };
        let mut sector = Vec::new();
        for t in 0..faces.len() {
            for corner in 0..3 {
                if normals.corners[t][corner] == DVec3::ZERO {
                    normals.gather(topology, t, corner, &mut sector);
                    let normal = mean(mesh, &faces, &flat, &sector);
                    sector.iter().for_each(|(t, corner)| normals.corners[*t][*corner] = normal);
                }
            }
        }
        normals
    }

    /// Collects the faces about a corner up to the next sharp edges; each face with the index of this corner.
    fn gather(&self, topology: &Topology, t: usize, corner: usize, sector: &mut Vec<(usize, usize)>) {
        let over = |t: usize, edge: usize| match self.sharp[t][edge] {
            true => None,
            false => topology.neighbours[t][edge].get(),
        };
        let mut start = (t, corner);
        // Go back over the edges that start at the corner, to the first face of the sector.
        while let Some((other, edge)) = over(start.0, start.1) {
            start = (other, (edge + 1) % 3);
            if start == (t, corner) {
                break;
            }
        }
        sector.clear();
        let mut at = start;
        loop {
            sector.push(at);
            let Some((other, edge)) = over(at.0, (at.1 + 2) % 3) else { break };
            at = (other, edge);
            if at == start {
                break;
            }
        }
    }
}

/// Returns the normal of a sector.
fn mean(mesh: &Mesh, faces: &[DVec3], flat: &[Option<u32>], sector: &[(usize, usize)]) -> DVec3 {
    let mut planes = sector.iter().filter_map(|(t, _)| flat[*t].map(|plane| (plane, *t)));
    if let Some((plane, t)) = planes.next()
        && planes.all(|(other, _)| other == plane)
    {
        return faces[t];
    }
    let weighted: DVec3 = sector
        .iter()
        .map(|(t, corner)| {
            let p = mesh.corners_m(*t);
            let (a, b) = (p[(corner + 1) % 3] - p[*corner], p[(corner + 2) % 3] - p[*corner]);
            let squares = a.length_squared() * b.length_squared();
            if squares > 0.0 { a.cross(b) / squares } else { DVec3::ZERO }
        })
        .sum();
    weighted.try_normalize().unwrap_or(faces[sector[0].0])
}

/// Returns the derivatives at both ends of the curve of an edge, the same for both of its faces.
fn tangents_m(mesh: &Mesh, topology: &Topology, normals: &Normals, t: usize, edge: usize) -> [DVec3; 2] {
    let next = (edge + 1) % 3;
    let p = mesh.corners_m(t);
    let chord_m = p[next] - p[edge];
    let length_m = chord_m.length();
    let own = [normals.corners[t][edge], normals.corners[t][next]];
    // The neighbour has the edge in the opposite direction.
    let other = match topology.neighbours[t][edge].get() {
        Some((t, edge)) if normals.sharp[t][edge] => {
            [normals.corners[t][(edge + 1) % 3], normals.corners[t][edge]]
        }
        _ => own,
    };
    [0, 1].map(|end| {
        let line = own[end].cross(other[end]);
        let direction = if line.length() > CREASE {
            line.normalize() * line.dot(chord_m).signum()
        } else {
            let normal = (own[end] + other[end]).normalize_or_zero();
            (chord_m - normal * normal.dot(chord_m)).normalize_or_zero()
        };
        let cosine = direction.dot(chord_m) / length_m;
        if cosine < STEEP {
            return chord_m;
        }
        // The derivative of the cubic that meets a circle at its middle.
        let tangent = direction * (2.0 * length_m / (1.0 + cosine));
        if (tangent - chord_m).length() <= STRAIGHT * length_m { chord_m } else { tangent }
    })
}

impl Normals {
    /// Returns the frame of the patch over a face. Not real-time.
    #[must_use]
    pub fn frame(&self, mesh: &Mesh, topology: &Topology, t: usize) -> Frame {
        Frame {
            corners_m: mesh.corners_m(t),
            normals: self.corners[t],
            tangents_m: [0, 1, 2].map(|edge| tangents_m(mesh, topology, self, t, edge)),
        }
    }
}
