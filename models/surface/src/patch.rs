//! Curved triangle: a quartic Gregory patch over a flat triangle.
//!
//! The boundary is three cubic curves that two neighbours share. Across a boundary, the tangent plane at each point is spanned by
//! the tangent `T(s)` of the curve and by a vector `K(s)` that is linear along it from `K0 = n0 x T0` to `K1 = n1 x T1`; the derivative
//! across is `lambda(s) T(s) + mu(s) K(s)` with linear `lambda` and `mu`, which the tangents at the ends determine. Neighbours
//! compute the same plane, so normals are continuous (G1) over edges and at vertices. Each edge thus determines two of six inner
//! points of a quartic triangle; two points near a corner are blended rationally (Gregory 1974; for triangles Longhi 1985, Walton
//! and Meek 1996, Computer-Aided Design 28, 113-117). Curvature is bounded, but jumps at edges.
//!
//! All shapes are displacements from the flat triangle: three corners with equal normals and straight edges give the plane.

use crate::tree::Disc;
use flotor_hal::DVec3;

/// Barycentric coordinates in a triangle: not negative, sum 1.
pub type Barycentric = [f64; 3];

/// Displacement, m, as stored.
pub(crate) type Stored = [f32; 3];

/// Corners of a curved triangle, with normals and tangents.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// Corners, m, counter-clockwise seen from outside.
    pub corners_m: [DVec3; 3],
    /// Unit normals at the corners.
    pub normals: [DVec3; 3],
    /// Derivatives at start and end of each edge, from corner `i` to the next, m; perpendicular to the normals.
    pub tangents_m: [[DVec3; 2]; 3],
}

/// Curved triangle. 224 bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Patch {
    /// Corners, m.
    pub(crate) corners_m: [DVec3; 3],
    /// Displacements of the two inner points of each cubic edge from the straight edge, m.
    edges: [[Stored; 2]; 3],
    /// Displacements of the inner points near each corner, m: for the edge from the corner, and for the edge to the corner.
    inner: [[Stored; 2]; 3],
    /// Upper bound of the distance from the flat triangle, m; zero for a flat patch.
    pub(crate) bulge_m: f32,
}

/// Point of a patch with its derivatives with respect to the first two barycentric coordinates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Jet {
    pub(crate) point_m: DVec3,
    pub(crate) first: [DVec3; 2],
}

/// Displacement of an inner point below which the patch is flat, relative to the edges.
const FLAT: f64 = 1.0e-11;

/// Rounds a displacement to its stored form, identical on both sides of an edge.
#[allow(clippy::cast_possible_truncation)] // seven digits of a displacement are far below its own error
fn stored(v: DVec3) -> Stored {
    [v.x as f32, v.y as f32, v.z as f32]
}

fn vector(v: Stored) -> DVec3 {
    DVec3::new(f64::from(v[0]), f64::from(v[1]), f64::from(v[2]))
}

/// Index of each coordinate, with the next two in cyclic order.
const TURNS: [[usize; 3]; 3] = [[0, 1, 2], [1, 2, 0], [2, 0, 1]];
/// Sum of two coordinates up to which a point counts as the third corner, where the weights of the inner points have no limit.
const AT_CORNER: f64 = 1.0e-12;

/// Returns two coordinates divided by their sum; zero at the corner where both vanish.
#[inline(always)]
fn shares(xj: f64, xk: f64) -> [f64; 2] {
    let sum = xj + xk;
    let each = if sum > AT_CORNER { 1.0 / sum } else { 0.0 };
    [xj * each, xk * each]
}

