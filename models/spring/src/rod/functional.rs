//! Energy of the rod at given plates, as a function of a few coefficients.
//!
//! The shape of the rod is the direction of its sections, a polynomial in stereographic coordinates
//! ([`flotor_lanes::basis`]). Stretch, shear and twist need no unknowns of their own: for given directions their
//! energy is a quadratic, and the best of them is in closed form,
//!
//! ```text
//! W = integral of w² p'²/2 + (tau/2) Phi² + b.n/2,     n = A⁻¹ b,
//! Phi = psi - integral of w (p x p'),                  twist to be distributed
//! b = chord - integral of d,                           length to be made up by stretch and shear
//! A = 1/beta + delta integral of d dᵀ                  compliance to it
//! ```
//!
//! (lengths in `L0`, energies in `alpha/L0`). An equilibrium is a stationary point of `W`, a stable one a
//! minimum: the eliminated parts are minima always, so the negative eigenvalues of the matrix of `W` are
//! those of the whole rod. Force and torque on the plates are the derivatives of `W` at held coefficients
//! (envelope theorem), exact derivatives of the minimised `W` at any order of the polynomial, and their error
//! is the square of the shape's.

use std::f64::consts::PI;

use flotor_hal::glam::{DMat3, DVec2, DVec3};

use super::contact::{self, Coils, Contact, Touching};
use super::plate::Plate;
use super::section::{Along, Curvatures, Load, Sections};
use crate::rigidity::Spring;
use flotor_lanes::basis::Basis;
use flotor_lanes::matrix::dot;

/// Coefficients of the bubbles: first those of `p_x`, then those of `p_y`; `N = 2 K`.
pub(crate) type Shape<const N: usize> = [f64; N];

/// Dimensionless shear compliance, softening and torsional rigidity of a rod, relative to the bending rigidity `alpha` and the free
/// length `L0`, with the contact of its coils.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ratios {
    /// `alpha / (beta L0²)`
    pub(super) shear_compliance: f64,
    /// `(1/gamma - 1/beta) alpha / L0²`
    pub(super) softening: f64,
    /// `tau / alpha`
    pub(super) torsion: f64,
    /// Contact of the coils; `None` for coils that pass through each other.
    pub(super) contact: Option<Contact>,
}

impl Ratios {
    pub(crate) fn new(spring: &Spring, coils: Coils) -> Self {
        let rigidities = spring.rigidities();
        let free_length_m = spring.geometry().free_length_m;
        let unit_n = rigidities.alpha_n_m2 / (free_length_m * free_length_m);
        Self {
            shear_compliance: unit_n / rigidities.beta_n,
            softening: unit_n / rigidities.gamma_n - unit_n / rigidities.beta_n,
            torsion: rigidities.tau_n_m2 / rigidities.alpha_n_m2,
            contact: match coils {
                Coils::Pass => None,
                Coils::Touch => Some(Contact::new(spring, unit_n)),
            },
        }
    }
}

/// Energy with `K` bubbles in each direction, summed at `Q` stations.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Functional<const K: usize, const N: usize, const Q: usize> {
    /// Polynomial basis of the shapes.
    pub(crate) basis: Basis<K, Q>,
    pub(super) ratios: Ratios,
}

/// Energy of a shape between plates and its first derivatives.
pub(crate) struct Value<const N: usize, const Q: usize> {
    pub(crate) energy: f64,
    /// Derivatives with respect to the coefficients.
    pub(crate) slope: Shape<N>,
    /// Derivatives with respect to the lean of the upper plate.
    pub(crate) by_lean: DVec2,
    /// Load of the sections; its force and torsion are the derivatives with respect to displacement and turn of the upper plate.
    pub(crate) load: Load,
    compliance: DMat3,
    /// Set of touching sections.
    pub(crate) touching: Touching,
    contact: Option<Contact>,
    sections: Sections<Q>,
}

/// Energy and its derivatives with respect to the pose of the plate, in units of the bending rigidity and the free
/// length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reading {
    pub(crate) energy: f64,
    /// Derivative of the energy with respect to the displacement of the upper plate.
    pub(crate) force: DVec3,
    /// Derivative with respect to the lean of the plate.
    pub(crate) by_lean: DVec2,
    /// Derivative with respect to the turn of the plate.
    pub(crate) torsion: f64,
}

/// Second derivatives of the energy.
pub(crate) struct Curvature<const N: usize> {
    /// Second derivatives with respect to the coefficients.
    pub(crate) matrix: [[f64; N]; N],
    /// Derivatives of the reaction on the plate with respect to the coefficients.
    pub(crate) reaction: Reaction<N>,
}

/// Derivatives of the reaction on the plate with respect to each coefficient, at a fixed plate.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Reaction<const N: usize> {
    pub(crate) force: [[f64; N]; 3],
    pub(crate) by_lean: [[f64; N]; 2],
    pub(crate) torsion: [f64; N],
}

flotor_hal::restorable!([const N: usize] Reaction<N> { force, by_lean, torsion });

impl<const K: usize, const N: usize, const Q: usize> Functional<K, N, Q> {
    const TWO_COMPONENTS: () = assert!(N == 2 * K);

