//! The state machine behind the screens: which comes after which, and what an input does to a sitting.

use super::{Input, Pause, Question, Screen, TrialView};
use crate::blinding::Codes;
use crate::kinematics::StimulusKinematics;
use crate::log::TrialEvent;
use crate::protocol::{Protocol, Quality};
use crate::sitting::{AnswerError, Sitting, Verdict};
use crate::trial::{Exploration, Modality, Phase, Position, Presented, Response, Trial};

/// What became of an input.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// There is another screen.
    Shown,
    /// A trial was answered: to be logged before the next screen is shown.
    Answered(Box<TrialEvent>),
    /// To be logged; the screen stays.
    Note(String),
    /// The person stopped.
    Stopped,
}

/// How one stimulus was felt.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Felt {
    /// Measures of the movement, where they are kept.
    pub kinematics: Option<StimulusKinematics>,
    /// Whether the handle left its range.
    pub boundary_hit: bool,
    /// Ticks the servo missed meanwhile.
    pub missed_ticks: u64,
}

/// An input that does not fit the screen; nothing has changed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InputError {
    /// Nothing is asked now, or something is.
    #[error("{0}")]
    NotNow(&'static str),
    /// The answer does not fit the question.
    #[error(transparent)]
    Answer(#[from] AnswerError),
}

/// Where a trial stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Ready(Pause),
    /// Index of the stimulus.
    Feel(usize),
    Ask,
}

/// A person's sitting.
#[derive(Clone, Debug)]
pub struct Attended {
    sitting: Sitting,
    codes: Codes,
    quality: Quality,
    stage: Stage,
    exploration: Exploration,
    of_about: u64,
    rest_every: u32,
    since_rest: u32,
}

impl Attended {
    /// A sitting at its first trial, or where it broke off; a rest is offered after so many trials (0: never).
    #[must_use]
    pub fn new(sitting: Sitting, protocol: &Protocol, seed: u64, rest_every: u32) -> Self {
        Self {
            sitting,
            codes: Codes::new(protocol, seed),
            quality: protocol.stimulus().quality(),
            stage: Stage::Ready(Pause::Welcome),
            exploration: Exploration::default(),
            of_about: protocol.presentations_about(),
            rest_every,
            since_rest: 0,
        }
    }

    /// What is shown now; the same however often it is asked.
    #[must_use]
    pub fn screen(&self) -> Screen {
        let Some(trial) = self.sitting.next() else { return Screen::Over };
        let view = self.view(&trial);
        match self.stage {
            Stage::Ready(reason) => Screen::Ready { reason, next: view },
            Stage::Feel(index) => Screen::Feel { position: position(&trial, index), trial: view },
            Stage::Ask => Screen::Ask { question: question(&trial), trial: view },
        }
    }

    /// The stimulus to be felt now and the trial it belongs to: for the apparatus, not for eyes.
    #[must_use]
    pub fn stimulus(&self) -> Option<(Trial, f64)> {
        let trial = self.sitting.next()?;
        match self.stage {
            Stage::Feel(index) => Some((trial, trial.presented.values().get(index).copied()?)),
            Stage::Ready(_) | Stage::Ask => None,
        }
    }

    /// Takes in how the stimulus was felt that has just gone.
    pub fn felt(&mut self, felt: Felt) {
        self.exploration.kinematics.extend(felt.kinematics);
        self.exploration.boundary_hit |= felt.boundary_hit;
        self.exploration.missed_ticks += felt.missed_ticks;
    }

    /// Takes in what a person did, `time_s` after the screen came up.
    ///
    /// # Errors
    /// [`InputError`]; the screen stays as it is.
    pub fn input(&mut self, input: Input, time_s: f64) -> Result<Step, InputError> {
        let Some(trial) = self.sitting.next() else {
            return match input {
                Input::Note { text } => Ok(Step::Note(text)),
                _ => Ok(Step::Stopped),
            };
        };
        match (self.stage, input) {
            (_, Input::Note { text }) => Ok(Step::Note(text)),
            (_, Input::Stop) => Ok(Step::Stopped),
            (Stage::Ready(_), Input::Continue) => self.go_to(Stage::Feel(0)),
            (Stage::Feel(index), Input::Continue) => {
                let last = index + 1 >= trial.presented.values().len();
                self.go_to(if last { Stage::Ask } else { Stage::Feel(index + 1) })
            }
            (Stage::Ask, Input::Again) => self.go_to(Stage::Feel(0)),
            (Stage::Ask, Input::Continue) if trial.phase == Phase::Practice => {
                self.answer(&trial, Response::Seen, time_s)
            }
            (Stage::Ask, Input::Answer { response }) => self.answer(&trial, response, time_s),
            (Stage::Ask, Input::Continue) => Err(InputError::NotNow("an answer is expected")),
            (_, Input::Answer { .. }) => Err(InputError::NotNow("no question is open yet")),
            (_, Input::Again) => Err(InputError::NotNow("it can be repeated after its end")),
        }
    }

