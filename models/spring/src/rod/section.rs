//! Energy density of a section, in stereographic coordinates, and its derivatives.
//!
//! With `p` the coordinates of the section's normal `d` ([`super::plate`]), `p'` its change per scaled arc
//! length and `w = 2/(1+p²)`, everything is rational:
//!
//! ```text
//! d = (w p, 1 - w p²)          normal
//! |d'|²/2 = w² p'²/2           bending energy, in units of alpha/L0
//! w (p x p')                   rate at which the shortest turn to d winds about d
//! ```
//!
//! Internal force `n` and torsional moment `T` are the same in every section, and for fixed `n` and `T` the rod's
//! equilibrium is a stationary point of the sum over
//!
//! ```text
//! l(p, p') = w² p'²/2 - T w (p x p') - n.d - delta (n.d)²/2,   delta = 1/gamma - 1/beta,
//! ```
//!
//! the Lagrange top of Kirchhoff's analogy, with a quadratic potential from shear and compression.
//! Derivation: the book, chapter "The spring".

use flotor_hal::glam::{DMat3, DVec3};

use flotor_lanes::matrix::dot;

/// Array of one number per section, for `Q` sections.
pub(crate) type Along<const Q: usize> = [f64; Q];

/// Unit antisymmetric matrix, of the area that `p_c` and `p'_e` span.
const TURN: [[f64; 2]; 2] = [[0.0, 1.0], [-1.0, 0.0]];

/// Normals of the sections and their rates, with derived quantities of the energy.
#[derive(Clone, Debug)]
pub(crate) struct Sections<const Q: usize> {
    pub(crate) lean: [Along<Q>; 2],
    pub(crate) lean_rate: [Along<Q>; 2],
    /// `w`
    pub(crate) scale: Along<Q>,
    /// `d`
    pub(crate) normal: [Along<Q>; 3],
    /// `p x p'`
    area_rate: Along<Q>,
}

/// Integrals over the rod.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Integrals {
    /// Bending energy.
    pub(crate) bending: f64,
    /// Winding about the normal (rad).
    pub(crate) winding_rad: f64,
    /// Integral of `d - z`.
    pub(crate) lean: DVec3,
    /// Integral of `d dᵀ`.
    pub(crate) second: DMat3,
}

/// Load common to all sections of a rod in equilibrium, in units of `alpha/L0²` and `alpha/L0`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Load {
    /// Force of the upper on the lower part of the rod, `n`.
    pub(crate) force: DVec3,
    /// Torsional moment, `T`.
    pub(crate) torsion: f64,
    /// `delta` in units of `L0²/alpha`.
    pub(crate) softening: f64,
}

impl<const Q: usize> Sections<Q> {
    #[inline(always)]
    pub(crate) fn new(lean: [Along<Q>; 2], lean_rate: [Along<Q>; 2]) -> Self {
        let ([x, y], [dx, dy]) = (&lean, &lean_rate);
        let (mut scale, mut normal, mut area_rate) = ([0.0; Q], [[0.0; Q]; 3], [0.0; Q]);
        for i in 0..Q {
            // Stereographic projection: w = 2 / (1 + p²), normal (w p, 1 - w p²), and the rate of the area p sweeps.
            let square = x[i] * x[i] + y[i] * y[i];
            let w = 2.0 / (1.0 + square);
            scale[i] = w;
            normal[0][i] = w * x[i];
            normal[1][i] = w * y[i];
            normal[2][i] = 1.0 - w * square;
            area_rate[i] = x[i] * dy[i] - y[i] * dx[i];
        }
        Self { lean, lean_rate, scale, normal, area_rate }
    }

