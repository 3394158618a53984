//! State machine for the screens of a person's session.

use super::log::StepEvent;
use super::screen::{Again, Input, Pause, Picture, Screen, TrialPlace};
use crate::screen::StimulusExploration;
use crate::time_of_day::TimeOfDay;
use crate::trial::Exploration;
use flotor_study_design::answer::{Answer, Reply};
use flotor_study_design::course::{Course, ReplyError, Step, Trial};
use flotor_study_design::form::Questionnaire;
use flotor_study_design::value::{Setting, Value};
use std::collections::VecDeque;

/// Effect of a person's input.
#[derive(Clone, Debug, PartialEq)]
pub enum Effect {
    /// Another screen is shown.
    Shown,
    /// A step was answered; log it before showing the next screen.
    Answered(Box<StepEvent>),
    /// The person has read this text; log it before showing the next screen.
    Read(String),
    /// Note to be logged; the screen does not change.
    Note(String),
    /// The person stopped the session, or gave any input but a note after the last step.
    Stopped,
}

/// Reason for the rejection of an input; the state is unchanged.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InputError {
    /// The input does not fit the screen; the text explains why.
    #[error("{0}")]
    NotNow(&'static str),
    /// The answer does not fit the question.
    #[error(transparent)]
    Reply(#[from] ReplyError),
}

/// Stage of a trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Ready(Pause),
    /// Index of the interval being felt.
    Feel(usize),
    Ask,
    Confidence,
}

/// Screen state machine of a person's session.
#[derive(Clone, Debug)]
#[must_use]
pub struct AttendedCourse {
    course: Course,
    /// Texts to read before the next step, in order.
    texts: VecDeque<String>,
    stage: Stage,
    /// Place of the trial before; `None` at the start and after a questionnaire.
    before: Option<TrialPlace>,
    exploration: Exploration,
    /// Answer that waits for its confidence.
    answer: Option<Answer>,
    /// Answers to the items of the open questionnaire so far.
    items: Vec<Value>,
    /// Largest number of repetitions of a trial at the person's request; unlimited if `None`.
    again_most: Option<u32>,
    /// Number of repetitions of the trial so far, at the person's request.
    again: u32,
}

impl AttendedCourse {
    /// Creates the state machine at the next step of a course.
    pub fn new(course: Course) -> Self {
        Self {
            course,
            texts: VecDeque::new(),
            stage: Stage::Ready(Pause::Start),
            before: None,
            exploration: Exploration::default(),
            answer: None,
            items: Vec::new(),
            again_most: None,
            again: 0,
        }
    }

    /// Sets the texts that the person reads before the next step, such as a consent form or instructions.
    pub fn after_reading(self, texts: impl IntoIterator<Item = String>) -> Self {
        Self { texts: texts.into_iter().collect(), ..self }
    }

    /// Limits the number of repetitions of a trial at the person's request.
    pub fn with_again_at_most(self, times: Option<u32>) -> Self {
        Self { again_most: times, ..self }
    }

    /// Returns the course.
    #[must_use]
    pub fn course(&self) -> &Course {
        &self.course
    }

    /// Returns the current screen; does not change the state.
    #[must_use]
    pub fn screen(&self) -> Screen {
        let Some(step) = self.course.next() else { return Screen::Over };
        if let Some(text) = self.texts.front() {
            return Screen::Read { text: text.clone() };
        }
        match step {
            Step::Form { questionnaire, .. } => self.item(questionnaire),
            Step::Rest { .. } => self.ready(Pause::Rest),
            Step::Trial(trial) => match self.stage {
                Stage::Ready(reason) => self.ready(reason),
                Stage::Feel(index) => {
                    let (of, trial) = (self.intervals(&trial), self.place(&trial));
                    Screen::Feel { trial, interval: index + 1, of }
                }
                Stage::Ask => {
                    Screen::Ask { task: self.course.design().task().clone(), again: self.again_left() }
                }
                Stage::Confidence => self.confidence(),
            },
        }
    }

