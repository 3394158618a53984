//! Conversion of a triangle soup to an indexed mesh: merges equal points, removes degenerate faces, closes gaps of rounding.

use crate::soup::Soup;
use flotor_hal::DVec3;
use std::collections::BTreeMap;

/// Distance below which two points of open borders are merged, relative to the diagonal of the bounding box.
const GAP: f64 = 1.0e-6;
/// Height below which a triangle is degenerate, relative to the diagonal of the bounding box: rounding error of binary32.
const SLIVER: f64 = 1.0e-9;
/// Length of the shortest edge with a direction accurate to a thousandth, relative to the rounding error of a coordinate.
const RESOLVED: f64 = 1000.0;
/// Maximum number of passes over slivers: each pass removes one of a chain.
const MOST_PASSES: usize = 16;

/// Indexed triangles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Points, m.
    pub points_m: Vec<DVec3>,
    /// Corners of each triangle, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Group of each triangle.
    pub groups: Vec<u16>,
}

/// Numbers of changed faces and points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Welded {
    /// Faces removed because two corners are one point.
    pub collapsed: usize,
    /// Faces without area removed by a flip of their longest edge.
    pub flipped: usize,
    /// Duplicate faces of equal orientation that were removed.
    pub doubled: usize,
    /// Points of borders merged over gaps of rounding.
    pub closed: usize,
    /// Points merged because their edge is too short for a reliable direction in binary32.
    pub unresolved: usize,
}

/// Hash table from keys to indices, with open addressing: five times faster than the standard library's map on a million points.
pub(crate) struct Numbers {
    slots: Vec<u32>,
    mask: usize,
}

impl Numbers {
    const NONE: u32 = u32::MAX;

    pub(crate) fn new(count: usize) -> Self {
        let size = (2 * count).next_power_of_two().max(16);
        Self { slots: vec![Self::NONE; size], mask: size - 1 }
    }

    /// Returns the number stored for a key; `is_same` compares with the key of a number. Stores `next` for a new key.
    pub(crate) fn find_or_insert(&mut self, hash: u64, next: u32, is_same: impl Fn(u32) -> bool) -> u32 {
        #[allow(clippy::cast_possible_truncation)] // masked
        let mut slot = (hash >> 20) as usize & self.mask;
        loop {
            let number = self.slots[slot];
            if number == Self::NONE {
                self.slots[slot] = next;
                return next;
            }
            if is_same(number) {
                return number;
            }
            slot = (slot + 1) & self.mask;
        }
    }
}

/// Mixes words into a hash.
pub(crate) fn mix(words: &[u64]) -> u64 {
    words.iter().fold(0x9e37_79b9_7f4a_7c15, |hash: u64, word| {
        let mixed = (hash ^ word).wrapping_mul(0xff51_afd7_ed55_8ccd);
        mixed ^ (mixed >> 32)
    })
}

/// Returns the diagonal of the bounding box of points, m.
pub(crate) fn diagonal_m(points_m: &[DVec3]) -> f64 {
    let bounds = points_m.iter().fold(None, |bounds: Option<(DVec3, DVec3)>, p| {
        Some(bounds.map_or((*p, *p), |(low, high)| (low.min(*p), high.max(*p))))
    });
    bounds.map_or(0.0, |(low, high)| (high - low).length())
}

/// Merges equal points of a soup, scaled by `metres`, and removes degenerate faces. Not real-time.
#[must_use]
#[allow(clippy::cast_possible_truncation)] // a soup has fewer than 2^32 points
pub fn weld(soup: Soup, metres: f64) -> (Mesh, Welded) {
    let rounding_m = rounding(&soup.points) * metres;
    let mut points_m: Vec<DVec3> = Vec::with_capacity(soup.points.len() / 2);
    let mut numbers = Numbers::new(soup.points.len());
    let mut new_number = Vec::with_capacity(soup.points.len());
    for point in &soup.points {
        // Adding zero turns -0.0 into 0.0.
        let p = DVec3::from_array(*point) * metres + DVec3::ZERO;
        let hash = mix(&p.to_array().map(f64::to_bits));
        let next = points_m.len() as u32;
        let number = numbers.find_or_insert(hash, next, |other| points_m[other as usize] == p);
        if number == next {
            points_m.push(p);
        }
        new_number.push(number);
    }
    drop(numbers);
    let mut welded = Welded::default();
    let mut mesh = Mesh { points_m, ..Mesh::default() };
    mesh.triangles = soup.triangles.iter().map(|t| t.map(|c| new_number[c as usize])).collect();
    mesh.groups = soup.groups;
    mesh.groups.resize(mesh.triangles.len(), 0);
    drop((soup.points, soup.triangles, new_number));
    welded.collapsed += mesh.remove_collapsed();
    welded.doubled += mesh.remove_doubled();
    welded.closed = mesh.close_gaps();
    welded.collapsed += mesh.remove_collapsed();
    welded.unresolved = mesh.merge_unresolved(RESOLVED * rounding_m);
    welded.flipped = mesh.flip_slivers();
    mesh.drop_unused();
    (mesh, welded)
}

