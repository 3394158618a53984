//! The equilibrium of a pose without a past and without a matrix of its own.
//!
//! Short of buckling the rod has one equilibrium, and the straight column along the chord is close to it. Its matrix of
//! second derivatives is known: with the force `N` that compresses it to the chord's length, `sigma = 1 + softening N`,
//!
//! ```text
//! W2 = 1/2 ∫ theta'² + N sigma/2 ∫ theta² + sigma²/(2 shear compliance) (∫ theta)²
//! ```
//!
//! for small turns `theta` of its sections. In the bubbles of [`super::basis`] that is tridiagonal, the even ones and the
//! odd ones apart. A quasi-Newton method (L-BFGS) starts from it and learns from the slopes what the angles add. Each of
//! its steps costs one energy; seven to ten of them reach the equilibrium, in the time of one and a half matrices.
//!
//! Source: Nocedal and Wright, *Numerical Optimization*, 7.2 (L-BFGS); the column: Haringx, as in [`crate::bending`].

use flotor_hal::glam::{DVec2, DVec3};
use pulp::NullaryFnOnce;

use super::equilibrium::Reading;
use super::functional::{Functional, Ratios, Shape};
use super::matrix::{added, dot_in_four as dot};
use super::plate::Plate;

/// Energies per search at most. A search that needs more is one for Newton's method.
const MOST_ENERGIES: usize = 24;
/// Step that counts as none: a force to a hundredth of a micronewton.
const TOLERANCE: f64 = 1e-10;
/// Longest step, as the root mean square slope of `p`.
const LONGEST_STEP: f64 = 0.8;
/// Least curvature assumed, of that of a rod without load: close to buckling the angles themselves stiffen it.
const LEAST_CURVATURE: f64 = 0.2;

/// The straight column along the chord.
struct Column<const K: usize> {
    /// `p` of the chord, and the scale `w` of lengths in `p` there.
    lean: DVec2,
    scale: f64,
    /// Factors of `theta²` and of the square of its mean in the energy.
    load: f64,
    sway: f64,
    /// Its second derivatives by the bubbles of one component, factored.
    inverse_pivot: [f64; K],
    /// Of each bubble over the one two before it.
    factor: [f64; K],
}

impl<const K: usize> Column<K> {
    /// Along the chord between the plates; `None` where it has buckled.
    fn new(ratios: &Ratios, plate: &Plate) -> Option<Self> {
        let chord = plate.displacement + DVec3::Z;
        let length = chord.length();
        let lean = DVec2::new(chord.x, chord.y) / (length + chord.z);
        let scale = 2.0 / (1.0 + lean.length_squared());
        let Ratios { shear_compliance, softening, .. } = *ratios;
        let force = (length - 1.0) / (shear_compliance + softening);
        let sigma = 1.0 + softening * force;
        let (load, sway) = (force * sigma, sigma * sigma / shear_compliance);

        let (mut pivot, mut factor) = ([0.0; K], [0.0; K]);
        for i in 0..K {
            // Of degree n: integrals of b_n², b_n b_(n-2), and (∫ b_1)² = 1/12; the others have no mean.
            let n = (i + 1) as f64;
            let square = 0.5 / ((2.0 * n - 1.0) * (2.0 * n + 3.0));
            pivot[i] = 1.0 + load * square + if i == 0 { sway / 12.0 } else { 0.0 };
            if i >= 2 {
                let product = -0.25 / ((2.0 * n - 1.0) * ((2.0 * n + 1.0) * (2.0 * n - 3.0)).sqrt());
                factor[i] = load * product / pivot[i - 2];
                pivot[i] -= factor[i] * load * product;
            }
            if pivot[i].is_nan() || pivot[i] <= 0.0 {
                return None;
            }
            pivot[i] = pivot[i].max(LEAST_CURVATURE);
        }
        Some(Self { lean, scale, load, sway, inverse_pivot: pivot.map(|pivot| 1.0 / pivot), factor })
    }

    /// The bent column between the ends of a rod, to first order in their leans from the chord.
    #[inline(always)]
    fn bent<const N: usize>(&self, upper: DVec2) -> Shape<N> {
        let mut shape = [0.0; N];
        let (x, y) = shape.split_at_mut(K);
        for (component, chord, upper) in [(x, self.lean.x, upper.x), (y, self.lean.y, upper.y)] {
            // Slope of W2 at the straight line between the ends: ∫ b_1 = -1/sqrt 12, ∫ (2 s - 1) b_2 = -1/(6 sqrt 5).
            component[0] = (self.load + self.sway) * (0.5 * upper - chord) / 12.0f64.sqrt();
            component[1] = self.load * upper / (12.0 * 5.0f64.sqrt());
            self.solve(component);
        }
        shape
    }

