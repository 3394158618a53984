//! Elastic half-space under surface forces: the singular part of every contact, which no mesh resolves.
//!
//! Frame: `p` and `q` along the surface, `w` out of it; the solid is `w < 0`. Point forces are those of Boussinesq
//! (along `w`) and Cerruti (along the surface); K. L. Johnson, *Contact Mechanics* (1985), sections 3.2 and 3.6. At the
//! surface all displacements are inversely proportional to the distance, so a uniform load on a polygon has a closed form along
//! its edges: in polar coordinates about the evaluation point, `int k(angle) / r dA = contour integral of k r d(angle)`.

use crate::jet::Jet;
use flotor_hal::math;
use std::f64::consts::PI;

/// Material of a half-space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace {
    /// Young's modulus, Pa.
    pub youngs_modulus_pa: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
}

/// Displacement at a point under a unit force along each direction, with its gradient.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    /// Displacement along `p`, `q`, `w` (first index) under a unit force along `p`, `q`, `w` (second), m/N; each with
    /// its derivatives along `p`, `q`, `w`.
    pub displacement: [[Jet; 3]; 3],
}

/// Compliance between two points, m/N: first index direction of the displacement, second index direction of the force.
pub type Block = [[f64; 3]; 3];

/// Adds `share` times a block to `sum`.
pub(crate) fn add_scaled(sum: &mut Block, block: &Block, share: f64) {
    for (row, values) in sum.iter_mut().zip(block) {
        row.iter_mut().zip(values).for_each(|(s, v)| *s += share * v);
    }
}

impl HalfSpace {
    fn shear_pa(&self) -> f64 {
        self.youngs_modulus_pa / (2.0 * (1.0 + self.poisson_ratio))
    }

    /// Returns the displacement, with its gradient, at a point of the solid other than the origin, under unit forces at the origin.
    #[must_use]
    pub fn field(&self, point_m: [f64; 3]) -> Field {
        let nu = self.poisson_ratio;
        let scale = 1.0 / (4.0 * PI * self.shear_pa());
        let p = Jet::variable(point_m[0], 0);
        let q = Jet::variable(point_m[1], 1);
        let depth = -Jet::variable(point_m[2], 2);
        let r = (p * p + q * q + depth * depth).sqrt();
        let inverse = r.recip();
        let cubed = inverse * inverse * inverse;
        let beside = (r + depth).recip();
        let c = 1.0 - 2.0 * nu;
        let radial = inverse * beside * c;
        let falling = radial * beside;
        let normal_in_plane = depth * cubed - radial;
        let normal_up = depth * depth * cubed + inverse * (2.0 * (1.0 - nu));
        let tangent_up = depth * cubed + radial;
        let shared = inverse + beside * c;
        let stretch = cubed - falling;
        let displacement = [
            [shared + p * p * stretch, p * q * stretch, -(p * normal_in_plane)],
            [p * q * stretch, shared + q * q * stretch, -(q * normal_in_plane)],
            [-(p * tangent_up), -(q * tangent_up), normal_up],
        ];
        Field { displacement: displacement.map(|row| row.map(|jet| jet * scale)) }
    }

    /// Returns the displacement of a surface point under a uniform traction of 1 Pa along each direction on a polygon,
    /// m per Pa. `corners_m` run counterclockwise, relative to the point.
    #[must_use]
    pub fn polygon(&self, corners_m: &[[f64; 2]]) -> Block {
        let nu = self.poisson_ratio;
        let mut sums = Edges::default();
        for (i, from) in corners_m.iter().enumerate() {
            sums.add(*from, corners_m[(i + 1) % corners_m.len()]);
        }
        // `e` points from the point to the load, the kernels from load to point: even kernels are equal, odd ones change sign.
        let scale = 1.0 / (2.0 * PI * self.shear_pa());
        let odd = 0.5 * (1.0 - 2.0 * nu) * scale;
        let tangent = |i: usize, j: usize, even: f64| scale * ((1.0 - nu) * even + nu * sums.second[i + j]);
        let (pp, pq, qq) =
            (tangent(0, 0, sums.zeroth), scale * nu * sums.second[1], tangent(1, 1, sums.zeroth));
        let (up_p, up_q) = (odd * -sums.first[0], odd * -sums.first[1]);
        [[pp, pq, up_p], [pq, qq, up_q], [-up_p, -up_q, scale * (1.0 - nu) * sums.zeroth]]
    }
}

/// Sums of `int k / r dA` for `k = 1`, `e_i` and `e_i e_j`, with `e` the direction from the point to the load.
#[derive(Default)]
struct Edges {
    zeroth: f64,
    first: [f64; 2],
    /// `pp`, `pq`, `qq`.
    second: [f64; 3],
}

