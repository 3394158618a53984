//! Designed study with simulated subjects: presents each step, collects its answer, and writes it to disk before the next.

use super::dataset::{DesignedData, Progress};
use super::log::{Begin, Event, FORMAT, StepEvent};
use crate::conduct::ApparatusOrFrontEndError;
use crate::dataset::{DatasetError, ExistingLogPolicy};
use crate::log::{InputFile, LogWriter, Plan};
use crate::trial::Exploration;
use flotor_study_design::course::{Course, Session, Step, Trial};
use flotor_study_design::design::Design;
use flotor_study_design::observer::{Population, SimulatedObserver};
use flotor_study_design::subject::SubjectNumber;
use flotor_study_design::value::{Setting, Value};
use serde_json::json;
use std::num::NonZeroUsize;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// Apparatus that presents the intervals of a trial one after the other, each with its settings, and measures the exploration.
pub trait DesignedPresenter {
    /// Presents a trial; returns `None` if a stop request interrupted it, which then counts as not presented. Not real-time.
    ///
    /// # Errors
    /// Errors of the apparatus; the trial counts as not presented.
    fn present(
        &mut self,
        trial: &Trial,
        intervals: &[Vec<(Setting, Value)>],
    ) -> Result<Option<Exploration>, ApparatusOrFrontEndError>;
}

/// Factory of presenters, one per session; returns `None` if a stop was requested before the presenter was ready.
pub type PresenterOf<'a> =
    dyn Fn(Session) -> Result<Option<Box<dyn DesignedPresenter + 'a>>, ApparatusOrFrontEndError> + Sync + 'a;

impl DesignedPresenter for crate::conduct::NoApparatus {
    fn present(
        &mut self,
        _trial: &Trial,
        _intervals: &[Vec<(Setting, Value)>],
    ) -> Result<Option<Exploration>, ApparatusOrFrontEndError> {
        Ok(Some(Exploration::default()))
    }
}

/// Designed study with simulated subjects.
#[derive(Clone, Debug)]
pub struct DesignedCohort {
    /// Design of the study.
    pub design: Design,
    /// Seed of orders, presentations and simulated answers.
    pub seed: u64,
    /// Numbers of the subjects; each takes part in all sessions of the design.
    pub subjects: Vec<SubjectNumber>,
    /// Distribution of the simulated observers.
    pub population: Population,
    /// Description of the apparatus, for the log.
    pub apparatus: serde_json::Value,
    /// Files that determine the stimuli, for the log.
    pub inputs: Vec<InputFile>,
    /// Version of the program, for the log.
    pub version: String,
    /// Study file in use, for the log.
    pub plan: Plan,
    /// Policy for sessions with an existing log.
    pub existing_log: ExistingLogPolicy,
}

/// Error that ended a designed study early; completed steps are in the logs.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DesignedError {
    /// Error of the data set or of a log.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// Error of the apparatus in a session.
    #[error("{subject}, session {session}: {cause}")]
    Apparatus {
        /// Number of the subject.
        subject: SubjectNumber,
        /// Number of the session.
        session: u32,
        /// Error of the apparatus.
        cause: ApparatusOrFrontEndError,
    },
}

