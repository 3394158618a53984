//! Data folder of a designed study, in the layout of [`crate::dataset`]; a study of several sessions has `ses-` folders.

use super::log::{Begin, DesignedLog, Event};
use super::table::{self, forms_tsv, trials_tsv};
use crate::dataset::table::{PARTICIPANT, members, person_cells, person_columns};
use crate::dataset::{
    Dataset, DatasetError, ExistingLogPolicy, complete, complete_table, kept, make_folder, pretty, replace,
};
use crate::log::{LogError, LogProblem, LogWriter};
use flotor_study_design::course::{Course, Session};
use flotor_study_design::design::Design;
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};

/// Folder with the data of a designed study.
#[derive(Clone, Debug)]
pub struct DesignedData {
    data: Dataset,
}

/// Progress of a session.
pub enum Progress {
    /// No log yet.
    New,
    /// The session began and is not complete.
    Partial(Box<DesignedLog>),
    /// The session is complete.
    Complete,
}

impl DesignedData {
    /// Creates the handle of the data set in a folder, which need not exist yet.
    #[must_use]
    pub fn at(root: &Path) -> Self {
        Self { data: Dataset::at(root) }
    }

    /// Returns true if the folder has the log of a designed study.
    #[must_use]
    pub fn is_here(&self) -> bool {
        /// Begin of the first event, after the chain of 64 digits.
        const FIRST: &str = "\"event\":{\"begin\":{\"designed\":";
        // A pipe would wait for its writer.
        let mut paths = self.data.log_paths().into_iter().flatten().filter(|path| path.is_file());
        paths.any(|path| {
            use std::io::Read;
            let mut head = [0_u8; 256];
            let read = std::fs::File::open(path).and_then(|mut file| file.read(&mut head));
            let head = head.get(..read.unwrap_or(0)).unwrap_or_default();
            String::from_utf8_lossy(head).contains(FIRST)
        })
    }

    /// Returns the root folder.
    #[must_use]
    pub fn root(&self) -> &Path {
        self.data.root()
    }

    /// Returns the start of the file names of a session.
    fn name(design: &Design, session: Session) -> String {
        let subject = session.subject;
        match design.blocks().sessions {
            1 => format!("{subject}_task-{}", design.study()),
            _ => format!("{subject}_ses-{:02}_task-{}", session.session, design.study()),
        }
    }

    /// Returns the log path of a session.
    #[must_use]
    pub fn log_path(&self, design: &Design, session: Session) -> PathBuf {
        self.data.source_folder(session.subject).join(format!("{}_log.jsonl", Self::name(design, session)))
    }

    /// Returns the folder of the recordings of a session, and the start of their names.
    #[must_use]
    pub fn motion(&self, design: &Design, session: Session) -> (PathBuf, String) {
        (self.data.source_folder(session.subject).join("motion"), Self::name(design, session))
    }

    fn table_path(&self, design: &Design, session: Session, suffix: &str) -> PathBuf {
        let subject = session.subject;
        let folder = match design.blocks().sessions {
            1 => format!("{subject}/beh"),
            _ => format!("{subject}/ses-{:02}/beh", session.session),
        };
        self.root().join(folder).join(format!("{}{suffix}_beh.tsv", Self::name(design, session)))
    }

    /// Reads and verifies all logs, in the order of their paths.
    ///
    /// # Errors
    /// If a log is invalid or misplaced, there is no log, or logs belong to different studies.
    pub fn logs(&self) -> Result<Vec<DesignedLog>, DatasetError> {
        let mut logs: Vec<DesignedLog> = Vec::new();
        for path in self.data.log_paths()? {
            let log = DesignedLog::read(&path)?;
            let place = self.log_path(&log.begin.design, log.begin.session);
            if place != path {
                return Err(DatasetError::OtherPlace { path, place });
            }
            if let Some(first) = logs.first()
                && let Some(what) = first.begin.differs(&log.begin)
            {
                return Err(DatasetError::Mixed { path, other: first.path().into(), what });
            }
            logs.push(log);
        }
        Ok(logs)
    }

    /// Returns the progress of the session of `begin`, after checking that it may begin or resume.
    ///
    /// # Errors
    /// If the log is invalid, in use or of another study, or `policy` refuses it.
    pub fn progress(&self, begin: &Begin, policy: ExistingLogPolicy) -> Result<Progress, DatasetError> {
        let path = self.log_path(&begin.design, begin.session);
        let log = match DesignedLog::read(&path) {
            _ if !path.exists() => None,
            // The process was killed before the first line was complete: nothing was recorded.
            Err(LogError { problem: LogProblem::Empty, .. }) => None,
            log => Some(Box::new(log?)),
        };
        let Some(log) = log else {
            // Two studies in one folder would make the folder unusable.
            let other =
                self.data.log_paths().into_iter().flatten().find_map(|path| DesignedLog::read(&path).ok());
            return other.map_or(Ok(()), |other| same_study(begin, &other)).map(|()| Progress::New);
        };
        if !log.complete {
            LogWriter::check_free(&path)?;
        }
        let (subject, root) = (begin.session.subject, self.root().to_path_buf());
        match policy {
            ExistingLogPolicy::Refuse if log.complete => Err(DatasetError::Duplicate { subject, root }),
            ExistingLogPolicy::Refuse => {
                Err(DatasetError::Unfinished { subject, trials: log.steps.len(), root })
            }
            ExistingLogPolicy::Resume => {
                same_study(begin, &log)?;
                Ok(if log.complete { Progress::Complete } else { Progress::Partial(log) })
            }
        }
    }