/// Returns the rounding error of the coordinates if all are binary32 numbers; zero for more precise coordinates.
#[allow(clippy::cast_possible_truncation)] // the question
fn rounding(points: &[[f64; 3]]) -> f64 {
    let largest = points.as_flattened().iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let are_rounded = points.as_flattened().iter().all(|x| f64::from(*x as f32) == *x);
    if are_rounded { largest * f64::from(f32::EPSILON) * 0.5 } else { 0.0 }
}

fn is_collapsed(t: &[u32; 3]) -> bool {
    t[0] == t[1] || t[1] == t[2] || t[2] == t[0]
}

impl Mesh {
    /// Returns the corners of a triangle, m.
    #[must_use]
    pub fn corners_m(&self, triangle: usize) -> [DVec3; 3] {
        self.triangles[triangle].map(|corner| self.points_m[corner as usize])
    }

    fn retain(&mut self, keep: impl Fn(usize, &[u32; 3]) -> bool) -> usize {
        let before = self.triangles.len();
        let mut kept = 0;
        for i in 0..before {
            if keep(i, &self.triangles[i]) {
                self.triangles[kept] = self.triangles[i];
                self.groups[kept] = self.groups[i];
                kept += 1;
            }
        }
        self.triangles.truncate(kept);
        self.groups.truncate(kept);
        before - kept
    }

    fn remove_collapsed(&mut self) -> usize {
        self.retain(|_, t| !is_collapsed(t))
    }

    /// Removes faces with the same corners and orientation as an earlier face.
    #[allow(clippy::cast_possible_truncation)] // fewer than 2^32 faces
    fn remove_doubled(&mut self) -> usize {
        let turned = |t: [u32; 3]| {
            let least = (0..3).min_by_key(|&i| t[i]).unwrap_or(0);
            [t[least], t[(least + 1) % 3], t[(least + 2) % 3]]
        };
        let mut numbers = Numbers::new(self.triangles.len());
        let is_first: Vec<bool> = (0..self.triangles.len())
            .map(|i| {
                let key = turned(self.triangles[i]);
                let hash = mix(&key.map(u64::from));
                let same = |other: u32| turned(self.triangles[other as usize]) == key;
                numbers.find_or_insert(hash, i as u32, same) == i as u32
            })
            .collect();
        self.retain(|i, _| is_first[i])
    }

    /// Returns the points of the borders: ends of edges with a single face.
    fn border(&self) -> Vec<u32> {
        let mut edges = Vec::with_capacity(3 * self.triangles.len());
        for t in &self.triangles {
            for i in 0..3 {
                let (a, b) = (t[i], t[(i + 1) % 3]);
                edges.push((a.min(b), a.max(b)));
            }
        }
        edges.sort_unstable();
        let mut ends: Vec<u32> = edges
            .chunk_by(|a, b| a == b)
            .filter(|chunk| chunk.len() == 1)
            .flat_map(|chunk| [chunk[0].0, chunk[0].1])
            .collect();
        ends.sort_unstable();
        ends.dedup();
        ends
    }

    /// Merges border points that are closer to each other than [`GAP`].
    fn close_gaps(&mut self) -> usize {
        let ends = self.border();
        let gap_m = GAP * diagonal_m(&self.points_m);
        if ends.is_empty() || gap_m == 0.0 {
            return 0;
        }
        #[allow(clippy::cast_possible_truncation)] // a million cells along an axis
        let cell = |p: DVec3| (p / (2.0 * gap_m)).floor().to_array().map(|x| x as i64);
        let mut cells: BTreeMap<[i64; 3], Vec<u32>> = BTreeMap::new();
        let mut merged: BTreeMap<u32, u32> = BTreeMap::new();
        for end in ends {
            let p = self.points_m[end as usize];
            let [x, y, z] = cell(p);
            let near = (-1..=1).flat_map(|i| (-1..=1).flat_map(move |j| (-1..=1).map(move |k| [i, j, k])));
            let other = near
                .filter_map(|[i, j, k]| cells.get(&[x.wrapping_add(i), y.wrapping_add(j), z.wrapping_add(k)]))
                .flatten()
                .find(|other| self.points_m[**other as usize].distance(p) <= gap_m)
                .copied();
            match other {
                Some(other) => drop(merged.insert(end, other)),
                None => cells.entry([x, y, z]).or_default().push(end),
            }
        }
        if !merged.is_empty() {
            for t in &mut self.triangles {
                *t = t.map(|corner| merged.get(&corner).copied().unwrap_or(corner));
            }
        }
        merged.len()
    }

