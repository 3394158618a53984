//! Folder layout of the data of a study, following BIDS (bids.neuroimaging.io):
//!
//! ```text
//! DIR/dataset_description.json
//! DIR/participants.tsv, participants.json
//! DIR/task-jnd_beh.json                                  meanings of the columns
//! DIR/sub-01/beh/sub-01_task-jnd_beh.tsv                 one row per presentation
//! DIR/sourcedata/sub-01/sub-01_task-jnd_log.jsonl        the event log: source of all other files
//! ```
//!
//! The logs are the primary data. Tables are generated from the logs, written atomically (to a temporary file, then renamed),
//! and can be regenerated at any time. Lists of participants and scans, and descriptions, are merged with the existing files
//! instead of replaced, because BIDS asks people to extend them (`kept`).

pub(crate) mod kept;
pub(crate) mod table;

pub use kept::Unmergeable;
pub use table::trials_csv;

use crate::log::{Begin, Event, InputFile, LogError, LogProblem, LogWriter, SittingLog};
use crate::protocol::SubjectNumber;
use crate::sitting::Sitting;
use flotor_hal::read_file;
use serde_json::{Map, Value};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Maximum size of a file that people may have extended, bytes: a list of a million participants.
const MOST_BYTES: u64 = 256 << 20;

/// Folder with the data of a study.
#[derive(Clone, Debug)]
pub struct Dataset {
    root: PathBuf,
}

/// Progress of a subject.
pub enum Progress {
    /// No log yet.
    New,
    /// The sitting began and is not complete.
    Partial(Box<SittingLog>),
    /// The sitting is complete.
    Complete,
}

/// Policy for subjects with an existing log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExistingLogPolicy {
    /// Rejects subjects with a log.
    Refuse,
    /// Skips complete subjects and resumes incomplete ones.
    Resume,
}

/// Error of a data set.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DatasetError {
    /// Error of a log.
    #[error(transparent)]
    Log(#[from] LogError),
    /// Error of a file or folder.
    #[error("{}: {action}: {cause}; check the path, its permissions and the free disk space", path.display())]
    File {
        /// File or folder.
        path: PathBuf,
        /// Attempted operation.
        action: &'static str,
        /// Error of the system.
        cause: std::io::Error,
    },
    /// A file edited by people cannot be merged with the generated one.
    #[error("{}: {problem}; correct the file, or remove it: the program then writes a new file", path.display())]
    Unmergeable {
        /// Path of the file.
        path: PathBuf,
        /// Reason why the file cannot be merged.
        problem: Unmergeable,
    },
    /// The folder has no study.
    #[error("{}: not the folder of a study (no logs under sourcedata/); give the folder that `flotor study` has written (--out)", .0.display())]
    NoStudy(PathBuf),
    /// The folder has logs of different studies.
    #[error("{}: {what}, unlike {}; delete the file that does not belong to the study, or use another folder", path.display(), other.display())]
    Mixed {
        /// Path of one of the logs.
        path: PathBuf,
        /// Log of the other study.
        other: PathBuf,
        /// Description of the difference.
        what: String,
    },
    /// A log is at the path of another subject or task, where its subject could count twice or under another number.
    #[error("{}: the log is of {subject}, task {task}, and belongs at {}; move the log there, or remove the log if \
    that file exists already", path.display(), place.display())]
    Misplaced {
        /// Path of the log.
        path: PathBuf,
        /// Subject of the log.
        subject: SubjectNumber,
        /// Task of the log.
        task: &'static str,
        /// Correct path of the log.
        place: PathBuf,
    },
    /// The log of a designed study is at another path than its subject and session say.
    #[error("{}: the log belongs at {}; move the log there, or remove the log if that file exists already", path.display(), place.display())]
    OtherPlace {
        /// Path of the log.
        path: PathBuf,
        /// Correct path of the log.
        place: PathBuf,
    },
    /// The configuration differs from the configuration at the start of the study.
    #[error("{}: {what}; restore the settings of the start, or use another folder", path.display())]
    Changed {
        /// Path of one of the study's logs.
        path: PathBuf,
        /// Description of the difference.
        what: String,
    },
    /// An input file has changed since the sitting began.
    #[error("{}: `{}` ({}) is not the file of the start of the sitting: its hash is {}, and was {}; restore the earlier file, or use another folder",
        path.display(), now.name, now.used_as, now.hash, then)]
    OtherInput {
        /// Path of one of the logs.
        path: PathBuf,
        /// The changed file.
        now: InputFile,
        /// Hash of the file at the start of the sitting.
        then: String,
    },
    /// The subject is already complete.
    #[error("{subject} is already complete in {}; add --resume to skip complete subjects (simulated), choose another --subject \
        (human), or use another folder", root.display())]
    Duplicate {
        /// Number of the subject.
        subject: SubjectNumber,
        /// Root folder of the data set.
        root: PathBuf,
    },
    /// The subject has begun, but is not complete.
    #[error("{subject} in {} is incomplete (answered trials: {trials}); add --resume to continue", root.display())]
    Unfinished {
        /// Number of the subject.
        subject: SubjectNumber,
        /// Number of logged trials.
        trials: usize,
        /// Root folder of the data set.
        root: PathBuf,
    },
}

