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

use flotor_hal::DVec3;

/// Barycentric coordinates of a place in a triangle: not negative, sum 1.
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
    /// Displacements of the inner points near each corner, m: of the edge from the corner, of the edge to the corner.
    inner: [[Stored; 2]; 3],
    /// Largest distance from the flat triangle, m, or more; zero for a flat patch.
    pub(crate) bulge_m: f32,
}

/// Point of a patch with its derivatives by the first two barycentric coordinates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Jet {
    pub(crate) point_m: DVec3,
    pub(crate) first: [DVec3; 2],
    /// Derivatives `aa`, `ab`, `bb`.
    pub(crate) second: [DVec3; 3],
}

/// Displacement below which an inner point is in the flat triangle, relative to the edges.
const FLAT: f64 = 1.0e-11;

/// Value, two first and three second derivatives of a weight.
type Weight = [f64; 6];

/// Returns a displacement as stored; the neighbour of an edge rounds the same number.
#[allow(clippy::cast_possible_truncation)] // seven digits of a displacement are far below its own error
fn stored(v: DVec3) -> Stored {
    [v.x as f32, v.y as f32, v.z as f32]
}

fn vector(v: Stored) -> DVec3 {
    DVec3::new(f64::from(v[0]), f64::from(v[1]), f64::from(v[2]))
}

/// Reduces gradient `[u, v, w]` and Hessian `[uu, uv, uw, vv, vw, ww]` to the coordinates `u`, `v` with `w = 1 - u - v`.
fn reduce(value: f64, g: [f64; 3], h: [f64; 6]) -> Weight {
    let [uu, uv, uw, vv, vw, ww] = h;
    [value, g[0] - g[2], g[1] - g[2], uu - 2.0 * uw + ww, uv - uw - vw + ww, vv - 2.0 * vw + ww]
}

/// Index of a pair of coordinates in a Hessian.
const PAIR: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

/// Returns the cubic weights `3 x_i^2 x_j` and `3 x_i x_j^2` of an edge.
fn edge_weights(x: Barycentric, i: usize) -> [Weight; 2] {
    let j = (i + 1) % 3;
    let (a, b) = (x[i], x[j]);
    let weight = |value, by_i, by_j, ii, ij, jj| {
        let (mut g, mut h) = ([0.0; 3], [0.0; 6]);
        (g[i], g[j]) = (by_i, by_j);
        (h[PAIR[i][i]], h[PAIR[i][j]], h[PAIR[j][j]]) = (ii, ij, jj);
        reduce(value, g, h)
    };
    [
        weight(3.0 * a * a * b, 6.0 * a * b, 3.0 * a * a, 6.0 * b, 6.0 * a, 0.0),
        weight(3.0 * a * b * b, 3.0 * b * b, 6.0 * a * b, 0.0, 6.0 * b, 6.0 * a),
    ]
}

/// Returns the weights `12 x_i^2 x_j^2 x_k / (x_j + x_k)` and `12 x_i^2 x_j x_k^2 / (x_j + x_k)` near a corner; their second
/// derivatives have no limit at the corner and count as zero there.
fn inner_weights(x: Barycentric, i: usize) -> [Weight; 2] {
    let (j, k) = ((i + 1) % 3, (i + 2) % 3);
    let (a, sum) = (x[i], x[j] + x[k]);
    if sum <= 1.0e-12 {
        return [[0.0; 6]; 2];
    }
    let half = |j: usize, k: usize| {
        let (t, r) = (x[j] / sum, x[k] / sum);
        // The share s^2 t^2 r, with its derivatives by x_j and x_k.
        let f = sum * sum * t * t * r;
        let (f_j, f_k) = (sum * t * r * (t + 2.0 * r), sum * t * t * t);
        let (f_jj, f_jk, f_kk) = (2.0 * r * r * r, t * t * (3.0 - 2.0 * t), -2.0 * t * t * t);
        let (mut g, mut h) = ([0.0; 3], [0.0; 6]);
        (g[i], g[j], g[k]) = (24.0 * a * f, 12.0 * a * a * f_j, 12.0 * a * a * f_k);
        h[PAIR[i][i]] = 24.0 * f;
        (h[PAIR[i][j]], h[PAIR[i][k]]) = (24.0 * a * f_j, 24.0 * a * f_k);
        (h[PAIR[j][j]], h[PAIR[j][k]], h[PAIR[k][k]]) =
            (12.0 * a * a * f_jj, 12.0 * a * a * f_jk, 12.0 * a * a * f_kk);
        reduce(12.0 * a * a * f, g, h)
    };
    [half(j, k), half(k, j)]
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
    // Points of the elevated edge, displaced; the flat point cancels.
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
            // A cubic boundary, elevated, contributes a quarter of its two points near the corner.
            let elevated = (vector(edges[i][0]) + vector(edges[before][1])) * 0.25;
            let size_m = chords_m[i].length() + chords_m[before].length();
            // Rounding of a flat triangle is no curvature.
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
        // The sums of the weights are at most 3/4 and 4/9.
        let bulge_m = 0.75 * most(&edges) + 0.445 * most(&inner);
        let bulge_m = if bulge_m > 0.0 { (bulge_m as f32).next_up() } else { 0.0 };
        Self { corners_m, edges, inner, bulge_m }
    }

    /// Length of [`Self::write`], bytes.
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

    /// Returns lower and upper corner of a box about the patch, m.
    pub(crate) fn bounds_m(&self) -> [DVec3; 2] {
        let [p, q, r] = self.corners_m;
        let bulge = DVec3::splat(f64::from(self.bulge_m));
        [p.min(q).min(r) - bulge, p.max(q).max(r) + bulge]
    }

    /// Evaluates the patch. Real-time: bounded, no allocation.
    pub(crate) fn jet(&self, x: Barycentric) -> Jet {
        let [p, q, r] = self.corners_m;
        let mut point_m = p * x[0] + q * x[1] + r * x[2];
        let mut first = [p - r, q - r];
        let mut second = [DVec3::ZERO; 3];
        let mut add = |weights: [Weight; 2], points: &[Stored; 2]| {
            for (weight, point) in weights.iter().zip(points) {
                let v = vector(*point);
                point_m += v * weight[0];
                first[0] += v * weight[1];
                first[1] += v * weight[2];
                second[0] += v * weight[3];
                second[1] += v * weight[4];
                second[2] += v * weight[5];
            }
        };
        for i in 0..3 {
            add(edge_weights(x, i), &self.edges[i]);
            add(inner_weights(x, i), &self.inner[i]);
        }
        Jet { point_m, first, second }
    }

    /// Returns the outward unit normal at a place. Real-time: bounded, no allocation.
    #[must_use]
    pub fn normal(&self, x: Barycentric) -> DVec3 {
        let Jet { first: [a, b], .. } = self.jet(x);
        a.cross(b).try_normalize().unwrap_or_else(|| self.flat_normal())
    }

    /// Returns the point at a place, m. Real-time: bounded, no allocation.
    #[must_use]
    pub fn point_m(&self, x: Barycentric) -> DVec3 {
        self.jet(x).point_m
    }

    /// Returns the unit normal of the flat triangle; zero for one without area. Real-time: bounded, no allocation.
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
