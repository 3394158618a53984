//! State machine for the screens of a person's sitting.

use super::{Input, May, Pause, Question, Screen, TrialView};
use crate::kinematics::StimulusKinematics;
use crate::log::TrialEvent;
use crate::protocol::{Protocol, Quality};
use crate::sitting::{AnswerError, Sitting, Verdict, check_kind};
use crate::time_of_day::TimeOfDay;
use crate::trial::{Exploration, Modality, Position, Presented, Response, Trial};
use std::collections::VecDeque;

/// Effect of a person's input.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Another screen is shown.
    Shown,
    /// A trial was answered; log it before showing the next screen.
    Answered(Box<TrialEvent>),
    /// The answer to the trial of this number was withdrawn; log the withdrawal before showing the question again.
    Withdrawn(u32),
    /// A practice trial before the sitting resumes was answered; log this description before showing the next screen.
    Practised(String),
    /// The person has read this text; log it before showing the next screen.
    Read(String),
    /// Note to be logged; the screen does not change.
    Note(String),
    /// The person stopped the sitting, or gave any input but a note after the last trial.
    Stopped,
}

/// Exploration of one stimulus.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StimulusExploration {
    /// Movement measures; `None` if not recorded.
    pub kinematics: Option<StimulusKinematics>,
    /// True if the handle left its range.
    pub boundary_hit: bool,
    /// Number of ticks the servo missed during the stimulus.
    pub missed_ticks: u64,
}

/// Reason for the rejection of an input; the state is unchanged.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InputError {
    /// The input does not fit the screen; the text explains why.
    #[error("{0}")]
    NotNow(&'static str),
    /// A rating is 0 or below, which a ratio scale excludes.
    #[error("a rating must be a number above 0")]
    NotAbove0,
    /// The answer does not fit the question.
    #[error(transparent)]
    Answer(#[from] AnswerError),
}

/// Stage of a trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Ready(Pause),
    /// Index of the stimulus being felt.
    Feel(usize),
    Ask,
}

/// Availability of a withdrawal of the last answer.
#[derive(Clone, Debug)]
enum Undo {
    /// The last answer can be withdrawn; holds the state before it.
    Possible(Box<Before>),
    /// The answer to the open trial was already withdrawn once.
    Used,
    Impossible,
}

/// State before the last answer, restored by a withdrawal.
#[derive(Clone, Debug)]
struct Before {
    sitting: Sitting,
    exploration: Exploration,
    since_rest: u32,
    again: u32,
}

/// Screen state machine of a person's sitting.
#[derive(Clone, Debug)]
#[must_use]
pub struct ScreenStateMachine {
    sitting: Sitting,
    quality: Quality,
    /// Texts to read before the next trial, in order.
    texts: VecDeque<String>,
    stage: Stage,
    exploration: Exploration,
    of_about: u64,
    rest_every: u32,
    since_rest: u32,
    /// Maximum number of repetitions of a trial at the person's request; unlimited if `None`.
    again_most: Option<u32>,
    /// Number of repetitions of the current trial so far, at the person's request.
    again: u32,
    undo: Undo,
    /// Practice trials offered before the sitting resumes; empty once started.
    offered: Vec<Trial>,
    /// Remaining practice trials, in order.
    practice: VecDeque<Trial>,
}

impl ScreenStateMachine {
    /// Creates the state machine at the next trial of a sitting; offers a rest after every `rest_every` trials (0: never).
    pub fn new(sitting: Sitting, protocol: &Protocol, rest_every: u32) -> Self {
        Self {
            sitting,
            quality: protocol.stimulus().quality(),
            texts: VecDeque::new(),
            stage: Stage::Ready(Pause::Welcome),
            exploration: Exploration::default(),
            of_about: protocol.presentations_about(),
            rest_every,
            since_rest: 0,
            again_most: None,
            again: 0,
            undo: Undo::Impossible,
            offered: Vec::new(),
            practice: VecDeque::new(),
        }
    }

    /// Sets the texts that the person reads before the next trial, such as a consent form or instructions.
    pub fn after_reading(self, texts: impl IntoIterator<Item = String>) -> Self {
        Self { texts: texts.into_iter().collect(), ..self }
    }

    /// Limits the number of repetitions of a trial at the person's request.
    pub fn with_again_at_most(self, times: u32) -> Self {
        Self { again_most: Some(times), ..self }
    }

    /// Offers practice before the sitting resumes ([`Input::Practise`]).
    pub fn with_practice_offered(self) -> Self {
        Self { offered: self.sitting.practice(), ..self }
    }

    /// Marks the open trial as already answered and withdrawn; its next answer cannot be withdrawn.
    pub fn with_answer_taken_back(self) -> Self {
        Self { undo: Undo::Used, ..self }
    }

    /// Returns the open trial, of practice or of the sitting; `None` if all trials were presented.
    fn trial(&self) -> Option<Trial> {
        self.practice.front().copied().or_else(|| self.sitting.next())
    }