/// Returns the inner points of a quartic next to an edge from `from` to `to`: displacements near its start and its end.
fn beside_edge(frame: &Frame, from: usize) -> [DVec3; 2] {
    let (to, apex) = ((from + 1) % 3, (from + 2) % 3);
    let [p, q] = [frame.corners_m[from], frame.corners_m[to]];
    let [start, end] = frame.tangents_m[from];
    let (first, last) = (p + start / 3.0, q - end / 3.0);
    // The derivative of the curve, and the derivative across it, at both ends.
    let along = [start, (last - first) * 3.0, end];
    let across = [-frame.tangents_m[apex][1], frame.tangents_m[to][0] + end];
    let length_m = (q - p).length();
    let conormal = |normal: DVec3, tangent: DVec3| normal.cross(tangent.normalize_or_zero()) * length_m;
    let k = [conormal(frame.normals[from], start), conormal(frame.normals[to], end)];
    let part = |v: DVec3, base: DVec3| {
        let square = base.length_squared();
        if square > 0.0 { v.dot(base) / square } else { 0.0 }
    };
    let lambda = [part(across[0], start), part(across[1], end)];
    let mu = [part(across[0], k[0]), part(across[1], k[1])];
    let near = (along[0] * lambda[1] + along[1] * (2.0 * lambda[0])) / 3.0;
    let far = (along[1] * (2.0 * lambda[1]) + along[2] * lambda[0]) / 3.0;
    let both = k[1] * mu[0] + k[0] * mu[1];
    let near = near + (k[0] * mu[0] + both) / 3.0;
    let far = far + (k[1] * mu[1] + both) / 3.0;
    let flat = (frame.corners_m[apex] - p) * 0.25;
    let rise = (first + last) * 0.5 - (p + q) * 0.5;
    // Displacements of the degree-elevated edge; the flat part cancels.
    let start_rise = (first - (p * 2.0 + q) / 3.0) * 0.75;
    [start_rise + near * 0.25 - flat, rise + far * 0.25 - flat]
}

impl Patch {
    /// Builds the patch of a frame. Not real-time.
    #[must_use]
    pub fn new(frame: &Frame) -> Self {
        let [p, q, r] = frame.corners_m;
        let chords_m = [q - p, r - q, p - r];
        let edges: [[Stored; 2]; 3] = std::array::from_fn(|i| {
            let [start, end] = frame.tangents_m[i];
            [stored((start - chords_m[i]) / 3.0), stored((chords_m[i] - end) / 3.0)]
        });
        let beside: [[DVec3; 2]; 3] = std::array::from_fn(|i| beside_edge(frame, i));
        let inner = std::array::from_fn(|i| {
            let before = (i + 2) % 3;
            // Degree elevation of the cubic boundary: a quarter of its two points near the corner.
            let elevated = (vector(edges[i][0]) + vector(edges[before][1])) * 0.25;
            let size_m = chords_m[i].length() + chords_m[before].length();
            // Treat rounding errors of a flat triangle as zero curvature.
            let rise = |v: DVec3| if v.length() <= FLAT * size_m { [0.0; 3] } else { stored(v) };
            [rise(beside[i][0] - elevated), rise(beside[before][1] - elevated)]
        });
        Self::of_parts(frame.corners_m, edges, inner)
    }

    /// Builds the flat patch of three corners. Not real-time.
    #[must_use]
    pub fn flat(corners_m: [DVec3; 3]) -> Self {
        Self::of_parts(corners_m, Default::default(), Default::default())
    }

    #[allow(clippy::cast_possible_truncation)] // rounded up
    fn of_parts(corners_m: [DVec3; 3], edges: [[Stored; 2]; 3], inner: [[Stored; 2]; 3]) -> Self {
        let most = |all: &[[Stored; 2]; 3]| {
            all.as_flattened().iter().map(|v| vector(*v).length()).fold(0.0, f64::max)
        };
        // The sums of the weights are at most 3/4 (edges) and 4/9 (inner points).
        let bulge_m = 0.75 * most(&edges) + 0.445 * most(&inner);
        let bulge_m = if bulge_m > 0.0 { (bulge_m as f32).next_up() } else { 0.0 };
        Self { corners_m, edges, inner, bulge_m }
    }

    /// Length of the data of [`Self::write`], bytes.
    pub(crate) const BYTES: usize = 9 * 8 + 36 * 4 + 4;

    /// Appends the numbers of the patch.
    pub(crate) fn write(&self, bytes: &mut Vec<u8>) {
        self.corners_m.iter().flat_map(|p| p.to_array()).for_each(|x| bytes.extend(x.to_le_bytes()));
        let stored = self.edges.as_flattened().iter().chain(self.inner.as_flattened());
        stored.flatten().chain([&self.bulge_m]).for_each(|x| bytes.extend(x.to_le_bytes()));
    }

    /// Builds the patch from the numbers of [`Self::write`].
    pub(crate) fn read(bytes: &[u8; Self::BYTES]) -> Self {
        let (long, short) = bytes.split_at(9 * 8);
        let mut long = long.as_chunks().0.iter().map(|x| f64::from_le_bytes(*x));
        let mut short = short.as_chunks().0.iter().map(|x| f32::from_le_bytes(*x));
        let mut one = || long.next().unwrap_or_default();
        let corners_m = std::array::from_fn(|_| DVec3::new(one(), one(), one()));
        let mut stored = || {
            std::array::from_fn(|_| {
                std::array::from_fn(|_| std::array::from_fn(|_| short.next().unwrap_or_default()))
            })
        };
        let (edges, inner) = (stored(), stored());
        Self { corners_m, edges, inner, bulge_m: short.next().unwrap_or_default() }
    }

