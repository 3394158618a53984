//! Exhaustive reference: the free place nearest to a tool, by all patches of the smoothed surface.
//!
//! Each patch gives its closest point to the tool and with it a candidate, a radius above it; the nearest candidate that is free is
//! the answer, because no free place is nearer than the nearest candidate. Where none of the nearest candidates is free, several
//! patches hold the ball, and the place is found by projection onto the tangent planes of all patches about it. Which places a tool
//! can reach is found by following its path in steps of 5 um, each with all patches.

use flotor_hal::{DVec3, math};
use flotor_surface::closest::Foot;
use flotor_surface::surface::{Place, Surface};

/// Depth of a patch in the ball that is free, m.
const FREE_M: f64 = 1.0e-9;
/// Step of the path that the reference follows, m.
const FINE_M: f64 = 5.0e-6;
/// Height over a patch at which a point is tested, m.
const PROBE_M: f64 = 1.0e-6;
/// Largest distance of a foot that is looked at, m.
const REACH_M: f64 = 6.0e-3;

/// All patches, each with a sphere about it.
pub(crate) struct Patches<'a> {
    pub(crate) surface: &'a Surface,
    spheres: Vec<(DVec3, f64)>,
    is_flat: Vec<bool>,
}

/// Places of a grid in a triangle, `n` to a side.
fn grid(n: u32) -> impl Iterator<Item = [f64; 3]> {
    (0..=n)
        .flat_map(move |i| (0..=n - i).map(move |j| [i, j, n - i - j].map(|k| f64::from(k) / f64::from(n))))
}

impl<'a> Patches<'a> {
    pub(crate) fn new(surface: &'a Surface) -> Self {
        let (mut spheres, mut is_flat) = (Vec::new(), Vec::new());
        for patch in surface.patches() {
            let [p, q, r] = *patch.corners();
            let middle_m = (p + q + r) / 3.0;
            let far = |at| (patch.point_m(at) - middle_m).length();
            // The grid of ten misses less than a tenth.
            spheres.push((middle_m, 1.1 * grid(10).map(far).fold(0.0, f64::max)));
            let off = |at: [f64; 3]| (patch.point_m(at) - (p * at[0] + q * at[1] + r * at[2])).length();
            is_flat.push(grid(10).map(off).fold(0.0, f64::max) == 0.0);
        }
        Self { surface, spheres, is_flat }
    }

    /// Returns the closest point of a patch: from the best place of a grid, and from the flat triangle; then no place near it is
    /// nearer.
    fn foot(&self, number: usize, c_m: DVec3) -> Foot {
        let patch = &self.surface.patches()[number];
        let mut best = patch.nearest(c_m);
        if self.is_flat[number] {
            return best;
        }
        let far = |at: &[f64; 3]| (patch.point_m(*at) - c_m).length_squared();
        let start = grid(5).min_by(|a, b| far(a).total_cmp(&far(b))).expect("a place");
        let other = patch.closest(c_m, start);
        if other.distance_m < best.distance_m {
            best = other;
        }
        for _ in 0..20 {
            let moves = [1.0e-2, 1.0e-4, 1.0e-6].into_iter().flat_map(|h| {
                [[h, -h, 0.0], [-h, h, 0.0], [h, 0.0, -h], [-h, 0.0, h], [0.0, h, -h], [0.0, -h, h]]
            });
            let beside = moves.map(|step| [0, 1, 2].map(|i| best.at[i] + step[i]));
            let nearer = beside
                .filter(|at| at.iter().all(|x| *x >= 0.0))
                .find(|at| (patch.point_m(*at) - c_m).length() < best.distance_m - 1.0e-13);
            let Some(at) = nearer else { break };
            let found = patch.closest(c_m, at);
            if found.distance_m < best.distance_m {
                best = found;
            } else {
                let point_m = patch.point_m(at);
                best = Foot { at, point_m, normal: patch.normal(at), distance_m: (point_m - c_m).length() };
            }
        }
        best
    }

