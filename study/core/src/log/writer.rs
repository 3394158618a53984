//! Writer of a log, which appends lines and syncs each to disk.

use super::lines::LogEnd;
use super::{CHAIN_START, Event, Incident, LogError, LogProblem, chain, line, stamped};
use crate::platform::open_alone;
use crate::time_of_day::{SittingClock, TimeOfDay};
use serde::Serialize;
use std::fs::{File, OpenOptions};
use std::io::{Error, ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Event of a log.
pub trait LoggedEvent: Serialize {
    /// Returns true for the first event of a log.
    fn is_begin(&self) -> bool;
}

impl LoggedEvent for Event {
    fn is_begin(&self) -> bool {
        matches!(self, Self::Begin(_))
    }
}

/// Log open for writing, with exclusive write access.
pub struct LogWriter {
    file: File,
    path: PathBuf,
    chain: String,
    /// Clock of the time stamps; `None` without time stamps.
    clock: Option<SittingClock>,
}

impl LogWriter {
    /// Creates a log. Overwrites a file without a complete line: the process was killed before the first event was written.
    ///
    /// # Errors
    /// If the log exists, is open in another process, or cannot be created.
    pub fn create(path: &Path) -> Result<Self, LogError> {
        let failed = |cause| LogError::file(path, "cannot create the log", cause);
        let mut options = OpenOptions::new();
        let options = options.read(true).write(true).create(true).truncate(false);
        let mut file = open(options, path, "cannot create the log")?;
        let mut written = Vec::new();
        file.read_to_end(&mut written).map_err(failed)?;
        if written.contains(&b'\n') {
            return Err(failed(Error::from(ErrorKind::AlreadyExists)));
        }
        cut(&mut file, 0).map_err(failed)?;
        // Sync the folder, too: without this a power failure may lose the new directory entry.
        if let Some(folder) = path.parent().and_then(|folder| File::open(folder).ok()) {
            let _ = folder.sync_all();
        }
        Ok(Self { file, path: path.into(), chain: CHAIN_START.to_owned(), clock: None })
    }

    /// Opens a log to continue it after its last complete line. Truncates an incomplete last line.
    ///
    /// # Errors
    /// If the log is open in another process, has changed since it was read, or cannot be written.
    pub(crate) fn append(path: &Path, end: &LogEnd) -> Result<Self, LogError> {
        let failed = |cause| LogError::file(path, "cannot continue the log", cause);
        let mut file = open(OpenOptions::new().write(true), path, "cannot continue the log")?;
        if file.metadata().map_err(failed)?.len() != end.read_bytes {
            return Err(LogError::of_file(path, LogProblem::InUse));
        }
        cut(&mut file, end.complete_bytes).map_err(failed)?;
        Ok(Self { file, path: path.into(), chain: end.chain.clone(), clock: None })
    }

    /// Checks that no other process writes to a log.
    ///
    /// # Errors
    /// [`LogProblem::InUse`], or errors of the file system.
    pub(crate) fn check_free(path: &Path) -> Result<(), LogError> {
        open(OpenOptions::new().write(true), path, "cannot open the log").map(drop)
    }

    /// Enables time stamps: from now on every line has the time of day.
    #[must_use]
    pub fn stamped(self) -> Self {
        Self { clock: Some(SittingClock::start()), ..self }
    }

    /// Returns the time of day by the log's clock; `None` without time stamps.
    #[must_use]
    pub fn now(&self) -> Option<TimeOfDay> {
        self.clock.map(|clock| clock.now())
    }

    /// Writes an event. With time stamps, first writes an incident if the system's time of day was set. Returns once the event is
    /// on disk. Not real-time.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&mut self, event: &impl LoggedEvent) -> Result<(), LogError> {
        let clock = self.clock.as_mut().filter(|_| !event.is_begin());
        if let Some(by_ms) = clock.and_then(SittingClock::take_jump_ms) {
            self.write_line(&Event::Incident(Incident::TimeOfDaySet { by_ms }))?;
        }
        self.write_line(event)
    }

    fn write_line(&mut self, event: &impl Serialize) -> Result<(), LogError> {
        let text = serde_json::to_string(event)
            .map_err(|error| LogError::of_file(&self.path, LogProblem::Text(error.to_string())))?;
        let text = match self.now() {
            None => text,
            Some(time) => stamped(&text, time),
        };
        let next = chain(&self.chain, &text);
        let mut bytes = line(&next, &text).into_bytes();
        bytes.push(b'\n');
        let before = self.file.metadata().map(|file| file.len());
        let written = self.file.write_all(&bytes).and_then(|()| self.file.sync_data());
        if let Err(cause) = written {
            // Remove a partial line: in the middle it would make the whole log unreadable.
            let _ = before.and_then(|length| self.file.set_len(length));
            return Err(LogError::file(&self.path, "cannot write the log", cause));
        }
        self.chain = next;
        Ok(())
    }
}

/// Opens a log that no other process writes to; `action` is the failed operation in an error of the file system.
fn open(options: &OpenOptions, path: &Path, action: &'static str) -> Result<File, LogError> {
    let file = open_alone(options, path).map_err(|cause| LogError::file(path, action, cause))?;
    file.ok_or_else(|| LogError::of_file(path, LogProblem::InUse))
}

/// Truncates a file to a length and seeks to its end.
fn cut(file: &mut File, bytes: u64) -> Result<(), Error> {
    file.set_len(bytes)?;
    file.seek(SeekFrom::End(0)).map(drop)
}