    /// Merges the ends of edges shorter than `least_m`, and removes faces that become coincident. Returns the number of merged
    /// points.
    fn merge_unresolved(&mut self, least_m: f64) -> usize {
        let mut merged = 0;
        for _ in 0..MOST_PASSES {
            let mut target: BTreeMap<u32, u32> = BTreeMap::new();
            let mut is_taken = vec![false; self.points_m.len()];
            for t in &self.triangles {
                for i in 0..3 {
                    let (a, b) = (t[i].min(t[(i + 1) % 3]), t[i].max(t[(i + 1) % 3]));
                    let is_short = self.points_m[a as usize].distance_squared(self.points_m[b as usize])
                        < least_m * least_m;
                    if is_short && !is_taken[a as usize] && !is_taken[b as usize] {
                        (is_taken[a as usize], is_taken[b as usize]) = (true, true);
                        target.insert(b, a);
                    }
                }
            }
            if target.is_empty() {
                break;
            }
            merged += target.len();
            for corner in self.triangles.as_flattened_mut() {
                *corner = target.get(corner).copied().unwrap_or(*corner);
            }
            self.remove_collapsed();
            self.remove_folded(&is_taken);
        }
        merged
    }

    /// Removes pairs of coincident faces of opposite orientation at the points marked in `at`.
    #[allow(clippy::cast_possible_truncation)] // fewer than 2^32 faces
    fn remove_folded(&mut self, at: &[bool]) {
        let sorted = |mut t: [u32; 3]| {
            t.sort_unstable();
            t
        };
        let mut numbers = Numbers::new(self.triangles.len());
        let mut is_folded = vec![false; self.triangles.len()];
        for i in 0..self.triangles.len() {
            let key = sorted(self.triangles[i]);
            if !key.iter().any(|corner| at[*corner as usize]) {
                continue;
            }
            let same = |other: u32| sorted(self.triangles[other as usize]) == key;
            let first = numbers.find_or_insert(mix(&key.map(u64::from)), i as u32, same) as usize;
            if first != i && !is_folded[first] {
                (is_folded[first], is_folded[i]) = (true, true);
            }
        }
        self.retain(|i, _| !is_folded[i]);
    }

    /// Removes degenerate triangles: splits the neighbour over the longest edge at the middle corner.
    #[allow(clippy::cast_possible_truncation)] // fewer than 2^32 faces
    fn flip_slivers(&mut self) -> usize {
        let least_m = SLIVER * diagonal_m(&self.points_m);
        let mut flipped = 0;
        for _ in 0..MOST_PASSES {
            let longest = |mesh: &Self, i: usize| {
                let [p, q, r] = mesh.corners_m(i);
                let lengths = [(q - p).length(), (r - q).length(), (p - r).length()];
                let edge = (0..3).fold(0, |best, i| if lengths[i] > lengths[best] { i } else { best });
                let height_m = (q - p).cross(r - p).length() / lengths[edge].max(f64::MIN_POSITIVE);
                (height_m <= least_m).then_some(edge)
            };
            let slivers: Vec<(usize, usize)> =
                (0..self.triangles.len()).filter_map(|i| longest(self, i).map(|edge| (i, edge))).collect();
            if slivers.is_empty() {
                break;
            }
            let wanted: BTreeMap<(u32, u32), usize> = slivers
                .iter()
                .map(|&(i, edge)| {
                    let (a, b) = (self.triangles[i][edge], self.triangles[i][(edge + 1) % 3]);
                    ((a.min(b), a.max(b)), i)
                })
                .collect();
            let mut over: BTreeMap<usize, (usize, usize)> = BTreeMap::new();
            for (j, t) in self.triangles.iter().enumerate() {
                for edge in 0..3 {
                    let (a, b) = (t[edge], t[(edge + 1) % 3]);
                    if let Some(&i) = wanted.get(&(a.min(b), a.max(b)))
                        && i != j
                    {
                        over.insert(i, (j, edge));
                    }
                }
            }
            let mut changed = vec![false; self.triangles.len()];
            let mut any = false;
            for (i, edge) in slivers {
                let middle = self.triangles[i][(edge + 2) % 3];
                match over.get(&i) {
                    Some(&(j, there)) if !changed[i] && !changed[j] => {
                        let t = self.triangles[j];
                        let (a, b, apex) = (t[there], t[(there + 1) % 3], t[(there + 2) % 3]);
                        self.triangles[j] = [a, middle, apex];
                        self.triangles[i] = [middle, b, apex];
                        self.groups[i] = self.groups[j];
                        (changed[i], changed[j], any) = (true, true, true);
                        flipped += 1;
                    }
                    Some(_) => {}
                    None => {
                        // At a border, collapse it to a point.
                        self.triangles[i] = [middle; 3];
                        (changed[i], any) = (true, true);
                        flipped += 1;
                    }
                }
            }
            self.remove_collapsed();
            if !any {
                break;
            }
        }
        flipped
    }

    /// Removes points without a triangle.
    #[allow(clippy::cast_possible_truncation)] // fewer than 2^32 points
    fn drop_unused(&mut self) {
        let mut number = vec![u32::MAX; self.points_m.len()];
        self.triangles.as_flattened().iter().for_each(|corner| number[*corner as usize] = 0);
        let mut kept = 0;
        for i in 0..self.points_m.len() {
            if number[i] == 0 {
                number[i] = kept as u32;
                self.points_m[kept] = self.points_m[i];
                kept += 1;
            }
        }
        self.points_m.truncate(kept);
        self.triangles.as_flattened_mut().iter_mut().for_each(|c| *c = number[*c as usize]);
    }
}
