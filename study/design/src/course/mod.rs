//! State machine of one subject in one session of a designed study, for people, simulated observers and replay.
//!
//! [`Course::next`] returns the next step, [`Course::answer`] processes its answer. Both depend only on design, seed, subject, session
//! and the answers so far: a course that repeats the answers of a log continues as the interrupted one.

mod plan;
mod session;
mod step;

pub use session::Session;
pub use step::{Phase, Signal, Step, Trial};

use crate::answer::{Answer, Position, Reply};
use crate::design::{Condition, Design, TrackOrder};
use crate::method::{Outcome, Track};
use crate::random::Purpose;
use crate::stimulus::{Side, Stimulus};
use crate::task::Ask;
use crate::value::{Setting, Value};
use plan::{Item, Planned, Running};
use serde::Serialize;
use std::collections::VecDeque;

/// State of the handle while a step was presented.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Handle {
    /// Always in its range.
    InRange,
    /// Pushed out of its range: the trial is presented again, up to [`Course::REPEATS`] times.
    LeftRange,
}

/// Reason for the rejection of an answer; the state is unchanged.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReplyError {
    /// The answer does not fit the question.
    #[error("the answer is not one of those offered at this step; give one of these")]
    Answer(Answer),
    /// The confidence is missing, is not on its scale, or is not a part of the question.
    #[error("{}; give a point of the scale of confidence, where the question has one", match .0 {
        Some(given) => format!("the confidence {given} is not expected here"),
        None => "the confidence is missing".to_owned(),
    })]
    Confidence(Option<f64>),
    /// All steps were answered.
    #[error("the session is complete; no further answer is accepted")]
    Over,
}

/// Result of a track.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TrackResult {
    /// Number of the track in the session, from 1.
    pub track: u32,
    /// Number of the block.
    pub block: u32,
    /// Levels of all factors.
    pub condition: Condition,
    /// Threshold on the scale of the levels; `None` if the track ended without one.
    pub threshold: Option<f64>,
    /// Number of counted trials.
    pub trials: u32,
}

/// Session of one subject in progress.
#[derive(Clone, Debug)]
pub struct Course {
    design: Design,
    session: Session,
    items: VecDeque<Item>,
    presented: u32,
    since_rest: u32,
    repeat: u32,
    results: Vec<TrackResult>,
}

impl Course {
    /// Maximum number of repeats of one trial.
    pub const REPEATS: u32 = 3;

    /// Creates the course at its first step.
    #[must_use]
    pub fn new(design: &Design, session: Session) -> Self {
        let items = plan::items(design, session);
        Self {
            design: design.clone(),
            session,
            items,
            presented: 0,
            since_rest: 0,
            repeat: 0,
            results: Vec::new(),
        }
    }

    /// Returns the design.
    #[must_use]
    pub fn design(&self) -> &Design {
        &self.design
    }

    /// Returns the name of the course.
    #[must_use]
    pub fn session(&self) -> Session {
        self.session
    }

    /// Returns the number of trials answered so far, practice and repeats included.
    #[must_use]
    pub fn presented(&self) -> u32 {
        self.presented
    }

