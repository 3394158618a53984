//! A sitting carried out: stimuli presented, answers asked for, every trial on disk before the next.

use crate::log::{Event, LogError, LogWriter, TrialEvent};
use crate::observer::SimulatedSubject;
use crate::sitting::{AnswerError, Sitting};
use crate::trial::{Exploration, Trial};
use std::sync::atomic::{AtomicBool, Ordering};

/// Whatever went wrong in an apparatus or a terminal.
pub type OutsideError = Box<dyn std::error::Error + Send + Sync>;

/// Presents the stimuli of a trial, one after the other, and says what happened.
pub trait Presenter {
    /// Presents a trial; `None` if a request to stop ended the presentation: the trial counts as never presented. Not real-time.
    ///
    /// # Errors
    /// What the apparatus said; the trial counts as never presented.
    fn present(&mut self, trial: &Trial) -> Result<Option<Exploration>, OutsideError>;
}

/// Presents nothing: simulated observers who need no apparatus.
#[derive(Clone, Copy, Debug, Default)]
pub struct Nothing;

impl Presenter for Nothing {
    fn present(&mut self, _trial: &Trial) -> Result<Option<Exploration>, OutsideError> {
        Ok(Some(Exploration::default()))
    }
}

/// How a sitting ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// Everything was presented.
    Complete,
    /// It was stopped; the log can be resumed.
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
    /// The apparatus, in a trial.
    #[error("trial {trial}: {cause}")]
    Trial {
        /// Its number in the sitting.
        trial: u32,
        /// What was said.
        cause: OutsideError,
    },
    /// The subject gave an answer that is none.
    #[error(transparent)]
    Answer(#[from] AnswerError),
}

/// Carries the sitting of a simulated subject on to its end, or to where it is stopped. `watch` is told of every trial once it
/// is on disk.
///
/// # Errors
/// [`ConductError`]; the trials before are in the log.
pub fn conduct(
    sitting: &mut Sitting,
    log: &mut LogWriter,
    presenter: &mut dyn Presenter,
    subject: &SimulatedSubject,
    watch: &dyn Fn(),
    stop: &AtomicBool,
) -> Result<Ending, ConductError> {
    while let Some(trial) = sitting.next() {
        let outside = |cause| ConductError::Trial { trial: trial.number, cause };
        let Some(exploration) = presenter.present(&trial).map_err(outside)? else {
            return Ok(Ending::Stopped);
        };
        if stop.load(Ordering::Relaxed) {
            return Ok(Ending::Stopped);
        }
        let response = subject.respond(&trial);
        let verdict = sitting.answer(response, &exploration)?;
        log.write(&Event::Trial(Box::new(TrialEvent { trial, response, verdict, exploration })))?;
        watch();
    }
    log.write(&Event::End { trials: sitting.presented() })?;
    Ok(Ending::Complete)
}
