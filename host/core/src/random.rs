//! Random numbers that depend only on seed and stream, in any order of work.

use flotor_hal::DVec3;

/// Generator for more dimensions than a low-discrepancy sequence has: SplitMix64 (Steele, Lea and Flood, OOPSLA
/// 2014). Each `stream` of a seed is independent of the others, so work can be done in any order.
#[derive(Clone, Debug)]
pub struct Random {
    state: u64,
}

impl Random {
    /// Creates stream number `stream` of a seed.
    #[must_use]
    pub fn new(seed: u64, stream: u64) -> Self {
        let mut random = Self { state: seed ^ 0x6a09_e667_f3bc_c908 };
        random.state = random.bits() ^ stream.wrapping_mul(0xd134_2543_de82_ef95);
        random.bits();
        random
    }

    /// Returns 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.state ^ self.state >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ mixed >> 31
    }

    /// Returns a uniform number in 0..1.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / 9_007_199_254_740_992.0
    }

    /// Returns a uniform number in -1..1.
    pub fn symmetric(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }

    /// Returns a uniform vector in the cube -1..1.
    pub fn vector(&mut self) -> DVec3 {
        DVec3::new(self.symmetric(), self.symmetric(), self.symmetric())
    }

    /// Returns a uniform unit vector.
    pub fn direction(&mut self) -> DVec3 {
        loop {
            let inside = self.vector();
            if (1.0e-3..=1.0).contains(&inside.length_squared()) {
                return inside.normalize();
            }
        }
    }
}
