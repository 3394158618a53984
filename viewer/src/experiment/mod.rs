//! Sitting of a perception experiment, in the window in front of the person.
//!
//! The experiment is a separate program, `flotor study`, which owns trials, stimuli, answers and the log. It sends the screen to
//! show, and the window sends the input of the person ([`wire`]). This module has the state in between: the current screen, the
//! digits typed so far, and the meaning of each key. All input works by keyboard alone: in studies the other hand holds the
//! device.

pub mod screens;
pub mod texts;
pub mod wire;

use egui::Context;
use flotor_study::screen::{Input, May, Question, Screen, StopKey, WindowMessage, WindowReply, WindowState};
use flotor_study::trial::Response;
use std::sync::mpsc::{Receiver, Sender, TryRecvError};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};
use texts::Texts;

/// Meaning of a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StudyKey {
    /// Continue, or confirm a typed rating.
    Enter,
    /// Feel the stimulus again.
    Again,
    /// Practise before the sitting continues.
    Practise,
    /// Withdraw the last answer.
    Withdraw,
    /// Type a digit of a rating, or choose the answer of this number.
    Digit(u8),
    /// Type the decimal point of a rating.
    Point,
    /// Delete the last digit or the decimal point.
    Back,
}

/// Length of a typed rating from which no further digits are accepted.
const MOST_DIGITS: usize = 8;
/// Display time of a warning.
const WARNED: Duration = Duration::from_secs(2);

/// Returns egui's key for the configured key of the emergency stop.
#[must_use]
pub const fn key_of(stop_key: StopKey) -> egui::Key {
    match stop_key {
        StopKey::Escape => egui::Key::Escape,
        StopKey::Space => egui::Key::Space,
        StopKey::F12 => egui::Key::F12,
    }
}

/// Current screen, and the channels from and to the experiment.
#[derive(Debug)]
pub struct Prompt {
    told: Receiver<WindowMessage>,
    said: Sender<WindowReply>,
    screen: Option<Screen>,
    /// True while keys are accepted; false while the experiment prepares the next screen.
    is_persons_turn: bool,
    typed: String,
    warned: Option<Instant>,
    refused: Option<String>,
    is_lost: bool,
    waker: Waker,
    /// Key of the emergency stop.
    pub stop_key: StopKey,
    /// Texts of the screens.
    pub texts: Texts,
}

/// Handle for waking the window on a message of the experiment; shared with the thread that receives messages, and without effect
/// until the window is open.
#[derive(Clone, Debug, Default)]
pub struct Waker(Arc<OnceLock<Context>>);

impl Waker {
    /// Requests a repaint of the window.
    pub fn wake(&self) {
        if let Some(context) = self.0.get() {
            context.request_repaint();
        }
    }
}

impl Prompt {
    /// Creates a prompt with the channels from and to the experiment.
    #[must_use]
    pub fn new(told: Receiver<WindowMessage>, said: Sender<WindowReply>) -> Self {
        Self {
            told,
            said,
            screen: None,
            is_persons_turn: false,
            typed: String::new(),
            warned: None,
            refused: None,
            is_lost: false,
            waker: Waker::default(),
            stop_key: StopKey::default(),
            texts: Texts::english(),
        }
    }

    /// Returns the waker for the thread that receives messages.
    #[must_use]
    pub fn waker(&self) -> Waker {
        self.waker.clone()
    }

    /// Connects the waker to the window, and reports to the experiment that the window is open.
    pub fn open(&mut self, window: &Context) {
        let _ = self.waker.0.set(window.clone()); // a window opens once
        self.say(WindowReply::Window { window: WindowState::Open });
    }

