//! Pseudo-random numbers for tests: the same for a seed on every machine.
//!
//! The file uses no other module of this crate: crates that cannot depend on the crate include it with `#[path]`.

#![allow(dead_code, unreachable_pub)] // each test program uses its part

/// SplitMix64 generator of pseudo-random numbers (Steele, Lea and Flood, OOPSLA 2014). The field is its state, at first the seed.
pub struct Random(pub u64);

impl Random {
    /// Advances the generator and returns 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    /// Returns a random whole number below `bound`; 0 if the bound is 0.
    #[allow(clippy::cast_possible_truncation)] // less than the bound
    pub fn below(&mut self, bound: usize) -> usize {
        (self.bits() % bound.max(1) as u64) as usize
    }

    /// Returns a random number from 0 to 1, both included.
    pub fn share(&mut self) -> f64 {
        self.bits() as f64 / u64::MAX as f64
    }

    /// Returns a random number from -1 to 1, both included.
    pub fn symmetric(&mut self) -> f64 {
        2.0 * self.share() - 1.0
    }

    /// Returns a random number in the half-open interval from 0 to 1: a multiple of 2^-53.
    pub fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }
}