impl DatasetError {
    fn file(path: &Path, action: &'static str, cause: std::io::Error) -> Self {
        Self::File { path: path.into(), action, cause }
    }
}

impl Dataset {
    /// Creates the handle of the data set in a folder, which need not exist yet.
    #[must_use]
    pub fn at(root: &Path) -> Self {
        Self { root: root.into() }
    }

    /// Returns the root folder.
    #[must_use]
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Returns the log path of a subject.
    #[must_use]
    pub fn log_path(&self, subject: SubjectNumber, task: &str) -> PathBuf {
        self.root.join(format!("sourcedata/{subject}/{subject}_task-{task}_log.jsonl"))
    }

    /// Returns the folder for the log and the recordings of a subject.
    #[must_use]
    pub fn source_folder(&self, subject: SubjectNumber) -> PathBuf {
        self.root.join(format!("sourcedata/{subject}"))
    }

    fn table_path(&self, subject: SubjectNumber, task: &str) -> PathBuf {
        self.root.join(format!("{subject}/beh/{subject}_task-{task}_beh.tsv"))
    }

    /// Reads and verifies all logs, in the order of their paths.
    ///
    /// # Errors
    /// If a log is invalid or misplaced, there is no log, or logs belong to different studies.
    pub fn logs(&self) -> Result<Vec<SittingLog>, DatasetError> {
        self.each_log()?.collect()
    }

    /// Reads and verifies the logs one by one, so that only one is in memory.
    fn each_log(&self) -> Result<impl Iterator<Item = Result<SittingLog, DatasetError>>, DatasetError> {
        let mut first: Option<(Begin, PathBuf)> = None;
        let read = move |path: PathBuf| {
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
            Ok(log)
        };
        Ok(self.log_paths()?.into_iter().map(read))
    }

    pub(crate) fn log_paths(&self) -> Result<Vec<PathBuf>, DatasetError> {
        let mut paths: Vec<PathBuf> = Vec::new();
        let source = self.root.join("sourcedata");
        let folders = std::fs::read_dir(&source).map_err(|cause| match cause.kind() {
            ErrorKind::PermissionDenied => DatasetError::file(&source, "cannot read the folder", cause),
            _ => DatasetError::NoStudy(self.root.clone()),
        })?;
        for folder in folders.flatten().filter(|entry| entry.path().is_dir()) {
            let files =
                std::fs::read_dir(folder.path()).into_iter().flatten().flatten().map(|file| file.path());
            paths.extend(files.filter(|path| is_log(path)));
        }
        paths.sort();
        if paths.is_empty() { Err(DatasetError::NoStudy(self.root.clone())) } else { Ok(paths) }
    }

    /// Returns the progress of the subject of `begin`, after checking that the sitting may begin or resume.
    ///
    /// # Errors
    /// If a log is invalid or in use, `existing_log` is [`ExistingLogPolicy::Refuse`] and there is a log, or the study began
    /// with another configuration or other input files.
    pub fn progress(&self, begin: &Begin, existing_log: ExistingLogPolicy) -> Result<Progress, DatasetError> {
        let (subject, root) = (begin.subject, self.root.clone());
        let path = self.log_path(subject, begin.protocol.task());
        let log = match SittingLog::read(&path) {
            _ if !path.exists() => None,
            // The process was killed before the first line was complete: nothing was recorded.
            Err(LogError { problem: LogProblem::Empty, .. }) => None,
            log => Some(Box::new(log?)),
        };
        let Some(log) = log else {
            // Check before writing the first line: two studies in one folder would make the folder unusable.
            let mut logs = self.log_paths().into_iter().flatten().map(|path| SittingLog::read(&path));
            let other = logs.find_map(Result::ok);
            return other.map_or(Ok(()), |other| same_study(begin, &other)).map(|()| Progress::New);
        };
        if !log.complete {
            LogWriter::check_free(&path)?;
        }
        match existing_log {
            ExistingLogPolicy::Refuse if log.complete => Err(DatasetError::Duplicate { subject, root }),
            ExistingLogPolicy::Refuse => {
                Err(DatasetError::Unfinished { subject, trials: log.trials.len(), root })
            }
            ExistingLogPolicy::Resume => {
                same_study(begin, &log)?;
                Ok(if log.complete { Progress::Complete } else { Progress::Partial(log) })
            }
        }
    }

