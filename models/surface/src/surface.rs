//! Smooth surface: patches with their neighbours, in a tree.

use crate::closest::{Foot, closest_of_triangle};
use crate::normals::Normals;
use crate::parallel::fill;
use crate::patch::{Barycentric, Patch};
use crate::topology::{EdgeRef, Topology};
use crate::tree::{Tree, hilbert_order};
use crate::weld::Mesh;
use flotor_hal::DVec3;

/// Point on the surface: a patch, and the closest point of this patch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Place {
    /// Number of the patch.
    pub patch: usize,
    /// Closest point of the patch.
    pub foot: Foot,
}

/// Crossing of a segment with the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Number of the patch.
    pub patch: usize,
    /// Barycentric coordinates in the patch.
    pub at: Barycentric,
    /// Fraction of the segment before the crossing, 0 to 1.
    pub share: f64,
}

/// Sides of a patch that can be touched, and its group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Trait {
    /// Number of the group.
    pub group: u16,
    /// True for a patch of a closed body, touched from outside only.
    pub is_closed: bool,
}

/// Smooth surface of a mesh; about 260 bytes per triangle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    pub(crate) patches: Vec<Patch>,
    pub(crate) neighbours: Vec<[EdgeRef; 3]>,
    pub(crate) traits: Vec<Trait>,
    tree: Tree,
}

/// Maximum number of patches that a walk crosses.
const MOST_PATCHES: usize = 64;
/// Largest travel, relative to an edge, for which the last closest point is a better start than the closest point of the flat
/// triangle.
const NEAR: f64 = 0.05;
/// Maximum number of patches about a corner.
const MOST_FAN: usize = 4096;
/// Smallest relative decrease of the distance for which a neighbour counts as nearer.
const NEARER: f64 = 1.0e-14;
/// Tolerance of the barycentric coordinates beyond the sides, so that a segment through an edge crosses at least one of its two
/// patches.
const BETWEEN: f64 = 1.0e-7;

impl Surface {
    /// Builds the patches of a mesh in the order of the tree. Not real-time.
    #[must_use]
    #[allow(clippy::cast_possible_truncation)] // fewer than 2^32 faces
    pub fn new(mesh: &Mesh, topology: &Topology, normals: &Normals) -> Self {
        let count = mesh.triangles.len();
        let middles: Vec<DVec3> =
            (0..count).map(|t| mesh.corners_m(t).into_iter().sum::<DVec3>() / 3.0).collect();
        let order = hilbert_order(&middles);
        drop(middles);
        let mut new_number = vec![0_u32; count];
        order.iter().enumerate().for_each(|(new, old)| new_number[*old as usize] = new as u32);
        let mut patches = vec![Patch::flat([DVec3::ZERO; 3]); count];
        fill(&mut patches, |new| Patch::new(&normals.frame(mesh, topology, order[new] as usize)));
        let renumber = |edge: EdgeRef| match edge.get() {
            Some((t, e)) => EdgeRef::new(new_number[t] as usize, e),
            None => EdgeRef::NONE,
        };
        let neighbours = order.iter().map(|old| topology.neighbours[*old as usize].map(renumber)).collect();
        let traits = order
            .iter()
            .map(|old| Trait {
                group: mesh.groups[*old as usize],
                is_closed: topology.components[topology.component[*old as usize] as usize].is_closed,
            })
            .collect();
        Self::from_parts(patches, neighbours, traits)
    }

    pub(crate) fn from_parts(patches: Vec<Patch>, neighbours: Vec<[EdgeRef; 3]>, traits: Vec<Trait>) -> Self {
        let tree =
            Tree::new(patches.len(), |number| patches[number].disc(), |number| patches[number].bounds_m());
        Self { patches, neighbours, traits, tree }
    }

    /// Returns the number of patches.
    #[must_use]
    pub fn count(&self) -> usize {
        self.patches.len()
    }

    /// Returns true if a part of the surface is open.
    #[must_use]
    pub fn has_borders(&self) -> bool {
        self.traits.iter().any(|one| !one.is_closed)
    }

    /// Returns the patches.
    #[must_use]
    pub fn patches(&self) -> &[Patch] {
        &self.patches
    }

    /// Returns the patch over an edge with its edge; `None` on a border.
    #[must_use]
    pub fn neighbour(&self, patch: usize, edge: usize) -> Option<(usize, usize)> {
        self.neighbours[patch][edge].get()
    }

