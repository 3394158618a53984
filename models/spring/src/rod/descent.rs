//! Quasi-Newton search for the equilibrium of a pose without a history.
//!
//! Short of buckling the rod has one equilibrium, and the straight column along the chord is close to it ([`super::column`]). The
//! second derivatives of the column are known. A quasi-Newton method (BFGS) starts from these and takes the effect of the angles
//! from the slopes: each step adds a matrix of rank two to the inverse of the curvature. This matrix is stored as two vectors, so
//! that all products with a slope can be formed at once, whereas the two loops of L-BFGS form one product after the other. Each
//! step needs one evaluation of the energy ([`super::search_energy`]); seven to ten steps reach the equilibrium.
//!
//! Source: Nocedal and Wright, *Numerical Optimization*, 6.1 (BFGS).

use pulp::{Scalar256b, Simd, WithSimd};

use super::column::{Column, Products};
use super::functional::{Ratios, Reading, Shape};
use super::plate::Plate;
use super::search_energy::{COEFFICIENTS, FOURS, Four, Fours, SearchEnergy, dot, four, in_order, numbers};

/// Maximum number of energies per search; Newton's method continues a longer search.
const MOST_ENERGIES: usize = 24;
/// Maximum size of the last step, and of the error after it: about the square of the step over the step before.
const LAST_STEP: f64 = 1e-8;
const LEFT: f64 = 1.5e-10;
/// Longest step, as the root mean square slope of `p`.
const LONGEST_STEP: f64 = 0.8;

/// Energy, and the updates of a search; stored from search to search to reuse the memory only.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Descent {
    energy: SearchEnergy,
    products: Products,
    updates: [Update; MOST_ENERGIES],
}

/// Update of the inverse of the curvature by a step: `-weight (step otherᵀ + other stepᵀ)`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Update {
    step: [Four; FOURS],
    other: [Four; FOURS],
    weight: f64,
}

/// Equilibrium found, with the number of energies evaluated.
pub(crate) struct Found<const N: usize> {
    pub(crate) shape: Shape<N>,
    pub(crate) reading: Reading,
    pub(crate) energies: u32,
}

/// Search, compiled for several instruction sets.
struct Search<'a> {
    descent: &'a mut Descent,
    ratios: &'a Ratios,
    plate: &'a Plate,
}

impl WithSimd for Search<'_> {
    type Output = Option<Found<COEFFICIENTS>>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Option<Found<COEFFICIENTS>> {
        self.descent.search(simd, self.ratios, self.plate)
    }
}

impl Descent {
    pub(crate) fn new() -> Self {
        Self {
            energy: SearchEnergy::new(),
            products: Products::new(),
            updates: [Update { step: [[0.0; 4]; FOURS], other: [[0.0; 4]; FOURS], weight: 0.0 };
                MOST_ENERGIES],
        }
    }

    /// Finds the equilibrium between plates, a function of their pose; `None` if a rod may have buckled or the search
    /// does not converge. The bits are the same on every instruction set: always four sums at a time, and no product is
    /// fused with a sum. Real-time: bounded, no allocation.
    pub(crate) fn find(&mut self, ratios: &Ratios, plate: &Plate) -> Option<Found<COEFFICIENTS>> {
        let search = Search { descent: self, ratios, plate };
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = pulp::x86::V3::try_new() {
            return Simd::vectorize(avx2, search);
        }
        search.with_simd(Scalar256b)
    }

