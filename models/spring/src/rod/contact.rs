//! Contact of the coils along the whole rod.
//!
//! Where the rod is compressed to the thickness of its coils, or bent so far that the coils meet on the inner side,
//! they press on each other. The coils of a section meet at the stretch `(n d + (D/2) kappa) / L0`; a smaller stretch
//! `lambda` is resisted with the stiffness `k`. The best stretch at an axial force `N` follows in closed form, as
//! without contact, and contact adds to the energy of the rod
//!
//! ```text
//! (K/2) <e>²,     e = (n d + (D/2) kappa)/L0 - 1 - N/gamma,     1/K = 1/gamma + 1/k
//! ```
//!
//! with `<e>` for `e` where it is positive and zero elsewhere. In [`super::functional`] this term makes the relation of
//! length and force piecewise linear: [`solve`] finds the force in a few steps, most often in none.
//!
//! Derivation of the penalty: the book, chapter "The spring".

use flotor_hal::glam::{DMat3, DVec3};

use super::section::{Along, Curvatures, Load, Sections};
use crate::rigidity::Spring;

/// Axial stiffness of touching coils (N/m): the stiffest wall the device can render, 25 N/mm.
pub(crate) const STIFFNESS_N_PER_M: f64 = 25.0e3;
/// Curvature (rad per free length) below which `kappa` is rounded off: a stack of flat rings tips over its rim at a
/// threshold, where the energy has a kink.
const ROUNDING: f64 = 0.05;
/// Maximum number of steps of [`solve`]: each updates the set of touching sections, from the ends of the stretch inwards.
const MOST_STEPS: u32 = 12;

/// Choice between coils that pass through each other and coils that touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Coils {
    /// Coils pass through each other.
    Pass,
    /// Coils touch and press on each other.
    Touch,
}

/// Contact of one spring, lengths in `L0`, forces in `alpha/L0²`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Contact {
    /// `n d / L0`
    solid: f64,
    /// `D / (2 L0)`
    coil_radius: f64,
    /// `1/gamma`
    compliance: f64,
    /// `K`
    stiffness: f64,
}

impl Contact {
    /// Prepares the contact of a spring; `unit_n` is `alpha/L0²`.
    pub(crate) fn new(spring: &Spring, unit_n: f64) -> Self {
        let geometry = spring.geometry();
        let compliance = unit_n / spring.rigidities().gamma_n;
        let penalty = STIFFNESS_N_PER_M * geometry.free_length_m / unit_n;
        Self {
            solid: geometry.solid_length_m() / geometry.free_length_m,
            coil_radius: 0.5 * geometry.coil_diameter_m / geometry.free_length_m,
            compliance,
            stiffness: 1.0 / (compliance + 1.0 / penalty),
        }
    }
}

/// Set of touching sections, one bit each. A different set has a different matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Touching {
    sections: u32,
}

flotor_hal::restorable!(Touching { sections });

impl Touching {
    pub(crate) const NONE: Self = Self { sections: 0 };

    fn add(&mut self, section: usize) {
        self.sections |= 1 << section;
    }
}

/// Excess `e` of a section, with its derivatives.
struct Excess {
    /// `e`
    value: f64,
    /// Derivatives with respect to `p` and `p'`.
    by_lean: [f64; 2],
    by_rate: [f64; 2],
    /// Second derivatives of the rounded `kappa` times the coil radius.
    bend: Bend,
}

/// Second derivatives of `(D/2) kappa`, rounded off at zero.
struct Bend {
    by_lean_twice: [[f64; 2]; 2],
    by_lean_and_rate: [[f64; 2]; 2],
    by_rate_twice: [[f64; 2]; 2],
}

/// Solution of [`solve`]: contact force that closes the length constraint, with compliance, energy and touching
/// sections; dimensionless.
pub(crate) struct Solution {
    pub(crate) force: DVec3,
    /// Derivative of the missing length with respect to the force.
    pub(crate) compliance: DMat3,
    /// `(K/2) <e>²`, summed.
    pub(crate) energy: f64,
    /// Sections that touch.
    pub(crate) touching: Touching,
}

