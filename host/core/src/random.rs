//! Pseudorandom numbers that depend only on seed and stream, so that work can be done in any order.

use flotor_hal::DVec3;

/// Pseudorandom number generator SplitMix64 (Steele, Lea and Flood, OOPSLA 2014), for more dimensions than a
/// low-discrepancy sequence has. The streams of a seed are independent of each other.
#[derive(Clone, Debug)]
pub struct Random {
    state: u64,
}

impl Random {
    /// Creates the generator of one stream of a seed.
    #[must_use]
    pub fn new(seed: u64, stream: u64) -> Self {
        let mut random = Self { state: seed ^ 0x6a09_e667_f3bc_c908 };
        random.state = random.bits() ^ stream.wrapping_mul(0xd134_2543_de82_ef95);
        random.bits();
        random
    }

    /// Draws 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.state ^ self.state >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ mixed >> 31
    }

    /// Draws a sample of the uniform distribution from 0 (included) to 1 (excluded).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / 9_007_199_254_740_992.0
    }

    /// Draws a sample of the uniform distribution from -1 (included) to 1 (excluded).
    pub fn symmetric(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }

    /// Draws a vector from the uniform distribution in the cube from -1 to 1.
    pub fn vector(&mut self) -> DVec3 {
        DVec3::new(self.symmetric(), self.symmetric(), self.symmetric())
    }

    /// Draws a unit vector from the uniform distribution over all directions.
    pub fn direction(&mut self) -> DVec3 {
        loop {
            let inside = self.vector();
            if (1.0e-3..=1.0).contains(&inside.length_squared()) {
                return inside.normalize();
            }
        }
    }
}
