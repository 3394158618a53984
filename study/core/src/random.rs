//! Seeded randomness without a past: every draw has a stream of its own, named by who draws for what.
//!
//! A sitting that is continued after a crash therefore needs no generator state: trial 57 of subject 3 draws the same
//! numbers whenever it is asked, on every machine and in any order.

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::f64::consts::TAU;
use xxhash_rust::xxh3::xxh3_64;

/// What is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// Order of blocks, demos and stimuli.
    Schedule = 1,
    /// Which of a pair comes first, which way it differs.
    Presentation = 2,
    /// What kind of observer a simulated subject is.
    Subject = 3,
    /// The noise in a simulated answer.
    Answer = 4,
    /// How a simulated subject's hand moves.
    Hand = 5,
    /// Which code stands for which condition.
    Blinding = 6,
    /// Before which trials of a track or a replication a check is presented.
    CheckPlace = 7,
    /// Which earlier trial a check repeats.
    CheckTrial = 8,
    /// Sets of answers that a fitted observer might give.
    GoodnessOfFit = 9,
}

/// A stream of random numbers.
#[derive(Clone, Debug)]
pub(crate) struct Stream {
    generator: Pcg64Mcg,
}

impl Stream {
    /// The stream for one purpose, subject and index (of a trial, for instance) of an experiment.
    pub(crate) fn new(seed: u64, purpose: Purpose, subject: u16, index: u32) -> Self {
        let mut name = [0_u8; 15];
        let parts = [&seed.to_le_bytes()[..], &[purpose as u8], &subject.to_le_bytes(), &index.to_le_bytes()];
        name.iter_mut().zip(parts.concat()).for_each(|(byte, part)| *byte = part);
        Self { generator: Pcg64Mcg::seed_from_u64(xxh3_64(&name)) }
    }

    /// Evenly distributed over 0 (included) to 1 (excluded).
    pub(crate) fn uniform(&mut self) -> f64 {
        /// 2^-53: the 53 highest bits fill the mantissa.
        const STEP: f64 = 1.0 / (1_u64 << 53) as f64;
        let bits = (self.generator.next_u64() >> 11) as f64;
        bits * STEP
    }

    /// Normal distribution of mean 0 and deviation 1 (Box and Muller 1958), by functions that give the same bits on
    /// every machine.
    pub(crate) fn normal(&mut self) -> f64 {
        // 1 - u is never zero, so the logarithm is finite.
        let radius = (-2.0 * libm::log(1.0 - self.uniform())).sqrt();
        radius * libm::cos(TAU * self.uniform())
    }

    /// Heads or tails.
    pub(crate) fn coin(&mut self) -> bool {
        self.uniform() < 0.5
    }

    /// Evenly one of `0..n`; 0 for `n` = 0.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // n is the length of a list of trials
        let index = (self.uniform() * n as f64) as usize;
        index.min(n.saturating_sub(1))
    }

    /// Every order equally likely (Fisher and Yates).
    pub(crate) fn shuffle<T>(&mut self, list: &mut [T]) {
        for last in (1..list.len()).rev() {
            let other = self.below(last + 1);
            list.swap(last, other);
        }
    }
}

#[cfg(test)]
mod tests;
