//! Self-intersections of a surface, where a ball may be held on the wrong face. Not real-time.

use crate::parallel::on_ranges;
use crate::surface::Surface;
use flotor_hal::DVec3;

/// Minimum fraction of a face or an edge on either side of an intersection: faces that only touch do not intersect.
const CLEAR: f64 = 1.0e-6;

/// Pairs of intersecting faces.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Crossings {
    /// Number of pairs.
    pub count: usize,
    /// Position of the first intersection, m.
    pub first_m: Option<DVec3>,
}

/// Finds the pairs of intersecting flat faces.
#[must_use]
pub fn crossings(surface: &Surface) -> Crossings {
    let parts = on_ranges(surface.count(), |range| {
        let mut found = Crossings::default();
        for t in range {
            let corners_m = surface.patches()[t].corners_m;
            let [p, q, r] = corners_m;
            surface.near_box([p.min(q).min(r), p.max(q).max(r)], t + 1, |other| {
                let theirs = surface.patches()[other].corners_m;
                let is_neighbour = theirs.iter().any(|corner| corners_m.contains(corner));
                if is_neighbour {
                    return;
                }
                if let Some(place_m) =
                    crossing_m(&corners_m, &theirs).or_else(|| crossing_m(&theirs, &corners_m))
                {
                    found.count += 1;
                    found.first_m = found.first_m.or(Some(place_m));
                }
            });
        }
        found
    });
    parts.into_iter().fold(Crossings::default(), |all, part| Crossings {
        count: all.count + part.count,
        first_m: all.first_m.or(part.first_m),
    })
}

/// Returns the point where an edge of the first triangle crosses the inside of the second, m (Moeller and Trumbore 1997, J.
/// Graphics Tools 2(1), 21-28).
fn crossing_m(edges: &[DVec3; 3], [p, q, r]: &[DVec3; 3]) -> Option<DVec3> {
    (0..3).find_map(|i| {
        let (from, to) = (edges[i], edges[(i + 1) % 3]);
        let (a, b, way) = (*q - *p, *r - *p, to - from);
        let side = way.cross(b);
        let det = a.dot(side);
        if det.abs() <= CLEAR * a.length() * b.length() * way.length() {
            return None;
        }
        let start = from - *p;
        let u = start.dot(side) / det;
        let other = start.cross(a);
        let (v, t) = (way.dot(other) / det, b.dot(other) / det);
        let is_inside = u > CLEAR && v > CLEAR && u + v < 1.0 - CLEAR && t > CLEAR && t < 1.0 - CLEAR;
        is_inside.then(|| from + way * t)
    })
}