    /// Presentations so far.
    #[must_use]
    pub fn presented(&self) -> u32 {
        self.sitting.presented()
    }

    /// Whether everything was presented.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.sitting.is_over()
    }

    // A `Result`, so that every arm above reads the same.
    #[allow(clippy::unnecessary_wraps)]
    fn go_to(&mut self, stage: Stage) -> Result<Step, InputError> {
        self.stage = stage;
        Ok(Step::Shown)
    }

    fn answer(&mut self, trial: &Trial, response: Response, time_s: f64) -> Result<Step, InputError> {
        self.exploration.response_time_s = Some(time_s);
        let verdict = self.sitting.answer(response, &self.exploration)?;
        let exploration = std::mem::take(&mut self.exploration);
        self.since_rest += 1;
        self.stage = self.next_stage(trial, verdict);
        Ok(Step::Answered(Box::new(TrialEvent { trial: *trial, response, verdict, exploration })))
    }

    /// Straight to the next stimulus, unless there is something to say first.
    fn next_stage(&mut self, before: &Trial, verdict: Verdict) -> Stage {
        let Some(next) = self.sitting.next() else { return Stage::Ask };
        let pause = if verdict == Verdict::Repeated {
            Some(Pause::OutOfRange)
        } else if next.phase != before.phase {
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

    fn view(&self, trial: &Trial) -> TrialView {
        TrialView {
            number: trial.number,
            of_about: self.of_about.max(trial.number.into()),
            phase: trial.phase,
            object_is_shown: trial.modality == Modality::Vh,
            condition: self.codes.condition(trial.modality, &trial.presented),
            repeat: trial.repeat,
            stimuli: trial.presented.values().len(),
            quality: self.quality,
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
    match (trial.phase, trial.presented) {
        (Phase::Practice, _) => Question::Nothing,
        (Phase::Main, Presented::Pair(_)) => Question::WhichIsMore,
        (Phase::Main, Presented::One { .. }) => Question::HowMuch,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{JndProtocol, MagnitudeProtocol, SubjectNumber};

    fn attended(protocol: &Protocol, rest_every: u32) -> Attended {
        let sitting = Sitting::new(protocol, 4, SubjectNumber::new(1).unwrap());
        Attended::new(sitting, protocol, 4, rest_every)
    }

    /// A whole sitting through the screens gives the trials of the bare state machine, in its order.
    #[test]
    fn screens_lead_through_every_trial_of_the_sitting() {
        let protocol = Protocol::Magnitude(MagnitudeProtocol::default());
        let mut person = attended(&protocol, 10);
        let mut bare = Sitting::new(&protocol, 4, SubjectNumber::new(1).unwrap());
        let (mut pauses, mut felt, mut answered) = (Vec::new(), 0, 0);
        loop {
            let screen = person.screen();
            assert_eq!(screen, person.screen(), "looking changes nothing");
            let input = match screen {
                Screen::Over => break,
                Screen::Ready { reason, .. } => {
                    pauses.push(reason);
                    Input::Continue
                }
                Screen::Feel { position, .. } => {
                    assert_eq!(position, None);
                    let (trial, value) = person.stimulus().unwrap();
                    assert_eq!((Some(trial), trial.presented), (bare.next(), Presented::One { value }));
                    felt += 1;
                    Input::Continue
                }
                Screen::Ask { question: Question::Nothing, .. } => Input::Continue,
                Screen::Ask { question, trial } => {
                    assert_eq!((question, trial.quality), (Question::HowMuch, Quality::Stiffness));
                    Input::Answer { response: Response::Rating(3.0) }
                }
            };
            if let Step::Answered(event) = person.input(input, 0.5).unwrap() {
                assert_eq!(bare.answer(event.response, &event.exploration), Ok(event.verdict));
                assert_eq!(event.exploration.response_time_s, Some(0.5));
                answered += 1;
            }
        }
        assert_eq!((felt, answered, bare.is_over()), (82, 82, true));
        assert_eq!(pauses.iter().filter(|pause| **pause == Pause::Welcome).count(), 1);
        assert_eq!(pauses.iter().filter(|pause| **pause == Pause::PhaseChanges).count(), 3);
        assert!(pauses.iter().filter(|pause| **pause == Pause::Rest).count() >= 6, "{pauses:?}");
    }

    #[test]
    fn what_does_not_fit_the_screen_changes_nothing() {
        let mut jnd = JndProtocol::default();
        jnd.demo.shown = false;
        let mut person = attended(&Protocol::Jnd(jnd), 0);
        let wrong = |person: &mut Attended, input: Input| {
            let before = person.screen();
            assert!(person.input(input, 0.0).is_err());
            assert_eq!(person.screen(), before);
        };
        let answer = |response| Input::Answer { response };
        wrong(&mut person, answer(Response::First));
        wrong(&mut person, Input::Again);
        person.input(Input::Continue, 0.0).unwrap();
        assert!(matches!(person.screen(), Screen::Feel { position: Some(Position::First), .. }));
        wrong(&mut person, answer(Response::First));
        person.input(Input::Continue, 0.0).unwrap();
        person.input(Input::Continue, 0.0).unwrap();
        wrong(&mut person, Input::Continue);
        wrong(&mut person, answer(Response::Rating(1.0)));
        // Once more, then an answer; a note in between.
        person.input(Input::Again, 0.0).unwrap();
        assert!(matches!(person.screen(), Screen::Feel { position: Some(Position::First), .. }));
        let note = Input::Note { text: "dog barked".to_owned() };
        assert_eq!(person.input(note, 0.0), Ok(Step::Note("dog barked".to_owned())));
        person.input(Input::Continue, 0.0).unwrap();
        person.input(Input::Continue, 0.0).unwrap();
        assert!(matches!(person.input(answer(Response::DontKnow), 1.0), Ok(Step::Answered(_))));
        assert_eq!(person.input(Input::Stop, 0.0), Ok(Step::Stopped));
    }

    /// A handle out of its range: the person is told, and the same trial comes again.
    #[test]
    fn out_of_range_is_said_and_repeated() {
        let mut jnd = JndProtocol::default();
        jnd.demo.shown = false;
        let mut person = attended(&Protocol::Jnd(jnd), 0);
        person.input(Input::Continue, 0.0).unwrap();
        person.felt(Felt { kinematics: None, boundary_hit: true, missed_ticks: 2 });
        person.input(Input::Continue, 0.0).unwrap();
        person.input(Input::Continue, 0.0).unwrap();
        let step = person.input(Input::Answer { response: Response::First }, 0.0).unwrap();
        let Step::Answered(event) = step else { panic!("{step:?}") };
        assert_eq!((event.verdict, event.exploration.missed_ticks), (Verdict::Repeated, 2));
        assert!(matches!(person.screen(), Screen::Ready { reason: Pause::OutOfRange, .. }));
    }

    #[test]
    fn screens_and_inputs_travel_as_json_without_a_stimulus() {
        let mut person = attended(&Protocol::Jnd(JndProtocol::default()), 0);
        person.input(Input::Continue, 0.0).unwrap();
        let screen = person.screen();
        let text = serde_json::to_string(&screen).unwrap();
        assert_eq!(serde_json::from_str::<Screen>(&text).unwrap(), screen);
        let (_, value) = person.stimulus().unwrap();
        assert!(!text.contains(&value.to_string()), "{text}");
        let rating = r#"{"input":"answer","response":{"rating":7.5}}"#;
        let expected = Input::Answer { response: Response::Rating(7.5) };
        assert_eq!(serde_json::from_str::<Input>(rating).unwrap(), expected);
        assert_eq!(serde_json::from_str::<Input>(r#"{"input":"continue"}"#).unwrap(), Input::Continue);
    }
}
