//! A sitting carried out: stimuli presented, answers asked for, every trial on disk before the next.

use crate::log::{Event, LogError, LogWriter, TrialEvent};
use crate::observer::SimulatedSubject;
use crate::sitting::{AnswerError, Sitting};
use crate::trial::{Exploration, Response, Trial};

/// Whatever went wrong in an apparatus or a terminal.
pub type OutsideError = Box<dyn std::error::Error + Send + Sync>;

/// Presents the stimuli of a trial, one after the other, and says what happened.
pub trait Presenter {
    /// Presents a trial. Not real-time.
    ///
    /// # Errors
    /// What the apparatus said; the trial counts as never presented.
    fn present(&mut self, trial: &Trial) -> Result<Exploration, OutsideError>;
}

/// What a respondent says.
#[derive(Clone, Debug, PartialEq)]
pub enum Reply {
    /// The answer, and how long it took, s.
    Answer {
        /// The answer.
        response: Response,
        /// From the end of the presentation.
        time_s: Option<f64>,
    },
    /// A note of the experimenter; the question stays.
    Note(String),
    /// Enough for now; the trial was not answered.
    Stop,
}

/// Answers trials: a person at a keyboard, or somebody simulated.
pub trait Respondent {
    /// Asked after a trial was presented. Not real-time.
    ///
    /// # Errors
    /// Nobody can be asked any more.
    fn respond(&mut self, trial: &Trial, exploration: &Exploration) -> Result<Reply, OutsideError>;
}

impl Respondent for SimulatedSubject {
    fn respond(&mut self, trial: &Trial, _exploration: &Exploration) -> Result<Reply, OutsideError> {
        Ok(Reply::Answer { response: SimulatedSubject::respond(self, trial), time_s: None })
    }
}

/// Presents nothing: simulated observers who need no apparatus.
#[derive(Clone, Copy, Debug, Default)]
pub struct Nothing;

impl Presenter for Nothing {
    fn present(&mut self, _trial: &Trial) -> Result<Exploration, OutsideError> {
        Ok(Exploration::default())
    }
}

/// How a sitting ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// Everything was presented.
    Complete,
    /// The respondent stopped; the log can be resumed.
    Stopped,
}

/// Why a sitting broke off. What is in the log stays and can be resumed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConductError {
    /// The log.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The apparatus, before the first trial.
    #[error("{0}")]
    Outside(OutsideError),
    /// The apparatus or the respondent, in a trial.
    #[error("trial {trial}: {cause}")]
    Trial {
        /// Its number in the sitting.
        trial: u32,
        /// What was said.
        cause: OutsideError,
    },
    /// The respondent gave an answer that is none.
    #[error(transparent)]
    Answer(#[from] AnswerError),
}

/// Carries a sitting on to its end. `watch` is told of every trial once it is on disk.
///
/// # Errors
/// [`ConductError`]; the trials before are in the log.
pub fn conduct(
    sitting: &mut Sitting,
    log: &mut LogWriter,
    presenter: &mut dyn Presenter,
    respondent: &mut dyn Respondent,
    watch: &mut dyn FnMut(&TrialEvent),
) -> Result<Ending, ConductError> {
    while let Some(trial) = sitting.next() {
        let outside = |cause| ConductError::Trial { trial: trial.number, cause };
        let mut exploration = presenter.present(&trial).map_err(outside)?;
        let response = loop {
            match respondent.respond(&trial, &exploration).map_err(outside)? {
                Reply::Answer { response, time_s } => {
                    exploration.response_time_s = time_s;
                    break response;
                }
                Reply::Note(text) => log.write(&Event::Note { text })?,
                Reply::Stop => return Ok(Ending::Stopped),
            }
        };
        let verdict = sitting.answer(response, &exploration)?;
        let event = TrialEvent { trial, response, verdict, exploration };
        log.write(&Event::Trial(Box::new(event.clone())))?;
        watch(&event);
    }
    log.write(&Event::End { trials: sitting.presented() })?;
    Ok(Ending::Complete)
}

/// A sitting of a simulated observer without apparatus and without a log, for studies of the method itself.
#[must_use]
pub fn rehearse(mut sitting: Sitting, subject: &SimulatedSubject) -> (Sitting, Vec<TrialEvent>) {
    let mut events = Vec::new();
    while let Some(trial) = sitting.next() {
        let response = SimulatedSubject::respond(subject, &trial);
        let exploration = Exploration::default();
        let Ok(verdict) = sitting.answer(response, &exploration) else { break };
        events.push(TrialEvent { trial, response, verdict, exploration });
    }
    (sitting, events)
}
