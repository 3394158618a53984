//! Screens and inputs of a person's session of a designed study.
//!
//! A front end shows a [`Screen`] and returns an [`Input`]. No screen has a value of a stimulus or a name of a condition.

use flotor_study_design::answer::Answer;
use flotor_study_design::course::Phase;
use flotor_study_design::form::Item;
use flotor_study_design::task::{AnswerScale, Task};
use flotor_study_design::value::Value;

/// Current screen.
#[derive(Clone, Debug, PartialEq)]
pub enum Screen {
    /// Text by the experimenter, such as a consent form or instructions; [`Input::Continue`] confirms the text.
    Read {
        /// Text; its first line is the title.
        text: String,
    },
    /// A message before the next trial; [`Input::Continue`] proceeds.
    Ready {
        /// Reason for the pause.
        reason: Pause,
        /// The next trial; `None` if no trial follows.
        next: Option<TrialPlace>,
    },
    /// An interval to be felt; [`Input::Continue`] ends it.
    Feel {
        /// Trial of the interval.
        trial: TrialPlace,
        /// Number of the interval, from 1.
        interval: usize,
        /// Number of intervals of the trial.
        of: usize,
    },
    /// The question of the trial, answered by [`Input::Answer`].
    Ask {
        /// The question.
        task: Task,
        /// Permission to feel the trial again.
        again: Again,
    },
    /// The question about the confidence in the answer, answered by [`Input::Point`].
    Confidence {
        /// Scale of the confidence.
        scale: AnswerScale,
    },
    /// Item of a questionnaire, answered by [`Input::Item`].
    Item {
        /// Title of the questionnaire; may be empty.
        title: String,
        /// The item.
        item: Item,
        /// Number of the item, from 1.
        number: usize,
        /// Number of items.
        of: usize,
    },
    /// All steps were answered.
    Over,
}

/// Permission to feel a trial again before its answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Again {
    /// Any number of times.
    Unlimited,
    /// This number of times; 0 at the limit.
    Left(u32),
}

/// Reason for a pause before a trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pause {
    /// The session begins or resumes, or a questionnaire is over.
    Start,
    /// Practice begins or ends.
    PhaseChanges,
    /// The picture appears or disappears.
    PictureChanges,
    /// A block begins.
    BlockBegins,
    /// Time to rest the hand.
    Rest,
    /// The handle left its range, and the trial is repeated.
    OutOfRange,
}

/// Place of a trial in the session, without its stimuli.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrialPlace {
    /// Number in the session, from 1.
    pub number: u32,
    /// Role in the analysis.
    pub phase: Phase,
    /// Number of the block, from 1.
    pub block: u32,
    /// Picture of the object; `None` if no factor changes it.
    pub picture: Option<Picture>,
}

/// Picture of the object during a trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Picture {
    /// Drawn.
    Shown,
    /// Not drawn.
    Hidden,
}

/// Input of a person.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// Proceeds to the next screen.
    Continue,
    /// Repeats the trial from the first interval on.
    Again,
    /// Answers the question of the trial.
    Answer(Answer),
    /// Names a point on the scale of the confidence.
    Point(f64),
    /// Answers an item of a questionnaire.
    Item(Value),
    /// Adds a note of the experimenter; the screen does not change.
    Note(String),
    /// Stops the session.
    Stop,
}
