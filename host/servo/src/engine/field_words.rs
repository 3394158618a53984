//! Encoding of a local linear model in words that two threads or two processes share.

use flotor_hal::{LinearField, Pose, Wrench};
use flotor_sync::Words;

/// Field sent from one thread or process to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sent(pub(super) LinearField);

/// Number of words: pose, wrench, stiffness, two radii and a time.
pub(super) const FIELD_WORDS: usize = 7 + 6 + 36 + 3;

impl Words<FIELD_WORDS> for Sent {
    fn to_words(&self) -> [u64; FIELD_WORDS] {
        let Self(LinearField { anchor, wrench, stiffness, valid_m, valid_rad, time_ns }) = self;
        let numbers = anchor.position_m.iter().chain(&anchor.orientation_xyzw);
        let numbers =
            numbers.chain(&wrench.force_n).chain(&wrench.torque_nm).chain(stiffness.iter().flatten());
        let numbers = numbers.chain([valid_m, valid_rad]).map(|number| number.to_bits());
        let mut words = [0; FIELD_WORDS];
        words.iter_mut().zip(numbers.chain([*time_ns])).for_each(|(place, word)| *place = word);
        words
    }

    fn from_words(words: &[u64; FIELD_WORDS]) -> Self {
        let mut numbers = words.iter().map(|word| f64::from_bits(*word));
        let mut next = || numbers.next().unwrap_or(f64::NAN);
        let anchor = Pose {
            position_m: std::array::from_fn(|_| next()),
            orientation_xyzw: std::array::from_fn(|_| next()),
        };
        let wrench =
            Wrench { force_n: std::array::from_fn(|_| next()), torque_nm: std::array::from_fn(|_| next()) };
        let stiffness = std::array::from_fn(|_| std::array::from_fn(|_| next()));
        let (valid_m, valid_rad) = (next(), next());
        let time_ns = words.last().copied().unwrap_or(0);
        Self(LinearField { anchor, wrench, stiffness, valid_m, valid_rad, time_ns })
    }
}
