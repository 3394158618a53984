//! Study with many simulated subjects in parallel.

use crate::conduct::{ApparatusOrFrontEndError, ConductError, Presenter, conduct};
use crate::dataset::{Dataset, DatasetError, ExistingLogPolicy, Progress};
use crate::log::{Begin, FORMAT, InputFile, Plan};
use crate::observer::{Population, SimulatedSubject};
use crate::protocol::{Protocol, SubjectNumber};
use serde_json::json;
use std::num::NonZeroUsize;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// Study with simulated subjects.
#[derive(Clone, Debug)]
pub struct Cohort {
    /// Experiment with its settings.
    pub protocol: Protocol,
    /// Seed of order, presentation and simulated answers.
    pub seed: u64,
    /// Numbers of the subjects.
    pub subjects: Vec<SubjectNumber>,
    /// Distribution of the simulated observers' parameters.
    pub population: Population,
    /// Description of the apparatus, for the log.
    pub apparatus: serde_json::Value,
    /// Files that determine the stimuli, for the log.
    pub inputs: Vec<InputFile>,
    /// Version of the program, for the log.
    pub version: String,
    /// The study file in use, for the log.
    pub plan: Option<Plan>,
    /// Policy for subjects with an existing log.
    pub existing_log: ExistingLogPolicy,
}

/// Error that ended a study early.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CohortError {
    /// Error of the data set.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// Error of a sitting.
    #[error("{subject}: {cause}")]
    Sitting {
        /// Number of the subject.
        subject: SubjectNumber,
        /// Error of the sitting.
        cause: ConductError,
    },
}

/// Factory of presenters, one per subject; returns `None` if a stop was requested before the presenter was ready.
pub type PresenterFactory<'a> =
    dyn Fn(SubjectNumber) -> Result<Option<Box<dyn Presenter + 'a>>, ApparatusOrFrontEndError> + Sync + 'a;

impl Cohort {
    /// Returns the simulated subject with this number.
    pub fn subject(&self, subject: SubjectNumber) -> SimulatedSubject {
        // The reference stimulus of simulated ratings is the mean of the levels.
        let middle = flotor_statistics::describe::mean(self.protocol.levels());
        SimulatedSubject::new(&self.population, self.seed, subject, middle).about(self.protocol.stimulus())
    }

    fn begin(&self, subject: SubjectNumber) -> Begin {
        Begin {
            format: FORMAT,
            person: None,
            version: self.version.clone(),
            subject,
            seed: self.seed,
            plan: self.plan.clone(),
            protocol: self.protocol.clone(),
            observer: json!({ "simulated": self.population }),
            apparatus: self.apparatus.clone(),
            inputs: self.inputs.clone(),
        }
    }

    /// Runs the study with `jobs` subjects at a time and writes the tables. `watch` is called after each trial is on disk; `stop`
    /// ends the study; a trial in progress then counts as not presented. Not real-time.
    ///
    /// Checks the logs of all subjects before the first presentation.
    ///
    /// # Errors
    /// [`CohortError`]; completed trials are in the logs.
    pub fn run(
        &self,
        dataset: &Dataset,
        jobs: NonZeroUsize,
        presenter: &PresenterFactory<'_>,
        watch: &(dyn Fn() + Sync),
        stop: &AtomicBool,
    ) -> Result<(), CohortError> {
        let progress = |subject: &SubjectNumber| {
            Ok((*subject, dataset.progress(&self.begin(*subject), self.existing_log)?))
        };
        let mut waiting = self.subjects.iter().map(progress).collect::<Result<Vec<_>, CohortError>>()?;
        waiting.retain(|(_, progress)| !matches!(progress, Progress::Complete));
        waiting.reverse(); // popped from the end
        let waiting = Mutex::new(waiting);
        let work = || {
            while let Some((subject, progress)) = waiting.lock().ok().and_then(|mut queue| queue.pop()) {
                if stop.load(Ordering::Relaxed) {
                    break;
                }
                self.sit(dataset, subject, progress, presenter, watch, stop)?;
            }
            Ok(())
        };
        let results: Vec<Result<(), CohortError>> = std::thread::scope(|scope| {
            // If the system has too few threads, this thread runs the remaining subjects.
            let start = |_| std::thread::Builder::new().spawn_scoped(scope, work).ok();
            let threads: Vec<_> = (1..jobs.get()).filter_map(start).collect();
            let own = std::iter::once(work());
            own.chain(threads.into_iter().filter_map(|thread| thread.join().ok())).collect()
        });
        results.into_iter().collect::<Result<(), _>>()?;
        Ok(dataset.write_tables()?)
    }

    fn sit(
        &self,
        dataset: &Dataset,
        subject: SubjectNumber,
        progress: Progress,
        presenter: &PresenterFactory<'_>,
        watch: &(dyn Fn() + Sync),
        stop: &AtomicBool,
    ) -> Result<(), CohortError> {
        // Trials presented before an interruption.
        let mut earlier = Vec::new();
        let (mut sitting, mut log) = match progress {
            Progress::Partial(log) => {
                earlier.extend(log.answers().map(|(trial, _)| trial));
                log.resume(&self.version).map_err(DatasetError::from)?
            }
            Progress::New | Progress::Complete => dataset.begin(self.begin(subject))?,
        };
        let failed = |cause| CohortError::Sitting { subject, cause };
        let presenter = presenter(subject).map_err(|cause| failed(ConductError::Outside(cause)))?;
        let Some(mut presenter) = presenter else { return Ok(()) };
        // An apparatus has state: replaying the earlier trials restores it, so that the continuation is bit-identical to an
        // uninterrupted sitting.
        for trial in &earlier {
            if stop.load(Ordering::Relaxed) {
                return Ok(());
            }
            let in_trial = |cause| failed(ConductError::Trial { trial: trial.number, cause });
            if presenter.present(trial).map_err(in_trial)?.is_none() {
                return Ok(());
            }
        }
        let simulated = self.subject(subject);
        conduct(&mut sitting, &mut log, presenter.as_mut(), &simulated, watch, stop).map_err(failed)?;
        Ok(())
    }
}
