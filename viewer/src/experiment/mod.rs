//! A sitting of a perception experiment, as the window in front of a person sees it.
//!
//! The experiment is another program, `flotor study`: trials, stimuli, answers and the log are its own. It tells this window
//! which screen to show, and the window says what the person does ([`wire`]). Here is what lies between the two: the screen of
//! the moment, the digits typed so far, and what a key means now. All of it works by keyboard alone: in studies the other hand
//! holds the device.

pub mod screens;
pub mod texts;
pub mod wire;

use egui::Context;
use flotor_study::screen::{Input, May, Question, Said, Screen, Told, WindowState};
use flotor_study::trial::Response;
use std::sync::mpsc::{Receiver, Sender, TryRecvError};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};
use texts::Texts;

/// What a key means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StudyKey {
    /// Go on.
    Enter,
    /// Feel it again.
    Again,
    /// Practise before the sitting goes on.
    Practise,
    /// Take the last answer back.
    Withdraw,
    /// A digit of a rating, or the answer of this number.
    Digit(u8),
    /// The decimal point of a rating.
    Point,
    /// Takes the last digit back.
    Back,
}

/// Digits of a rating at most.
const MOST_DIGITS: usize = 8;
/// How long a warning stays in sight after the last one.
const WARNED: Duration = Duration::from_secs(2);

/// The key that is the emergency stop in a sitting: not the largest one, which a person presses to go on.
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

impl StopKey {
    /// The same for the window.
    #[must_use]
    pub const fn key(self) -> egui::Key {
        match self {
            Self::Escape => egui::Key::Escape,
            Self::Space => egui::Key::Space,
            Self::F12 => egui::Key::F12,
        }
    }
}

/// The screen of the moment, and both ways to the experiment.
#[derive(Debug)]
pub struct Prompt {
    told: Receiver<Told>,
    said: Sender<Said>,
    screen: Option<Screen>,
    /// Keys mean something; else the experiment was told what the person did, and prepares the next screen.
    is_persons_turn: bool,
    typed: String,
    warned: Option<Instant>,
    refused: Option<String>,
    is_lost: bool,
    waker: Waker,
    /// What stops the device at once.
    pub stop_key: StopKey,
    /// Texts of the screens.
    pub texts: Texts,
}

/// Wakes the window when the experiment has said something: shared with who listens to it, and without effect until the window is
/// open.
#[derive(Clone, Debug, Default)]
pub struct Waker(Arc<OnceLock<Context>>);

impl Waker {
    /// Asks for a picture.
    pub fn wake(&self) {
        if let Some(context) = self.0.get() {
            context.request_repaint();
        }
    }
}

impl Prompt {
    /// A window that is told by one channel and speaks by the other.
    #[must_use]
    pub fn new(told: Receiver<Told>, said: Sender<Said>) -> Self {
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

    /// What is to be woken by who sends what the experiment says.
    #[must_use]
    pub fn waker(&self) -> Waker {
        self.waker.clone()
    }

    /// Says that the window is open.
    pub fn open(&mut self, window: &Context) {
        let _ = self.waker.0.set(window.clone()); // a window opens once
        self.say(Said::Window { window: WindowState::Open });
    }

    /// Takes in what the experiment has said since; true if the person is to be warned with a sound.
    pub fn take_in(&mut self) -> bool {
        let mut warn = false;
        loop {
            match self.told.try_recv() {
                Ok(Told::Screen(screen)) => {
                    self.screen = Some(screen);
                    self.is_persons_turn = true;
                    self.typed.clear();
                    self.refused = None;
                }
                Ok(Told::Warning { .. }) => {
                    self.warned = Some(Instant::now());
                    warn = true;
                }
                Ok(Told::Refused { refused }) => {
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

    /// What is shown; none before the experiment has said so.
    #[must_use]
    pub fn screen(&self) -> Option<&Screen> {
        self.screen.as_ref()
    }

    /// Whether the experiment has gone before its last screen.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        self.is_lost && self.screen != Some(Screen::Over)
    }

    /// Whether keys mean something now.
    #[must_use]
    pub fn is_persons_turn(&self) -> bool {
        self.is_persons_turn
    }

    /// The digits typed so far.
    #[must_use]
    pub fn typed(&self) -> &str {
        &self.typed
    }

    /// Whether the handle was out of its range a moment ago.
    #[must_use]
    pub fn is_warned(&self) -> bool {
        self.warned_for().is_some()
    }

    /// How much longer that stays in sight.
    #[must_use]
    pub fn warned_for(&self) -> Option<Duration> {
        self.warned.and_then(|since| WARNED.checked_sub(since.elapsed()))
    }

    /// Why the last answer was not taken, if so.
    #[must_use]
    pub fn refused(&self) -> Option<&str> {
        self.refused.as_deref()
    }

    /// Whether the person may see the scene now: while feeling, and never in the haptics-alone condition.
    #[must_use]
    pub fn shows_scene(&self) -> bool {
        matches!(&self.screen, Some(Screen::Feel { trial, .. }) if trial.object_is_shown)
    }

    /// Follows a key; a key that means nothing now is ignored.
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
            self.say(Said::Input(input));
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

    fn say(&mut self, said: Said) {
        self.is_lost |= self.said.send(said).is_err();
    }
}

#[cfg(test)]
mod tests;