    /// Returns the local closest points of a patch: a patch that winds may touch a ball twice.
    fn minima(&self, number: usize, c_m: DVec3) -> Vec<Foot> {
        let mut all = vec![self.foot(number, c_m)];
        let starts = grid(3).filter(|_| !self.is_flat[number]);
        for foot in starts.map(|at| self.surface.patches()[number].closest(c_m, at)) {
            if all.iter().all(|other| (other.point_m - foot.point_m).length() > 1.0e-7) {
                all.push(foot);
            }
        }
        all
    }

    /// Returns the feet of all patches within a distance, the nearest first.
    pub(crate) fn feet(&self, c_m: DVec3, within_m: f64) -> Vec<Place> {
        let near = |(middle_m, radius_m): &(DVec3, f64)| (*middle_m - c_m).length() - radius_m <= within_m;
        let mut all: Vec<Place> = (0..self.spheres.len())
            .filter(|number| near(&self.spheres[*number]))
            .map(|patch| Place { patch, foot: self.foot(patch, c_m) })
            .filter(|place| place.foot.distance_m <= within_m)
            .collect();
        all.sort_by(|a, b| a.foot.distance_m.total_cmp(&b.foot.distance_m));
        all
    }

    /// Returns the direction from a foot to `c_m`, towards the front.
    fn direction(&self, place: &Place, c_m: DVec3) -> DVec3 {
        let from_m = c_m - place.foot.point_m;
        let distance_m = from_m.length();
        if distance_m < 1.0e-12 {
            return place.foot.normal;
        }
        let sign = if from_m.dot(self.surface.outward(place)) < 0.0 { -1.0 } else { 1.0 };
        from_m * (sign / distance_m)
    }

    /// Returns true if a ball at `q_m` is free and in front.
    pub(crate) fn is_free(&self, q_m: DVec3, radius_m: f64) -> bool {
        let feet = self.feet(q_m, radius_m + 1.0e-4);
        let feet = if feet.is_empty() { self.feet(q_m, radius_m + REACH_M) } else { feet };
        let Some(nearest) = feet.first() else { return !self.is_inside(q_m) };
        let ties = feet.iter().take_while(|place| place.foot.distance_m < nearest.foot.distance_m + 1.0e-12);
        // Of faces of two bodies at one place, none may have the ball behind it.
        let facing = |place: &Place| {
            (q_m - place.foot.point_m).normalize_or_zero().dot(self.surface.outward(place).normalize())
        };
        let side = ties.map(facing).fold(f64::INFINITY, f64::min);
        nearest.foot.distance_m >= radius_m - FREE_M && (side >= -1.0e-9 || nearest.foot.distance_m < FREE_M)
    }

    /// Returns the feet from which the surface leads no nearer over the border of their patch.
    fn lowest_feet(&self, c_m: DVec3, within_m: f64) -> Vec<Place> {
        let mut feet: Vec<Place> = self
            .feet(c_m, within_m)
            .iter()
            .flat_map(|place| {
                self.minima(place.patch, c_m).into_iter().map(|foot| Place { patch: place.patch, foot })
            })
            .filter(|place| place.foot.distance_m <= within_m)
            .collect();
        feet.sort_by(|a, b| a.foot.distance_m.total_cmp(&b.foot.distance_m));
        let leads_nearer = |place: &Place| {
            let is_inner = place.foot.at.iter().all(|x| *x > 0.0);
            let nearer =
                feet.iter().take_while(|other| other.foot.distance_m < place.foot.distance_m - 1.0e-13);
            !is_inner
                && nearer
                    .map(|other| self.surface.patches()[other.patch].nearest(place.foot.point_m).distance_m)
                    .any(|gap_m| gap_m < 1.0e-10)
        };
        feet.iter().filter(|place| !leads_nearer(place)).copied().collect()
    }

    /// Returns true if a place far from the faces lies in a closed body, by the sum of the solid angles of all triangles.
    pub(crate) fn is_inside(&self, p_m: DVec3) -> bool {
        let solid_angle = |corners: &[DVec3; 3]| {
            let [a, b, c] = corners.map(|corner| corner - p_m);
            let lengths = [a, b, c].map(DVec3::length);
            let below = lengths.iter().product::<f64>()
                + a.dot(b) * lengths[2]
                + b.dot(c) * lengths[0]
                + c.dot(a) * lengths[1];
            2.0 * math::atan2(a.dot(b.cross(c)), below)
        };
        let sum: f64 = self.surface.patches().iter().map(|patch| solid_angle(patch.corners())).sum();
        !self.surface.has_borders() && sum.abs() > std::f64::consts::TAU
    }

