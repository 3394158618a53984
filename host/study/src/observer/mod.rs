//! Simulated subjects: what somebody with known thresholds would answer.
//!
//! A subject's answers depend on the seed, their number and the number of the trial alone, so a sitting continued after
//! a crash gets the answers it would have got.

mod hand;
mod ternary;

pub use hand::HandManner;
pub use ternary::TernaryObserver;

use crate::protocol::SubjectNumber;
use crate::random::{Purpose, Stream};
use crate::trial::{Modality, Phase, Position, Presented, Response, Trial};
use serde::{Deserialize, Serialize};

/// How well a modality tells differences.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sensitivity {
    /// Difference of one standard deviation of the noise, as a share of the base.
    pub sigma: f64,
    /// Evidence, in standard deviations, below which the answer is "I don't know".
    pub criterion: f64,
}

/// The people a study draws its simulated subjects from.
///
/// The defaults are those whose expected result equals the published one (Weber fractions of 14.2 and 17.2 %, about
/// 200 pairs, t(15) of 3.3).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Population {
    /// With vision.
    pub vh: Sensitivity,
    /// Without.
    pub h: Sensitivity,
    /// Spread of sensitivity between subjects (deviation of its logarithm).
    pub subject_spread: f64,
    /// Further spread between a subject's modalities (deviation of the logarithm).
    pub modality_spread: f64,
    /// Further spread between a subject's bases (deviation of the logarithm).
    pub base_spread: f64,
    /// Spread of the criterion between subjects, as a share of it.
    pub criterion_spread: f64,
    /// Spread of a preference for the second of a pair, in standard deviations of the noise.
    pub bias_spread: f64,
    /// Share of trials answered without attention, first or second by chance.
    pub lapse: f64,
    /// Spread between subjects of how much a rating rises with the stimulus (mean 1).
    pub rating_slope_spread: f64,
    /// Noise of a rating, as a share of the mean rating.
    pub rating_noise: f64,
    /// Spread of the subjects' free scales (deviation of the logarithm).
    pub rating_modulus_spread: f64,
}

impl Default for Population {
    fn default() -> Self {
        Self {
            vh: Sensitivity { sigma: 0.1060, criterion: 1.0 },
            h: Sensitivity { sigma: 0.1292, criterion: 1.0 },
            subject_spread: 0.20,
            modality_spread: 0.10,
            base_spread: 0.0,
            criterion_spread: 0.25,
            bias_spread: 0.0,
            lapse: 0.0,
            rating_slope_spread: 1.1,
            rating_noise: 0.5,
            rating_modulus_spread: 1.0,
        }
    }
}

impl Population {
    /// How a modality tells differences on average.
    #[must_use]
    pub fn sensitivity(&self, modality: Modality) -> Sensitivity {
        match modality {
            Modality::Vh => self.vh,
            Modality::H => self.h,
        }
    }
}

/// One simulated subject.
#[derive(Clone, Debug)]
pub struct SimulatedSubject {
    population: Population,
    seed: u64,
    subject: SubjectNumber,
    vh: TernaryObserver,
    h: TernaryObserver,
    rating_slope: f64,
    rating_modulus: f64,
    middle: f64,
}

impl SimulatedSubject {
    /// A subject drawn from a population; `middle` is the middle of the stimuli they will rate.
    #[must_use]
    pub fn new(population: &Population, seed: u64, subject: SubjectNumber, middle: f64) -> Self {
        let mut stream = Stream::new(seed, Purpose::Subject, subject.get(), 0);
        let general = stream.normal() * population.subject_spread;
        let criterion = (1.0 + stream.normal() * population.criterion_spread).max(0.0);
        let bias = stream.normal() * population.bias_spread;
        let mut observer = |modality| {
            let Sensitivity { sigma, criterion: mean_criterion } = population.sensitivity(modality);
            let own = general + stream.normal() * population.modality_spread;
            TernaryObserver {
                sigma: sigma * libm::exp(own),
                criterion: mean_criterion * criterion,
                bias,
                lapse: population.lapse,
            }
        };
        let (vh, h) = (observer(Modality::Vh), observer(Modality::H));
        Self {
            population: *population,
            seed,
            subject,
            vh,
            h,
            rating_slope: (1.0 + stream.normal() * population.rating_slope_spread).max(0.0),
            rating_modulus: 10.0 * libm::exp(stream.normal() * population.rating_modulus_spread),
            middle,
        }
    }

    /// How this subject tells differences from this base.
    #[must_use]
    pub fn observer(&self, modality: Modality, base: f64) -> TernaryObserver {
        let observer = match modality {
            Modality::Vh => self.vh,
            Modality::H => self.h,
        };
        if self.population.base_spread == 0.0 {
            return observer;
        }
        // A stream named by the base itself: the same deviation whenever it comes up.
        let bits = base.to_bits();
        #[allow(clippy::cast_possible_truncation)] // the halves of a name, mixed
        let name = (bits ^ (bits >> 32)) as u32 | 1;
        let deviation = Stream::new(self.seed, Purpose::Subject, self.subject.get(), name).normal();
        TernaryObserver {
            sigma: observer.sigma * libm::exp(deviation * self.population.base_spread),
            ..observer
        }
    }

    /// The answer to a trial.
    #[must_use]
    pub fn respond(&self, trial: &Trial) -> Response {
        if trial.phase == Phase::Practice {
            return Response::Seen;
        }
        let mut stream = Stream::new(self.seed, Purpose::Answer, self.subject.get(), trial.number);
        match trial.presented {
            Presented::One { value } => {
                let rise = self.rating_slope * (value / self.middle - 1.0);
                let noise = stream.normal() * self.population.rating_noise;
                // People do not write ratings with sixteen digits: three are kept of the usual size.
                let step = self.rating_modulus / 100.0;
                Response::Rating((self.rating_modulus * (1.0 + rise + noise) / step).round() * step)
            }
            Presented::Pair(pair) => {
                let observer = self.observer(trial.modality, pair.base);
                let second_minus_first = match pair.larger_at {
                    Position::First => -pair.delta,
                    Position::Second => pair.delta,
                };
                observer.respond(second_minus_first, &mut stream)
            }
        }
    }
}