/// Solves `missing = compliance force + (K/gamma) sum of <e> d` for the force, starting from the force without contact.
/// Real-time: bounded, no allocation.
pub(crate) fn solve<const Q: usize>(
    contact: &Contact,
    sections: &Sections<Q>,
    weight: &Along<Q>,
    free: DVec3,
    missing: DVec3,
    compliance: DMat3,
) -> Solution {
    let Contact { compliance: c, stiffness, .. } = *contact;
    let mut solution = Solution { force: free, compliance, energy: 0.0, touching: Touching::NONE };
    for _ in 0..MOST_STEPS {
        // Sums over the sections that touch: (K/gamma) <e> d, its derivative with respect to the force, and (K/2) <e>².
        let (mut pressed, mut released, mut energy) = (DVec3::ZERO, DMat3::ZERO, 0.0);
        let mut touching = Touching::NONE;
        for (i, weight) in weight.iter().enumerate() {
            let excess = sections.excess(contact, solution.force, i);
            if excess > 0.0 {
                touching.add(i);
                let normal = sections.normal_at(i);
                let share = weight * stiffness;
                pressed += share * c * excess * normal;
                released += DMat3::from_cols(normal * normal.x, normal * normal.y, normal * normal.z)
                    * (share * c * c);
                energy += 0.5 * share * excess * excess;
            }
        }
        solution = Solution { compliance: compliance - released, energy, touching, ..solution };
        let rest = missing - compliance * solution.force - pressed;
        let step = solution.compliance.inverse() * rest;
        // Converged to rounding of the force.
        if touching == Touching::NONE
            || step.length_squared() <= 1e-30 * (1.0 + solution.force.length_squared())
        {
            break;
        }
        solution.force += step;
    }
    solution
}

impl<const Q: usize> Sections<Q> {
    fn normal_at(&self, i: usize) -> DVec3 {
        DVec3::new(self.normal[0][i], self.normal[1][i], self.normal[2][i])
    }

    /// Returns `e` of a section.
    fn excess(&self, contact: &Contact, force: DVec3, i: usize) -> f64 {
        let square =
            self.lean_rate[0][i] * self.lean_rate[0][i] + self.lean_rate[1][i] * self.lean_rate[1][i];
        let scale = self.scale[i];
        // `kappa` rounded at zero, then `e` of the module documentation.
        let bend = (scale * scale * square + ROUNDING * ROUNDING).sqrt() - ROUNDING;
        contact.solid + contact.coil_radius * bend - 1.0 - contact.compliance * force.dot(self.normal_at(i))
    }

    /// Returns `e` of a section with its derivatives; `slope`: derivatives of `n.d` with respect to `p`.
    fn excess_slopes(&self, contact: &Contact, load: &Load, slope: [f64; 2], i: usize) -> Excess {
        let p = [self.lean[0][i], self.lean[1][i]];
        let rate = [self.lean_rate[0][i], self.lean_rate[1][i]];
        let (w, square) = (self.scale[i], rate[0] * rate[0] + rate[1] * rate[1]);
        let (w2, w3) = (w * w, w * w * w);
        // Derivatives of the rounded `kappa` with respect to the lean `p` and its rate.
        let root = (w2 * square + ROUNDING * ROUNDING).sqrt();
        let r = contact.coil_radius;
        // Derivatives of the square of kappa, w² p'².
        let square_by_lean = p.map(|p| -2.0 * w3 * square * p);
        let square_by_rate = rate.map(|rate| 2.0 * w2 * rate);
        let curved = |twice: f64, a: f64, b: f64| r * (0.5 * twice - 0.25 * a * b / (root * root)) / root;
        let (mut by_lean_twice, mut by_lean_and_rate, mut by_rate_twice) =
            ([[0.0; 2]; 2], [[0.0; 2]; 2], [[0.0; 2]; 2]);
        for a in 0..2 {
            for b in 0..2 {
                let same = if a == b { 1.0 } else { 0.0 };
                by_lean_twice[a][b] = curved(
                    square * (6.0 * w2 * w2 * p[a] * p[b] - 2.0 * w3 * same),
                    square_by_lean[a],
                    square_by_lean[b],
                );
                by_lean_and_rate[a][b] =
                    curved(-4.0 * w3 * p[a] * rate[b], square_by_lean[a], square_by_rate[b]);
                by_rate_twice[a][b] = curved(2.0 * w2 * same, square_by_rate[a], square_by_rate[b]);
            }
        }
        Excess {
            value: self.excess(contact, load.force, i),
            by_lean: [0, 1].map(|a| 0.5 * r * square_by_lean[a] / root - contact.compliance * slope[a]),
            by_rate: square_by_rate.map(|by_rate| 0.5 * r * by_rate / root),
            bend: Bend { by_lean_twice, by_lean_and_rate, by_rate_twice },
        }
    }