    /// Returns the lower and upper corner of the bounding box of all corners, m.
    #[must_use]
    pub fn box_m(&self) -> [DVec3; 2] {
        let corners = self.patches.iter().flat_map(|patch| patch.corners_m);
        corners.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| [low.min(p), high.max(p)])
    }

    /// Returns the memory of the surface, bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.count() * (size_of::<Patch>() + size_of::<[EdgeRef; 3]>() + size_of::<Trait>())
            + self.tree.bytes()
    }

    /// Returns true for a point on a closed body.
    #[inline]
    #[must_use]
    pub(crate) fn is_closed(&self, place: &Place) -> bool {
        self.traits[place.patch].is_closed
    }

    /// Returns the index of the group of a point.
    #[must_use]
    pub(crate) fn group(&self, place: &Place) -> u16 {
        self.traits[place.patch].group
    }

    /// Returns true for a point on the border of an open surface.
    pub(crate) fn is_border(&self, place: &Place) -> bool {
        !self.is_closed(place)
            && (0..3).any(|i| {
                place.foot.at[i] <= 0.0 && self.neighbours[place.patch][(i + 1) % 3] == EdgeRef::NONE
            })
    }

    /// Returns the point at barycentric coordinates of a patch.
    pub(crate) fn place(&self, patch: usize, at: Barycentric) -> Place {
        let jet = self.patches[patch].jet(at);
        let normal = self.patches[patch].normal(at);
        Place { patch, foot: Foot { at, point_m: jet.point_m, normal, distance_m: 0.0 } }
    }

    /// Finds the point nearest to `c_m` within `bound_m` that `is_wanted` accepts. Real-time: bounded, no allocation.
    #[must_use]
    pub fn nearest(&self, c_m: DVec3, bound_m: f64, is_wanted: impl Fn(&Place) -> bool) -> Option<Place> {
        self.nearest_besides(c_m, bound_m, |_| false, is_wanted)
    }

    /// Finds the nearest point as [`Self::nearest`], without the patches for which `is_known` returns true.
    pub(crate) fn nearest_besides(
        &self,
        c_m: DVec3,
        bound_m: f64,
        is_known: impl Fn(usize) -> bool,
        is_wanted: impl Fn(&Place) -> bool,
    ) -> Option<Place> {
        let mut best: Option<Place> = None;
        let mut bound_m = bound_m;
        self.tree.nearest(c_m, bound_m, |number| {
            if is_known(number) {
                return bound_m;
            }
            let patch = &self.patches[number];
            let (start, square) = closest_of_triangle(&patch.corners_m, c_m);
            // No point of the patch is farther from the triangle than its bulge.
            let reach_m = bound_m + f64::from(patch.bulge_m);
            if square > reach_m * reach_m {
                return bound_m;
            }
            let Some(foot) = patch.closest_within(c_m, start, bound_m) else { return bound_m };
            let place = Place { patch: number, foot };
            if is_wanted(&place) {
                bound_m = place.foot.distance_m;
                best = Some(place);
            }
            bound_m
        });
        best
    }

    /// Visits the patches with an index of at least `first` that may overlap a box.
    pub(crate) fn near_box(&self, [low_m, high_m]: [DVec3; 2], first: usize, visit: impl FnMut(usize)) {
        self.tree.along(low_m, high_m, first, visit);
    }

    /// Walks over neighbouring patches to a local closest point to `c_m`, starting at `patch`. Real-time: bounded, no allocation.
    #[must_use]
    pub fn walk(&self, c_m: DVec3, patch: usize) -> Place {
        let (patch, at) = self.flat_walk(c_m, patch);
        self.down_from(c_m, patch, at)
    }

    /// Follows the surface downhill to a local closest point to `c_m`, from a place. Real-time: bounded, no allocation.
    pub(crate) fn down_from(&self, c_m: DVec3, patch: usize, at: Barycentric) -> Place {
        let mut place = Place { patch, foot: self.patches[patch].closest(c_m, at) };
        for _ in 0..MOST_PATCHES {
            let Some(next) = self.step_on(c_m, &place) else { break };
            place = next;
        }
        place
    }

    /// Walks over neighbouring patches to a local closest point to `c_m`, starting at the closest point `from` of a position
    /// `travel_m` away. Real-time: bounded, no allocation.
    pub(crate) fn follow(&self, c_m: DVec3, from: &Place, travel_m: f64) -> Place {
        let [p, q, _] = self.patches[from.patch].corners_m;
        if travel_m < NEAR * p.distance(q) {
            self.down_from(c_m, from.patch, from.foot.at)
        } else {
            self.walk(c_m, from.patch)
        }
    }

    /// Walks over the flat triangles, ten times faster, and returns patch and coordinates as a start for the walk over the curved
    /// patches.
    fn flat_walk(&self, c_m: DVec3, patch: usize) -> (usize, Barycentric) {
        let nearest = |number: usize| closest_of_triangle(&self.patches[number].corners_m, c_m);
        let (mut number, (mut flat, mut square)) = (patch, nearest(patch));
        for _ in 0..MOST_PATCHES {
            let zeros = flat.map(|x| x <= 0.0);
            let mut best = (number, flat, square * (1.0 - 1.0e-9));
            let mut attempt = |other: usize| {
                let (at, found) = nearest(other);
                if found < best.2 {
                    best = (other, at, found);
                }
            };
            match zeros.iter().filter(|zero| **zero).count() {
                0 => break,
                1 => {
                    let apex = zeros.iter().position(|zero| *zero).unwrap_or(0);
                    let over = self.neighbours[number][(apex + 1) % 3].get();
                    over.iter().for_each(|(other, _)| attempt(*other));
                }
                _ => {
                    let corner = zeros.iter().position(|zero| !*zero).unwrap_or(0);
                    self.fan(number, corner, |other, _| attempt(other));
                }
            }
            if best.0 == number {
                break;
            }
            (number, flat, square) = best;
        }
        (number, flat)
    }

    /// Returns the closest point of a neighbour across the edge or the corner that a walk reached; `None` if it is not nearer.
    fn step_on(&self, c_m: DVec3, place: &Place) -> Option<Place> {
        let at = place.foot.at;
        let zeros = at.map(|x| x <= 0.0);
        match zeros.iter().filter(|zero| **zero).count() {
            0 => None,
            1 => {
                let apex = zeros.iter().position(|zero| *zero)?;
                self.over(c_m, place, (apex + 1) % 3)
            }
            _ => self.about(c_m, place, zeros.iter().position(|zero| !*zero)?),
        }
    }

    fn try_at(&self, c_m: DVec3, place: &Place, number: usize, at: Barycentric) -> Option<Place> {
        let foot = self.patches[number].closest(c_m, at);
        (foot.distance_m < place.foot.distance_m * (1.0 - NEARER)).then_some(Place { patch: number, foot })
    }

    fn over(&self, c_m: DVec3, place: &Place, edge: usize) -> Option<Place> {
        let (other, there) = self.neighbours[place.patch][edge].get()?;
        let mut at = [0.0; 3];
        at[there] = place.foot.at[(edge + 1) % 3];
        at[(there + 1) % 3] = place.foot.at[edge];
        self.try_at(c_m, place, other, at)
    }

    /// Continues a walk from a corner, in the two faces at the edge that points most directly towards `c_m`.
    fn about(&self, c_m: DVec3, place: &Place, corner: usize) -> Option<Place> {
        let to_m = c_m - place.foot.point_m;
        let mut best = (0.0, None);
        self.fan(place.patch, corner, |number, corner| {
            let patch = &self.patches[number];
            for (edge, way) in [(corner, patch.leaving(corner)), ((corner + 2) % 3, patch.arriving(corner))] {
                let steep = way.dot(to_m) / way.length();
                if steep > best.0 {
                    best = (steep, Some((number, corner, edge)));
                }
            }
        });
        let (number, corner, edge) = best.1?;
        let mut at = [0.0; 3];
        at[corner] = 1.0;
        let own = self.try_at(c_m, place, number, at);
        let over = self.neighbours[number][edge].get().and_then(|(other, there)| {
            let mut at = [0.0; 3];
            at[if edge == corner { (there + 1) % 3 } else { there }] = 1.0;
            self.try_at(c_m, place, other, at)
        });
        match (own, over) {
            (Some(own), Some(over)) if over.foot.distance_m < own.foot.distance_m => Some(over),
            (own, over) => own.or(over),
        }
    }

    /// Visits the patches about a corner of a patch, each with its index of this corner.
    fn fan(&self, patch: usize, corner: usize, mut visit: impl FnMut(usize, usize)) {
        visit(patch, corner);
        let mut at = (patch, corner);
        for _ in 0..MOST_FAN {
            match self.neighbours[at.0][(at.1 + 2) % 3].get() {
                Some(next) if next == (patch, corner) => return,
                Some(next) => at = next,
                None => break,
            }
            visit(at.0, at.1);
        }
        // At a border, visit the remaining patches in the other direction.
        let mut at = (patch, corner);
        for _ in 0..MOST_FAN {
            let Some((other, edge)) = self.neighbours[at.0][at.1].get() else { return };
            at = (other, (edge + 1) % 3);
            if at == (patch, corner) {
                return;
            }
            visit(at.0, at.1);
        }
    }

    /// Returns an outward direction at a point, also on an edge or at a corner; not normalised. Real-time: bounded, no
    /// allocation.
    #[must_use]
    pub fn outward(&self, place: &Place) -> DVec3 {
        let zeros = place.foot.at.map(|x| x <= 1.0e-9);
        let own = place.foot.normal;
        match zeros.iter().filter(|zero| **zero).count() {
            0 => own,
            1 => {
                let edge = (zeros.iter().position(|zero| *zero).unwrap_or(0) + 1) % 3;
                let Some((other, there)) = self.neighbours[place.patch][edge].get() else { return own };
                let mut at = [0.0; 3];
                at[there] = place.foot.at[(edge + 1) % 3];
                at[(there + 1) % 3] = 1.0 - at[there];
                own + self.patches[other].normal(at)
            }
            _ => {
                // Weighted by the angles of the faces (Baerentzen and Aanaes 2005, IEEE TVCG 11, 243-253).
                let mut sum = DVec3::ZERO;
                let corner = zeros.iter().position(|zero| !*zero).unwrap_or(0);
                self.fan(place.patch, corner, |number, corner| {
                    let patch = &self.patches[number];
                    let (a, b) = (patch.leaving(corner), patch.arriving(corner));
                    let angle_rad = flotor_hal::math::atan2(a.cross(b).length(), a.dot(b));
                    sum += a.cross(b).normalize_or_zero() * angle_rad;
                });
                sum
            }
        }
    }

    /// Finds the first crossing of a segment with the surface; closed bodies count only from outside. Real-time: bounded, no
    /// allocation.
    #[must_use]
    pub fn first_crossing(&self, from_m: DVec3, to_m: DVec3) -> Option<Crossing> {
        let mut first: Option<Crossing> = None;
        let way_m = to_m - from_m;
        self.tree.along(from_m, to_m, 0, |number| {
            let Some((at, share)) = self.patches[number].crossing(from_m, way_m) else { return };
            let is_entry = !self.traits[number].is_closed || self.patches[number].normal(at).dot(way_m) < 0.0;
            if is_entry && first.is_none_or(|first| share < first.share) {
                first = Some(Crossing { patch: number, at, share });
            }
        });
        first
    }
}

