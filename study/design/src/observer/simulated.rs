//! Simulated subject of a designed study.
//!
//! Choices are those of signal detection with a zone of "I don't know" ([`TernaryObserver`]); detections are evidence `d' + noise`
//! above a criterion; ratings are a point of the scale close to a mean with normal noise; magnitudes follow a power law with lognormal
//! noise. An answer depends on seed, subject, session and trial number alone.

use super::population::Population;
use super::ternary::TernaryObserver;
use crate::answer::{Answer, Position, Reply};
use crate::course::{Session, Signal, Step, Trial};
use crate::design::{Condition, Design};
use crate::form::Item;
use crate::random::{Purpose, Stream};
use crate::stimulus::{Side, Stimulus};
use crate::task::{AnswerScale, Ask};
use crate::value::Value;
use xxhash_rust::xxh3::xxh3_64;

/// Subject drawn from a population.
#[derive(Clone, Debug)]
pub struct SimulatedObserver {
    population: Population,
    session: Session,
    /// Deviation of the subject from the population, in its spreads.
    general: f64,
}

impl SimulatedObserver {
    /// Draws a subject; the same in all sessions.
    #[must_use]
    pub fn new(population: &Population, session: Session) -> Self {
        let mut stream = Stream::new(session.seed, Purpose::Subject, session.subject.get(), 0);
        Self { population: population.clone(), session, general: stream.normal() }
    }

    /// Returns the answer to a step of a course of `design`.
    #[must_use]
    pub fn respond(&self, design: &Design, step: &Step) -> Reply {
        match step {
            Step::Rest { .. } => Reply::plain(Answer::Rested),
            Step::Form { questionnaire, block } => {
                let name = u32::try_from(*questionnaire).unwrap_or(0) << 12 | block;
                let mut stream = self.session.stream(Purpose::Questionnaire, name);
                let items = design.questionnaires().get(*questionnaire).map_or(&[][..], |form| &form.items);
                Reply::plain(Answer::Form(items.iter().map(|item| fill_in(item, &mut stream)).collect()))
            }
            Step::Trial(trial) => self.judge(design, trial),
        }
    }

    /// Returns the threshold in a condition, on the scale of the levels.
    #[must_use]
    pub fn threshold(&self, design: &Design, condition: &Condition) -> f64 {
        let deviation = self.deviation(condition);
        self.population.threshold * libm::exp(deviation) * self.effects(design, condition).product::<f64>()
    }

    fn judge(&self, design: &Design, trial: &Trial) -> Reply {
        let mut stream = self.session.stream(Purpose::Answer, trial.number);
        let population = &self.population;
        let level = trial.level.unwrap_or(0.0);
        let answer = match &design.task().ask {
            Ask::Choice { unsure } => {
                let criterion = if *unsure { population.unsure_criterion } else { 0.0 };
                let threshold = self.threshold(design, &trial.condition);
                let (bias, lapse) = (population.bias, population.lapse);
                let observer =
                    TernaryObserver { bias, lapse, ..TernaryObserver::with_threshold(threshold, criterion) };
                let second_minus_first = match trial.comparison_at {
                    Some(Position::First) => -signed(design, level),
                    _ => signed(design, level),
                };
                match observer.respond(second_minus_first, &mut stream) {
                    Some(Position::First) => Answer::First,
                    Some(Position::Second) => Answer::Second,
                    // Without a criterion, only evidence of exactly 0.
                    None if *unsure => Answer::Unsure,
                    None => Answer::Second,
                }
            }
            Ask::Detection { .. } => {
                let (lapse, guess, noise) = (stream.uniform(), stream.coin(), stream.normal());
                let sensitivity = match trial.signal {
                    Some(Signal::Present) => level / self.threshold(design, &trial.condition),
                    _ => 0.0,
                };
                let reports = if lapse < population.lapse {
                    guess
                } else {
                    sensitivity + noise > population.yes_criterion
                };
                if reports { Answer::Present } else { Answer::Absent }
            }
            Ask::Rating { scale } => {
                let effects: f64 = self.effects(design, &trial.condition).sum();
                let steps = self.deviation(&trial.condition)
                    + effects
                    + population.slope * level
                    + population.noise * stream.normal();
                Answer::Rating(scale.nearest(0.5 * (scale.least + scale.most) + steps * scale.step))
            }
            Ask::Magnitude => {
                let effects: f64 = self.effects(design, &trial.condition).product();
                let power = libm::log(relative_value(design, trial));
                let exponent = power + self.deviation(&trial.condition) + population.noise * stream.normal();
                // People write about two digits, above 0.
                Answer::Magnitude((100.0 * effects * libm::exp(exponent)).round().max(1.0) / 10.0)
            }
        };
        let confidence = design.task().confidence.as_ref().map(|scale| {
            let certainty = 1.0 - libm::exp(-level.abs() / population.threshold);
            let share = certainty + 0.15 * stream.normal();
            scale.nearest(scale.least + (scale.most - scale.least) * share)
        });
        Reply { answer, confidence }
    }