    /// Processes new messages of the experiment; returns true if a warning sound is due.
    pub fn poll(&mut self) -> bool {
        let mut warn = false;
        loop {
            match self.told.try_recv() {
                Ok(WindowMessage::Screen(screen)) => {
                    self.screen = Some(screen);
                    self.is_persons_turn = true;
                    self.typed.clear();
                    self.refused = None;
                }
                Ok(WindowMessage::Warning { .. }) => {
                    self.warned = Some(Instant::now());
                    warn = true;
                }
                Ok(WindowMessage::Refused { refused }) => {
                    self.refused = Some(refused);
                    self.is_persons_turn = true;
                }
                Err(TryRecvError::Empty) => return warn,
                Err(TryRecvError::Disconnected) => {
                    self.is_lost = true;
                    return warn;
                }
            }
        }
    }

    /// Returns the current screen; `None` before the first message of the experiment.
    #[must_use]
    pub fn screen(&self) -> Option<&Screen> {
        self.screen.as_ref()
    }

    /// Returns whether the experiment has ended before its last screen.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.is_lost && self.screen != Some(Screen::Over)
    }

    /// Returns whether keys are accepted now.
    #[must_use]
    pub fn is_persons_turn(&self) -> bool {
        self.is_persons_turn
    }

    /// Returns the rating typed so far: digits and a decimal point.
    #[must_use]
    pub fn typed(&self) -> &str {
        &self.typed
    }

    /// Returns whether the warning about a handle outside its range is shown.
    #[must_use]
    pub fn is_warned(&self) -> bool {
        self.warned_for().is_some()
    }

    /// Returns the remaining display time of the warning; `None` without a warning.
    #[must_use]
    pub fn warned_for(&self) -> Option<Duration> {
        self.warned.and_then(|since| WARNED.checked_sub(since.elapsed()))
    }

    /// Returns the reason for the rejection of the last input; `None` if the input was accepted.
    #[must_use]
    pub fn refused(&self) -> Option<&str> {
        self.refused.as_deref()
    }

    /// Returns whether the person may see the scene now: while feeling, and never in the haptics-alone condition.
    #[must_use]
    pub fn shows_scene(&self) -> bool {
        matches!(&self.screen, Some(Screen::Feel { trial, .. }) if trial.object_is_shown)
    }

    /// Processes a key: edits the typed rating, or sends an input to the experiment. Ignores a key without meaning on the current
    /// screen.
    pub fn key(&mut self, key: StudyKey) {
        let Some(screen) = self.screen.as_ref().filter(|_| self.is_persons_turn) else { return };
        let answer = |response| Some(Input::Answer { response });
        let question = match screen {
            Screen::Ask { question, .. } => Some(*question),
            Screen::Over => return,
            Screen::Ready { .. } | Screen::Feel { .. } | Screen::Read { .. } => None,
        };
        let may = |what| screen.trial().is_some_and(|trial| trial.may.contains(&what));
        let input = match (question, key) {
            (None, StudyKey::Enter) => Some(Input::Continue),
            (None, StudyKey::Practise) => may(May::Practise).then_some(Input::Practise),
            (None, StudyKey::Withdraw) => may(May::Withdraw).then_some(Input::Withdraw),
            (Some(_), StudyKey::Again) => Some(Input::Again),
            (Some(Question::WhichIsMore), StudyKey::Digit(1)) => answer(Response::First),
            (Some(Question::WhichIsMore), StudyKey::Digit(2)) => answer(Response::Second),
            (Some(Question::WhichIsMore), StudyKey::Digit(0)) => answer(Response::DontKnow),
            (Some(Question::HowMuch), StudyKey::Enter) => {
                self.typed.parse().ok().and_then(|rating| answer(Response::Rating(rating)))
            }
            (Some(Question::HowMuch), key) => {
                self.write(key);
                None
            }
            _ => None,
        };
        if let Some(input) = input {
            self.is_persons_turn = false;
            self.refused = None;
            self.say(WindowReply::Input(input));
        }
    }

    fn write(&mut self, key: StudyKey) {
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
    }

    fn say(&mut self, said: WindowReply) {
        self.is_lost |= self.said.send(said).is_err();
    }
}

#[cfg(test)]
mod tests;
