//! Condition codes for blinded studies: experimenter and analyst do not know the conditions until unblinding.
//!
//! The assignment depends on protocol and seed alone, so it need not be stored.

use crate::protocol::Protocol;
use crate::trial::{Modality, Presented};
use flotor_study_design::random::{Purpose, Stream};

/// Condition codes of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct Codes {
    /// Bases of a difference experiment, or rated stimuli, in random order; the code of a level is its index plus 1.
    levels: Vec<f64>,
    /// Modality with code A.
    a: Modality,
}

impl Codes {
    /// Draws the codes for a study with this protocol and seed.
    #[must_use]
    pub fn new(protocol: &Protocol, seed: u64) -> Self {
        let mut stream = Stream::new(seed, Purpose::Blinding, 0, 0);
        let a = if stream.coin() { Modality::Vh } else { Modality::H };
        let mut levels = protocol.levels().to_vec();
        stream.shuffle(&mut levels);
        Self { levels, a }
    }

    /// Returns the code of a modality: A or B.
    #[must_use]
    pub fn modality(&self, modality: Modality) -> &'static str {
        if modality == self.a { "A" } else { "B" }
    }

    /// Returns the code of a base or rated stimulus: 1, 2, ...; 0 for a value that is not a level, such as a practice stimulus.
    #[must_use]
    pub fn level(&self, level: f64) -> usize {
        self.levels.iter().position(|known| *known == level).map_or(0, |index| index + 1)
    }

    /// Returns the code of a condition, such as `A2`.
    #[must_use]
    pub fn condition(&self, modality: Modality, presented: &Presented) -> String {
        format!("{}{}", self.modality(modality), self.level(presented.level()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::JndProtocol;
    use std::collections::BTreeSet;

    #[test]
    fn every_condition_has_its_code_and_seeds_have_others() {
        let protocol = Protocol::Jnd(JndProtocol::default());
        let mut keys = BTreeSet::new();
        for seed in 0..40 {
            let codes = Codes::new(&protocol, seed);
            assert_eq!(codes, Codes::new(&protocol, seed));
            let bases = [17.0, 26.0, 35.0].map(|base| codes.level(base));
            assert_eq!(BTreeSet::from(bases), BTreeSet::from([1, 2, 3]));
            assert_ne!(codes.modality(Modality::Vh), codes.modality(Modality::H));
            assert_eq!(codes.level(99.0), 0);
            keys.insert((bases, codes.modality(Modality::Vh)));
        }
        assert!(keys.len() > 6, "codes must not reveal the order: {keys:?}");
    }
}
