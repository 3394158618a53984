//! Digest of a run: equal digests mean equal runs.

use flotor_core::ModelOutputs;
use flotor_core::grip::{GRIP_WORDS, GripRecord};
use flotor_core::trace::{RECORD_WORDS, TIMING_WORDS, TickRecord};
use flotor_sync::Words;
use xxhash_rust::xxh3::Xxh3;

/// Number of words of a record that depend on the run alone, not on the machine.
const DIGEST_WORDS: usize = RECORD_WORDS - TIMING_WORDS;

/// Index of the word of events and buttons, the last before the grip.
const FLAGS_WORD: usize = DIGEST_WORDS - GRIP_WORDS - 1;

/// Parts of a record that a digest covers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Coverage {
    /// Time, pose, twist, grip, commanded and delivered wrench and effort, events and buttons: equal for a run with and without
    /// observers.
    #[default]
    Hand,
    /// Also the wrench, energy and effort of the models, and the energy of the port.
    Everything,
}

impl Coverage {
    /// Returns the record with zeros in the parts that the digest does not cover.
    #[inline]
    fn of(self, record: &TickRecord) -> TickRecord {
        match self {
            Self::Hand => TickRecord {
                model: ModelOutputs::ZERO,
                port_energy_j: 0.0,
                grip: record.grip.map(|grip| GripRecord { model: 0.0, ..grip }),
                ..*record
            },
            Self::Everything => *record,
        }
    }
}

/// Streaming xxh3-64 over the records of a run, without measured times.
///
/// The hash runs over the 64-bit words of each record, little-endian, in the order of [`TickRecord`], so it depends
/// neither on the machine nor on the batches in which records arrive; a part that the digest does not [cover](Coverage)
/// counts as zero. The words of a grip count for devices with a grip only. All NaNs count as equal and zero has no sign, because they
/// differ between processors and compilers.
/// The digest distinguishes runs, but is not cryptographic: it is not a protection against forgery.
#[derive(Clone, Default)]
#[must_use]
pub struct TraceDigest {
    coverage: Coverage,
    hash: Xxh3,
    ticks: u64,
}

impl TraceDigest {
    /// Creates a digest without ticks, with the coverage [`Coverage::Hand`].
    pub fn new() -> Self {
        Self::default()
    }

    /// Creates a digest without ticks, with this coverage.
    pub fn covering(coverage: Coverage) -> Self {
        Self { coverage, ..Self::default() }
    }

    /// Adds the next tick. Real-time: bounded, no allocation.
    pub fn update(&mut self, record: &TickRecord) {
        let mut bytes = [0; DIGEST_WORDS * size_of::<u64>()];
        let words = self.coverage.of(record).to_words();
        // The shorter side ends the iteration: the timing words at the end are left out.
        for (index, (place, word)) in bytes.chunks_exact_mut(size_of::<u64>()).zip(words).enumerate() {
            let word = if is_integer(index) { word } else { canonical(word) };
            place.copy_from_slice(&word.to_le_bytes());
        }
        let (all, grip) = bytes.split_at((DIGEST_WORDS - GRIP_WORDS) * size_of::<u64>());
        self.hash.update(all);
        if record.grip.is_some() {
            self.hash.update(grip);
        }
        self.ticks += 1;
    }

    /// Returns the digest as text: `xxh3:`, sixteen hexadecimal digits, `-`, number of ticks.
    #[must_use]
    pub fn finish(&self) -> String {
        format!("xxh3:{:016x}-{}", self.hash.digest(), self.ticks)
    }
}

/// Returns true for a word of a record that is an integer: index, time and period of the tick, events with buttons, kind of the grip.
fn is_integer(index: usize) -> bool {
    index < 3 || index == FLAGS_WORD || index == DIGEST_WORDS - 1
}

/// Returns the canonical bits of a number.
fn canonical(word: u64) -> u64 {
    match f64::from_bits(word) {
        number if number.is_nan() => f64::NAN.to_bits(),
        0.0 => 0,
        _ => word,
    }
}