    #[inline(always)]
    fn search<S: Simd>(&mut self, simd: S, ratios: &Ratios, plate: &Plate) -> Option<Found<COEFFICIENTS>> {
        let (column, mut shape) = self.products.column(simd, ratios, plate);
        if column.is_buckled {
            return None;
        }
        let mut slope = self.slope(simd, ratios, &shape, plate);
        // A whole step is `-down`.
        let mut down = column.solve(&slope);
        let (mut known, mut square_before) = (0, 0.0);
        for energies in (2..).take(MOST_ENERGIES) {
            let square = dot(&down, &down);
            let is_last = square <= LAST_STEP * LAST_STEP && square * square <= LEFT * LEFT * square_before;
            square_before = square;
            if is_last {
                let shape = added(&shape, -1.0, &down);
                let sections = self.energy.sections(simd, &shape, plate);
                let shared = self.energy.shared(simd, ratios, &sections, plate);
                let reading = self.energy.reading(simd, &sections, &shared);
                return Some(Found { shape: in_order(&shape), reading, energies });
            }
            if !square.is_finite() {
                return None;
            }
            let part = if square > LONGEST_STEP * LONGEST_STEP { LONGEST_STEP / square.sqrt() } else { 1.0 };
            let mut step = down;
            for entry in &mut step {
                *entry = *entry * -part;
            }
            shape = added(&shape, 1.0, &step);
            let slope_there = self.slope(simd, ratios, &shape, plate);
            let down_there = self.inverse(simd, known, &column, &slope_there);
            let change = added(&slope_there, -1.0, &slope);
            // Inverse curvature times the change of the slope; should equal the step.
            let guess = added(&down_there, -1.0, &down);
            let curvature = dot(&step, &change);
            (slope, down) = (slope_there, down_there);
            if curvature > 0.0 {
                let weight = 1.0 / curvature;
                let part = 0.5 * (1.0 + weight * dot(&change, &guess));
                let (by_step, by_guess) = (dot(&step, &slope), dot(&guess, &slope));
                let other = added(&guess, -part, &step);
                down = added(&down, -weight * (by_guess - part * by_step), &step);
                down = added(&down, -weight * by_step, &other);
                let update = &mut self.updates[known];
                for j in 0..FOURS {
                    (update.step[j], update.other[j]) = (numbers(step[j]), numbers(other[j]));
                }
                update.weight = weight;
                known += 1;
            }
        }
        None
    }

    #[inline(always)]
    fn slope<S: Simd>(&self, simd: S, ratios: &Ratios, shape: &Fours<S>, plate: &Plate) -> Fours<S> {
        let sections = self.energy.sections(simd, shape, plate);
        let shared = self.energy.shared(simd, ratios, &sections, plate);
        self.energy.slope(simd, &sections, &shared)
    }

    /// Returns the inverse curvature times a slope.
    #[inline(always)]
    fn inverse<S: Simd>(&self, simd: S, known: usize, column: &Column<S>, slope: &Fours<S>) -> Fours<S> {
        let mut result = column.solve(slope);
        for update in self.updates.iter().take(known) {
            let (mut step, mut other) = (*slope, *slope);
            for j in 0..FOURS {
                (step[j], other[j]) = (four(simd, update.step[j]), four(simd, update.other[j]));
            }
            let (by_step, by_other) = (dot(&step, slope), dot(&other, slope));
            result = added(&result, -update.weight * by_other, &step);
            result = added(&result, -update.weight * by_step, &other);
        }
        result
    }
}

/// Returns `sum + factor * vector`.
#[inline(always)]
fn added<S: Simd>(sum: &Fours<S>, factor: f64, vector: &Fours<S>) -> Fours<S> {
    let mut result = *sum;
    for (entry, addend) in result.iter_mut().zip(vector) {
        *entry = *entry + *addend * factor;
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preset::Preset;
    use crate::rod::contact::Coils;
    use flotor_hal::glam::{DVec2, DVec3};

    #[test]
    fn the_instructions_do_not_change_a_bit() {
        let mut descent = Descent::new();
        for preset in Preset::ALL {
            let ratios = Ratios::new(&preset.spring(), Coils::Pass);
            for part in [0.2, 0.6, 1.0] {
                let plate = Plate {
                    displacement: DVec3::new(0.1, -0.15, -0.05) * part,
                    lean: DVec2::new(0.2, 0.1) * part,
                    turn_rad: 0.3 * part,
                };
                let widest = descent.find(&ratios, &plate).unwrap();
                let plain = Search { descent: &mut descent, ratios: &ratios, plate: &plate }
                    .with_simd(Scalar256b)
                    .unwrap();
                assert_eq!((widest.shape, widest.reading), (plain.shape, plain.reading), "{preset:?} {part}");
            }
        }
    }
}
