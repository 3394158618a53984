//! Polynomial basis along a rod, with the quadrature points of its energy.
//!
//! A field along the rod is a straight line from its value at the lower plate (zero, by choice of
//! coordinates) to that at the upper plate, plus `K` *bubbles* that vanish at both plates. Bubble `k` is the
//! integral of the normalised Legendre polynomial of degree `k`, so the slopes of the bubbles are
//! orthonormal: the bending energy of small deflections is a sum of squares of the coefficients, and the
//! matrix of the rod stays well conditioned at any order. For the rod's smooth fields the error falls
//! exponentially with `K`.
//!
//! Source: integrated Legendre (Lobatto) shape functions, Szabó and Babuška, *Finite Element Analysis*
//! (1991), chapter 3; Gauss-Legendre quadrature, NIST DLMF 3.5(v).

use flotor_hal::math;
use std::f64::consts::PI;

/// Tables of `K` bubbles at `Q` quadrature stations on the rod, arc length scaled to 0..1.
///
/// Each table exists in both index orders, so that sums over bubbles and over stations both read consecutive memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Basis<const K: usize, const Q: usize> {
    /// Weights of the Gauss quadrature; their sum is 1.
    pub weight: [f64; Q],
    /// Scaled arc length of the stations, 0 to 1; also the value at each station of the line from 0 to 1.
    pub station: [f64; Q],
    /// Values of the bubbles at the stations, indexed by bubble, then station.
    pub bubble: [[f64; Q]; K],
    /// Slopes of the bubbles at the stations, per scaled arc length, indexed by bubble, then station.
    pub slope: [[f64; Q]; K],
    /// Values of the bubbles at the stations, indexed by station, then bubble.
    pub bubble_at: [[f64; K]; Q],
    /// Slopes of the bubbles at the stations, per scaled arc length, indexed by station, then bubble.
    pub slope_at: [[f64; K]; Q],
}

impl<const K: usize, const Q: usize> Default for Basis<K, Q> {
    /// Computes the tables. Real-time: bounded, no allocation; some microseconds.
    fn default() -> Self {
        let mut basis = Self {
            weight: [0.0; Q],
            station: [0.0; Q],
            bubble: [[0.0; Q]; K],
            slope: [[0.0; Q]; K],
            bubble_at: [[0.0; K]; Q],
            slope_at: [[0.0; K]; Q],
        };
        for i in 0..Q {
            let (t, weight) = gauss_legendre(Q, i);
            basis.weight[i] = 0.5 * weight;
            basis.station[i] = 0.5 * (1.0 + t);
            (basis.bubble_at[i], basis.slope_at[i]) = bubbles(t);
            for k in 0..K {
                basis.bubble[k][i] = basis.bubble_at[i][k];
                basis.slope[k][i] = basis.slope_at[i][k];
            }
        }
        basis
    }
}

/// Returns the first `K` bubbles and their slopes per scaled arc length, at scaled arc length `(1 + t) / 2`.
pub fn bubbles<const K: usize>(t: f64) -> ([f64; K], [f64; K]) {
    let (mut bubble, mut slope) = ([0.0; K], [0.0; K]);
    let mut legendre = Legendre::at(t);
    for (bubble, slope) in bubble.iter_mut().zip(&mut slope) {
        let below = legendre.value;
        legendre.advance();
        // Degree k + 1; the integral of P_n from -1 is (P_(n+1) - P_(n-1)) / (2 n + 1).
        let norm = (2.0 * legendre.degree + 1.0).sqrt();
        let mut above = legendre;
        above.advance();
        *slope = norm * legendre.value;
        *bubble = 0.5 * (above.value - below) / norm;
    }
    (bubble, slope)
}

/// Legendre polynomial of a degree at a point, by the three-term recurrence.
#[derive(Clone, Copy)]
struct Legendre {
    argument: f64,
    degree: f64,
    value: f64,
    previous: f64,
}

impl Legendre {
    fn at(argument: f64) -> Self {
        Self { argument, degree: 0.0, value: 1.0, previous: 0.0 }
    }

    fn advance(&mut self) {
        let Self { argument, degree, value, previous } = *self;
        // Recurrence of the Legendre polynomials: (n + 1) P(n+1) = (2 n + 1) x P(n) - n P(n-1).
        let next = ((2.0 * degree + 1.0) * argument * value - degree * previous) / (degree + 1.0);
        *self = Self { argument, degree: degree + 1.0, value: next, previous: value };
    }

    /// Returns the derivative, for arguments inside -1..1.
    fn derivative(&self) -> f64 {
        // (x² - 1) P'(n) = n (x P(n) - P(n-1)).
        self.degree * (self.argument * self.value - self.previous) / (self.argument * self.argument - 1.0)
    }
}

/// Returns node `i`, in ascending order, and its weight in the Gauss-Legendre rule with `count` nodes on -1..1.
pub fn gauss_legendre(count: usize, i: usize) -> (f64, f64) {
    let legendre = |t| {
        let mut polynomial = Legendre::at(t);
        (0..count).for_each(|_| polynomial.advance());
        polynomial
    };
    let mut node = -math::cos(PI * (i as f64 + 0.75) / (count as f64 + 0.5));
    // Newton's method doubles the digits of this estimate: 3, 6, 12, all; one more iteration for the last bit.
    for _ in 0..5 {
        let polynomial = legendre(node);
        node -= polynomial.value / polynomial.derivative();
    }
    let derivative = legendre(node).derivative();
    (node, 2.0 / ((1.0 - node * node) * (derivative * derivative)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quadrature_is_exact_to_its_degree() {
        let basis = Basis::<3, 9>::default();
        for power in 0..18 {
            let sum: f64 = (0..9).map(|i| basis.weight[i] * basis.station[i].powi(power)).sum();
            // The integral of s^n over 0..1; rounding of nine terms below one.
            assert!((sum - 1.0 / f64::from(power + 1)).abs() < 4e-16, "{power}: {sum}");
        }
    }

    #[test]
    fn slopes_are_orthonormal_and_belong_to_the_bubbles() {
        let basis = Basis::<8, 12>::default();
        let inner =
            |a: &[f64; 12], b: &[f64; 12]| -> f64 { (0..12).map(|i| basis.weight[i] * a[i] * b[i]).sum() };
        for k in 0..8 {
            for l in 0..8 {
                let expected = if k == l { 1.0 } else { 0.0 };
                assert!((inner(&basis.slope[k], &basis.slope[l]) - expected).abs() < 4e-15);
                // Bubbles vanish at the ends, so integration by parts leaves no boundary term.
                let parts =
                    inner(&basis.bubble[k], &basis.slope[l]) + inner(&basis.slope[k], &basis.bubble[l]);
                assert!(parts.abs() < 4e-15, "{k} {l}: {parts:e}");
            }
            // The mean slope is the difference of the end values.
            assert!(inner(&basis.slope[k], &[1.0; 12]).abs() < 4e-15);
        }
    }
}