    /// Begins a session: creates its log and writes `begin` as the first line.
    ///
    /// # Errors
    /// If the log exists or cannot be written.
    pub fn begin(&self, begin: Begin) -> Result<(Course, LogWriter), DatasetError> {
        let path = self.log_path(&begin.design, begin.session);
        make_folder(&self.data.source_folder(begin.session.subject))?;
        let course = Course::new(&begin.design, begin.session);
        let writer = LogWriter::create(&path)?;
        let mut writer = if begin.is_of_a_person() { writer.stamped() } else { writer };
        writer.write(&Event::Begin(Box::new(begin)))?;
        Ok((course, writer))
    }

    /// Writes the tables of all complete sessions, the list of participants, and the description files.
    ///
    /// # Errors
    /// Errors of [`Self::logs`], or if a file cannot be read, merged or written.
    pub fn write_tables(&self) -> Result<(), DatasetError> {
        let logs = self.logs()?;
        let Some(begin) = logs.first().map(|log| log.begin.clone()) else { return Ok(()) };
        let design = &begin.design;
        let mut participants =
            "participant_id\tobserver\tsessions_complete\tage\tsex\thandedness\n".to_owned();
        let mut listed = Vec::new();
        for log in &logs {
            let session = log.begin.session;
            if !listed.contains(&session.subject) {
                listed.push(session.subject);
                let own = logs.iter().filter(|other| other.begin.session.subject == session.subject);
                let complete = own.filter(|other| other.complete).count();
                let observer = log.begin.observer_kind().word();
                let person = person_cells(log.begin.person.as_ref()).join("\t");
                participants += &format!("{}\t{observer}\t{complete}\t{person}\n", session.subject);
            }
            if !log.complete {
                continue;
            }
            let one = std::slice::from_ref(log);
            replace(&self.table_path(design, session, ""), &trials_tsv(one))?;
            let forms = forms_tsv(one);
            if !forms.is_empty() {
                replace(&self.table_path(design, session, "forms"), &forms)?;
            }
        }
        complete_table(&self.root().join("participants.tsv"), &participants, PARTICIPANT)?;
        let study = design.study();
        let mut sidecars = vec![
            (format!("task-{study}_beh.json"), columns(design)),
            ("dataset_description.json".to_owned(), description(&begin)),
            ("participants.json".to_owned(), participant_columns()),
        ];
        if !design.questionnaires().is_empty() {
            sidecars.push((format!("task-{study}forms_beh.json"), form_columns(design)));
        }
        for (name, object) in sidecars {
            let generated = pretty(object.clone());
            complete(&self.root().join(name), &generated, |earlier| {
                Ok(kept::object(earlier, object, OWNED)?.map(pretty))
            })?;
        }
        Ok(())
    }
}

/// Keys of the description files that the program overwrites.
const OWNED: &[&str] = &["TaskName", "Design", "Seed", "Observer", "Apparatus"];

fn same_study(begin: &Begin, log: &DesignedLog) -> Result<(), DatasetError> {
    let path = || log.path().to_path_buf();
    if let Some(what) = begin.differs(&log.begin) {
        return Err(DatasetError::Changed { path: path(), what });
    }
    let changed = begin.inputs.iter().find_map(|now| {
        let then =
            log.begin.inputs.iter().find(|then| then.used_as == now.used_as && then.hash != now.hash)?;
        Some((now.clone(), then.hash.clone()))
    });
    changed.map_or(Ok(()), |(now, then)| Err(DatasetError::OtherInput { path: path(), now, then }))
}

fn described(columns: &[(&str, &str)]) -> Map<String, Value> {
    columns.iter().map(|(name, meaning)| ((*name).to_owned(), json!({ "Description": meaning }))).collect()
}

/// Returns the JSON sidecar of the tables of trials.
fn columns(design: &Design) -> Map<String, Value> {
    let mut sidecar = members(&json!({
        "TaskName": design.study(),
        "Design": design,
        "subject": { "Description": "Subject, as in the list of participants" },
        "session": { "Description": "Session, from 1" },
    }));
    for factor in design.factors() {
        let setting =
            factor.setting.as_ref().map_or("standard of the stimulus".to_owned(), ToString::to_string);
        sidecar.insert(factor.name.clone(), json!({ "Description": format!("Level of {setting}") }));
    }
    sidecar.extend(described(&table::COLUMNS));
    sidecar.extend(described(&[table::OBSERVER]));
    sidecar
}

/// Returns the JSON sidecar of the tables of questionnaires.
fn form_columns(design: &Design) -> Map<String, Value> {
    let mut sidecar = members(&json!({
        "TaskName": format!("{}forms", design.study()),
        "subject": { "Description": "Subject, as in the list of participants" },
        "session": { "Description": "Session, from 1" },
        "questionnaire": { "Description": "Questionnaire of the study file, from 1" },
        "after_block": { "Description": "Number of blocks before it in the session" },
    }));
    for item in design.questionnaires().iter().flat_map(|form| &form.items) {
        sidecar.insert(item.key().to_owned(), json!({ "Description": item.text() }));
    }
    sidecar
}

fn description(begin: &Begin) -> Map<String, Value> {
    members(&json!({
        "Name": format!("Perception study: {}", begin.design.study()),
        "BIDSVersion": "1.9.0",
        "DatasetType": "raw",
        "GeneratedBy": [{ "Name": "flotor", "Version": begin.version }],
        "Seed": begin.session.seed,
        "Observer": begin.observer,
        "Apparatus": begin.apparatus,
    }))
}

fn participant_columns() -> Map<String, Value> {
    let mut columns = described(&[table::OBSERVER, ("sessions_complete", "Number of complete sessions")]);
    columns.extend(person_columns());
    columns
}
