//! Closest point of a curved triangle: Newton's method with an active set of the three sides.
//!
//! Minimises `f = |S(x) - c|^2 / 2` over barycentric coordinates. A coordinate at zero is held there while the derivative of `f`
//! towards the inside is not negative (Bertsekas 1982, SIAM J. Control Optim. 20, 221-246). The Hessian is exact; where it is not
//! positive definite, beyond the centre of curvature, the Gauss-Newton matrix replaces it.

use crate::patch::{Barycentric, Jet, Patch};
use flotor_hal::DVec3;

/// Closest point of a patch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Foot {
    /// Barycentric coordinates in the patch.
    pub at: Barycentric,
    /// Point, m.
    pub point_m: DVec3,
    /// Outward unit normal of the patch at the point.
    pub normal: DVec3,
    /// Distance from the queried point, m.
    pub distance_m: f64,
}

/// Maximum number of Newton steps; six are usual from the middle of a patch.
const MOST_STEPS: usize = 40;
/// Length of a step below which the next step is below rounding (quadratic convergence), relative to the size of the patch.
const LAST_STEP: f64 = 1.0e-8;
/// Length of the next step, predicted from the last two by quadratic convergence, below which the next step is below rounding,
/// relative to the size of the patch.
const NEXT_STEP: f64 = 1.0e-14;
/// Maximum length of a step for which the distance is nearly quadratic, relative to the size of the patch.
const SHORT_STEP: f64 = 0.25;
/// Maximum number of halvings of a step that does not reduce the distance (backtracking).
const MOST_HALVINGS: usize = 12;

/// Returns the barycentric coordinates of the closest point of the flat triangle, and its squared distance, m², (Ericson 2005,
/// Real-Time Collision Detection, 5.1.5). Real-time: bounded, no allocation.
pub(crate) fn closest_of_triangle(corners_m: &[DVec3; 3], c: DVec3) -> (Barycentric, f64) {
    let [p, q, r] = *corners_m;
    let (pq, pr, pc) = (q - p, r - p, c - p);
    let (d1, d2) = (pq.dot(pc), pr.dot(pc));
    let place = 'found: {
        if d1 <= 0.0 && d2 <= 0.0 {
            break 'found [1.0, 0.0, 0.0];
        }
        let qc = c - q;
        let (d3, d4) = (pq.dot(qc), pr.dot(qc));
        if d3 >= 0.0 && d4 <= d3 {
            break 'found [0.0, 1.0, 0.0];
        }
        let vc = d1 * d4 - d3 * d2;
        if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
            let t = d1 / (d1 - d3);
            break 'found [1.0 - t, t, 0.0];
        }
        let rc = c - r;
        let (d5, d6) = (pq.dot(rc), pr.dot(rc));
        if d6 >= 0.0 && d5 <= d6 {
            break 'found [0.0, 0.0, 1.0];
        }
        let vb = d5 * d2 - d1 * d6;
        if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
            let t = d2 / (d2 - d6);
            break 'found [1.0 - t, 0.0, t];
        }
        let va = d3 * d6 - d5 * d4;
        if va <= 0.0 && d4 >= d3 && d5 >= d6 {
            let t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
            break 'found [0.0, 1.0 - t, t];
        }
        let sum = va + vb + vc;
        [va / sum, vb / sum, vc / sum]
    };
    // Degenerate triangle: its corners coincide to rounding.
    let place = if place.iter().all(|x| x.is_finite()) { place } else { [1.0, 0.0, 0.0] };
    let point_m = p * place[0] + q * place[1] + r * place[2];
    (place, (point_m - c).length_squared())
}

/// Gradient and Hessian of `f` with respect to the first two coordinates.
struct Quadratic {
    gradient: [f64; 2],
    hessian: [f64; 3],
    gauss_newton: [f64; 3],
}

/// Returns true for a matrix `[aa, ab, bb]` that is positive definite beyond rounding.
fn is_positive([aa, ab, bb]: [f64; 3]) -> bool {
    aa > 0.0 && aa * bb - ab * ab > 1.0e-9 * aa * bb.abs()
}

impl Quadratic {
    fn of(patch: &Patch, at: Barycentric, jet: &Jet, c: DVec3) -> Self {
        let d = jet.point_m - c;
        let [a, b] = jet.first;
        let gauss_newton = [a.dot(a), a.dot(b), b.dot(b)];
        let bend = patch.bend_along(at, d);
        let hessian = [0, 1, 2].map(|i| gauss_newton[i] + bend[i]);
        Self { gradient: [a.dot(d), b.dot(d)], hessian, gauss_newton }
    }
}

/// Change of the first two coordinates along each side, in the order of the coordinate that is zero there.
const SIDES: [[f64; 2]; 3] = [[0.0, 1.0], [1.0, 0.0], [1.0, -1.0]];

impl Quadratic {
    fn is_convex(&self) -> bool {
        is_positive(self.hessian)
    }