    /// Returns the number of the trial and the settings of the interval to be felt, for the apparatus; `None` on other screens. Must
    /// not be shown to the person.
    #[must_use]
    pub fn interval(&self) -> Option<(u32, Vec<(Setting, Value)>)> {
        let (Some(Step::Trial(trial)), Stage::Feel(index), true) =
            (self.course.next(), self.stage, self.texts.is_empty())
        else {
            return None;
        };
        self.course.settings(&trial).into_iter().nth(index).map(|settings| (trial.number, settings))
    }

    /// Records the time from which an interval can be felt; only the first time of a trial counts.
    pub fn record_onset(&mut self, time: TimeOfDay) {
        self.exploration.onset.get_or_insert(time);
    }

    /// Adds the exploration of the interval that has just ended.
    pub fn record_exploration(&mut self, felt: StimulusExploration) {
        self.exploration.kinematics.extend(felt.kinematics);
        self.exploration.boundary_hit |= felt.boundary_hit;
        self.exploration.missed_ticks += felt.missed_ticks;
    }

    /// Processes a person's input, `time_s` seconds after the screen was shown.
    ///
    /// # Errors
    /// [`InputError`]; the screen does not change.
    pub fn input(&mut self, input: Input, time_s: f64) -> Result<Effect, InputError> {
        let input = match (self.course.next(), input) {
            (_, Input::Note(text)) => return Ok(Effect::Note(text)),
            (_, Input::Stop) | (None, _) => return Ok(Effect::Stopped),
            (Some(_), input) => input,
        };
        match (self.course.next(), input) {
            (_, Input::Continue) if !self.texts.is_empty() => {
                Ok(Effect::Read(self.texts.pop_front().unwrap_or_default()))
            }
            _ if !self.texts.is_empty() => {
                Err(InputError::NotNow("this input has no effect while a text is shown; continue first"))
            }
            (Some(Step::Form { questionnaire, .. }), Input::Item(value)) => {
                self.take_item(questionnaire, value)
            }
            (Some(Step::Form { .. }), _) => Err(InputError::NotNow("answer the item first")),
            (Some(Step::Rest { .. }), Input::Continue) => {
                self.reply(Reply::plain(Answer::Rested), None, self.before)
            }
            (Some(Step::Trial(trial)), input) => self.of_trial(&trial, input, time_s),
            _ => Err(InputError::NotNow("no question is open; continue")),
        }
    }

    fn of_trial(&mut self, trial: &Trial, input: Input, time_s: f64) -> Result<Effect, InputError> {
        match (self.stage, input) {
            (Stage::Ready(_), Input::Continue) => Ok(self.go_to(Stage::Feel(0))),
            (Stage::Feel(index), Input::Continue) => {
                let is_last = index + 1 >= self.intervals(trial);
                Ok(self.go_to(if is_last { Stage::Ask } else { Stage::Feel(index + 1) }))
            }
            (Stage::Ask, Input::Again) if self.again_left() == Again::Left(0) => {
                Err(InputError::NotNow("the largest number of repetitions is reached; answer now"))
            }
            (Stage::Ask, Input::Again) => {
                self.again += 1;
                self.exploration.response_time_s = None;
                Ok(self.go_to(Stage::Feel(0)))
            }
            (Stage::Ask, Input::Answer(answer)) => {
                if !self.course.design().task().accepts(&answer) {
                    return Err(ReplyError::Answer(answer).into());
                }
                self.exploration.response_time_s = Some(time_s);
                if self.course.design().task().confidence.is_some() {
                    self.answer = Some(answer);
                    return Ok(self.go_to(Stage::Confidence));
                }
                self.reply_to(trial, Reply::plain(answer))
            }
            (Stage::Confidence, Input::Point(point)) => {
                let answer = self.answer.clone().ok_or(InputError::NotNow("answer the question first"))?;
                self.reply_to(trial, Reply { answer, confidence: Some(point) })
            }
            (Stage::Ask | Stage::Confidence, Input::Continue) => {
                Err(InputError::NotNow("give an answer first"))
            }
            (_, Input::Again) => {
                Err(InputError::NotNow("a trial can be repeated only while its question is open"))
            }
            _ => Err(InputError::NotNow("no question is open yet; continue until the question appears")),
        }
    }

