//! Sitting of a simulated subject: presents stimuli, collects answers, and writes every trial to disk before the next.

use crate::log::{Event, LogError, LogWriter, TrialEvent};
use crate::observer::SimulatedSubject;
use crate::sitting::{AnswerError, Sitting};
use crate::trial::{Exploration, Trial};
use std::sync::atomic::{AtomicBool, Ordering};

/// Error of an apparatus or a front end.
pub type ApparatusOrFrontEndError = Box<dyn std::error::Error + Send + Sync>;

/// Apparatus that presents the stimuli of a trial one after the other and measures the exploration.
pub trait Presenter {
    /// Presents a trial; returns `None` if a stop request interrupted the trial, which then counts as not presented. Not
    /// real-time.
    ///
    /// # Errors
    /// Errors of the apparatus; the trial counts as not presented.
    fn present(&mut self, trial: &Trial) -> Result<Option<Exploration>, ApparatusOrFrontEndError>;
}

/// Presenter without an apparatus, for simulated observers.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoApparatus;

impl Presenter for NoApparatus {
    fn present(&mut self, _trial: &Trial) -> Result<Option<Exploration>, ApparatusOrFrontEndError> {
        Ok(Some(Exploration::default()))
    }
}

/// Way in which a sitting ended without an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// All trials were presented.
    Complete,
    /// Stopped on request; the log can be resumed.
    Stopped,
}

/// Error that interrupted a sitting. The log stays valid and can be resumed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConductError {
    /// Error of the log.
    #[error(transparent)]
    Log(#[from] LogError),
    /// Error in setting up the apparatus, before the first trial.
    #[error("{0}")]
    Outside(ApparatusOrFrontEndError),
    /// Error of the apparatus during a trial.
    #[error("trial {trial}: {cause}")]
    Trial {
        /// Trial number in the sitting.
        trial: u32,
        /// Error of the apparatus.
        cause: ApparatusOrFrontEndError,
    },
    /// The subject gave an invalid answer.
    #[error(transparent)]
    Answer(#[from] AnswerError),
}

/// Runs the sitting of a simulated subject until it is complete or stopped. `watch` is called after each trial is on disk. Not
/// real-time.
///
/// # Errors
/// [`ConductError`]; earlier trials are in the log.
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
