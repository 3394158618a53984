//! Low-discrepancy points that cover a space evenly, reproducible by seed and in any order of work.
//!
//! The sequence is Sobol's (I. M. Sobol, USSR Comput. Math. 7(4), 1967) with the direction numbers of S. Joe and F. Y.
//! Kuo (SIAM J. Sci. Comput. 30, 2008), its points shifted by the seed: any first part of it covers the space evenly.

pub use flotor_core::Random; // the same for the same seed

/// Dimensions of the sequence: one per degree of freedom.
pub const DIMENSIONS: usize = 6;
/// Binary digits of a coordinate; the sequence has 2 to this power points.
const DIGITS: usize = 32;
/// Degree and inner coefficients of a primitive polynomial, and the first direction numbers, for dimensions 2 to 6 (Joe
/// and Kuo, file new-joe-kuo-6.21201).
const POLYNOMIALS: [(usize, u32, [u32; 4]); DIMENSIONS - 1] = [
    (1, 0, [1, 0, 0, 0]),
    (2, 1, [1, 3, 0, 0]),
    (3, 1, [1, 3, 1, 0]),
    (3, 2, [1, 1, 1, 0]),
    (4, 1, [1, 1, 3, 3]),
];

/// Sobol sequence in six dimensions, with a digital shift drawn from a seed.
#[derive(Clone, Debug)]
pub struct Sobol {
    directions: [[u32; DIGITS]; DIMENSIONS],
    shift: [u32; DIMENSIONS],
}

impl Sobol {
    /// Creates the sequence, shifted by the seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        let mut directions = [[0; DIGITS]; DIMENSIONS];
        directions[0] = std::array::from_fn(|digit| 1 << (DIGITS - 1 - digit));
        for (row, (degree, coefficients, first)) in directions.iter_mut().skip(1).zip(POLYNOMIALS) {
            for digit in 0..DIGITS {
                row[digit] = if digit < degree {
                    first[digit] << (DIGITS - 1 - digit)
                } else {
                    let oldest = row[digit - degree];
                    let inner = (1..degree).filter(|k| coefficients >> (degree - 1 - k) & 1 == 1);
                    inner.fold(oldest ^ oldest >> degree, |sum, k| sum ^ row[digit - k])
                };
            }
        }
        let mut random = Random::new(seed, 0);
        #[allow(clippy::cast_possible_truncation)] // the upper half of the bits, on purpose
        let shift = std::array::from_fn(|_| (random.bits() >> 32) as u32);
        Self { directions, shift }
    }

    /// Returns point `index`, strictly inside the unit cube. The points may be computed in any order.
    #[must_use]
    pub fn point(&self, index: u64) -> [f64; DIMENSIONS] {
        std::array::from_fn(|dimension| {
            let digits = self.directions[dimension].iter().enumerate();
            let set = digits.filter(|(digit, _)| index >> digit & 1 == 1);
            let bits = set.fold(self.shift[dimension], |sum, (_, direction)| sum ^ direction);
            (f64::from(bits) + 0.5) / 4_294_967_296.0
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_fills_every_elementary_interval() {
        // A (t, m, s)-net property that even coverage means: of the first 2^m points each of 2^m equal slices
        // of every single coordinate holds exactly one.
        let sobol = Sobol::new(7);
        for dimension in 0..DIMENSIONS {
            let mut slices = [0; 1024];
            for index in 0..1024 {
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                let slice = (sobol.point(index)[dimension] * 1024.0) as usize;
                slices[slice] += 1;
            }
            assert!(slices.iter().all(|count| *count == 1), "dimension {dimension}");
        }
    }

    #[test]
    fn the_sequence_integrates_better_than_random_points() {
        // Integral of prod(1 + (u - 1/2)) is 1. Random points would be off by 0.7 / sqrt(65536) = 3e-3; a
        // tenth of that is out of their reach and far above what the sequence leaves.
        let sobol = Sobol::new(3);
        let product = |index| sobol.point(index).iter().map(|u| 0.5 + u).product::<f64>();
        let mean = (0..65536).map(product).sum::<f64>() / 65536.0;
        assert!((mean - 1.0).abs() < 3.0e-4, "{mean}");
    }
}