    /// Returns the current screen; does not change the state.
    #[must_use]
    pub fn screen(&self) -> Screen {
        let Some(trial) = self.trial() else { return Screen::Over };
        if let Some(text) = self.texts.front() {
            return Screen::Read { text: text.clone() };
        }
        let view = self.view(&trial);
        match self.stage {
            Stage::Ready(reason) => Screen::Ready { reason, next: view },
            Stage::Feel(index) => Screen::Feel { position: position(&trial, index), trial: view },
            Stage::Ask => Screen::Ask { question: question(&trial), trial: view },
        }
    }

    /// Returns the trial and value of the stimulus to be felt, for the apparatus; `None` on other screens. Must not be shown to
    /// the person.
    #[must_use]
    pub fn stimulus(&self) -> Option<(Trial, f64)> {
        let trial = self.trial()?;
        match self.stage {
            Stage::Feel(index) => Some((trial, trial.presented.values().get(index).copied()?)),
            Stage::Ready(_) | Stage::Ask => None,
        }
    }

    /// Records the time from which a stimulus can be felt; only the first time of a trial counts.
    pub fn record_onset(&mut self, time: TimeOfDay) {
        self.exploration.onset.get_or_insert(time);
    }

    /// Adds the exploration of the stimulus that has just ended.
    pub fn record_exploration(&mut self, felt: StimulusExploration) {
        self.exploration.kinematics.extend(felt.kinematics);
        self.exploration.boundary_hit |= felt.boundary_hit;
        self.exploration.missed_ticks += felt.missed_ticks;
    }

    /// Processes a person's input, `time_s` seconds after the screen was shown.
    ///
    /// # Errors
    /// [`InputError`]; the screen does not change.
    pub fn input(&mut self, input: Input, time_s: f64) -> Result<Step, InputError> {
        let Some(trial) = self.trial() else {
            return match input {
                Input::Note { text } => Ok(Step::Note(text)),
                _ => Ok(Step::Stopped),
            };
        };
        if !self.texts.is_empty() {
            return match input {
                Input::Note { text } => Ok(Step::Note(text)),
                Input::Stop => Ok(Step::Stopped),
                Input::Continue => Ok(Step::Read(self.texts.pop_front().unwrap_or_default())),
                Input::Again | Input::Withdraw | Input::Practise | Input::Answer { .. } => {
                    Err(InputError::NotNow("this input has no effect while a text is shown; continue first"))
                }
            };
        }
        match (self.stage, input) {
            (_, Input::Note { text }) => Ok(Step::Note(text)),
            (_, Input::Stop) => Ok(Step::Stopped),
            (Stage::Ready(Pause::Welcome), Input::Practise) if !self.offered.is_empty() => {
                self.practice = std::mem::take(&mut self.offered).into();
                self.go_to(Stage::Ready(Pause::PhaseChanges))
            }
            (_, Input::Practise) => Err(InputError::NotNow(
                "practice is not offered now, only at the start of a sitting that resumes after its practice",
            )),
            (_, Input::Withdraw) => self.withdraw(),
            (Stage::Ready(_), Input::Continue) => self.go_to(Stage::Feel(0)),
            (Stage::Feel(index), Input::Continue) => {
                // The felt stimulus could influence the previous answer, which is final from now on.
                if matches!(self.undo, Undo::Possible(_)) {
                    self.undo = Undo::Impossible;
                }
                let last = index + 1 >= trial.presented.values().len();
                self.go_to(if last { Stage::Ask } else { Stage::Feel(index + 1) })
            }
            (Stage::Ask, Input::Again) if self.again_left() == Some(0) => {
                Err(InputError::NotNow("the largest number of repetitions is reached; answer now"))
            }
            (Stage::Ask, Input::Again) => {
                self.again += 1;
                self.exploration.response_time_s = None;
                self.go_to(Stage::Feel(0))
            }
            (Stage::Ask, Input::Answer { response: Response::Rating(rating) }) if rating <= 0.0 => {
                Err(InputError::NotAbove0)
            }
            (Stage::Ask, Input::Answer { response }) => self.answer(&trial, response, time_s),
            (Stage::Ask, Input::Continue) => Err(InputError::NotNow("give an answer first")),
            (_, Input::Answer { .. }) => {
                Err(InputError::NotNow("no question is open yet; continue until the question appears"))
            }
            (_, Input::Again) => {
                Err(InputError::NotNow("a trial can be repeated only while its question is open"))
            }
        }
    }

    /// Returns the number of presentations so far.
    #[must_use]
    pub fn presented(&self) -> u32 {
        self.sitting.presented()
    }