impl Patch {
    /// Returns the derivative of the edge that starts at a corner, m.
    pub(crate) fn leaving(&self, corner: usize) -> DVec3 {
        self.corner_tangent(corner, corner)
    }

    /// Returns the derivative of the edge that ends at a corner, in the reverse direction, m.
    pub(crate) fn arriving(&self, corner: usize) -> DVec3 {
        self.corner_tangent(corner, (corner + 2) % 3)
    }

    /// Finds the crossing of a segment with the patch, and the fraction of the segment before it (Newton's method, from the flat
    /// triangle).
    fn crossing(&self, from_m: DVec3, way_m: DVec3) -> Option<(Barycentric, f64)> {
        let [p, q, r] = self.corners_m;
        let inside = |at: &Barycentric, slack: f64| at.iter().all(|x| *x >= -slack);
        let (normal, bulge_m) = ((p - r).cross(q - r), f64::from(self.bulge_m));
        let height = (from_m - r).dot(normal);
        let (low, high) = (height.min(height + way_m.dot(normal)), height.max(height + way_m.dot(normal)));
        let reach = bulge_m * normal.length();
        if low > reach || high < -reach {
            return None;
        }
        // Solves columns (a, b, -way) for (x, y, share).
        let solve = |a: DVec3, b: DVec3, right: DVec3| {
            let normal = a.cross(b);
            let det = -way_m.dot(normal);
            (det != 0.0).then(|| {
                let share = right.dot(normal) / det;
                let side = -way_m;
                (right.dot(b.cross(side)) / det, a.dot(right.cross(side)) / det, share)
            })
        };
        let (x, y, share) = solve(p - r, q - r, from_m - r)?;
        let mut at = [x, y, 1.0 - x - y];
        let mut share = share;
        if self.is_flat() {
            return (inside(&at, BETWEEN) && (0.0..=1.0).contains(&share)).then_some((at, share));
        }
        // A crossing of a curved patch is near its flat triangle.
        if !inside(&at, 1.0) {
            return None;
        }
        let mut is_met = false;
        for _ in 0..12 {
            let jet = self.jet(at);
            let miss = from_m + way_m * share - jet.point_m;
            let [a, b] = jet.first;
            let (x, y, more) = solve(a, b, miss)?;
            at = [at[0] + x, at[1] + y, at[2] - x - y];
            share += more;
            if !at.iter().all(|x| x.abs() < 3.0) {
                return None;
            }
            is_met = x.abs() + y.abs() + more.abs() < 1.0e-10;
            if is_met {
                break;
            }
        }
        (is_met && inside(&at, BETWEEN) && (0.0..=1.0).contains(&share)).then_some((at, share))
    }
}
