//! Screens and inputs of a person's sitting.
//!
//! A front end (terminal or window) shows [`ScreenStateMachine::screen`], waits for an [`Input`], and passes it to
//! [`ScreenStateMachine::input`]. Screens and inputs are plain data (serde) and also travel as lines of JSON
//! ([`WindowMessage`], [`WindowReply`]) to the viewer, a separate program. No screen identifies the stimulus, not even by a
//! code: a person could learn the answer for a code.
//!
//! ```text
//! Ready -> Feel (first) -> Feel (second) -> Ask -> Ready or Feel of the next trial ... -> Over
//!            ^                               |
//!            +------------ again ------------+
//!                    Ready or Feel (first) -- withdraw --> Ask of the trial before
//! ```

mod attended;
mod line;

pub use attended::{InputError, ScreenStateMachine, Step, StimulusExploration};
pub use line::{Warning, WindowMessage, WindowReply, WindowState};

use crate::protocol::Quality;
use crate::trial::{Phase, Position, Response};
use flotor_study_design::words;
use serde::{Deserialize, Serialize};

/// Key of the emergency stop in a window; by default not the space bar, which a person tends to press to continue.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum StopKey {
    /// Escape
    #[default]
    Escape,
    /// The space bar
    Space,
    /// F12
    F12,
}

words! { StopKey { Escape = "escape", Space = "space", F12 = "f12" } }

/// Current screen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "screen", rename_all = "kebab-case")]
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
        /// The next trial.
        next: TrialView,
    },
    /// A stimulus to be felt; [`Input::Continue`] ends the stimulus.
    Feel {
        /// Trial of the stimulus.
        trial: TrialView,
        /// Position in a pair; `None` for a single stimulus.
        position: Option<Position>,
    },
    /// A question, answered by [`Input::Answer`].
    Ask {
        /// Trial of the question.
        trial: TrialView,
        /// Kind of question.
        question: Question,
    },
    /// All trials were presented.
    Over,
}

impl Screen {
    /// Returns the trial of the screen, if it has one.
    #[must_use]
    pub fn trial(&self) -> Option<&TrialView> {
        match self {
            Self::Ready { next: trial, .. } | Self::Feel { trial, .. } | Self::Ask { trial, .. } => {
                Some(trial)
            }
            Self::Over | Self::Read { .. } => None,
        }
    }
}

/// Reason for a pause between stimuli.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pause {
    /// The sitting begins or resumes.
    Welcome,
    /// Practice begins or ends.
    PhaseChanges,
    /// The object becomes visible, or invisible.
    ModalityChanges,
    /// Time to rest the hand.
    Rest,
    /// The handle left its range, and the trial is repeated.
    OutOfRange,
}

/// Kind of question.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Question {
    /// Choice of the stimulus with more of the judged quality: [`Response::First`], [`Response::Second`] or
    /// [`Response::DontKnow`].
    WhichIsMore,
    /// Magnitude on a free scale: [`Response::Rating`], any number above 0.
    HowMuch,
}

/// Data on a trial for a front end, without the stimulus values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrialView {
    /// Number of this presentation in the sitting, from 1.
    pub number: u32,
    /// Estimated number of presentations in the sitting.
    pub of_about: u64,
    /// Phase as shown to the subject: a check appears as a counted trial.
    pub phase: Phase,
    /// True if the object is visible.
    pub object_is_shown: bool,
    /// Number of repeats of the trial so far because the handle left its range.
    pub repeat: u32,
    /// Number of stimuli: one to rate, or two to compare.
    pub stimuli: usize,
    /// Quality of the stimulus that the subject judges: stiffness or force.
    pub quality: Quality,
    /// Optional inputs that the screen accepts.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub may: Vec<May>,
}

/// Optional input of a person.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum May {
    /// Repeat the trial: [`Input::Again`].
    Again {
        /// Remaining repetitions; unlimited if `None`.
        left: Option<u32>,
    },
    /// Withdraw the last answer: [`Input::Withdraw`].
    Withdraw,
    /// Practise before the sitting resumes: [`Input::Practise`].
    Practise,
}

/// Input of a person.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "input", rename_all = "kebab-case")]
pub enum Input {
    /// Proceeds to the next screen.
    Continue,
    /// Repeats the trial from the first stimulus on.
    Again,
    /// Answers the question.
    Answer {
        /// Answer to the question.
        response: Response,
    },
    /// Withdraws the last answer and returns to its question; possible once per trial, before the next stimulus was felt.
    Withdraw,
    /// Starts practice before the sitting resumes; practice does not count.
    Practise,
    /// Adds a note of the experimenter; the screen does not change.
    Note {
        /// Text of the note.
        text: String,
    },
    /// Stops the sitting.
    Stop,
}
