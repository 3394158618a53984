//! Errors of a log.

use super::FORMAT;
use crate::sitting::AnswerError;
use std::path::{Path, PathBuf};

/// Error of a log: file, line (from 1; 0 for the whole file) and problem.
#[derive(Debug, thiserror::Error)]
#[error("{}{}: {problem}", path.display(), line_text(*.line))]
pub struct LogError {
    /// Path of the log.
    pub path: PathBuf,
    /// Line number, from 1; 0 for the whole file.
    pub line: usize,
    /// Reason for the rejection of the log, or for the failed operation.
    #[source]
    pub problem: LogProblem,
}

fn line_text(line: usize) -> String {
    if line == 0 { String::new() } else { format!(":{line}") }
}

/// Reason for rejecting an event log, or for a failed operation on it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LogProblem {
    /// The file could not be read or written.
    #[error("{action}: {cause}; check the path, its permissions and the free disk space")]
    File {
        /// Attempted operation.
        action: &'static str,
        /// Error of the system.
        cause: std::io::Error,
    },
    /// Another process has the log open, or has written to it since it was read.
    #[error(
        "another process is running this sitting, or has just written to its log; end that process or wait for its end, and \
         try again"
    )]
    InUse,
    /// The log has no complete line.
    #[error("the log has no complete line, so it contains no data; remove the file")]
    Empty,
    /// A line has invalid syntax.
    #[error("the line does not belong to an event log: {0}; use an unchanged copy")]
    Text(String),
    /// The chain is intact, but this version cannot parse the event or its time.
    #[error("this version cannot read the line: {0}; use the version that wrote the log")]
    Unknown(String),
    /// The hash chain is broken.
    #[error(
        "the hash chain is broken: this line or an earlier one was changed, removed or exchanged; use an unchanged \
         copy"
    )]
    Chain,
    /// The revision of the format is unknown, for example newer than this program.
    #[error(
        "format {found} is not supported; this version reads formats up to {FORMAT}: use the version that \
         wrote the log"
    )]
    Format {
        /// Revision found in the log.
        found: u32,
    },
    /// An event is out of sequence; the text names the event.
    #[error("{0}; use an unchanged copy")]
    Order(&'static str),
    /// The replayed experiment presents another trial or reaches another verdict.
    #[error(
        "trial {number} does not follow from protocol, seed and answers; another version of the program wrote the \
         log: use that version"
    )]
    Diverges {
        /// Trial, from 1.
        number: u32,
    },
    /// The course of a designed study has another step, or refuses the answer.
    #[error(
        "step {number} does not follow from design, seed and answers; another version of the program wrote the log: \
         use that version"
    )]
    OtherStep {
        /// Step, from 1.
        number: u32,
    },
    /// The answer does not fit the trial.
    #[error("trial {number}: {cause}")]
    Answer {
        /// Trial, from 1.
        number: u32,
        /// Error of the answer.
        cause: AnswerError,
    },
}

impl LogError {
    pub(crate) fn file(path: &Path, action: &'static str, cause: std::io::Error) -> Self {
        Self::of_file(path, LogProblem::File { action, cause })
    }

    pub(super) fn of_file(path: &Path, problem: LogProblem) -> Self {
        Self { path: path.into(), line: 0, problem }
    }
}