    /// Moves a ball at `q_m` to the place nearest to `c_m` that it reaches, by steps of at most `most_m`.
    fn slide(&self, mut q_m: DVec3, c_m: DVec3, radius_m: f64, most_m: f64) -> DVec3 {
        for _ in 0..4000 {
            let mut planes: Vec<(DVec3, f64)> = Vec::new();
            let is_behind = |place: &Place| (q_m - place.foot.point_m).dot(self.surface.outward(place)) < 0.0;
            let feet = self.lowest_feet(q_m, radius_m + 2.0 * most_m);
            let is_outside = feet.first().is_some_and(|nearest| !is_behind(nearest));
            for place in feet {
                // A face that has a ball behind it which the nearest face has in front lies beyond an edge.
                if is_outside && is_behind(&place) {
                    continue;
                }
                let normal = self.direction(&place, q_m);
                let height_m = (q_m - place.foot.point_m).dot(normal);
                let plane = (normal, radius_m - height_m);
                let is_known = planes
                    .iter()
                    .any(|p| (p.0 - normal).length() < 1.0e-9 && (p.1 - plane.1).abs() < 1.0e-13);
                if !is_known && planes.len() < 12 {
                    planes.push(plane);
                }
            }
            let way_m = nearest_allowed(&planes, c_m - q_m);
            let length_m = way_m.length();
            q_m += way_m * (most_m / length_m).min(1.0);
            if length_m < 1.0e-13 {
                break;
            }
        }
        q_m
    }

    /// Returns the place that a ball reaches whose tool goes straight from a free place to `c_m`.
    pub(crate) fn followed(&self, from_m: DVec3, c_m: DVec3, radius_m: f64) -> DVec3 {
        let steps = ((c_m - from_m).length() / FINE_M).ceil();
        if radius_m == 0.0 {
            return self.followed_point(from_m, c_m, steps);
        }
        let mut q_m = from_m;
        let mut step = 1.0;
        while step <= steps {
            q_m = self.slide(q_m, from_m.lerp(c_m, step / steps), radius_m, (0.3 * radius_m).min(2.0e-5));
            step += 1.0;
        }
        q_m
    }

    /// Returns true if a small ball finds room at a place: a point does not fit between two bodies that touch.
    fn is_open(&self, place: &Place) -> bool {
        let point_m = place.foot.point_m;
        let all: DVec3 = self.feet(point_m, 1.0e-9).iter().map(|other| other.foot.normal).sum();
        [place.foot.normal, all.normalize_or_zero()]
            .into_iter()
            .any(|way| self.is_free(point_m + way * PROBE_M, 0.05 * PROBE_M))
    }

    /// Moves a point: follows the closest point from the crossing of the surface, over adjacent patches.
    fn followed_point(&self, from_m: DVec3, c_m: DVec3, steps: f64) -> DVec3 {
        let mut held: Option<Place> = None;
        let mut last_m = from_m;
        let mut step = 1.0;
        while step <= steps {
            let tool_m = from_m.lerp(c_m, step / steps);
            step += 1.0;
            if held.is_none() {
                held = self.surface.first_crossing(last_m, tool_m).map(|crossing| {
                    let patch = &self.surface.patches()[crossing.patch];
                    let (point_m, normal) = (patch.point_m(crossing.at), patch.normal(crossing.at));
                    let foot =
                        Foot { at: crossing.at, point_m, normal, distance_m: (point_m - tool_m).length() };
                    Place { patch: crossing.patch, foot }
                });
                last_m = tool_m;
            }
            let Some(mut at) = held else { continue };
            at.foot.distance_m = (at.foot.point_m - tool_m).length();
            loop {
                let touching = self.feet(at.foot.point_m, 1.0e-9);
                let next = touching
                    .iter()
                    .filter(|place| place.foot.normal.dot(at.foot.normal) > -0.9)
                    .map(|place| Place {
                        patch: place.patch,
                        foot: self.surface.patches()[place.patch].closest(tool_m, place.foot.at),
                    })
                    .filter(|place| self.is_open(place))
                    .min_by(|a, b| a.foot.distance_m.total_cmp(&b.foot.distance_m));
                let Some(next) = next else { break };
                if next.foot.distance_m >= at.foot.distance_m - 1.0e-14 {
                    break;
                }
                at = next;
            }
            // Outside again: the tool is in front.
            held = ((tool_m - at.foot.point_m).dot(self.surface.outward(&at)) <= 0.0).then_some(at);
        }
        held.map_or(c_m, |at| at.foot.point_m)
    }