    /// Returns the deviation of the subject in a condition: general, and of the condition.
    fn deviation(&self, condition: &Condition) -> f64 {
        // The levels name the stream, so that the deviation is the same whenever the condition recurs.
        let name: String = condition.iter().map(|(factor, value)| format!("{factor}={value};")).collect();
        #[allow(clippy::cast_possible_truncation)] // hash
        let name = xxh3_64(name.as_bytes()) as u32 | 1;
        let own = Stream::new(self.session.seed, Purpose::Subject, self.session.subject.get(), name).normal();
        self.general * self.population.subject_spread + own * self.population.condition_spread
    }

    /// Returns the effect of each factor's level.
    fn effects<'a>(&'a self, design: &'a Design, condition: &'a Condition) -> impl Iterator<Item = f64> + 'a {
        design.factors().iter().filter_map(move |factor| {
            let effects = self.population.effect.get(&factor.name)?;
            let value = condition.get(&factor.name)?;
            let level = factor.values.iter().position(|known| known == value)?;
            effects.get(level).copied()
        })
    }
}

/// Returns a level with the sign of its side of the standard.
fn signed(design: &Design, level: f64) -> f64 {
    match design.stimulus() {
        Some(Stimulus::Graded { side: Side::Below, .. }) => -level,
        _ => level,
    }
}

/// Returns the value of a trial as a multiple of a middle one: of the stimulus and its standard, or of the first factor with positive
/// numbers; 1 without either.
fn relative_value(design: &Design, trial: &Trial) -> f64 {
    if let (Some(value), Some(standard)) = (
        trial.intervals.first().and_then(Value::number),
        design.value(&trial.condition, 0.0).and_then(|value| value.number()),
    ) {
        return (value / standard).max(f64::MIN_POSITIVE);
    }
    let numbers = |values: &[Value]| {
        let numbers: Option<Vec<f64>> = values.iter().map(Value::number).collect();
        numbers.filter(|numbers| numbers.iter().all(|number| *number > 0.0))
    };
    let found = design.factors().iter().filter(|factor| factor.setting.is_some()).find_map(|factor| {
        let numbers = numbers(&factor.values)?;
        let middle = numbers.iter().map(|number| libm::log(*number)).sum::<f64>() / numbers.len() as f64;
        Some(trial.condition.get(&factor.name)?.number()? / libm::exp(middle))
    });
    found.unwrap_or(1.0)
}

/// Draws an answer to an item.
fn fill_in(item: &Item, stream: &mut Stream) -> Value {
    let within = |scale: &AnswerScale, share: f64| {
        Value::Number(scale.nearest(scale.least + share * (scale.most - scale.least)))
    };
    match item {
        Item::Scale { scale, .. } => within(scale, stream.uniform()),
        Item::Choice { options, .. } => {
            Value::Choice(options.get(stream.below(options.len())).cloned().unwrap_or_default())
        }
        Item::Number { least, most, .. } => {
            Value::Number((least + stream.uniform() * (most - least)).round().clamp(*least, *most))
        }
        Item::Text { .. } => Value::Choice("simulated".to_owned()),
    }
}
