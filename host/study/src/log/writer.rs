//! Adds lines to a log and does not return before they are on disk.

use super::{CHAIN_START, Event, LogError, LogProblem, chain, line, stamped};
use crate::time_of_day::TimeOfDay;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

/// An open log.
pub struct LogWriter {
    file: File,
    path: PathBuf,
    chain: String,
    stamps: Stamps,
}

/// Whether lines have a time of day.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stamps {
    None,
    TimeOfDay,
}

impl LogWriter {
    /// A new log.
    ///
    /// # Errors
    /// The file exists, or cannot be created.
    pub fn create(path: &Path) -> Result<Self, LogError> {
        let file = OpenOptions::new().write(true).create_new(true).open(path);
        let file = file.map_err(|cause| LogError::file(path, "cannot create the log", cause))?;
        // The name of a new file is kept by its folder: without this a crash may leave the file nameless.
        if let Some(folder) = path.parent().and_then(|folder| File::open(folder).ok()) {
            let _ = folder.sync_all();
        }
        Ok(Self { file, path: path.into(), chain: CHAIN_START.to_owned(), stamps: Stamps::None })
    }

    /// A log that goes on: after `complete_bytes`, whose chain is known. What lies behind is a line that was never
    /// completed, and is cut off.
    pub(super) fn append(path: &Path, complete_bytes: u64, chain: String) -> Result<Self, LogError> {
        let open = || {
            let mut file = OpenOptions::new().write(true).open(path)?;
            file.set_len(complete_bytes)?;
            std::io::Seek::seek(&mut file, std::io::SeekFrom::End(0))?;
            Ok(file)
        };
        let file = open().map_err(|cause| LogError::file(path, "cannot continue the log", cause))?;
        Ok(Self { file, path: path.into(), chain, stamps: Stamps::None })
    }

    /// The same, with the time of day in every line from now on.
    #[must_use]
    pub fn stamped(self) -> Self {
        Self { stamps: Stamps::TimeOfDay, ..self }
    }

    /// Writes an event. When this returns, it is on disk.
    ///
    /// # Errors
    /// What the system said.
    pub fn write(&mut self, event: &Event) -> Result<(), LogError> {
        let text = serde_json::to_string(event).map_err(|error| LogError {
            path: self.path.clone(),
            line: 0,
            problem: LogProblem::Text(error.to_string()),
        })?;
        let text = match self.stamps {
            Stamps::None => text,
            Stamps::TimeOfDay => stamped(&text, TimeOfDay::now()),
        };
        let next = chain(&self.chain, &text);
        let mut bytes = line(&next, &text).into_bytes();
        bytes.push(b'\n');
        let before = self.file.metadata().map(|file| file.len());
        let written = self.file.write_all(&bytes).and_then(|()| self.file.sync_data());
        if let Err(cause) = written {
            // A part of a line in the middle would make the whole log unreadable.
            let _ = before.and_then(|length| self.file.set_len(length));
            return Err(LogError::file(&self.path, "cannot write the log", cause));
        }
        self.chain = next;
        Ok(())
    }
}