    /// Returns the free place nearest to `c_m`, and whether the next patch is more than 1 um farther.
    pub(crate) fn nearest(&self, c_m: DVec3, radius_m: f64, hint_m: DVec3) -> (DVec3, bool) {
        if self.is_free(c_m, radius_m) {
            return (c_m, true);
        }
        // Twice as far as the nearest patch, but not less than what several patches hold.
        let first_m =
            self.feet(c_m, REACH_M / 4.0).first().map_or(REACH_M / 2.0, |place| place.foot.distance_m);
        let feet = self.feet(c_m, 2.0 * first_m + 2.0e-4);
        let is_clear = feet
            .iter()
            .find(|place| (place.foot.point_m - feet[0].foot.point_m).length() > 1.0e-9)
            .is_none_or(|next| next.foot.distance_m > feet[0].foot.distance_m + 1.0e-6);
        let mut all: Vec<DVec3> = Vec::new();
        for place in &feet {
            let direction = self.direction(place, c_m);
            all.push(place.foot.point_m + direction * radius_m);
        }
        let far = |q: &DVec3| (*q - c_m).length();
        all.sort_by(|a, b| far(a).total_cmp(&far(b)));
        if let Some(first) = all.first().filter(|q| self.is_free(**q, radius_m)) {
            return (*first, is_clear);
        }
        let single = all.iter().find(|q| self.is_free(**q, radius_m)).copied();
        let held = all.iter().take(6).chain([&hint_m]).map(|q| self.slide(*q, c_m, radius_m, 0.2 * radius_m));
        let held = held.filter(|q| radius_m > 0.0 && self.is_free(*q, radius_m));
        let best = held.chain(single).min_by(|a, b| far(a).total_cmp(&far(b)));
        (best.unwrap_or(DVec3::INFINITY), false)
    }
}

/// Returns the displacement nearest to `to_m` with `normal . y >= least_m` for all planes: of the points on up to three planes that
/// are allowed, the nearest.
fn nearest_allowed(planes: &[(DVec3, f64)], to_m: DVec3) -> DVec3 {
    let mut all = vec![to_m];
    let n = planes.len();
    for i in 0..n {
        let (a, x) = planes[i];
        all.push(to_m + a * (x - a.dot(to_m)));
        for j in 0..i {
            let (b, y) = planes[j];
            let line = a.cross(b);
            let square = line.length_squared();
            if square > 1.0e-14 {
                let point = (b.cross(line) * x + line.cross(a) * y) / square;
                all.push(point + line * (line.dot(to_m) / square));
            }
            for (c, z) in &planes[..j] {
                let det = line.dot(*c);
                if det.abs() > 1.0e-10 {
                    all.push((b.cross(*c) * x + c.cross(a) * y + line * *z) / det);
                }
            }
        }
    }
    let violation = |y: &DVec3| planes.iter().map(|(a, x)| x - a.dot(*y)).fold(0.0, f64::max);
    let far = |y: &DVec3| (*y - to_m).length();
    let allowed = all.iter().filter(|y| violation(y) <= 1.0e-13).min_by(|a, b| far(a).total_cmp(&far(b)));
    // Inside several planes at once none may be allowed: the least violation.
    *allowed
        .or_else(|| all.iter().min_by(|a, b| violation(a).total_cmp(&violation(b))))
        .expect("the goal itself")
}
