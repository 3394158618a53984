//! Faces of a mesh's surface: quadrature points, and lookup of a point on a plane face.

use crate::cells::{face_rule, face_shapes};
use crate::mesh::Facet;

/// Quadrature point of a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Position, m.
    pub position_m: [f64; 3],
    /// Outward normal times the area that the point represents, m².
    pub normal_m2: [f64; 3],
    /// Weights of the facet's nodes (shape functions).
    pub shares: Vec<f64>,
}

fn sum<const N: usize>(
    nodes: &[usize],
    nodes_m: &[[f64; 3]],
    of: impl Fn(usize) -> [f64; N],
) -> [[f64; 3]; N] {
    let mut sums = [[0.0; 3]; N];
    for (k, &node) in nodes.iter().enumerate() {
        for (total, share) in sums.iter_mut().zip(of(k)) {
            total.iter_mut().zip(nodes_m[node]).for_each(|(t, x)| *t += share * x);
        }
    }
    sums
}

impl Facet {
    /// Returns the quadrature points of the facet. Not real-time.
    #[must_use]
    pub fn points(&self, nodes_m: &[[f64; 3]]) -> Vec<SurfacePoint> {
        face_rule(self.corners).into_iter().map(|(at, weight)| self.point(nodes_m, at, weight)).collect()
    }

    /// Returns the point at `at` of the reference face, with the area of so much of that face. Not real-time.
    #[must_use]
    pub fn point(&self, nodes_m: &[[f64; 3]], at: [f64; 2], weight: f64) -> SurfacePoint {
        let shapes = face_shapes(self.corners, at);
        let [position_m, u, v] = sum(&self.nodes, nodes_m, |k| [shapes[k].0, shapes[k].1[0], shapes[k].1[1]]);
        let normal_m2 = [0, 1, 2].map(|k| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            weight * (u[i] * v[j] - u[j] * v[i])
        });
        SurfacePoint { position_m, normal_m2, shares: shapes.into_iter().map(|s| s.0).collect() }
    }

    /// Returns false if the point at x and y `at_m` lies clearly outside the facet. Not real-time.
    #[must_use]
    pub fn may_hold(&self, nodes_m: &[[f64; 3]], at_m: [f64; 2]) -> bool {
        (0..2).all(|k| {
            let all = || self.nodes.iter().map(|&node| nodes_m[node][k]);
            let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
            let more = 0.2 * (high - low); // a curved edge bulges beyond its nodes
            (low - more..=high + more).contains(&at_m[k])
        })
    }

    /// Finds the point at x and y `at_m` on the facet, by Newton's method. Returns the weights of the nodes, and the distance
    /// outside the facet (0: inside) in the reference coordinates of the facet. Not real-time.
    #[must_use]
    pub fn locate(&self, nodes_m: &[[f64; 3]], at_m: [f64; 2]) -> (Vec<f64>, f64) {
        let mut at = if self.corners == 3 { [1.0 / 3.0; 2] } else { [0.0; 2] };
        for _ in 0..20 {
            let shapes = face_shapes(self.corners, at);
            let [place, u, v] = sum(&self.nodes, nodes_m, |k| [shapes[k].0, shapes[k].1[0], shapes[k].1[1]]);
            let miss = [at_m[0] - place[0], at_m[1] - place[1]];
            let determinant = u[0] * v[1] - u[1] * v[0];
            let step = [
                (miss[0] * v[1] - miss[1] * v[0]) / determinant,
                (u[0] * miss[1] - u[1] * miss[0]) / determinant,
            ];
            for (c, s) in at.iter_mut().zip(step) {
                // Far outside the facet its curved edges have no meaning.
                *c = (*c + s).clamp(-4.0, 4.0);
            }
            if step[0].abs() + step[1].abs() < 1.0e-13 {
                break;
            }
        }
        let outside = if self.corners == 3 {
            (-at[0]).max(-at[1]).max(at[0] + at[1] - 1.0).max(0.0)
        } else {
            (at[0].abs().max(at[1].abs()) - 1.0).max(0.0)
        };
        (face_shapes(self.corners, at).into_iter().map(|s| s.0).collect(), outside)
    }
}