    pub(crate) fn new(ratios: Ratios) -> Self {
        let () = Self::TWO_COMPONENTS;
        Self { basis: Basis::default(), ratios }
    }

    /// Sets the rigidity ratios of the rod. Real-time: bounded, no allocation.
    pub(crate) fn set_ratios(&mut self, ratios: Ratios) {
        self.ratios = ratios;
    }

    /// Returns an upper estimate of the fall of the matrix's eigenvalues as plate and shape move by these distances.
    ///
    /// The lowest eigenvalue of the straight rod falls from 4 to 0 over the compression `4 pi² alpha/(gamma
    /// L0²)` at which it buckles; twice that slope covers other shapes.
    pub(crate) fn eigenvalue_fall(&self, plate_moved: f64, shape_moved: f64) -> f64 {
        let axial_compliance = self.ratios.shear_compliance + self.ratios.softening;
        2.0 * plate_moved / (PI * PI * axial_compliance) + 4.0 * shape_moved
    }

    /// Returns the energy of a shape between plates, with load and first derivatives. Real-time: bounded, no allocation.
    #[inline(always)]
    pub(crate) fn value(&self, shape: &Shape<N>, plate: &Plate) -> Value<N, Q> {
        let sections = self.sections(shape, plate);
        let integrals = sections.integrate(&self.basis.weight);
        let Ratios { shear_compliance, softening, torsion, contact } = self.ratios;
        let mut compliance =
            DMat3::from_diagonal(DVec3::splat(shear_compliance)) + softening * integrals.second;
        let missing = plate.displacement - integrals.lean;
        let twist_rad = plate.turn_rad - integrals.winding_rad;
        let mut force = solve_symmetric(&compliance, missing);
        let mut stretching = 0.5 * missing.dot(force);
        let (mut touching, mut touched) = (Touching::NONE, None);
        if let Some(contact) = &contact {
            let solved = contact::solve(contact, &sections, &self.basis.weight, force, missing, compliance);
            if solved.touching != Touching::NONE {
                force = solved.force;
                stretching = missing.dot(force) - 0.5 * force.dot(compliance * force) + solved.energy;
                compliance = solved.compliance;
                (touching, touched) = (solved.touching, Some(*contact));
            }
        }
        let load = Load { force, torsion: torsion * twist_rad, softening };
        let mut slopes = sections.slopes(&load, &self.basis.weight);
        if let Some(contact) = &touched {
            sections.add_contact_slopes(contact, &load, &self.basis.weight, &mut slopes);
        }
        let [by_lean, by_rate] = slopes;
        let slope =
            joined(&self.projected(&by_lean[0], &by_rate[0]), &self.projected(&by_lean[1], &by_rate[1]));
        let mut by_end = [0.0; 2];
        for (by_end, (by_lean, by_rate)) in by_end.iter_mut().zip(by_lean.iter().zip(&by_rate)) {
            *by_end = dot(&self.basis.station, by_lean) + by_rate.iter().sum::<f64>();
        }
        Value {
            energy: integrals.bending + 0.5 * load.torsion * twist_rad + stretching,
            slope,
            by_lean: DVec2::from_array(by_end),
            load,
            compliance,
            touching,
            contact: touched,
            sections,
        }
    }

    /// Returns the energy with the reaction on the plate, and the slope. Real-time: bounded, no allocation.
    #[inline(always)]
    pub(crate) fn reading(&self, shape: &Shape<N>, plate: &Plate) -> (Reading, Shape<N>) {
        let Value { energy, slope, by_lean, load, .. } = self.value(shape, plate);
        (Reading { energy, force: load.force, by_lean, torsion: load.torsion }, slope)
    }

    #[inline(always)]
    fn sections(&self, shape: &Shape<N>, plate: &Plate) -> Sections<Q> {
        let (mut lean, mut rate) = ([[0.0; Q]; 2], [[0.0; Q]; 2]);
        let (x, y) = shape.split_at(K);
        for (c, (coefficients, end)) in [(x, plate.lean.x), (y, plate.lean.y)].into_iter().enumerate() {
            add_products(&mut lean[c], &self.basis.station, end);
            rate[c] = [end; Q];
            for (k, coefficient) in coefficients.iter().enumerate() {
                add_products(&mut lean[c], &self.basis.bubble[k], *coefficient);
                add_products(&mut rate[c], &self.basis.slope[k], *coefficient);
            }
        }
        Sections::new(lean, rate)
    }