    /// Returns true if all steps were answered.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.items.is_empty()
    }

    /// Returns the results of the completed tracks, in order of completion.
    #[must_use]
    pub fn results(&self) -> &[TrackResult] {
        &self.results
    }

    /// Returns the step to present now, `None` after the last; does not change the state.
    #[must_use]
    pub fn next(&self) -> Option<Step> {
        let item = self.items.front()?;
        if let Item::Form { questionnaire, block } = *item {
            return Some(Step::Form { questionnaire, block });
        }
        let rest_every = self.design.blocks().rest_every;
        if rest_every > 0 && self.since_rest >= rest_every {
            return Some(Step::Rest { after: self.presented });
        }
        self.trial().map(Step::Trial)
    }

    /// Returns the next trial, which may come after questionnaires or a rest; `None` if no trial follows.
    #[must_use]
    pub fn upcoming(&self) -> Option<Trial> {
        let mut after = self.clone();
        while let Some(Item::Form { .. }) = after.items.front() {
            after.items.pop_front();
        }
        after.trial()
    }

    /// Returns the settings of each interval of a trial, in the order of presentation: those of the condition, then the stimulus.
    #[must_use]
    pub fn settings(&self, trial: &Trial) -> Vec<Vec<(Setting, Value)>> {
        let condition = self.design.settings(&trial.condition);
        match self.design.stimulus() {
            None => vec![condition],
            Some(stimulus) => {
                let of = |value: &Value| {
                    condition.iter().cloned().chain([(stimulus.setting().clone(), value.clone())]).collect()
                };
                trial.intervals.iter().map(of).collect()
            }
        }
    }

    /// Processes the answer to the step of [`Course::next`], and advances to the next step or to a repeat.
    ///
    /// # Errors
    /// If the answer does not fit the step, or the course is over; the state is unchanged.
    pub fn answer(&mut self, reply: &Reply, handle: Handle) -> Result<(), ReplyError> {
        let step = self.next().ok_or(ReplyError::Over)?;
        self.check(&step, reply)?;
        match step {
            Step::Form { .. } => drop(self.items.pop_front()),
            Step::Rest { .. } => self.since_rest = 0,
            Step::Trial(trial) => {
                self.presented += 1;
                self.since_rest += 1;
                if handle == Handle::LeftRange && self.repeat < Self::REPEATS {
                    self.repeat += 1;
                    return Ok(());
                }
                self.repeat = 0;
                self.take(&trial, &reply.answer);
            }
        }
        Ok(())
    }

    fn check(&self, step: &Step, reply: &Reply) -> Result<(), ReplyError> {
        let task = self.design.task();
        let is_right = match (step, &reply.answer) {
            (Step::Rest { .. }, Answer::Rested) => true,
            (Step::Form { questionnaire, .. }, Answer::Form(answers)) => {
                let items =
                    self.design.questionnaires().get(*questionnaire).map_or(&[][..], |form| &form.items);
                items.len() == answers.len() && items.iter().zip(answers).all(|(item, one)| item.accepts(one))
            }
            (Step::Trial(_), answer) => task.accepts(answer),
            _ => false,
        };
        if !is_right {
            return Err(ReplyError::Answer(reply.answer.clone()));
        }
        let scale = task.confidence.as_ref().filter(|_| matches!(step, Step::Trial(_)));
        match (scale, reply.confidence) {
            (None, None) => Ok(()),
            (Some(scale), Some(point)) if scale.has(point) => Ok(()),
            (_, confidence) => Err(ReplyError::Confidence(confidence)),
        }
    }

    /// Returns the trial of the first item; `None` if it has none.
    fn trial(&self) -> Option<Trial> {
        let number = self.presented + 1;
        // A repeat presents the same trial: its draws have the number of the first presentation.
        let name = number - self.repeat;
        let (planned, track) = match self.items.front()? {
            Item::Form { .. } => return None,
            Item::Trial(planned) => (planned.clone(), 0),
            Item::Tracks(tracks) => {
                let running = tracks.get(self.chosen(tracks, name)?)?;
                (self.planned(running, name), running.number)
            }
        };
        let Planned { phase, block, condition, level, signal } = planned;
        let shown = match signal {
            Signal::Present => level,
            Signal::Absent => level.map(|_| 0.0),
        };
        let value = |level: f64| self.design.value(&condition, level);
        let (intervals, comparison_at) = match (&self.design.task().ask, shown) {
            (_, None) => (Vec::new(), None),
            (Ask::Choice { .. }, Some(level)) => {
                let second = self.session.stream(Purpose::Presentation, name).coin();
                let (standard, comparison) = (value(0.0), value(level));
                let (order, at) = if second {
                    ([standard, comparison], Position::Second)
                } else {
                    ([comparison, standard], Position::First)
                };
                (order.into_iter().flatten().collect(), Some(at))
            }
            (_, Some(level)) => (value(level).into_iter().collect(), None),
        };
        let signal = matches!(self.design.task().ask, Ask::Detection { .. }).then_some(signal);
        let (level, repeat) = (shown, self.repeat);
        Some(Trial {
            number,
            phase,
            block,
            track,
            condition,
            level,
            intervals,
            comparison_at,
            signal,
            repeat,
        })
    }

    /// Returns the index of the track of the trial with this number.
    fn chosen(&self, tracks: &[Running], name: u32) -> Option<usize> {
        match self.design.blocks().tracks {
            TrackOrder::Successive => (!tracks.is_empty()).then_some(0),
            TrackOrder::Interleaved => {
                let stream = &mut self.session.stream(Purpose::Interleaving, name);
                (!tracks.is_empty()).then(|| stream.below(tracks.len()))
            }
        }
    }

    /// Returns the next trial of a track: its level, or no signal in a share of the trials of a detection.
    fn planned(&self, running: &Running, name: u32) -> Planned {
        let share = match (&self.design.task().ask, &running.track) {
            (Ask::Detection { .. }, Track::Limits(_)) => 0.0,
            (Ask::Detection { absent_share }, _) => *absent_share,
            _ => 0.0,
        };
        let is_absent = self.session.stream(Purpose::Presentation, name).uniform() < share;
        Planned {
            phase: Phase::Main,
            block: running.block,
            condition: running.condition.clone(),
            level: Some(running.track.level()),
            signal: if is_absent { Signal::Absent } else { Signal::Present },
        }
    }

    /// Takes an answer that counts, and removes what it completes.
    fn take(&mut self, trial: &Trial, answer: &Answer) {
        let Some(Item::Tracks(tracks)) = self.items.front_mut() else {
            self.items.pop_front();
            return;
        };
        let Some(index) = tracks.iter().position(|running| running.number == trial.track) else { return };
        let outcome = outcome(trial, answer).map(|outcome| match self.design.stimulus() {
            Some(Stimulus::Graded { side: Side::Below, .. }) if trial.comparison_at.is_some() => {
                outcome.mirrored()
            }
            _ => outcome,
        });
        if let (Some(running), Some(outcome)) = (tracks.get_mut(index), outcome) {
            running.trials += 1;
            // A trial without the signal does not belong to the track of the signal's level.
            if trial.signal != Some(Signal::Absent) {
                running.track.answer(outcome);
            }
            if !running.track.is_done() {
                return;
            }
        }
        let Running { number, block, condition, track, trials } = tracks.remove(index);
        let threshold = track.threshold();
        self.results.push(TrackResult { track: number, block, condition, threshold, trials });
        if tracks.is_empty() {
            self.items.pop_front();
        }
    }
}

/// Returns the outcome of an answer for its track: positive if the signal was noticed or the comparison was named as that with more on
/// its side of the standard; `None` for an answer that no track can follow.
fn outcome(trial: &Trial, answer: &Answer) -> Option<Outcome> {
    let named = |position: Position| {
        if trial.comparison_at == Some(position) { Outcome::Positive } else { Outcome::Negative }
    };
    Some(match answer {
        Answer::First => named(Position::First),
        Answer::Second => named(Position::Second),
        Answer::Unsure => Outcome::Unsure,
        Answer::Present => Outcome::Positive,
        Answer::Absent => Outcome::Negative,
        Answer::Rating(point) => Outcome::Rated(*point),
        Answer::Magnitude(_) | Answer::Form(_) | Answer::Rested => return None,
    })
}
