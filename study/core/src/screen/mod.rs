//! A person's way through a sitting, screen by screen: what is shown now, and what they may do about it.
//!
//! Made for any front end, a terminal or a window alike: show [`Attended::screen`], wait for an [`Input`], hand it to
//! [`Attended::input`]. Screens and inputs are plain data (serde), so they also travel as lines of JSON ([`Told`], [`Said`]): the
//! viewer's window is a program of its own. No screen says which stimulus it is, not even by a
//! code: the answer to a code can be learnt.
//!
//! ```text
//! Ready -> Feel (first) -> Feel (second) -> Ask -> Ready or Feel of the next trial ... -> Over
//!            ^                               |
//!            +------------ again ------------+
//!                    Ready or Feel (first) -- withdraw --> Ask of the trial before
//! ```

mod attended;
mod line;

pub use attended::{Attended, Felt, InputError, Step};
pub use line::{Said, Told, Warning, WindowState};

use crate::protocol::Quality;
use crate::trial::{Phase, Position, Response};
use serde::{Deserialize, Serialize};

/// What is shown now.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "screen", rename_all = "kebab-case")]
pub enum Screen {
    /// A text of the experimenter, such as a consent or instructions; [`Input::Continue`] says that it was read.
    Read {
        /// The text; its first line is a title.
        text: String,
    },
    /// Words before the next trial; [`Input::Continue`] goes on.
    Ready {
        /// Why.
        reason: Pause,
        /// What is to come.
        next: TrialView,
    },
    /// A stimulus is there to be felt; [`Input::Continue`] when it was.
    Feel {
        /// The trial.
        trial: TrialView,
        /// Which of a pair; none where there is only one.
        position: Option<Position>,
    },
    /// A question; [`Input::Answer`].
    Ask {
        /// The trial.
        trial: TrialView,
        /// The question.
        question: Question,
    },
    /// Everything was presented.
    Over,
}

impl Screen {
    /// The trial that it is about, if it is about one.
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

/// Why nothing is felt just now.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pause {
    /// The sitting begins, or goes on after it broke off.
    Welcome,
    /// From practice to what counts, or to practice again.
    PhaseChanges,
    /// The object will be seen from now on, or no longer.
    ModalityChanges,
    /// Time to rest the hand.
    Rest,
    /// The handle left its range: the trial comes again.
    OutOfRange,
}

/// What may be asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Question {
    /// Which had more of it: [`Response::First`], [`Response::Second`] or [`Response::DontKnow`].
    WhichIsMore,
    /// How much: [`Response::Rating`], any number above 0 of one's own.
    HowMuch,
}

/// What a front end may know of a trial.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrialView {
    /// Count of presentations in the sitting, from 1.
    pub number: u32,
    /// About how many there will be.
    pub of_about: u64,
    /// Whether it counts.
    pub phase: Phase,
    /// Whether the object is to be seen.
    pub object_is_shown: bool,
    /// How often it had to be repeated.
    pub repeat: u32,
    /// How many stimuli it has: one to be rated, or two to be compared.
    pub stimuli: usize,
    /// What is judged.
    pub quality: Quality,
    /// What the person may do now besides going on and answering.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub may: Vec<May>,
}

/// Something that a person may do, but need not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum May {
    /// Feel the trial once more: [`Input::Again`].
    Again {
        /// So many more times; none: without limit.
        left: Option<u32>,
    },
    /// Take the last answer back: [`Input::Withdraw`].
    Withdraw,
    /// Practise before the sitting goes on: [`Input::Practise`].
    Practise,
}

/// What a person does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "input", rename_all = "kebab-case")]
pub enum Input {
    /// Goes on.
    Continue,
    /// Wants to feel the trial once more, from the first stimulus on.
    Again,
    /// Answers the question.
    Answer {
        /// The answer.
        response: Response,
    },
    /// Takes the last answer back, once for each trial and before the next stimulus was felt: its question is open again.
    Withdraw,
    /// Practises before the sitting goes on; none of it counts.
    Practise,
    /// A note of the experimenter; the screen stays.
    Note {
        /// In their words.
        text: String,
    },
    /// Enough for now.
    Stop,
}