    fn take_item(&mut self, questionnaire: usize, value: Value) -> Result<Effect, InputError> {
        let items = self.form(questionnaire).map_or(&[][..], |form| &form.items);
        let (count, is_right) =
            (items.len(), items.get(self.items.len()).is_some_and(|item| item.accepts(&value)));
        if !is_right {
            return Err(ReplyError::Answer(Answer::Form(vec![value])).into());
        }
        self.items.push(value);
        if self.items.len() < count {
            return Ok(Effect::Shown);
        }
        let answers = std::mem::take(&mut self.items);
        self.reply(Reply::plain(Answer::Form(answers)), None, None)
    }

    fn reply_to(&mut self, trial: &Trial, reply: Reply) -> Result<Effect, InputError> {
        let effect = self.reply(reply, Some(self.exploration.clone()), Some(self.place(trial)))?;
        (self.exploration, self.answer, self.again) = (Exploration::default(), None, 0);
        Ok(effect)
    }

    /// Answers the step of the course; `before` is the trial before the next one, `None` after a questionnaire.
    fn reply(
        &mut self,
        reply: Reply,
        exploration: Option<Exploration>,
        before: Option<TrialPlace>,
    ) -> Result<Effect, InputError> {
        let step = self.course.next().ok_or(ReplyError::Over)?;
        let event = StepEvent { step, reply, exploration };
        self.course.answer(&event.reply, event.handle())?;
        self.before = before;
        self.stage = self.first_stage();
        Ok(Effect::Answered(Box::new(event)))
    }

    fn go_to(&mut self, stage: Stage) -> Effect {
        self.stage = stage;
        Effect::Shown
    }

    /// Returns the first stage of the next trial: its first interval, or a pause with its reason.
    fn first_stage(&self) -> Stage {
        let Some(next) = self.course.upcoming() else { return Stage::Ready(Pause::Start) };
        let (now, is_repeat) = (self.place(&next), next.repeat > 0);
        let reason = match self.before {
            None => Pause::Start,
            Some(_) if is_repeat => Pause::OutOfRange,
            Some(before) if before.phase != now.phase => Pause::PhaseChanges,
            Some(before) if before.picture != now.picture => Pause::PictureChanges,
            Some(before) if before.block != now.block => Pause::BlockBegins,
            Some(_) => return Stage::Feel(0),
        };
        Stage::Ready(reason)
    }

    fn ready(&self, reason: Pause) -> Screen {
        Screen::Ready { reason, next: self.course.upcoming().map(|trial| self.place(&trial)) }
    }

    fn confidence(&self) -> Screen {
        let scale = self.course.design().task().confidence.clone();
        scale.map_or(Screen::Over, |scale| Screen::Confidence { scale })
    }

    fn form(&self, questionnaire: usize) -> Option<&Questionnaire> {
        self.course.design().questionnaires().get(questionnaire)
    }

    fn item(&self, questionnaire: usize) -> Screen {
        let form = self.form(questionnaire);
        let item = form.and_then(|form| form.items.get(self.items.len()));
        let (Some(form), Some(item)) = (form, item) else { return Screen::Over };
        Screen::Item {
            title: form.title.clone(),
            item: item.clone(),
            number: self.items.len() + 1,
            of: form.items.len(),
        }
    }

    fn intervals(&self, trial: &Trial) -> usize {
        self.course.settings(trial).len()
    }

    fn again_left(&self) -> Again {
        self.again_most.map_or(Again::Unlimited, |most| Again::Left(most.saturating_sub(self.again)))
    }

    fn place(&self, trial: &Trial) -> TrialPlace {
        let settings = self.course.design().settings(&trial.condition);
        let picture = settings.iter().find(|(setting, _)| *setting == Setting::Picture);
        let picture =
            picture.map(
                |(_, value)| {
                    if value.to_string() == Setting::SHOWN { Picture::Shown } else { Picture::Hidden }
                },
            );
        TrialPlace { number: trial.number, phase: trial.phase, block: trial.block, picture }
    }
}

#[cfg(test)]
mod tests;