    #[inline(always)]
    fn solve(&self, x: &mut [f64]) {
        for i in 2..K {
            x[i] -= self.factor[i] * x[i - 2];
        }
        for (x, inverse) in x.iter_mut().zip(&self.inverse_pivot) {
            *x *= inverse;
        }
        for i in (2..K).rev() {
            x[i - 2] -= self.factor[i] * x[i];
        }
    }
}

/// What the steps of a search have shown of the curvature. Kept from search to search for its memory alone.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Descent<const N: usize> {
    steps: [Shape<N>; MOST_ENERGIES],
    changes: [Shape<N>; MOST_ENERGIES],
    /// One over the product of the two.
    weights: [f64; MOST_ENERGIES],
}

/// An equilibrium.
pub(crate) struct Found<const N: usize> {
    pub(crate) shape: Shape<N>,
    pub(crate) reading: Reading,
    pub(crate) energies: u32,
}

/// A search, for the widest instructions of the machine.
struct Search<'a, const K: usize, const N: usize, const Q: usize> {
    descent: &'a mut Descent<N>,
    functional: &'a Functional<K, N, Q>,
    plate: &'a Plate,
}

impl<const K: usize, const N: usize, const Q: usize> NullaryFnOnce for Search<'_, K, N, Q> {
    type Output = Option<Found<N>>;

    #[inline(always)]
    fn call(self) -> Option<Found<N>> {
        self.descent.search(self.functional, self.plate)
    }
}

impl<const N: usize> Descent<N> {
    pub(crate) fn new() -> Self {
        let none = [[0.0; N]; MOST_ENERGIES];
        Self { steps: none, changes: none, weights: [0.0; MOST_ENERGIES] }
    }

    /// The equilibrium between plates, a function of their pose; `None` where a rod may have buckled or the search does
    /// not end. The same bits whatever the instructions: no product is fused with a sum. Real-time: bounded, no
    /// allocation.
    pub(crate) fn find<const K: usize, const Q: usize>(
        &mut self,
        functional: &Functional<K, N, Q>,
        plate: &Plate,
    ) -> Option<Found<N>> {
        let search = Search { descent: self, functional, plate };
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = pulp::x86::V3::try_new() {
            return avx2.vectorize(search);
        }
        search.call()
    }

    #[inline(always)]
    fn search<const K: usize, const Q: usize>(
        &mut self,
        functional: &Functional<K, N, Q>,
        plate: &Plate,
    ) -> Option<Found<N>> {
        let column = Column::<K>::new(&functional.ratios, plate)?;
        let mut shape = column.bent(plate.lean);
        let (mut reading, mut slope) = functional.reading(&shape, plate);
        let mut known = 0;
        for energies in (1..).take(MOST_ENERGIES) {
            let step = self.step(known, &column, &slope);
            let size = dot(&step, &step).sqrt();
            if size <= TOLERANCE {
                reading.energy += 0.5 * dot(&slope, &step);
                return Some(Found { shape, reading, energies });
            }
            if !size.is_finite() {
                return None;
            }
            let step =
                if size > LONGEST_STEP { step.map(|entry| entry * (LONGEST_STEP / size)) } else { step };
            shape = added(&shape, 1.0, &step);
            let (there, slope_there) = functional.reading(&shape, plate);
            let change = added(&slope_there, -1.0, &slope);
            let curvature = dot(&step, &change);
            if curvature > 0.0 {
                (self.steps[known], self.changes[known]) = (step, change);
                self.weights[known] = 1.0 / curvature;
                known += 1;
            }
            (reading, slope) = (there, slope_there);
        }
        None
    }

    /// Minus the inverse curvature times a slope: the two loops of L-BFGS about the column.
    #[inline(always)]
    fn step<const K: usize>(&self, known: usize, column: &Column<K>, slope: &Shape<N>) -> Shape<N> {
        let mut step = slope.map(|entry| -entry);
        let mut shares = [0.0; MOST_ENERGIES];
        for i in (0..known).rev() {
            shares[i] = self.weights[i] * dot(&self.steps[i], &step);
            step = added(&step, -shares[i], &self.changes[i]);
        }
        let (x, y) = step.split_at_mut(K);
        column.solve(x);
        column.solve(y);
        let inverse_scale = 1.0 / (column.scale * column.scale);
        step = step.map(|entry| entry * inverse_scale);
        for (i, share) in shares.iter().enumerate().take(known) {
            let again = self.weights[i] * dot(&self.changes[i], &step);
            step = added(&step, share - again, &self.steps[i]);
        }
        step
    }
}