    /// Begins a sitting: creates its log and writes `begin` as the first line.
    ///
    /// # Errors
    /// If the log exists or cannot be written.
    pub fn begin(&self, begin: Begin) -> Result<(Sitting, LogWriter), DatasetError> {
        let path = self.log_path(begin.subject, begin.protocol.task());
        let folder = self.source_folder(begin.subject);
        make_folder(&folder)?;
        let sitting = Sitting::new(&begin.protocol, begin.seed, begin.subject);
        let writer = LogWriter::create(&path)?;
        let mut writer = if begin.is_of_a_person() { writer.stamped() } else { writer };
        writer.write(&Event::Begin(Box::new(begin)))?;
        Ok((sitting, writer))
    }

    /// Writes the tables of all complete sittings, the lists of participants and scans, and the description files.
    ///
    /// # Errors
    /// Errors of [`Self::logs`], or if a file cannot be read, merged or written.
    pub fn write_tables(&self) -> Result<(), DatasetError> {
        let mut participants = table::PARTICIPANTS_HEAD.to_owned();
        let mut first = None;
        for log in self.each_log()? {
            let log = log?;
            participants += &table::participant(&log);
            if log.complete {
                let path = self.table_path(log.begin.subject, log.begin.protocol.task());
                replace(&path, &table::trials(&log))?;
                if let Some(scans) = table::scans(&log) {
                    let subject = log.begin.subject;
                    let path = self.root.join(format!("{subject}/{subject}_scans.tsv"));
                    complete_table(&path, &scans, table::SCAN)?;
                }
            }
            first.get_or_insert(log.begin);
        }
        let Some(begin) = first else { return Ok(()) };
        complete_table(&self.root.join("participants.tsv"), &participants, table::PARTICIPANT)?;
        let task = format!("task-{}_beh.json", begin.protocol.task());
        for (name, (object, owned)) in [
            (task.as_str(), table::columns(&begin.protocol)),
            ("dataset_description.json", table::description(&begin)),
            ("participants.json", table::participant_columns()),
        ] {
            let generated = pretty(object.clone());
            complete(&self.root.join(name), &generated, |earlier| {
                Ok(kept::object(earlier, object, owned)?.map(pretty))
            })?;
        }
        Ok(())
    }
}

/// Writes a generated file, merged with an existing file that people may have edited.
pub(crate) fn complete(
    path: &Path,
    generated: &str,
    merge: impl FnOnce(&str) -> Result<Option<String>, Unmergeable>,
) -> Result<(), DatasetError> {
    let Some(earlier) = read_earlier(path)? else { return replace(path, generated) };
    let merged =
        merge(&earlier).map_err(|problem| DatasetError::Unmergeable { path: path.into(), problem })?;
    merged.map_or(Ok(()), |text| replace(path, &text))
}

pub(crate) fn complete_table(path: &Path, generated: &str, key: &'static str) -> Result<(), DatasetError> {
    complete(path, generated, |earlier| kept::table(earlier, generated, key))
}

/// Reads an existing file; returns `None` if there is none.
fn read_earlier(path: &Path) -> Result<Option<String>, DatasetError> {
    let not_utf8 = |_| DatasetError::Unmergeable { path: path.into(), problem: Unmergeable::NotUtf8 };
    match read_file(path, MOST_BYTES) {
        Ok(bytes) => String::from_utf8(bytes).map(Some).map_err(not_utf8),
        Err(cause) if cause.kind() == ErrorKind::NotFound => Ok(None),
        Err(cause) => Err(DatasetError::file(path, "cannot read the file", cause)),
    }
}

/// Writes a file atomically.
pub(crate) fn replace(path: &Path, text: &str) -> Result<(), DatasetError> {
    if let Some(folder) = path.parent() {
        make_folder(folder)?;
    }
    let aside = path.with_extension("part");
    std::fs::write(&aside, text)
        .map_err(|cause| DatasetError::file(&aside, "cannot write the file", cause))?;
    std::fs::rename(&aside, path)
        .map_err(|cause| DatasetError::file(path, "cannot rename the new file to this name", cause))
}

pub(crate) fn make_folder(folder: &Path) -> Result<(), DatasetError> {
    std::fs::create_dir_all(folder)
        .map_err(|cause| DatasetError::file(folder, "cannot make the folder", cause))
}

pub(crate) fn pretty(object: Map<String, Value>) -> String {
    serde_json::to_string_pretty(&Value::Object(object)).unwrap_or_default() + "\n"
}

/// Checks that configuration and input files of a sitting equal those of a log.
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

/// Returns true for the log of a sitting. Names with a leading dot are ignored: macOS adds a file `._NAME` for each file that
/// it copies to a USB stick.
pub(crate) fn is_log(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name.ends_with("_log.jsonl") && !name.starts_with('.')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_without_an_end_is_not_read() {
        let endless = Path::new("/dev/zero");
        if endless.exists() {
            complete(endless, "", |_| Ok(None)).expect_err("a device file");
        }
    }
}