    /// Returns the Newton step in the three coordinates; the coordinates `held` do not change.
    fn step(&self, held: [bool; 3]) -> [f64; 3] {
        let [ga, gb] = self.gradient;
        let step = match held.iter().filter(|h| **h).count() {
            0 => {
                let solve = |[aa, ab, bb]: [f64; 3]| {
                    let det = aa * bb - ab * ab;
                    is_positive([aa, ab, bb]).then(|| [(ab * gb - bb * ga) / det, (ab * ga - aa * gb) / det])
                };
                solve(self.hessian).or_else(|| solve(self.gauss_newton)).unwrap_or([0.0; 2])
            }
            1 => {
                let [da, db] = SIDES[held.iter().position(|h| *h).unwrap_or(0)];
                let slope = ga * da + gb * db;
                let curve = |[aa, ab, bb]: [f64; 3]| da * da * aa + 2.0 * da * db * ab + db * db * bb;
                let (exact, safe) = (curve(self.hessian), curve(self.gauss_newton));
                let curve = if exact > 1.0e-9 * safe { exact } else { safe };
                let t = if curve > 0.0 { -slope / curve } else { 0.0 };
                [t * da, t * db]
            }
            _ => [0.0; 2],
        };
        [step[0], step[1], -step[0] - step[1]]
    }
}

/// Returns which coordinates are held at zero, with the step.
fn held_and_step(quadratic: &Quadratic, at: Barycentric) -> [f64; 3] {
    let slope = [quadratic.gradient[0], quadratic.gradient[1], 0.0];
    let mean = at[0] * slope[0] + at[1] * slope[1];
    let mut held = [0, 1, 2].map(|i| at[i] <= 0.0 && slope[i] >= mean);
    for _ in 0..3 {
        let step = quadratic.step(held);
        match (0..3).find(|&i| !held[i] && at[i] <= 0.0 && step[i] < 0.0) {
            Some(i) => held[i] = true,
            None => return step,
        }
    }
    [0.0; 3]
}

impl Patch {
    /// Finds the local closest point to `c_m`, starting at the coordinates `start`. Real-time: bounded, no allocation.
    #[must_use]
    pub fn closest(&self, c_m: DVec3, start: Barycentric) -> Foot {
        self.descend(c_m, start, f64::INFINITY)
    }

    /// Finds the local closest point as [`Self::closest`]; `None` if it is not nearer than `bound_m`.
    pub(crate) fn closest_within(&self, c_m: DVec3, start: Barycentric, bound_m: f64) -> Option<Foot> {
        let foot = self.descend(c_m, start, bound_m);
        (foot.distance_m < bound_m).then_some(foot)
    }

    /// Descends from `start` to the closest point; stops early where no point nearer than `bound_m` is expected.
    fn descend(&self, c_m: DVec3, start: Barycentric, bound_m: f64) -> Foot {
        if self.is_flat() {
            let (at, square) = closest_of_triangle(&self.corners_m, c_m);
            let [p, q, r] = self.corners_m;
            let point_m = p * at[0] + q * at[1] + r * at[2];
            return Foot { at, point_m, normal: self.flat_normal(), distance_m: square.sqrt() };
        }
        let mut at = start;
        let mut jet = self.jet(at);
        let mut square = (jet.point_m - c_m).length_squared();
        let mut before = f64::INFINITY;
        for _ in 0..MOST_STEPS {
            let quadratic = Quadratic::of(self, at, &jet, c_m);
            let step = held_and_step(&quadratic, at);
            let size = step[0].abs().max(step[1].abs()).max(step[2].abs());
            // The first-order decrease of the squared distance in this step, with a safety factor of two.
            let slope = quadratic.gradient[0] * step[0] + quadratic.gradient[1] * step[1];
            let is_too_far =
                size < SHORT_STEP && quadratic.is_convex() && square + 2.0 * slope > bound_m * bound_m;
            if size == 0.0 || is_too_far {
                break;
            }
            let mut share = 1.0_f64;
            let mut blocked = None;
            for i in 0..3 {
                if step[i] < 0.0 && at[i] + step[i] < 0.0 {
                    let most = at[i] / -step[i];
                    if most < share {
                        (share, blocked) = (most, Some(i));
                    }
                }
            }
            let mut moved = None;
            for _ in 0..MOST_HALVINGS {
                let mut next = [0, 1, 2].map(|i| (at[i] + share * step[i]).max(0.0));
                if let Some(i) = blocked {
                    next[i] = 0.0;
                }
                let sum = next[0] + next[1] + next[2];
                next = next.map(|x| x / sum);
                let there = self.jet(next);
                let found = (there.point_m - c_m).length_squared();
                // Rounding may increase the distance in the last step.
                if found <= square * (1.0 + 1.0e-14) || size * share < LAST_STEP {
                    moved = Some((next, there, found));
                    break;
                }
                (share, blocked) = (0.5 * share, None);
            }
            let Some((next, there, found)) = moved else { break };
            let is_full = share == 1.0 && blocked.is_none();
            let next_size = size * (size / before) * (size / before);
            let done = size * share < LAST_STEP && blocked.is_none()
                || is_full && next_size < NEXT_STEP && before < 1.0;
            before = if is_full { size } else { f64::INFINITY };
            (at, jet, square) = (next, there, found);
            if done {
                break;
            }
        }
        let [a, b] = jet.first;
        let normal = a.cross(b).try_normalize().unwrap_or_else(|| self.flat_normal());
        Foot { at, point_m: jet.point_m, normal, distance_m: square.sqrt() }
    }

    /// Finds the local closest point to `c_m`, starting at the closest point of the flat triangle. Real-time: bounded, no
    /// allocation.
    #[must_use]
    pub fn nearest(&self, c_m: DVec3) -> Foot {
        let (start, _) = closest_of_triangle(&self.corners_m, c_m);
        self.closest(c_m, start)
    }
}
