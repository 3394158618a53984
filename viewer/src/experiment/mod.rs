//! A sitting of a perception experiment in front of the window: which screen is shown, which key leads on.
//!
//! ```text
//! Instruction -> Present (1) -> [Present (2)] -> Answer -> Present ... -> Over
//!                    ^                              |
//!                    +------------- Break <---------+   before another replication or modality
//! ```
//!
//! The order of trials, what an answer is worth and the log are `flotor_study`'s; here are only the steps of one trial. All of it
//! works by keyboard alone: in studies the other hand holds the device.

pub mod screens;

use flotor_record::trace::{Events, TickRecord};
use flotor_study::log::{Event, LogError, LogWriter, TrialEvent};
use flotor_study::protocol::{Protocol, Stimulus};
use flotor_study::sitting::{AnswerError, Sitting};
use flotor_study::trial::{Exploration, Modality, Phase, Presented, Response, Trial};
use std::time::Instant;

/// What the subject sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Screen {
    /// What it is about, before the first trial.
    Instruction,
    /// A stimulus to feel, by its place in the trial from 0.
    Present(usize),
    /// The question.
    Answer,
    /// A rest.
    Break,
    /// Everything was presented.
    Over,
}

/// What a key means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StudyKey {
    /// Go on.
    Enter,
    /// A digit of a rating, or the answer of this number.
    Digit(u8),
    /// The decimal point of a rating.
    Point,
    /// Takes the last digit back.
    Back,
}