impl DesignedCohort {
    /// Returns the sessions in the order of subjects.
    fn sessions(&self) -> impl Iterator<Item = Session> + '_ {
        let seed = self.seed;
        let of = move |subject: &SubjectNumber| {
            let subject = *subject;
            (1..=self.design.blocks().sessions).map(move |session| Session { seed, subject, session })
        };
        self.subjects.iter().flat_map(of)
    }

    fn begin(&self, session: Session) -> Begin {
        Begin {
            designed: FORMAT,
            version: self.version.clone(),
            session,
            plan: self.plan.clone(),
            design: self.design.clone(),
            person: None,
            observer: json!({ "simulated": self.population }),
            apparatus: self.apparatus.clone(),
            inputs: self.inputs.clone(),
        }
    }

    /// Runs the study with `jobs` sessions at a time and writes the tables. `watch` is called after each step is on disk; `stop` ends the
    /// study; a step in progress then counts as not presented. Not real-time.
    ///
    /// Checks the logs of all sessions before the first presentation.
    ///
    /// # Errors
    /// [`DesignedError`]; completed steps are in the logs.
    pub fn run(
        &self,
        data: &DesignedData,
        jobs: NonZeroUsize,
        presenter: &PresenterOf<'_>,
        watch: &(dyn Fn() + Sync),
        stop: &AtomicBool,
    ) -> Result<(), DesignedError> {
        let progress =
            |session: Session| Ok((session, data.progress(&self.begin(session), self.existing_log)?));
        let mut waiting = self.sessions().map(progress).collect::<Result<Vec<_>, DesignedError>>()?;
        waiting.retain(|(_, progress)| !matches!(progress, Progress::Complete));
        waiting.reverse(); // popped from the end
        let waiting = Mutex::new(waiting);
        let work = || {
            while let Some((session, progress)) = waiting.lock().ok().and_then(|mut queue| queue.pop()) {
                if stop.load(Ordering::Relaxed) {
                    break;
                }
                self.sit(data, session, progress, presenter, watch, stop)?;
            }
            Ok(())
        };
        let results: Vec<Result<(), DesignedError>> = std::thread::scope(|scope| {
            // If the system has too few threads, this thread runs the remaining sessions.
            let start = |_| std::thread::Builder::new().spawn_scoped(scope, work).ok();
            let threads: Vec<_> = (1..jobs.get()).filter_map(start).collect();
            let own = std::iter::once(work());
            own.chain(threads.into_iter().filter_map(|thread| thread.join().ok())).collect()
        });
        results.into_iter().collect::<Result<(), _>>()?;
        Ok(data.write_tables()?)
    }

    fn sit(
        &self,
        data: &DesignedData,
        session: Session,
        progress: Progress,
        presenter: &PresenterOf<'_>,
        watch: &(dyn Fn() + Sync),
        stop: &AtomicBool,
    ) -> Result<(), DesignedError> {
        let (mut earlier, mut before) = (Vec::new(), 0);
        let (mut course, mut log) = match progress {
            Progress::Partial(log) => {
                earlier.extend(log.steps.iter().filter_map(|event| match &event.step {
                    Step::Trial(trial) => Some(trial.clone()),
                    Step::Form { .. } | Step::Rest { .. } => None,
                }));
                before = u32::try_from(log.steps.len()).unwrap_or(u32::MAX);
                log.resume(&self.version).map_err(DatasetError::from)?
            }
            Progress::New | Progress::Complete => data.begin(self.begin(session))?,
        };
        let failed =
            |cause| DesignedError::Apparatus { subject: session.subject, session: session.session, cause };
        let Some(mut presenter) = presenter(session).map_err(failed)? else { return Ok(()) };
        // An apparatus has state: presenting the earlier trials restores it, so that the continuation is bit-identical to an
        // uninterrupted session.
        for trial in &earlier {
            let presented = presenter.present(trial, &course.settings(trial)).map_err(failed)?;
            if presented.is_none() || stop.load(Ordering::Relaxed) {
                return Ok(());
            }
        }
        let observer = SimulatedObserver::new(&self.population, session);
        let presented =
            conduct(&mut course, &mut log, presenter.as_mut(), &observer, watch, stop).map_err(failed)?;
        match presented {
            None => Ok(()),
            Some(presented) => {
                Ok(log.write(&Event::End { steps: before + presented }).map_err(DatasetError::from)?)
            }
        }
    }
}

/// Presents the steps of a course until it is over, and returns their number; `None` after a stop request.
fn conduct(
    course: &mut Course,
    log: &mut LogWriter,
    presenter: &mut dyn DesignedPresenter,
    observer: &SimulatedObserver,
    watch: &dyn Fn(),
    stop: &AtomicBool,
) -> Result<Option<u32>, ApparatusOrFrontEndError> {
    let mut steps = 0;
    while let Some(step) = course.next() {
        let exploration = match &step {
            Step::Trial(trial) => match presenter.present(trial, &course.settings(trial))? {
                None => return Ok(None),
                presented => presented,
            },
            Step::Form { .. } | Step::Rest { .. } => None,
        };
        if stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let reply = observer.respond(course.design(), &step);
        let event = StepEvent { step, reply, exploration };
        course.answer(&event.reply, event.handle())?;
        log.write(&Event::Step(Box::new(event)))?;
        steps += 1;
        watch();
    }
    Ok(Some(steps))
}