    /// Returns the corners, m.
    #[must_use]
    pub fn corners(&self) -> &[DVec3; 3] {
        &self.corners_m
    }

    /// Returns true for a patch without curvature.
    pub(crate) fn is_flat(&self) -> bool {
        self.bulge_m == 0.0
    }

    /// Returns the lower and upper corner of a bounding box, m.
    pub(crate) fn bounds_m(&self) -> [DVec3; 2] {
        let [p, q, r] = self.corners_m;
        let bulge = DVec3::splat(f64::from(self.bulge_m));
        [p.min(q).min(r) - bulge, p.max(q).max(r) + bulge]
    }

    /// Returns a flat cylinder that contains the patch.
    pub(crate) fn disc(&self) -> Disc {
        let [p, q, r] = self.corners_m;
        let longest = [(p, q), (q, r), (r, p)].into_iter().fold((p, p), |longest, edge| {
            if edge.0.distance_squared(edge.1) > longest.0.distance_squared(longest.1) {
                edge
            } else {
                longest
            }
        });
        let half_way_m = (longest.0 + longest.1) * 0.5;
        let (a, b) = (q - p, r - p);
        let normal = a.cross(b);
        // Use the circumscribed circle; for an obtuse triangle, the smaller circle over the longest edge.
        let centre_m = p
            + (normal.cross(a) * b.length_squared() + b.cross(normal) * a.length_squared())
                / (2.0 * normal.length_squared());
        let radius_m = |m: DVec3| self.corners_m.iter().map(|corner| m.distance(*corner)).fold(0.0, f64::max);
        let (middle_m, radius_m) = [centre_m, half_way_m]
            .map(|m| (m, radius_m(m)))
            .into_iter()
            .filter(|(_, radius_m)| radius_m.is_finite())
            .fold((p, f64::INFINITY), |best, next| if next.1 < best.1 { next } else { best });
        let bulge_m = f64::from(self.bulge_m);
        let axis = normal.try_normalize().unwrap_or(DVec3::Z);
        Disc { middle_m, axis, radius_m: radius_m + bulge_m, half_m: bulge_m }
    }

