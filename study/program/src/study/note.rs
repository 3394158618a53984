//! `flotor study note`: a note of the experimenter in a subject's log.

use crate::of_dataset;
use clap::Args;
use flotor_command::CommandError;
use flotor_command::options::count;
use flotor_study::dataset::Dataset;
use flotor_study::designed::DesignedData;
use flotor_study::log::LogError;
use flotor_study::protocol::SubjectNumber;
use std::path::PathBuf;

#[derive(Args)]
pub(super) struct NoteArguments {
    /// Folder of the study
    #[arg(value_name = "DIR")]
    data: PathBuf,
    /// Number of the subject
    #[arg(value_name = "SUBJECT", value_parser = count(1..=SubjectNumber::MOST))]
    subject: u16,
    /// Text of the note, without names
    #[arg(value_name = "TEXT")]
    text: String,
}

/// Adds the note to the log of the subject: with several sessions, to the last one that has begun.
pub(super) fn run(arguments: &NoteArguments) -> Result<(), CommandError> {
    let designed = DesignedData::at(&arguments.data);
    let noted = if designed.is_here() {
        let logs = designed.logs().map_err(of_dataset)?;
        let logs = logs.into_iter().map(|log| (log.begin.session.subject, log));
        last_of(arguments, logs.collect())?.annotate(&arguments.text)
    } else {
        let logs = Dataset::at(&arguments.data).logs().map_err(of_dataset)?;
        let logs = logs.into_iter().map(|log| (log.begin.subject, log));
        last_of(arguments, logs.collect())?.annotate(&arguments.text)
    };
    noted.map_err(|error: LogError| CommandError::Failed(error.to_string()))
}

/// Returns the last log of the subject; an error with the subjects of the study if it has none.
fn last_of<T>(arguments: &NoteArguments, logs: Vec<(SubjectNumber, T)>) -> Result<T, CommandError> {
    let mut subjects: Vec<String> = logs.iter().map(|(subject, _)| subject.get().to_string()).collect();
    subjects.dedup();
    let log = logs.into_iter().rfind(|(subject, _)| subject.get() == arguments.subject);
    log.map(|(_, log)| log).ok_or_else(|| {
        let (data, subject) = (arguments.data.display(), arguments.subject);
        let subjects = subjects.join(", ");
        CommandError::Usage(format!("{data}: the study has no subject {subject}; choose one of: {subjects}"))
    })
}