    /// Returns true if all trials were presented.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.sitting.is_over()
    }

    // Returns a `Result` like the other branches of `input`.
    #[allow(clippy::unnecessary_wraps)]
    fn go_to(&mut self, stage: Stage) -> Result<Step, InputError> {
        self.stage = stage;
        Ok(Step::Shown)
    }

    fn answer(&mut self, trial: &Trial, response: Response, time_s: f64) -> Result<Step, InputError> {
        if !self.practice.is_empty() {
            return self.practised(trial, response);
        }
        let mut exploration = self.exploration.clone();
        // Add the response time of a withdrawn answer.
        exploration.response_time_s = Some(exploration.response_time_s.unwrap_or(0.0) + time_s);
        let before = self.sitting.clone();
        let verdict = self.sitting.answer(response, &exploration)?;
        self.undo = match self.undo {
            Undo::Used => Undo::Impossible,
            Undo::Possible(_) | Undo::Impossible => Undo::Possible(Box::new(Before {
                sitting: before,
                exploration: exploration.clone(),
                since_rest: self.since_rest,
                again: self.again,
            })),
        };
        self.exploration = Exploration::default();
        self.since_rest += 1;
        self.again = 0;
        self.stage = self.next_stage(trial, verdict);
        Ok(Step::Answered(Box::new(TrialEvent { trial: *trial, response, verdict, exploration })))
    }

    fn practised(&mut self, trial: &Trial, response: Response) -> Result<Step, InputError> {
        check_kind(trial, response)?;
        self.practice.pop_front();
        (self.exploration, self.again) = (Exploration::default(), 0);
        self.stage = self.next_stage(trial, Verdict::Taken);
        let values: Vec<String> = trial.presented.values().iter().map(ToString::to_string).collect();
        let (values, word) = (values.join(" and "), response.word());
        Ok(Step::Practised(format!("practice before going on: presented {values}, answer {word}")))
    }

    fn withdraw(&mut self) -> Result<Step, InputError> {
        match (self.stage, std::mem::replace(&mut self.undo, Undo::Used)) {
            (Stage::Ready(_) | Stage::Feel(0), Undo::Possible(before)) => {
                let Before { sitting, exploration, since_rest, again } = *before;
                (self.sitting, self.exploration) = (sitting, exploration);
                (self.since_rest, self.again) = (since_rest, again);
                self.stage = Stage::Ask;
                Ok(Step::Withdrawn(self.sitting.presented() + 1))
            }
            (_, undo) => {
                self.undo = undo;
                Err(InputError::NotNow(
                    "no answer can be taken back now; take an answer back before the next stimulus ends, and only once",
                ))
            }
        }
    }

    /// Returns the stage after an answer: the next stimulus, or a pause with its reason.
    fn next_stage(&mut self, before: &Trial, verdict: Verdict) -> Stage {
        let Some(next) = self.trial() else { return Stage::Ask };
        let pause = if verdict == Verdict::Repeated {
            Some(Pause::OutOfRange)
        } else if next.phase.shown() != before.phase.shown() {
            Some(Pause::PhaseChanges)
        } else if next.modality != before.modality {
            Some(Pause::ModalityChanges)
        } else if self.rest_every > 0 && self.since_rest >= self.rest_every {
            Some(Pause::Rest)
        } else {
            None
        };
        if matches!(pause, Some(Pause::Rest | Pause::PhaseChanges)) {
            self.since_rest = 0;
        }
        pause.map_or(Stage::Feel(0), Stage::Ready)
    }

    /// Returns the number of remaining repetitions of the trial; unlimited if `None`.
    fn again_left(&self) -> Option<u32> {
        self.again_most.map(|most| most.saturating_sub(self.again))
    }

    fn may(&self) -> Vec<May> {
        let again = match (self.stage, self.again_left()) {
            (Stage::Ask, left) if left != Some(0) => Some(May::Again { left }),
            _ => None,
        };
        let withdraw = match (self.stage, &self.undo) {
            (Stage::Ready(_) | Stage::Feel(0), Undo::Possible(_)) => Some(May::Withdraw),
            _ => None,
        };
        let is_offered = self.stage == Stage::Ready(Pause::Welcome) && !self.offered.is_empty();
        again.into_iter().chain(withdraw).chain(is_offered.then_some(May::Practise)).collect()
    }

    fn view(&self, trial: &Trial) -> TrialView {
        // A practice trial before a resumed sitting has the number of the next trial.
        let number = if trial.number == 0 { self.presented() + 1 } else { trial.number };
        TrialView {
            number,
            of_about: self.of_about.max(number.into()),
            phase: trial.phase.shown(),
            object_is_shown: trial.modality == Modality::Vh,
            repeat: trial.repeat,
            stimuli: trial.presented.values().len(),
            quality: self.quality,
            may: self.may(),
        }
    }
}

fn position(trial: &Trial, index: usize) -> Option<Position> {
    match trial.presented {
        Presented::One { .. } => None,
        Presented::Pair(_) if index == 0 => Some(Position::First),
        Presented::Pair(_) => Some(Position::Second),
    }
}

fn question(trial: &Trial) -> Question {
    // The question is asked in practice, too, so that the person knows it before trials count.
    match trial.presented {
        Presented::Pair(_) => Question::WhichIsMore,
        Presented::One { .. } => Question::HowMuch,
    }
}

#[cfg(test)]
mod tests;