    /// Evaluates point and tangents: weights `3 x_i^2 x_j` and `3 x_i x_j^2` of the points of an edge, `12 x_i^2 x_j^2 x_k / (x_j +
    /// x_k)` and `12 x_i^2 x_j x_k^2 / (x_j + x_k)` of those near a corner. Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn jet(&self, x: Barycentric) -> Jet {
        let [p, q, r] = self.corners_m;
        let mut bent_m = DVec3::ZERO;
        let mut by = [DVec3::ZERO; 3];
        for [i, j, k] in TURNS {
            let (start, end) = (vector(self.edges[i][0]) * x[i], vector(self.edges[i][1]) * x[j]);
            let both = start + end;
            bent_m += both * (3.0 * x[i] * x[j]);
            by[i] += (both + start) * (3.0 * x[j]);
            by[j] += (both + end) * (3.0 * x[i]);

            let (near, far) = (vector(self.inner[i][0]), vector(self.inner[i][1]));
            let [t, r] = shares(x[j], x[k]);
            let square = 12.0 * x[i] * x[i];
            let mixed = (near * t + far * r) * (x[j] * x[k]);
            bent_m += mixed * square;
            by[i] += mixed * (24.0 * x[i]);
            let scale = square * (x[j] + x[k]);
            by[j] += (near * (t * r * (t + 2.0 * r)) + far * (r * r * r)) * scale;
            by[k] += (near * (t * t * t) + far * (t * r * (r + 2.0 * t))) * scale;
        }
        Jet {
            point_m: p * x[0] + q * x[1] + r * x[2] + bent_m,
            first: [p - r + (by[0] - by[2]), q - r + (by[1] - by[2])],
        }
    }

    /// Returns the second derivatives `aa`, `ab`, `bb` along `d`, m^2 for a `d` in m; at a corner, where they have no limit,
    /// those of its edges are used. Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn bend_along(&self, x: Barycentric, d: DVec3) -> [f64; 3] {
        // By pairs of coordinates: each with itself, and each with the next one.
        let (mut own, mut next) = ([0.0; 3], [0.0; 3]);
        for [i, j, k] in TURNS {
            let (start, end) = (vector(self.edges[i][0]).dot(d), vector(self.edges[i][1]).dot(d));
            own[i] += 6.0 * x[j] * start;
            own[j] += 6.0 * x[i] * end;
            next[i] += 6.0 * (x[i] * start + x[j] * end);

            let (near, far) = (vector(self.inner[i][0]).dot(d), vector(self.inner[i][1]).dot(d));
            let [t, r] = shares(x[j], x[k]);
            let square = 12.0 * x[i] * x[i];
            own[i] += 24.0 * x[j] * x[k] * (t * near + r * far);
            let scale = 24.0 * x[i] * (x[j] + x[k]);
            next[i] += scale * (t * r * (t + 2.0 * r) * near + r * r * r * far);
            next[k] += scale * (t * t * t * near + t * r * (r + 2.0 * t) * far);
            own[j] += 2.0 * square * r * r * r * (near - far);
            own[k] += 2.0 * square * t * t * t * (far - near);
            next[j] += square * (t * t * (3.0 - 2.0 * t) * near + r * r * (3.0 - 2.0 * r) * far);
        }
        [
            own[0] - 2.0 * next[2] + own[2],
            next[0] - next[2] - next[1] + own[2],
            own[1] - 2.0 * next[1] + own[2],
        ]
    }

    /// Returns the outward unit normal at barycentric coordinates. Real-time: bounded, no allocation.
    #[must_use]
    pub fn normal(&self, x: Barycentric) -> DVec3 {
        let Jet { first: [a, b], .. } = self.jet(x);
        a.cross(b).try_normalize().unwrap_or_else(|| self.flat_normal())
    }

    /// Returns the point at barycentric coordinates, m. Real-time: bounded, no allocation.
    #[must_use]
    pub fn point_m(&self, x: Barycentric) -> DVec3 {
        self.jet(x).point_m
    }

    /// Returns the unit normal of the flat triangle; zero for a triangle without area. Real-time: bounded, no allocation.
    #[must_use]
    pub fn flat_normal(&self) -> DVec3 {
        let [p, q, r] = self.corners_m;
        (q - p).cross(r - p).normalize_or_zero()
    }

    /// Returns the derivative of an edge at one of its ends, towards the other end, m.
    pub(crate) fn corner_tangent(&self, corner: usize, edge: usize) -> DVec3 {
        let far = if edge == corner { (corner + 1) % 3 } else { edge };
        let point = usize::from(edge != corner);
        self.corners_m[far] - self.corners_m[corner] + vector(self.edges[edge][point]) * 3.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_those_of_differences() {
        let corners_m = [DVec3::ZERO, DVec3::new(1.0, 0.1, 0.0), DVec3::new(0.2, 0.9, 0.1)];
        let number = |i: usize| 0.1 * flotor_hal::math::sin(1.7 * i as f64 + 0.3);
        let displaced = |first: usize| {
            std::array::from_fn(|i| {
                std::array::from_fn(|k| {
                    stored(DVec3::from_array([0, 1, 2].map(|axis| number(first + 6 * i + 3 * k + axis))))
                })
            })
        };
        let patch = Patch::of_parts(corners_m, displaced(0), displaced(40));
        let (h, d) = (1.0e-5, DVec3::new(0.3, -0.5, 0.8));
        for at in [[0.3, 0.3, 0.4], [0.7, 0.1, 0.2], [0.05, 0.15, 0.8]] {
            let moved = |u: f64, v: f64| patch.jet([at[0] + u * h, at[1] + v * h, at[2] - (u + v) * h]);
            let [aa, ab, bb] = patch.bend_along(at, d);
            let (u, v) = ((moved(1.0, 0.0), moved(-1.0, 0.0)), (moved(0.0, 1.0), moved(0.0, -1.0)));
            // Errors of a central difference: h^2 times the third derivative, and rounding over h.
            let by = |(ahead, behind): &(Jet, Jet)| (ahead.point_m - behind.point_m) / (2.0 * h);
            assert!((by(&u) - patch.jet(at).first[0]).length() < 1.0e-8);
            assert!((by(&v) - patch.jet(at).first[1]).length() < 1.0e-8);
            let second = |(ahead, behind): &(Jet, Jet), i: usize| {
                (ahead.first[i] - behind.first[i]).dot(d) / (2.0 * h)
            };
            for (found, expected) in
                [(second(&u, 0), aa), (second(&u, 1), ab), (second(&v, 0), ab), (second(&v, 1), bb)]
            {
                assert!((found - expected).abs() < 1.0e-7, "{at:?}: {found} {expected}");
            }
        }
    }
}