/// Why a sitting cannot go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExperimentError {
    /// The log.
    #[error(transparent)]
    Log(#[from] LogError),
    /// An answer that does not fit.
    #[error(transparent)]
    Answer(#[from] AnswerError),
}

/// A sitting under way.
pub struct Experiment {
    sitting: Sitting,
    stimulus: Stimulus,
    log: Option<LogWriter>,
    trial: Option<Trial>,
    screen: Screen,
    exploration: Exploration,
    asked: Option<Instant>,
    typed: String,
}

/// Digits of a rating at most.
const MOST_DIGITS: usize = 8;

impl Experiment {
    /// At the next trial of a sitting; what is answered goes into the log.
    #[must_use]
    pub fn new(sitting: Sitting, protocol: &Protocol, log: Option<LogWriter>) -> Self {
        let trial = sitting.next();
        Self {
            screen: if trial.is_some() { Screen::Instruction } else { Screen::Over },
            sitting,
            stimulus: protocol.stimulus().clone(),
            log,
            trial,
            exploration: Exploration::default(),
            asked: None,
            typed: String::new(),
        }
    }

    /// What is shown.
    #[must_use]
    pub fn screen(&self) -> Screen {
        self.screen
    }

    /// The trial under way.
    #[must_use]
    pub fn trial(&self) -> Option<&Trial> {
        self.trial.as_ref()
    }

    /// The digits typed so far.
    #[must_use]
    pub fn typed(&self) -> &str {
        &self.typed
    }

    /// Presentations so far, and about how many are to come.
    #[must_use]
    pub fn progress(&self) -> (u32, usize) {
        (self.sitting.presented(), self.sitting.items_left())
    }

    /// What is varied, and the value to present now.
    #[must_use]
    pub fn stimulus(&self) -> Option<(&Stimulus, f64)> {
        let Screen::Present(index) = self.screen else { return None };
        let value = self.trial?.presented.values().get(index).copied()?;
        Some((&self.stimulus, value))
    }

    /// Whether the subject may see the scene now: while feeling, and never in the haptics-alone condition.
    #[must_use]
    pub fn shows_scene(&self) -> bool {
        let sees = self.trial.is_some_and(|trial| trial.modality == Modality::Vh);
        sees && matches!(self.screen, Screen::Present(_))
    }

    /// Looks at a tick while something is presented.
    pub fn observe(&mut self, record: &TickRecord) {
        if matches!(self.screen, Screen::Present(_)) {
            self.exploration.boundary_hit |= record.events.intersects(Events::BOUNDARY);
            self.exploration.missed_ticks += u64::from(record.events.intersects(Events::MISSED));
        }
    }

    /// Follows a key; a key that means nothing now is ignored.
    ///
    /// # Errors
    /// [`ExperimentError`]: what was answered could not be kept.
    pub fn key(&mut self, key: StudyKey) -> Result<(), ExperimentError> {
        let Some(trial) = self.trial else { return Ok(()) };
        let last = trial.presented.values().len().saturating_sub(1);
        match (self.screen, key) {
            (Screen::Instruction | Screen::Break, StudyKey::Enter) => self.screen = Screen::Present(0),
            (Screen::Present(index), StudyKey::Enter) if index < last => {
                self.screen = Screen::Present(index + 1)
            }
            (Screen::Present(_), StudyKey::Enter) if trial.phase == Phase::Practice => {
                self.answer(&trial, Response::Seen)?;
            }
            (Screen::Present(_), StudyKey::Enter) => {
                self.screen = Screen::Answer;
                self.asked = Some(Instant::now());
            }
            (Screen::Answer, key) => self.answer_key(&trial, key)?,
            _ => {}
        }
        Ok(())
    }

    fn answer_key(&mut self, trial: &Trial, key: StudyKey) -> Result<(), ExperimentError> {
        match (trial.presented, key) {
            (Presented::Pair(_), StudyKey::Digit(1)) => self.answer(trial, Response::First),
            (Presented::Pair(_), StudyKey::Digit(2)) => self.answer(trial, Response::Second),
            (Presented::Pair(_), StudyKey::Digit(0)) => self.answer(trial, Response::DontKnow),
            (Presented::One { .. }, StudyKey::Enter) => match self.typed.parse::<f64>() {
                Ok(rating) if rating.is_finite() && rating > 0.0 => {
                    self.answer(trial, Response::Rating(rating))
                }
                _ => Ok(()),
            },
            (Presented::One { .. }, key) => {
                match key {
                    StudyKey::Digit(digit) if self.typed.len() < MOST_DIGITS => {
                        self.typed.push(char::from(b'0' + digit.min(9)));
                    }
                    StudyKey::Point if !self.typed.contains('.') => self.typed.push('.'),
                    StudyKey::Back => {
                        self.typed.pop();
                    }
                    _ => {}
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn answer(&mut self, trial: &Trial, response: Response) -> Result<(), ExperimentError> {
        let mut exploration = std::mem::take(&mut self.exploration);
        exploration.response_time_s = self.asked.take().map(|asked| asked.elapsed().as_secs_f64());
        let verdict = self.sitting.answer(response, &exploration)?;
        self.typed.clear();
        if let Some(log) = &mut self.log {
            let event = TrialEvent { trial: *trial, response, verdict, exploration };
            log.write(&Event::Trial(Box::new(event)))?;
        }
        self.trial = self.sitting.next();
        self.screen = match &self.trial {
            None => Screen::Over,
            Some(next) if is_another_block(trial, next) => Screen::Break,
            Some(_) => Screen::Present(0),
        };
        if let (Screen::Over, Some(log)) = (self.screen, &mut self.log) {
            log.write(&Event::End { trials: self.sitting.presented() })?;
        }
        Ok(())
    }
}

/// People rest between replications and modalities.
fn is_another_block(last: &Trial, next: &Trial) -> bool {
    (last.modality, last.phase, last.replication) != (next.modality, next.phase, next.replication)
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_study::protocol::{JndProtocol, MagnitudeProtocol, SubjectNumber};

    fn experiment(protocol: &Protocol, subject: u16) -> Experiment {
        let sitting = Sitting::new(protocol, 1, SubjectNumber::new(subject).unwrap());
        Experiment::new(sitting, protocol, None)
    }

    fn press(experiment: &mut Experiment, keys: &[StudyKey]) {
        keys.iter().for_each(|key| experiment.key(*key).unwrap());
    }

    #[test]
    fn a_magnitude_sitting_goes_from_instruction_to_end_by_keyboard() {
        let protocol = Protocol::Magnitude(MagnitudeProtocol::default());
        let mut experiment = experiment(&protocol, 1);
        assert_eq!(experiment.screen(), Screen::Instruction);
        assert_eq!(experiment.stimulus(), None, "nothing is felt before it begins");
        let (mut seen, mut breaks, mut hidden) = (0, 0, 0);
        for _ in 0..2000 {
            match experiment.screen() {
                Screen::Over => break,
                Screen::Instruction => press(&mut experiment, &[StudyKey::Enter]),
                Screen::Break => {
                    breaks += 1;
                    press(&mut experiment, &[StudyKey::Digit(3), StudyKey::Enter]);
                }
                Screen::Present(_) => {
                    seen += 1;
                    let modality = experiment.trial().unwrap().modality;
                    assert_eq!(experiment.shows_scene(), modality == Modality::Vh);
                    hidden += u32::from(!experiment.shows_scene());
                    assert!(experiment.stimulus().is_some_and(|(_, value)| (12.0..=48.0).contains(&value)));
                    press(&mut experiment, &[StudyKey::Enter]);
                }
                Screen::Answer => {
                    assert!(!experiment.shows_scene());
                    let keys = [StudyKey::Enter, StudyKey::Digit(4), StudyKey::Digit(2), StudyKey::Back];
                    press(&mut experiment, &keys);
                    assert_eq!(experiment.typed(), "4");
                    press(&mut experiment, &[StudyKey::Point, StudyKey::Digit(5), StudyKey::Enter]);
                }
            }
        }
        assert_eq!(experiment.screen(), Screen::Over);
        assert_eq!((seen, hidden), (82, 41), "72 trials and two demos of 5, half of them without vision");
        assert_eq!(breaks, 7, "after each demo and replication but the last");
    }

    #[test]
    fn a_pair_is_felt_one_after_the_other_and_answered_by_number() {
        let protocol = Protocol::Jnd(JndProtocol::default());
        let mut experiment = experiment(&protocol, 2);
        press(&mut experiment, &[StudyKey::Enter]);
        let mut answered = 0;
        while answered < 3 {
            let values = experiment.trial().unwrap().presented.values();
            match experiment.screen() {
                Screen::Present(index) => {
                    assert_eq!(experiment.stimulus().map(|(_, value)| value), Some(values[index]));
                    press(&mut experiment, &[StudyKey::Digit(1), StudyKey::Enter]);
                }
                Screen::Answer => {
                    press(&mut experiment, &[StudyKey::Digit(7)]);
                    assert_eq!(experiment.screen(), Screen::Answer, "7 is no answer");
                    press(&mut experiment, &[StudyKey::Digit(answered)]);
                    answered += 1;
                }
                _ => press(&mut experiment, &[StudyKey::Enter]),
            }
        }
    }
}
