//! Random streams without stored state: seed, purpose, subject and index determine a stream.
//!
//! A sitting resumed after a crash therefore needs no generator state: trial 57 of subject 3 draws the same numbers on every
//! machine, regardless of other draws.

use crate::subject::SubjectNumber;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::f64::consts::TAU;
use xxhash_rust::xxh3::xxh3_64;

/// Purpose of a random stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Order of blocks, demos and stimuli.
    Schedule = 1,
    /// Order within a pair, and side of the comparison.
    Presentation = 2,
    /// Parameters of a simulated subject.
    Subject = 3,
    /// Noise of a simulated answer.
    Answer = 4,
    /// Movement of a simulated subject's hand.
    Hand = 5,
    /// Codes of the conditions.
    Blinding = 6,
    /// Places of the checks in a track or replication.
    CheckPlace = 7,
    /// Choice of the trial that a check repeats.
    CheckTrial = 8,
    /// Simulated answers of a fitted observer.
    GoodnessOfFit = 9,
    /// Assignment of a level to a subject.
    Assignment = 10,
    /// Choice among interleaved tracks.
    Interleaving = 11,
    /// Simulated answers to a questionnaire.
    Questionnaire = 12,
}

/// Streams of a subject in an experiment.
#[derive(Clone, Copy, Debug)]
pub struct Draws {
    /// Seed of the study.
    pub seed: u64,
    /// Number of the subject.
    pub subject: SubjectNumber,
}

impl Draws {
    /// Creates the stream for a purpose and index.
    #[must_use]
    pub fn stream(self, purpose: Purpose, index: u32) -> Stream {
        Stream::new(self.seed, purpose, self.subject.get(), index)
    }
}

/// Stream of random numbers.
#[derive(Clone, Debug)]
pub struct Stream {
    generator: Pcg64Mcg,
}

impl Stream {
    /// Creates the stream for a seed, purpose, subject and index (for instance the number of a trial).
    #[must_use]
    pub fn new(seed: u64, purpose: Purpose, subject: u16, index: u32) -> Self {
        let mut name = [0_u8; 15];
        let parts = [&seed.to_le_bytes()[..], &[purpose as u8], &subject.to_le_bytes(), &index.to_le_bytes()];
        name.iter_mut().zip(parts.concat()).for_each(|(byte, part)| *byte = part);
        Self { generator: Pcg64Mcg::seed_from_u64(xxh3_64(&name)) }
    }

    /// Draws a number uniformly distributed over [0, 1).
    pub fn uniform(&mut self) -> f64 {
        /// 2^-53: the 53 highest bits fill the mantissa.
        const STEP: f64 = 1.0 / (1_u64 << 53) as f64;
        let bits = (self.generator.next_u64() >> 11) as f64;
        bits * STEP
    }

    /// Draws a sample of the standard normal distribution (Box and Muller 1958), bit-identical on every machine.
    pub fn normal(&mut self) -> f64 {
        // 1 - u is never zero, so the logarithm is finite.
        let radius = (-2.0 * libm::log(1.0 - self.uniform())).sqrt();
        radius * libm::cos(TAU * self.uniform())
    }

    /// Draws true or false with equal probability.
    pub fn coin(&mut self) -> bool {
        self.uniform() < 0.5
    }

    /// Draws an integer uniformly from `0..n`; returns 0 for `n` = 0.
    pub fn below(&mut self, n: usize) -> usize {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // n is the length of a list of trials
        let index = (self.uniform() * n as f64) as usize;
        index.min(n.saturating_sub(1))
    }

    /// Shuffles a list; all orders are equally likely (Fisher and Yates).
    pub fn shuffle<T>(&mut self, list: &mut [T]) {
        for last in (1..list.len()).rev() {
            let other = self.below(last + 1);
            list.swap(last, other);
        }
    }
}

#[cfg(test)]
mod tests;