    /// Adds the derivatives of `(K/2) <e>²` with respect to `p` and `p'`, times the weight.
    pub(crate) fn add_contact_slopes(
        &self,
        contact: &Contact,
        load: &Load,
        weight: &Along<Q>,
        [by_lean, by_rate]: &mut [[Along<Q>; 2]; 2],
    ) {
        for (i, weight) in weight.iter().enumerate() {
            let slope = self.potential(load, i).slope;
            let excess = self.excess_slopes(contact, load, slope, i);
            if excess.value > 0.0 {
                let pressure = weight * contact.stiffness * excess.value;
                for a in 0..2 {
                    by_lean[a][i] += pressure * excess.by_lean[a];
                    by_rate[a][i] += pressure * excess.by_rate[a];
                }
            }
        }
    }

    /// Adds the second derivatives of `(K/2) <e>²`, and the derivatives of the length that contact contributes.
    pub(crate) fn add_contact_curvatures(
        &self,
        contact: &Contact,
        load: &Load,
        weight: &Along<Q>,
        all: &mut Curvatures<Q>,
    ) {
        let Contact { compliance, stiffness, .. } = *contact;
        for (i, weight) in weight.iter().enumerate() {
            let potential = self.potential(load, i);
            let excess = self.excess_slopes(contact, load, potential.slope, i);
            if excess.value <= 0.0 {
                continue;
            }
            // Second derivatives of (K/2) <e>²: K times the product of the slopes, and K e times the curvatures.
            let share = weight * stiffness;
            let pressure = share * excess.value;
            let (x, by) = (&excess.bend, [excess.by_lean, excess.by_rate]);
            let normal = self.normal_at(i).to_array();
            for a in 0..2 {
                for b in 0..2 {
                    let level = self.level_curvature(load, &potential, a, b, i);
                    all.by_lean_twice[a][b][i] +=
                        share * by[0][a] * by[0][b] + pressure * (x.by_lean_twice[a][b] - compliance * level);
                    all.by_lean_and_rate[a][b][i] +=
                        share * by[0][a] * by[1][b] + pressure * x.by_lean_and_rate[a][b];
                    all.by_rate_twice[a][b][i] +=
                        share * by[1][a] * by[1][b] + pressure * x.by_rate_twice[a][b];
                }
                for (axis, component) in normal.iter().enumerate() {
                    let turned = self.normal_slope(axis, a, i);
                    all.strain_by_lean[axis][a][i] +=
                        compliance * (share * by[0][a] * component + pressure * turned);
                    all.strain_by_rate[axis][a][i] += compliance * share * by[1][a] * component;
                }
            }
        }
    }

    /// Returns the stretch by which touching coils make a section longer than its force alone would.
    pub(crate) fn pressed(&self, contact: &Contact, load: &Load, i: usize) -> f64 {
        contact.stiffness * contact.compliance * self.excess(contact, load.force, i).max(0.0)
    }
}
