//! Simulated subjects with known thresholds.
//!
//! The noise of an answer depends only on the seed, the stimulus parameter, the subject's number and the trial number, so a sitting
//! resumed after a crash gets the same answers.

mod hand;

pub use flotor_study_design::observer::TernaryObserver;
pub use hand::HandManner;

use crate::protocol::{Stimulus, SubjectNumber};
use crate::trial::{Modality, Phase, Position, Presented, Response, Trial};
use flotor_study_design::random::{Purpose, Stream};
use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_64;

/// Sensitivity to differences, in one modality.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sensitivity {
    /// Standard deviation of the noise, as a fraction of the base.
    pub sigma: f64,
    /// Magnitude of the evidence, in standard deviations of the noise, up to which the answer is "I don't know".
    pub criterion: f64,
}

/// Judged quality with a published Weber fraction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Percept {
    /// Stiffness, felt by pressing.
    Stiffness,
    /// Weight pulling at the hand.
    FeltForce,
    /// Constant resistance to a push.
    ExertedForce,
}

/// Distribution of simulated subjects in a study.
///
/// The defaults are for stiffness and reproduce the result of the thesis (Weber fractions of 14.2 and 17.2 %, about 200 pairs
/// per subject, t(15) of 3.3).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[must_use]
pub struct Population {
    /// Mean sensitivity with vision and haptics.
    pub vh: Sensitivity,
    /// Mean sensitivity with haptics alone.
    pub h: Sensitivity,
    /// Spread of the sensitivity between subjects (standard deviation of the logarithm of sigma).
    pub subject_spread: f64,
    /// Additional spread between a subject's modalities (standard deviation of the logarithm of sigma).
    pub modality_spread: f64,
    /// Additional spread between a subject's bases (standard deviation of the logarithm of sigma).
    pub base_spread: f64,
    /// Standard deviation of the criterion between subjects, as a fraction of the mean criterion.
    pub criterion_spread: f64,
    /// Standard deviation, between subjects, of the bias to the second stimulus, in standard deviations of the noise.
    pub bias_spread: f64,
    /// Lapse rate: fraction of trials answered "first" or "second" by chance.
    pub lapse: f64,
    /// Standard deviation, between subjects, of the exponent of Stevens's power law for ratings (mean 1).
    pub rating_exponent_spread: f64,
    /// Noise of a rating (standard deviation of its logarithm).
    pub rating_noise: f64,
    /// Spread of the modulus of ratings between subjects (standard deviation of its logarithm).
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
            rating_exponent_spread: 0.7,
            rating_noise: 0.47,
            rating_modulus_spread: 1.0,
        }
    }
}

impl Population {
    /// Returns the population for a judged quality, with published Weber fractions.
    ///
    /// For forces the published Weber fractions are thresholds at about 75 %: 5.9 % of weights of 0.3 to 3 kg (Fechner's data,
    /// after Laming 1986), 7 % of constant resistances of 2.5 to 10 N (Pang, Tan and Durlach 1991, Percept. Psychophys.
    /// 49:531). No effect of vision is assumed for either.
    pub fn judging(percept: Percept) -> Self {
        match percept {
            Percept::Stiffness => Self::default(),
            Percept::FeltForce => Self::with_thresholds([0.059; 2]),
            Percept::ExertedForce => Self::with_thresholds([0.07; 2]),
        }
    }

    /// Returns the default population with other mean thresholds at 75 %, as fractions of the base:
    /// `[with vision, without vision]`.
    pub fn with_thresholds([vh, h]: [f64; 2]) -> Self {
        let usual = Self::default();
        let of = |usual: Sensitivity, threshold: f64| {
            let sigma = TernaryObserver::with_threshold(threshold, usual.criterion).sigma;
            Sensitivity { sigma, ..usual }
        };
        Self { vh: of(usual.vh, vh), h: of(usual.h, h), ..usual }
    }

    /// Returns the mean sensitivity of a modality.
    #[must_use]
    pub fn sensitivity(&self, modality: Modality) -> Sensitivity {
        match modality {
            Modality::Vh => self.vh,
            Modality::H => self.h,
        }
    }
}

/// Simulated subject.
#[derive(Clone, Debug)]
#[must_use]
pub struct SimulatedSubject {
    population: Population,
    seed: u64,
    answer_seed: u64,
    subject: SubjectNumber,
    vh: TernaryObserver,
    h: TernaryObserver,
    rating_exponent: f64,
    rating_modulus: f64,
    middle: f64,
}