    #[inline(always)]
    pub(crate) fn integrate(&self, weight: &Along<Q>) -> Integrals {
        let (w, [dx, dy], [nx, ny, nz]) = (&self.scale, &self.lean_rate, &self.normal);
        let [mut bending, mut winding, mut drop] = [[0.0; Q]; 3];
        let mut weighted = [[0.0; Q]; 3];
        for i in 0..Q {
            bending[i] = 0.5 * (w[i] * w[i]) * (dx[i] * dx[i] + dy[i] * dy[i]);
            winding[i] = w[i] * self.area_rate[i];
            // d_z - 1 without cancellation near the vertical.
            drop[i] = -(nx[i] * self.lean[0][i] + ny[i] * self.lean[1][i]);
            weighted[0][i] = weight[i] * nx[i];
            weighted[1][i] = weight[i] * ny[i];
            weighted[2][i] = weight[i] * nz[i];
        }
        let [xx, xy, xz] = [nx, ny, nz].map(|n| dot(&weighted[0], n));
        let [yy, yz] = [ny, nz].map(|n| dot(&weighted[1], n));
        let zz = dot(&weighted[2], nz);
        Integrals {
            bending: dot(weight, &bending),
            winding_rad: dot(weight, &winding),
            lean: DVec3::new(dot(weight, nx), dot(weight, ny), dot(weight, &drop)),
            second: DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]),
        }
    }

    /// Returns the first derivatives of `l` with respect to `p` and `p'`, each times the weight.
    #[inline(always)]
    pub(crate) fn slopes(&self, load: &Load, weight: &Along<Q>) -> [[Along<Q>; 2]; 2] {
        let ([x, y], [dx, dy]) = (&self.lean, &self.lean_rate);
        let mut by_lean = [[0.0; Q]; 2];
        let mut by_rate = [[0.0; Q]; 2];
        for i in 0..Q {
            let (w, a) = (self.scale[i], weight[i]);
            let Potential { slope, stress, .. } = self.potential(load, i);
            // Component along p: of the bending energy, and of the winding.
            let along = w * w * (self.area_rate[i] * load.torsion - w * (dx[i] * dx[i] + dy[i] * dy[i]));
            let twist = load.torsion * w;
            by_lean[0][i] = a * (along * x[i] - twist * dy[i] - stress * slope[0]);
            by_lean[1][i] = a * (along * y[i] + twist * dx[i] - stress * slope[1]);
            by_rate[0][i] = a * (w * w * dx[i] + twist * y[i]);
            by_rate[1][i] = a * (w * w * dy[i] - twist * x[i]);
        }
        [by_lean, by_rate]
    }

    /// Returns the second derivative of `n.d` with respect to `p`.
    #[inline]
    pub(crate) fn level_curvature(
        &self,
        load: &Load,
        potential: &Potential,
        c: usize,
        e: usize,
        i: usize,
    ) -> f64 {
        let (p, force) = ([self.lean[0][i], self.lean[1][i]], [load.force.x, load.force.y]);
        // Second derivatives of n.d = w (n.(p, 1)) - n_z with respect to p_c and p_e, with dw/dp = -w² p.
        let w2 = self.scale[i] * self.scale[i];
        let same = if c == e { 1.0 } else { 0.0 };
        let scale_curvature = 2.0 * w2 * self.scale[i] * p[c] * p[e] - same * w2;
        -w2 * (force[c] * p[e] + p[c] * force[e]) + potential.level * scale_curvature
    }

    /// Returns the derivative of component `axis` of `d` with respect to `p_c`.
    #[inline]
    pub(crate) fn normal_slope(&self, axis: usize, c: usize, i: usize) -> f64 {
        let (w, p) = (self.scale[i], [self.lean[0][i], self.lean[1][i]]);
        let scale_slope = -w * w * p[c];
        match axis {
            2 => scale_slope,
            _ => p[axis] * scale_slope + if axis == c { w } else { 0.0 },
        }
    }

    /// Returns `n.d`, its derivative with respect to `p`, and `1 + delta n.d`.
    #[inline(always)]
    pub(crate) fn potential(&self, load: &Load, i: usize) -> Potential {
        let (x, y, w, n) = (self.lean[0][i], self.lean[1][i], self.scale[i], load.force);
        let level = n.x * x + n.y * y + n.z;
        let value = w * level - n.z;
        Potential {
            level,
            slope: [w * (n.x - level * w * x), w * (n.y - level * w * y)],
            stress: 1.0 + load.softening * value,
        }
    }

    /// Returns the second derivatives of `l` and of the integrals that determine the load, each times the weight.
    #[inline]
    pub(crate) fn curvatures(&self, load: &Load, weight: &Along<Q>) -> Curvatures<Q> {
        let mut all = Curvatures {
            by_lean_twice: [[[0.0; Q]; 2]; 2],
            by_lean_and_rate: [[[0.0; Q]; 2]; 2],
            by_rate_twice: [[[0.0; Q]; 2]; 2],
            strain_by_lean: [[[0.0; Q]; 2]; 3],
            strain_by_rate: [[[0.0; Q]; 2]; 3],
            winding_by_lean: [[0.0; Q]; 2],
            winding_by_rate: [[0.0; Q]; 2],
        };
        for (i, &a) in weight.iter().enumerate() {
            let (p, rate) =
                ([self.lean[0][i], self.lean[1][i]], [self.lean_rate[0][i], self.lean_rate[1][i]]);
            let (w, area, t) = (self.scale[i], self.area_rate[i], load.torsion);
            let rate_squared = rate[0] * rate[0] + rate[1] * rate[1];
            let potential = self.potential(load, i);
            let Potential { slope, stress, .. } = potential;
            let (w2, w3) = (w * w, w * w * w);
            let scale_slope = [-w2 * p[0], -w2 * p[1]];
            // Derivatives of p x p' with respect to p and p'.
            let (area_by_lean, area_by_rate) = ([rate[1], -rate[0]], [-p[1], p[0]]);
            for c in 0..2 {
                for e in 0..2 {
                    let same = if c == e { 1.0 } else { 0.0 };
                    let scale_curvature = 2.0 * w3 * p[c] * p[e] - same * w2;
                    let bending = rate_squared * (3.0 * w2 * w2 * p[c] * p[e] - same * w3);
                    let winding = area_by_lean[c] * scale_slope[e]
                        + scale_slope[c] * area_by_lean[e]
                        + area * scale_curvature;
                    let height = self.level_curvature(load, &potential, c, e, i);
                    all.by_lean_twice[c][e][i] =
                        a * (bending - t * winding - stress * height - load.softening * slope[c] * slope[e]);
                    all.by_lean_and_rate[c][e][i] = a
                        * (-2.0 * w3 * p[c] * rate[e]
                            - t * (scale_slope[c] * area_by_rate[e] + w * TURN[c][e]));
                }
                all.winding_by_lean[c][i] = a * (w * area_by_lean[c] + area * scale_slope[c]);
                all.winding_by_rate[c][i] = a * (w * area_by_rate[c]);
                for (r, strain) in all.strain_by_lean.iter_mut().enumerate() {
                    let stretch = load.softening * self.normal[r][i] * slope[c];
                    strain[c][i] = a * (stress * self.normal_slope(r, c, i) + stretch);
                }
            }
            for c in 0..2 {
                all.by_rate_twice[c][c][i] = a * w2;
            }
        }
        all
    }
}

pub(crate) struct Potential {
    /// `n.d = w level - n_z`
    level: f64,
    pub(crate) slope: [f64; 2],
    stress: f64,
}

/// Second derivatives; the first index belongs to `p`, in `strain_by_lean` to the axis.
pub(crate) struct Curvatures<const Q: usize> {
    pub(crate) by_lean_twice: [[Along<Q>; 2]; 2],
    pub(crate) by_lean_and_rate: [[Along<Q>; 2]; 2],
    pub(crate) by_rate_twice: [[Along<Q>; 2]; 2],
    /// Derivatives of `d + delta (n.d) d`, the centreline's direction, at fixed force.
    pub(crate) strain_by_lean: [[Along<Q>; 2]; 3],
    pub(crate) strain_by_rate: [[Along<Q>; 2]; 3],
    pub(crate) winding_by_lean: [Along<Q>; 2],
    pub(crate) winding_by_rate: [Along<Q>; 2],
}
