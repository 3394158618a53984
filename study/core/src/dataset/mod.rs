//! Where the data of a study lie, in the manner of BIDS (bids.neuroimaging.io):
//!
//! ```text
//! DIR/dataset_description.json
//! DIR/participants.tsv, participants.json
//! DIR/task-jnd_beh.json                                  what the columns mean
//! DIR/sub-01/beh/sub-01_task-jnd_beh.tsv                 one row per presentation
//! DIR/sourcedata/sub-01/sub-01_task-jnd_log.jsonl        the event log: what everything else is made from
//! ```
//!
//! The logs are the data. Tables are made from them, whole or not at all (written aside, then renamed), and can be made
//! again at any time. The lists of participants and scans, and the descriptions, are completed and not replaced: BIDS asks people
//! to add to them (`kept`).

mod kept;
mod table;

pub use kept::Unmergeable;

use crate::exclusion::Exclusion;
use crate::log::{Begin, Event, InputFile, LogError, LogProblem, LogWriter, SittingLog};
use crate::protocol::SubjectNumber;
use crate::sitting::Sitting;
use serde_json::{Map, Value};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// A folder with the data of a study.
#[derive(Clone, Debug)]
pub struct Dataset {
    root: PathBuf,
}

/// How far a subject has come.
pub enum Progress {
    /// Never began.
    New,
    /// Began, and did not come to the end.
    Partial(Box<SittingLog>),
    /// Came to the end.
    Complete,
}

/// What to do about subjects who have begun before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Earlier {
    /// Nobody may have.
    Refuse,
    /// Who is complete stays so, who broke off goes on.
    Resume,
}

/// What cannot be done with a dataset.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DatasetError {
    /// A log.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A file or folder.
    #[error("{}: {action}: {cause}", path.display())]
    File {
        /// Which.
        path: PathBuf,
        /// What was attempted.
        action: &'static str,
        /// What the system said.
        cause: std::io::Error,
    },
    /// A file that people complete, which cannot be read any more.
    #[error("{}: {problem}; mend the file, or remove it to have it written anew", path.display())]
    Unmergeable {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: Unmergeable,
    },
    /// There is no study.
    #[error("{}: no study (no logs under sourcedata/); give the folder of `study --out`", .0.display())]
    NoStudy(PathBuf),
    /// Sittings that do not belong together.
    #[error("{}: {what}, unlike {}; delete the file that does not belong to the study, or use another folder", path.display(), other.display())]
    Mixed {
        /// A log.
        path: PathBuf,
        /// Another.
        other: PathBuf,
        /// What differs.
        what: String,
    },
    /// A log that lies where another one belongs: its subject would count twice, or as somebody else.
    #[error("{}: is a log of {subject}, task {task}, and does not belong there; remove it, or move it to {}", path.display(), place.display())]
    Misplaced {
        /// The log.
        path: PathBuf,
        /// Whose it is.
        subject: SubjectNumber,
        /// Of which task.
        task: &'static str,
        /// Where such a log belongs.
        place: PathBuf,
    },
    /// A study that was begun otherwise than it is to go on.
    #[error("{}: {what}; use what it was begun with, or another folder", path.display())]
    Changed {
        /// One of its logs.
        path: PathBuf,
        /// What differs.
        what: String,
    },
    /// A file that was changed since a sitting began.
    #[error("{}: `{}` ({}) is not the file that the sitting began with: its content is {}, and was {}; put the earlier file back, or use another folder",
        path.display(), now.name, now.used_as, now.hash, then)]
    OtherInput {
        /// One of the logs.
        path: PathBuf,
        /// The file.
        now: InputFile,
        /// Hash of the file that the sitting began with.
        then: String,
    },
    /// A subject who has been there.
    #[error("{subject} is already complete in {}; add --resume to skip complete subjects (simulated), choose another --subject \
        (human), or use another folder", root.display())]
    Duplicate {
        /// Who.
        subject: SubjectNumber,
        /// The dataset.
        root: PathBuf,
    },
    /// A subject who has begun.
    #[error("{subject} is incomplete after {trials} trials in {}; add --resume to continue", root.display())]
    Unfinished {
        /// Who.
        subject: SubjectNumber,
        /// How far they came.
        trials: usize,
        /// The dataset.
        root: PathBuf,
    },
}

impl Dataset {
    /// The data in a folder, which need not exist yet.
    #[must_use]
    pub fn at(root: &Path) -> Self {
        Self { root: root.into() }
    }

    /// The folder.
    #[must_use]
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The log of a subject.
    #[must_use]
    pub fn log_path(&self, subject: SubjectNumber, task: &str) -> PathBuf {
        self.root.join(format!("sourcedata/{subject}/{subject}_task-{task}_log.jsonl"))
    }