impl SimulatedSubject {
    /// Draws a subject from a population; `middle` is the stimulus that is rated with the subject's modulus.
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
            answer_seed: seed,
            subject,
            vh,
            h,
            rating_exponent: (1.0 + stream.normal() * population.rating_exponent_spread).max(0.0),
            rating_modulus: 10.0 * libm::exp(stream.normal() * population.rating_modulus_spread),
            middle,
        }
    }

    /// Returns the subject's observer parameters for a modality and base.
    pub fn observer(&self, modality: Modality, base: f64) -> TernaryObserver {
        let observer = match modality {
            Modality::Vh => self.vh,
            Modality::H => self.h,
        };
        if self.population.base_spread == 0.0 {
            return observer;
        }
        // The base itself selects the random stream, so that the deviation is the same whenever the base recurs.
        let bits = base.to_bits();
        #[allow(clippy::cast_possible_truncation)] // hash of the bits
        let name = (bits ^ (bits >> 32)) as u32 | 1;
        let deviation = Stream::new(self.seed, Purpose::Subject, self.subject.get(), name).normal();
        TernaryObserver {
            sigma: observer.sigma * libm::exp(deviation * self.population.base_spread),
            ..observer
        }
    }

    /// Selects the noise of the answers by the stimulus, so that a subject's answers to different objects are independent.
    pub fn about(self, stimulus: &Stimulus) -> Self {
        Self { answer_seed: self.seed ^ xxh3_64(stimulus.to_string().as_bytes()), ..self }
    }

    /// Returns the answer to a trial; [`Response::Seen`] in practice.
    #[must_use]
    pub fn respond(&self, trial: &Trial) -> Response {
        if trial.phase == Phase::Practice {
            return Response::Seen;
        }
        let mut stream = Stream::new(self.answer_seed, Purpose::Answer, self.subject.get(), trial.number);
        match trial.presented {
            Presented::One { value } => {
                let rise = self.rating_exponent * libm::log(value / self.middle);
                let noise = stream.normal() * self.population.rating_noise;
                // Round as people do: about three digits, above 0.
                let step = self.rating_modulus / 100.0;
                let steps = (100.0 * libm::exp(rise + noise)).round().max(1.0);
                Response::Rating(steps * step)
            }
            Presented::Pair(pair) => {
                let observer = self.observer(trial.modality, pair.base);
                let second_minus_first = match pair.larger_at {
                    Position::First => -pair.delta,
                    Position::Second => pair.delta,
                };
                match observer.respond(second_minus_first, &mut stream) {
                    Some(Position::First) => Response::First,
                    Some(Position::Second) => Response::Second,
                    None => Response::DontKnow,
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A threshold at 75 % of the people who judge a quality is the published one.
    #[test]
    fn each_quality_has_the_published_threshold() {
        for (percept, published) in [(Percept::FeltForce, 0.059), (Percept::ExertedForce, 0.07)] {
            let population = Population::judging(percept);
            for Sensitivity { sigma, criterion } in [population.vh, population.h] {
                let observer = TernaryObserver { sigma, criterion, bias: 0.0, lapse: 0.0 };
                assert!((observer.threshold(0.75) - published).abs() < 1.0e-12, "{percept:?}");
            }
        }
        assert_eq!(Population::judging(Percept::Stiffness), Population::default());
    }

    /// People write numbers above 0 alone.
    #[test]
    fn every_rating_is_above_0() {
        for subject in (1..=200).filter_map(SubjectNumber::new) {
            let simulated = SimulatedSubject::new(&Population::default(), 7, subject, 30.0);
            for number in 1..=100 {
                let presented = Presented::One { value: if number % 2 == 0 { 12.0 } else { 48.0 } };
                let (phase, replication, track, repeat) = (Phase::Main, 1, 0, 0);
                let modality = Modality::H;
                let answer = simulated.respond(&Trial {
                    number,
                    phase,
                    replication,
                    track,
                    modality,
                    presented,
                    repeat,
                });
                assert!(matches!(answer, Response::Rating(rating) if rating > 0.0), "{answer:?}");
            }
        }
    }

    #[test]
    fn another_object_has_other_noise_and_the_same_subject() {
        let subject = SubjectNumber::new(1).expect("a number");
        let of = |model: &str| {
            let stimulus = Stimulus { model: model.to_owned(), parameter: "stiffness_n_per_m".to_owned() };
            SimulatedSubject::new(&Population::default(), 7, subject, 30.0).about(&stimulus)
        };
        let (wall, spring) = (of("wall"), of("spring"));
        assert_eq!(wall.observer(Modality::H, 17.0), spring.observer(Modality::H, 17.0));
        assert_ne!(wall.answer_seed, spring.answer_seed);
    }
}