    /// Returns the second derivatives at a shape. Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn curvature(&self, value: &Value<N, Q>) -> Curvature<N> {
        let mut local = value.sections.curvatures(&value.load, &self.basis.weight);
        if let Some(contact) = &value.contact {
            value.sections.add_contact_curvatures(contact, &value.load, &self.basis.weight, &mut local);
        }
        let mut matrix = [[0.0; N]; N];
        let mut reaction = Reaction { force: [[0.0; N]; 3], by_lean: [[0.0; N]; 2], torsion: [0.0; N] };
        let mut strain = [[0.0; N]; 3];
        let mut strain_by_end = [DVec3::ZERO; 2];
        let mut winding_by_end = [0.0; 2];
        for c in 0..2 {
            for k in 0..K {
                matrix[c * K + k] = self.row(&local, c, &self.basis.bubble[k], &self.basis.slope[k]);
                for (axis, strain) in strain.iter_mut().enumerate() {
                    strain[c * K + k] = dot(&self.basis.bubble[k], &local.strain_by_lean[axis][c]);
                    if value.contact.is_some() {
                        strain[c * K + k] += dot(&self.basis.slope[k], &local.strain_by_rate[axis][c]);
                    }
                }
                // The twist is the turn less the winding.
                reaction.torsion[c * K + k] = -(dot(&self.basis.bubble[k], &local.winding_by_lean[c])
                    + dot(&self.basis.slope[k], &local.winding_by_rate[c]));
            }
            reaction.by_lean[c] = self.row(&local, c, &self.basis.station, &[1.0; Q]);
            strain_by_end[c] = DVec3::from_array([0, 1, 2].map(|r| {
                let by_rate: f64 = local.strain_by_rate[r][c].iter().sum();
                dot(&self.basis.station, &local.strain_by_lean[r][c]) + by_rate
            }));
            winding_by_end[c] = -(dot(&self.basis.station, &local.winding_by_lean[c])
                + local.winding_by_rate[c].iter().sum::<f64>());
        }
        let stiffness = value.compliance.inverse();
        for j in 0..N {
            let strain = DVec3::new(strain[0][j], strain[1][j], strain[2][j]);
            let force = stiffness * strain;
            reaction.force[0][j] = -force.x;
            reaction.force[1][j] = -force.y;
            reaction.force[2][j] = -force.z;
            for c in 0..2 {
                reaction.by_lean[c][j] += strain_by_end[c].dot(force)
                    + self.ratios.torsion * winding_by_end[c] * reaction.torsion[j];
            }
        }
        let [force_x, force_y, force_z] = &reaction.force;
        for (i, row) in matrix.iter_mut().enumerate() {
            let [sx, sy, sz] = [0, 1, 2].map(|r| strain[r][i]);
            let twist = self.ratios.torsion * reaction.torsion[i];
            for (j, entry) in row.iter_mut().enumerate() {
                *entry += twist * reaction.torsion[j] - (sx * force_x[j] + sy * force_y[j] + sz * force_z[j]);
            }
        }
        reaction.torsion = reaction.torsion.map(|winding| self.ratios.torsion * winding);
        Curvature { matrix, reaction }
    }

    /// Returns a row of the local part of the matrix: component `c` of a field against all bubbles of both components.
    #[inline]
    fn row(&self, local: &Curvatures<Q>, c: usize, field: &Along<Q>, rate: &Along<Q>) -> [f64; N] {
        let mut parts = [[0.0; K]; 2];
        for (e, part) in parts.iter_mut().enumerate() {
            let (mut by_lean, mut by_rate) = ([0.0; Q], [0.0; Q]);
            for i in 0..Q {
                // The derivative with respect to p_e and p'_c is that with respect to p'_c and p_e.
                by_lean[i] =
                    field[i] * local.by_lean_twice[c][e][i] + rate[i] * local.by_lean_and_rate[e][c][i];
                by_rate[i] =
                    field[i] * local.by_lean_and_rate[c][e][i] + rate[i] * local.by_rate_twice[c][e][i];
            }
            *part = self.projected(&by_lean, &by_rate);
        }
        joined(&parts[0], &parts[1])
    }

    /// Returns sums over the stations of a field times each bubble and another field times the bubble's slope.
    #[inline(always)]
    fn projected(&self, by_lean: &Along<Q>, by_rate: &Along<Q>) -> [f64; K] {
        let mut sums = [0.0; K];
        for i in 0..Q {
            add_products(&mut sums, &self.basis.bubble_at[i], by_lean[i]);
            add_products(&mut sums, &self.basis.slope_at[i], by_rate[i]);
        }
        sums
    }
}

/// Adds `factor * vector` to `sum`.
#[inline(always)]
fn add_products<const M: usize>(sum: &mut [f64; M], vector: &[f64; M], factor: f64) {
    for i in 0..M {
        sum[i] += factor * vector[i];
    }
}

/// Concatenates the coefficients of both components.
#[inline(always)]
pub(super) fn joined<const K: usize, const N: usize>(x: &[f64; K], y: &[f64; K]) -> Shape<N> {
    let mut shape = [0.0; N];
    for (entry, value) in shape.iter_mut().zip(x.iter().chain(y)) {
        *entry = *value;
    }
    shape
}

/// Solves a definite 3x3 system by cofactors.
#[inline(always)]
pub(super) fn solve_symmetric(matrix: &DMat3, right: DVec3) -> DVec3 {
    let (a, b, c) = (matrix.x_axis, matrix.y_axis, matrix.z_axis);
    // The rows of the inverse are the cross products of the columns over the determinant.
    let (bc, ca, ab) = (b.cross(c), c.cross(a), a.cross(b));
    DVec3::new(bc.dot(right), ca.dot(right), ab.dot(right)) / a.dot(bc)
}