    /// The folder for further recordings of a subject.
    #[must_use]
    pub fn source_folder(&self, subject: SubjectNumber) -> PathBuf {
        self.root.join(format!("sourcedata/{subject}"))
    }

    fn table_path(&self, subject: SubjectNumber, task: &str) -> PathBuf {
        self.root.join(format!("{subject}/beh/{subject}_task-{task}_beh.tsv"))
    }

    /// All logs, read, verified and in the order of their subjects.
    ///
    /// # Errors
    /// A log that cannot be used, none at all, or logs of different experiments.
    pub fn logs(&self) -> Result<Vec<SittingLog>, DatasetError> {
        let mut logs = Vec::new();
        self.each_log(|log| {
            logs.push(log);
            Ok(())
        })?;
        Ok(logs)
    }

    /// The same one after the other: only one is in memory.
    fn each_log(
        &self,
        mut take: impl FnMut(SittingLog) -> Result<(), DatasetError>,
    ) -> Result<(), DatasetError> {
        let mut first: Option<(Begin, PathBuf)> = None;
        for path in self.log_paths()? {
            let log = SittingLog::read(&path)?;
            let (subject, task) = (log.begin.subject, log.begin.protocol.task());
            let place = self.log_path(subject, task);
            if place != path {
                return Err(DatasetError::Misplaced { path, subject, task, place });
            }
            let (begin, other) = first.get_or_insert_with(|| (log.begin.clone(), path.clone()));
            if let Some(what) = begin.differs(&log.begin) {
                return Err(DatasetError::Mixed { path, other: other.clone(), what });
            }
            take(log)?;
        }
        Ok(())
    }

    fn log_paths(&self) -> Result<Vec<PathBuf>, DatasetError> {
        let mut paths: Vec<PathBuf> = Vec::new();
        let source = self.root.join("sourcedata");
        let folders = std::fs::read_dir(&source).map_err(|_| DatasetError::NoStudy(self.root.clone()))?;
        for folder in folders.flatten().filter(|entry| entry.path().is_dir()) {
            let files =
                std::fs::read_dir(folder.path()).into_iter().flatten().flatten().map(|file| file.path());
            paths.extend(files.filter(|path| is_log(path)));
        }
        paths.sort();
        if paths.is_empty() { Err(DatasetError::NoStudy(self.root.clone())) } else { Ok(paths) }
    }

    /// How far a subject has come, if the sitting may begin or go on.
    ///
    /// # Errors
    /// A log that cannot be used, one that `earlier` forbids, or a study that was begun otherwise.
    pub fn progress(&self, begin: &Begin, earlier: Earlier) -> Result<Progress, DatasetError> {
        let (subject, root) = (begin.subject, self.root.clone());
        let path = self.log_path(subject, begin.protocol.task());
        let log = match SittingLog::read(&path) {
            _ if !path.exists() => None,
            // Killed before its first line was complete: nothing happened yet.
            Err(LogError { problem: LogProblem::Empty, .. }) => None,
            log => Some(Box::new(log?)),
        };
        let Some(log) = log else {
            // Before the first line is written: two studies in one folder would make it unusable.
            let mut logs = self.log_paths().into_iter().flatten().map(|path| SittingLog::read(&path));
            let other = logs.find_map(Result::ok);
            return other.map_or(Ok(()), |other| same_study(begin, &other)).map(|()| Progress::New);
        };
        if !log.complete {
            LogWriter::check_free(&path)?;
        }
        match earlier {
            Earlier::Refuse if log.complete => Err(DatasetError::Duplicate { subject, root }),
            Earlier::Refuse => Err(DatasetError::Unfinished { subject, trials: log.trials.len(), root }),
            Earlier::Resume => {
                same_study(begin, &log)?;
                Ok(if log.complete { Progress::Complete } else { Progress::Partial(log) })
            }
        }
    }

    /// A new sitting with its log.
    ///
    /// # Errors
    /// The log exists or cannot be written.
    pub fn begin(&self, begin: Begin) -> Result<(Sitting, LogWriter), DatasetError> {
        let path = self.log_path(begin.subject, begin.protocol.task());
        let folder = self.source_folder(begin.subject);
        self.file(&folder, "cannot make the folder", std::fs::create_dir_all(&folder))?;
        let sitting = Sitting::new(&begin.protocol, begin.seed, begin.subject);
        let writer = LogWriter::create(&path)?;
        let mut writer = if begin.is_of_a_person() { writer.stamped() } else { writer };
        writer.write(&Event::Begin(Box::new(begin)))?;
        Ok((sitting, writer))
    }