impl Edges {
    /// Adds one edge at distance `D` along the normal `n`, from `s0` to `s1` along `t`. The direction to a point of the
    /// edge is `(D n + s t) / r`.
    fn add(&mut self, from: [f64; 2], to: [f64; 2]) {
        let along = [to[0] - from[0], to[1] - from[1]];
        let length = (along[0] * along[0] + along[1] * along[1]).sqrt();
        if length == 0.0 {
            return;
        }
        let t = along.map(|c| c / length);
        let n = [t[1], -t[0]];
        let distance = from[0] * n[0] + from[1] * n[1];
        if distance.abs() < 1.0e-12 * length {
            return; // an edge on a line through the point spans no area
        }
        let (s0, s1) = (from[0] * t[0] + from[1] * t[1], to[0] * t[0] + to[1] * t[1]);
        let at = |s: f64| {
            let r = (distance * distance + s * s).sqrt();
            let inverse_sinh = arsinh(s / distance.abs());
            // int D/r, D^3/r^3, D^2 s/r^3, D s^2/r^3, D^2/r^2, D s/r^2 ds
            [
                distance * inverse_sinh,
                distance * s / r,
                -distance * distance / r,
                distance * (inverse_sinh - s / r),
                distance * math::atan(s / distance),
                distance * math::ln(r),
            ]
        };
        let (low, high) = (at(s0), at(s1));
        let [zeroth, nn, nt, tt, first_n, first_t] = [0, 1, 2, 3, 4, 5].map(|i| high[i] - low[i]);
        self.zeroth += zeroth;
        for i in 0..2 {
            self.first[i] += n[i] * first_n + t[i] * first_t;
        }
        for (k, (i, j)) in [(0, 0), (0, 1), (1, 1)].into_iter().enumerate() {
            self.second[k] += n[i] * n[j] * nn + (n[i] * t[j] + t[i] * n[j]) * nt + t[i] * t[j] * tt;
        }
    }
}

/// Returns the inverse hyperbolic sine.
pub(crate) fn arsinh(x: f64) -> f64 {
    let size = x.abs();
    math::ln_1p(size + size * size / (1.0 + (1.0 + size * size).sqrt())).copysign(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOLID: HalfSpace = HalfSpace { youngs_modulus_pa: 3.0, poisson_ratio: 0.3 };

    /// Equilibrium inside: the divergence of the stress, by differences of exact gradients.
    #[test]
    fn the_field_is_in_equilibrium_and_leaves_the_surface_free() {
        let nu = SOLID.poisson_ratio;
        let mu = SOLID.shear_pa();
        let lambda = 2.0 * mu * nu / (1.0 - 2.0 * nu);
        let stress = |point: [f64; 3], force: usize, i: usize, j: usize| {
            let u = SOLID.field(point).displacement;
            let trace: f64 = (0..3).map(|k| u[k][force].slope[k]).sum();
            mu * (u[i][force].slope[j] + u[j][force].slope[i]) + if i == j { lambda * trace } else { 0.0 }
        };
        let (point, h) = ([0.7, -0.4, -0.9], 1.0e-4);
        for force in 0..3 {
            for i in 0..3 {
                let divergence: f64 = (0..3)
                    .map(|j| {
                        let (mut up, mut down) = (point, point);
                        up[j] += h;
                        down[j] -= h;
                        (stress(up, force, i, j) - stress(down, force, i, j)) / (2.0 * h)
                    })
                    .sum();
                // Central differences of order one stresses: h^2 times third derivatives.
                assert!(divergence.abs() < 1.0e-6, "{force} {i} {divergence}");
                assert!(stress([0.7, -0.4, 0.0], force, i, 2).abs() < 1.0e-14);
            }
        }
        // A hemisphere passes on the whole force: its traction integrates to it. Midpoints in angle and height.
        for force in 0..3 {
            let mut sum = [0.0; 3];
            let count = 200;
            for a in 0..count {
                for b in 0..count {
                    let angle = 2.0 * PI * (a as f64 + 0.5) / count as f64;
                    let height = -(b as f64 + 0.5) / count as f64;
                    let radius = (1.0 - height * height).sqrt();
                    let normal = [radius * angle.cos(), radius * angle.sin(), height];
                    let area = 2.0 * PI / (count * count) as f64;
                    for (i, total) in sum.iter_mut().enumerate() {
                        *total += area * (0..3).map(|j| stress(normal, force, i, j) * normal[j]).sum::<f64>();
                    }
                }
            }
            for (i, total) in sum.iter().enumerate() {
                let wanted = if i == force { -1.0 } else { 0.0 };
                assert!((total - wanted).abs() < 1.0e-4, "{force} {i} {total}");
            }
        }
    }

    /// A polygon is the sum of many small forces, whether the point is beside or inside.
    #[test]
    fn a_loaded_polygon_is_a_sum_of_point_forces() {
        let corners = [[-0.5, -0.3], [0.6, -0.4], [0.7, 0.5], [-0.2, 0.4]];
        for at in [[2.0, 1.0], [-0.3, 0.9], [0.1, 0.05]] {
            let count = 800;
            let mut sum = [[0.0; 3]; 3];
            for a in 0..count {
                for b in 0..count {
                    let (s, t) = ((a as f64 + 0.5) / count as f64, (b as f64 + 0.5) / count as f64);
                    let shares = [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t];
                    let load = [0, 1].map(|c| (0..4).map(|k| shares[k] * corners[k][c]).sum::<f64>());
                    let along = |c: usize| {
                        (corners[1][c] - corners[0][c]) * (1.0 - t) + (corners[2][c] - corners[3][c]) * t
                    };
                    let across = |c: usize| {
                        (corners[3][c] - corners[0][c]) * (1.0 - s) + (corners[2][c] - corners[1][c]) * s
                    };
                    let area = (along(0) * across(1) - along(1) * across(0)) / (count * count) as f64;
                    let field = SOLID.field([at[0] - load[0], at[1] - load[1], 0.0]).displacement;
                    for (row, u) in sum.iter_mut().zip(&field) {
                        row.iter_mut().zip(u).for_each(|(total, jet)| *total += area * jet.value);
                    }
                }
            }
            let closed = SOLID.polygon(&corners.map(|c| [c[0] - at[0], c[1] - at[1]]));
            for i in 0..3 {
                for j in 0..3 {
                    // The midpoint rule beside a pole is good to a thousandth of the cell's own share.
                    let error = closed[i][j] - sum[i][j];
                    assert!(error.abs() < 2.0e-3, "{at:?} {i}{j} {} {}", closed[i][j], sum[i][j]);
                }
            }
        }
    }
}
