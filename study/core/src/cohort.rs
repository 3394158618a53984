//! Simulated subjects, all of them, several at a time.

use crate::conduct::{ConductError, OutsideError, Presenter, conduct};
use crate::dataset::{Dataset, DatasetError, Earlier, Progress};
use crate::log::{Begin, FORMAT, InputFile, LogWriter, Plan};
use crate::observer::{Population, SimulatedSubject};
use crate::protocol::{Protocol, SubjectNumber};
use crate::sitting::Sitting;
use crate::trial::Trial;
use serde_json::json;
use std::num::NonZeroUsize;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// A study with simulated subjects.
#[derive(Clone, Debug)]
pub struct Cohort {
    /// The experiment.
    pub protocol: Protocol,
    /// Seed.
    pub seed: u64,
    /// Who.
    pub subjects: Vec<SubjectNumber>,
    /// What kind of people.
    pub population: Population,
    /// What presents the stimuli, for the log.
    pub apparatus: serde_json::Value,
    /// Files that decide what is presented, for the log.
    pub inputs: Vec<InputFile>,
    /// Version of the program, for the log.
    pub version: String,
    /// The study file that is followed, for the log.
    pub plan: Option<Plan>,
    /// What to do about subjects who have begun before.
    pub earlier: Earlier,
}

/// Why a study was not carried out to its end.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CohortError {
    /// The data.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// A sitting.
    #[error("{subject}: {cause}")]
    Sitting {
        /// Whose.
        subject: SubjectNumber,
        /// Why.
        cause: ConductError,
    },
}

/// Starts the presenter of one subject; `None` if a request to stop came first.
pub type PresenterFactory<'a> =
    dyn Fn(SubjectNumber) -> Result<Option<Box<dyn Presenter + 'a>>, OutsideError> + Sync + 'a;

/// One subject's turn.
struct Turn {
    subject: SubjectNumber,
    /// What was presented before it broke off.
    earlier: Vec<Trial>,
    sitting: Sitting,
    log: LogWriter,
}

impl Cohort {
    /// The middle of the stimuli, which simulated ratings are relative to.
    fn middle(&self) -> f64 {
        flotor_statistics::describe::mean(self.protocol.levels())
    }

    /// The subject of this number.
    #[must_use]
    pub fn subject(&self, subject: SubjectNumber) -> SimulatedSubject {
        SimulatedSubject::new(&self.population, self.seed, subject, self.middle())
            .about(self.protocol.stimulus())
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

    /// Carries the study out, `jobs` subjects at a time, and makes the tables. `watch` is told of every trial that
    /// is on disk; `stop` ends it after the trials under way.
    ///
    /// Nothing is presented before all subjects were found to be free, or what they did to be in order.
    ///
    /// # Errors
    /// [`CohortError`]; the trials so far are in the logs.
    pub fn run(
        &self,
        dataset: &Dataset,
        jobs: NonZeroUsize,
        presenter: &PresenterFactory<'_>,
        watch: &(dyn Fn() + Sync),
        stop: &AtomicBool,
    ) -> Result<(), CohortError> {
        let progress =
            |subject: &SubjectNumber| Ok((*subject, dataset.progress(&self.begin(*subject), self.earlier)?));
        let mut waiting = self.subjects.iter().map(progress).collect::<Result<Vec<_>, CohortError>>()?;
        waiting.retain(|(_, progress)| !matches!(progress, Progress::Complete));
        waiting.reverse(); // taken from the end
        let waiting = Mutex::new(waiting);
        let work = || {
            while let Some((subject, progress)) = waiting.lock().ok().and_then(|mut queue| queue.pop()) {
                if stop.load(Ordering::Relaxed) {
                    break;
                }
                let turn = self.turn(dataset, subject, progress)?;
                self.sit(turn, presenter, watch, stop)?;
            }
            Ok(())
        };
        let results: Vec<Result<(), CohortError>> = std::thread::scope(|scope| {
            // Where the system has too few threads, this one does the rest.
            let start = |_| std::thread::Builder::new().spawn_scoped(scope, work).ok();
            let threads: Vec<_> = (1..jobs.get()).filter_map(start).collect();
            let own = std::iter::once(work());
            own.chain(threads.into_iter().filter_map(|thread| thread.join().ok())).collect()
        });
        results.into_iter().collect::<Result<(), _>>()?;
        Ok(dataset.write_tables()?)
    }

    fn turn(
        &self,
        dataset: &Dataset,
        subject: SubjectNumber,
        progress: Progress,
    ) -> Result<Turn, CohortError> {
        let mut earlier = Vec::new();
        let (sitting, log) = match progress {
            Progress::Partial(log) => {
                earlier.extend(log.answers().map(|(trial, _)| trial));
                log.resume(&self.version).map_err(DatasetError::from)?
            }
            Progress::New | Progress::Complete => dataset.begin(self.begin(subject))?,
        };
        Ok(Turn { subject, earlier, sitting, log })
    }

    fn sit(
        &self,
        turn: Turn,
        presenter: &PresenterFactory<'_>,
        watch: &(dyn Fn() + Sync),
        stop: &AtomicBool,
    ) -> Result<(), CohortError> {
        let Turn { subject, earlier, mut sitting, mut log } = turn;
        let failed = |cause| CohortError::Sitting { subject, cause };
        let presenter = presenter(subject).map_err(|cause| failed(ConductError::Outside(cause)))?;
        let Some(mut presenter) = presenter else { return Ok(()) };
        // An apparatus has a past: presented with the same trials it comes to where it was, and what follows is, to
        // the bit, what would have followed.
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