    /// Makes the tables of every sitting that is complete, and the files that describe them.
    ///
    /// # Errors
    /// A log that cannot be used, or a file that cannot be written.
    pub fn write_tables(&self) -> Result<(), DatasetError> {
        let mut participants = table::PARTICIPANTS_HEAD.to_owned();
        let mut first = None;
        self.each_log(|log| {
            participants += &table::participant(&log);
            if log.complete {
                let path = self.table_path(log.begin.subject, log.begin.protocol.task());
                self.replace(&path, &table::trials(&log))?;
                if let Some(scans) = table::scans(&log) {
                    let subject = log.begin.subject;
                    let path = self.root.join(format!("{subject}/{subject}_scans.tsv"));
                    self.complete_table(&path, &scans, table::SCAN)?;
                }
            }
            first.get_or_insert(log.begin);
            Ok(())
        })?;
        let Some(begin) = first else { return Ok(()) };
        self.complete_table(&self.root.join("participants.tsv"), &participants, table::PARTICIPANT)?;
        let task = format!("task-{}_beh.json", begin.protocol.task());
        for (name, (object, owned)) in [
            (task.as_str(), table::columns(&begin.protocol)),
            ("dataset_description.json", table::description(&begin)),
            ("participants.json", table::participant_columns()),
        ] {
            self.complete_object(&self.root.join(name), object, owned)?;
        }
        Ok(())
    }

    /// Writes a table that people complete; what is theirs stays.
    fn complete_table(&self, path: &Path, generated: &str, key: &'static str) -> Result<(), DatasetError> {
        let Some(earlier) = self.read_earlier(path)? else { return self.replace(path, generated) };
        let merged = kept::table(&earlier, generated, key);
        let merged = merged.map_err(|problem| DatasetError::Unmergeable { path: path.into(), problem })?;
        merged.map_or(Ok(()), |text| self.replace(path, &text))
    }

    /// Writes a JSON object that people complete; what is theirs stays, but for the keys that are the program's own.
    fn complete_object(
        &self,
        path: &Path,
        generated: Map<String, Value>,
        owned: &[&str],
    ) -> Result<(), DatasetError> {
        let Some(earlier) = self.read_earlier(path)? else { return self.replace(path, &pretty(generated)) };
        let merged = kept::object(&earlier, generated, owned);
        let merged = merged.map_err(|problem| DatasetError::Unmergeable { path: path.into(), problem })?;
        merged.map_or(Ok(()), |object| self.replace(path, &pretty(object)))
    }

    /// Reads a file that was written before; none if there is no such file.
    fn read_earlier(&self, path: &Path) -> Result<Option<String>, DatasetError> {
        match std::fs::read_to_string(path) {
            Ok(text) => Ok(Some(text)),
            Err(cause) if cause.kind() == ErrorKind::NotFound => Ok(None),
            Err(cause) => {
                Err(DatasetError::File { path: path.into(), action: "cannot read the file", cause })
            }
        }
    }

    /// Writes a file whole or not at all.
    fn replace(&self, path: &Path, text: &str) -> Result<(), DatasetError> {
        if let Some(folder) = path.parent() {
            self.file(folder, "cannot make the folder", std::fs::create_dir_all(folder))?;
        }
        let aside = path.with_extension("part");
        self.file(&aside, "cannot write the table", std::fs::write(&aside, text))?;
        self.file(path, "cannot put the table in place", std::fs::rename(&aside, path))
    }

    #[allow(clippy::unused_self)] // reads as: of this dataset
    fn file(
        &self,
        path: &Path,
        action: &'static str,
        result: std::io::Result<()>,
    ) -> Result<(), DatasetError> {
        result.map_err(|cause| DatasetError::File { path: path.into(), action, cause })
    }
}

/// All trials of all sittings as one table with commas, a row each, for other programs; of what is excluded it says by which rule.
#[must_use]
pub fn trials_csv(logs: &[SittingLog], excluded: &[Exclusion]) -> String {
    table::long(logs, excluded)
}

fn pretty(object: Map<String, Value>) -> String {
    serde_json::to_string_pretty(&Value::Object(object)).unwrap_or_default() + "\n"
}

/// Whether a sitting belongs to the study of a log.
fn same_study(begin: &Begin, log: &SittingLog) -> Result<(), DatasetError> {
    let path = || log.path().to_path_buf();
    if let Some(what) = begin.differs(&log.begin) {
        return Err(DatasetError::Changed { path: path(), what });
    }
    match begin.changed_input(&log.begin) {
        None => Ok(()),
        Some((now, then)) => {
            Err(DatasetError::OtherInput { path: path(), now: now.clone(), then: then.hash.clone() })
        }
    }
}

/// Returns true for the log of a sitting. A name that begins with a dot belongs to the system: macOS puts a file `._NAME` beside each
/// one that it copies to a stick.
fn is_log(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name.ends_with("_log.jsonl") && !name.starts_with('.')
}
