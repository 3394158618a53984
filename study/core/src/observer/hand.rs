//! Movement of a simulated subject's hand, with the same parameters during the whole sitting.

use crate::protocol::SubjectNumber;
use flotor_study_design::random::{Purpose, Stream};
use serde::{Deserialize, Serialize};

/// Movement parameters of a simulated subject's hand, which explores along the vertical: intended movement up and down about a
/// point below home, grip stiffness and tremor. The intended movement does not depend on the force. The hand is compliant, so a
/// stiffer object moves less and pushes back more: speed and acceleration fall with the stiffness and force rises, contrary to
/// section 5 of CMU-RI-TR-07-21 (`docs/src/experiments.md`, Simulated observers).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HandManner {
    /// Frequency of the movement, Hz.
    pub frequency_hz: f64,
    /// Height of the middle of the intended movement above home, m; negative below.
    pub centre_m: f64,
    /// Half the distance between the intended turning points, m.
    pub amplitude_m: f64,
    /// Stiffness of the grip, N/m.
    pub stiffness_n_per_m: f64,
    /// Root mean square of the physiological tremor, m.
    pub tremor_m: f64,
}

/// Average hand: 1.5 Hz, from 2 mm above home to 10 mm below, a firm grip (2 N/mm, as the default of the simulated hand), and
/// the tremor of a braced hand (15 to 250 µm).
const AVERAGE: HandManner = HandManner {
    frequency_hz: 1.5,
    centre_m: -4.0e-3,
    amplitude_m: 6.0e-3,
    stiffness_n_per_m: 2000.0,
    tremor_m: 50.0e-6,
};
/// Spread between people: standard deviation of the logarithm of a parameter.
const SPREAD: f64 = 0.15;
/// Maximum deviation from the average, in standard deviations, so that the handle stays in its range.
const FARTHEST: f64 = 2.0;

impl HandManner {
    /// Returns the movement parameters of a subject's hand; they depend on seed and subject number alone.
    #[must_use]
    pub fn of(seed: u64, subject: SubjectNumber) -> Self {
        let mut stream = Stream::new(seed, Purpose::Hand, subject.get(), 0);
        let mut factor = || libm::exp(SPREAD * stream.normal().clamp(-FARTHEST, FARTHEST));
        Self {
            frequency_hz: AVERAGE.frequency_hz * factor(),
            centre_m: AVERAGE.centre_m,
            amplitude_m: AVERAGE.amplitude_m * factor(),
            stiffness_n_per_m: AVERAGE.stiffness_n_per_m * factor(),
            tremor_m: AVERAGE.tremor_m * factor(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hands_differ_and_stay_in_range() {
        let hands: Vec<HandManner> =
            (1..=200).filter_map(SubjectNumber::new).map(|subject| HandManner::of(3, subject)).collect();
        assert_ne!(hands[0], hands[1]);
        assert_eq!(hands[4], HandManner::of(3, SubjectNumber::new(5).unwrap()));
        for hand in hands {
            // The flotor moves 12 mm each way.
            assert!(hand.centre_m - hand.amplitude_m > -12.5e-3 && hand.frequency_hz < 2.1, "{hand:?}");
        }
    }
}
