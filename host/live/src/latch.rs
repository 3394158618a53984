//! Emergency stop latch of a machine: remains pressed across runs and restarts, until it is released.
//!
//! The latch is a file in the folder of the run sockets with two entries: the last press, and the last release, which contains the
//! number of the press that it releases. A press or a release overwrites its entry with one write. So neither needs a lock, a
//! release never undoes a press that it has not read, and a restart changes nothing. An unreadable entry counts as a press.
//!
//! A run opens the file and reserves its space before it energises a device. From then on a press needs neither a free descriptor
//! nor disk space nor permissions of the folder. Not real-time.

use crate::Directory;
use crate::directory::{DirectoryError, unusable};
use crate::platform::{is_same_file, private_file, read_at, write_all_at};
use flotor_core::lock;
use serde::{Deserialize, Serialize};
use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// File name of the latch.
const FILE: &str = "latch";
/// Size of an entry, bytes: more than the longest entry needs.
const ENTRY_BYTES: usize = 1024;
/// Maximum length of the name of a press's source, characters.
const LONGEST_NAME: usize = 120;
/// Number of descriptors reserved for an emergency stop: to list the other runs, and to connect to some of them.
const SPARE_DESCRIPTORS: usize = 4;

/// Emergency stop latch of all runs of this user on this machine. Clones share the opened file.
#[derive(Clone, Debug)]
pub struct Latch {
    /// Folder of the runs that the latch stops.
    pub(crate) directory: Directory,
    path: PathBuf,
    kept: Arc<Kept>,
}

/// Opened latch file, the error that prevents writing to the file, and descriptors reserved for an emergency stop.
#[derive(Debug)]
struct Kept {
    file: Option<File>,
    problem: Option<DirectoryError>,
    spare: Mutex<Vec<File>>,
}

/// Press of the emergency stop.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pressed {
    /// Source of the press, human-readable.
    pub source: String,
    /// Time of the press on this machine's wall clock.
    pub at: SystemTime,
}

/// Presses of the emergency stop latch, as read from its file: numbers of the last presses, and the press that is not released.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LatchState {
    /// Numbers of the last presses, released or not, in the file that was opened and in a file that has replaced it.
    presses: Vec<u64>,
    /// Press that is not released; while there is one, no device may be energised.
    pub pressed: Option<Pressed>,
}

#[derive(Clone, Copy)]
enum Place {
    Press,
    Release,
}

/// Entry of the file.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
enum Entry {
    /// `number` is the time of the press, ns since 1970, but larger than the number of the previous press.
    Press { number: u64, who: String },
    /// `press` is the number of the released press.
    Release { press: u64, who: String },
}

impl Directory {
    /// Opens the latch of the runs in this folder, and reserves its disk space and descriptors. Creates the folder if necessary.
    /// After a failure the latch may be unwritable: [`Latch::problem`].
    #[must_use]
    pub fn latch(&self) -> Latch {
        let path = self.path().join(FILE);
        let problem = self.make().err();
        // A folder of this user that others may enter has a problem, but the latch in it is used.
        let writable = if self.is_ours() { Some(open(&path)) } else { None };
        let (file, unwritable) = match writable {
            Some(Ok(file)) => (Some(file), None),
            Some(Err(error)) => (File::open(&path).ok(), Some(error)),
            None => (None, None),
        };
        let kept = Kept { file, problem: problem.or(unwritable), spare: Mutex::default() };
        let latch = Latch { directory: self.clone(), path, kept: Arc::new(kept) };
        latch.reserve_descriptors();
        latch
    }
}

/// Opens the file for reading and writing, and extends it to the size of both entries. The extension is only appended, so that no
/// press is overwritten.
fn open(path: &Path) -> Result<File, DirectoryError> {
    let open = || {
        let mut file = private_file(OpenOptions::new().append(true).create(true)).open(path)?;
        let length = usize::try_from(file.metadata()?.len()).unwrap_or(usize::MAX);
        file.write_all(&vec![b' '; (2 * ENTRY_BYTES).saturating_sub(length)])?;
        OpenOptions::new().read(true).write(true).open(path)
    };
    open().map_err(unusable(path))
}

impl Latch {
    /// Returns the path of the latch file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the reason why a press cannot be stored reliably, to be checked before a device is energised; `None` without a problem.
    #[must_use]
    pub fn problem(&self) -> Option<&DirectoryError> {
        self.kept.problem.as_ref()
    }

    /// Closes the reserved descriptors, to make room for those of an emergency stop.
    pub(crate) fn free_descriptors(&self) {
        lock(&self.kept.spare).clear();
    }

    /// Opens the descriptors that are reserved for an emergency stop.
    pub(crate) fn reserve_descriptors(&self) {
        let file = self.kept.file.iter().cycle().take(SPARE_DESCRIPTORS);
        let spare = file.flat_map(File::try_clone).collect();
        *lock(&self.kept.spare) = spare;
    }

    /// Reads the present state. A file that cannot be read counts as pressed; a folder of another user has no latch, because only
    /// other users could press the latch.
    #[must_use]
    pub fn state(&self) -> LatchState {
        let mut state = LatchState::default();
        if let Some(file) = &self.kept.file {
            self.add(file, &mut state);
        }
        if self.directory.is_ours() && !self.is_kept() {
            match File::open(&self.path) {
                Ok(file) => self.add(&file, &mut state),
                Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {}
                Err(error) => state.add(0, format!("{} cannot be read: {error}", self.path.display())),
            }
        }
        state
    }

    /// Presses the latch, with `who` as the source; a pressed latch does not change.
    ///
    /// # Errors
    /// If the press cannot be written to the opened file, which earlier runs read, or to the file at the path, which later runs read.
    pub fn press(&self, who: &str) -> Result<(), DirectoryError> {
        if self.state().pressed.is_some() {
            return Ok(());
        }
        self.write_each(|file| press(file, who))
    }

    /// Releases the latch; returns the press that was released, or `None` if the latch was not pressed.
    ///
    /// # Errors
    /// If the release cannot be written; the latch then stays pressed.
    pub fn release(&self, who: &str) -> Result<Option<Pressed>, DirectoryError> {
        let LatchState { presses, pressed } = self.state();
        if pressed.is_some() {
            self.write_each(|file| match last_press(file) {
                Some((press, _)) if presses.contains(&press) => {
                    write(file, Place::Release, &Entry::Release { press, who: short(who) })
                }
                _ => Ok(()),
            })?;
        }
        Ok(pressed)
    }

    /// Returns true if the file at the path is still the file that was opened.
    fn is_kept(&self) -> bool {
        let kept = self.kept.file.as_ref().and_then(|file| file.metadata().ok());
        let there = std::fs::metadata(&self.path);
        kept.zip(there.ok()).is_some_and(|(kept, there)| is_same_file(&kept, &there))
    }

    /// Writes to the file that was opened, which earlier runs read, and to a file that has replaced it, which later runs read.
    fn write_each(&self, write: impl Fn(&File) -> std::io::Result<()>) -> Result<(), DirectoryError> {
        let to_kept = self.kept.file.as_ref().map(|file| write(file).map_err(unusable(&self.path)));
        if matches!(to_kept, Some(Ok(()))) && self.is_kept() {
            return Ok(());
        }
        if !self.directory.is_ours() {
            self.directory.make()?;
        }
        write(&open(&self.path)?).map_err(unusable(&self.path))?;
        if self.is_kept() { Ok(()) } else { to_kept.unwrap_or(Ok(())) }
    }

    /// Adds the entries of a file to a state.
    fn add(&self, file: &File, state: &mut LatchState) {
        let Some((number, who)) = last_press(file) else { return };
        let who = who.unwrap_or_else(|problem| {
            format!("unreadable emergency stop entry in {}: {problem}", self.path.display())
        });
        let released = match read(file, Place::Release).map(|text| serde_json::from_str(&text)) {
            Ok(Ok(Entry::Release { press, .. })) => Some(press),
            _ => None,
        };
        if released == Some(number) {
            state.presses.push(number);
        } else {
            state.add(number, who);
        }
    }
}

impl LatchState {
    /// Returns true if the latch was pressed after an earlier state, even if it has been released since.
    #[must_use]
    pub fn was_pressed_after(&self, earlier: &Self) -> bool {
        self.presses.iter().any(|press| !earlier.presses.contains(press))
    }

    /// Adds a press that is not released.
    fn add(&mut self, number: u64, who: String) {
        self.presses.push(number);
        self.pressed.get_or_insert(Pressed { source: who, at: UNIX_EPOCH + Duration::from_nanos(number) });
    }
}

/// Records a press of the emergency stop in a latch file, in place of the previous press.
fn press(file: &File, who: &str) -> std::io::Result<()> {
    let before = last_press(file).and_then(|(number, who)| who.is_ok().then_some(number));
    let number = now_ns().max(before.map_or(0, |before| before.saturating_add(1)));
    write(file, Place::Press, &Entry::Press { number, who: short(who) })
}

/// Returns number and source of the last press in a file; a malformed entry has a hash as its number and an error in place of the source.
fn last_press(file: &File) -> Option<(u64, Result<String, String>)> {
    let text = match read(file, Place::Press) {
        Ok(text) if text.is_empty() => return None,
        Ok(text) => text,
        Err(error) => return Some((0, Err(error.to_string()))),
    };
    match serde_json::from_str(&text) {
        Ok(Entry::Press { number, who }) => Some((number, Ok(who))),
        _ => Some((fingerprint(&text), Err("malformed entry".to_owned()))),
    }
}

/// Returns a hash of a text (FNV-1a), less than any present time in nanoseconds.
fn fingerprint(text: &str) -> u64 {
    let hash = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    text.bytes().fold(0xcbf2_9ce4_8422_2325, hash) >> 8
}

/// Reads the text of an entry, without surrounding spaces; empty beyond the end of the file.
fn read(file: &File, place: Place) -> std::io::Result<String> {
    let mut bytes = [b' '; ENTRY_BYTES];
    read_at(file, &mut bytes, place.offset())?;
    Ok(String::from_utf8_lossy(&bytes).trim().to_owned())
}

/// Overwrites an entry, with one system call.
fn write(file: &File, place: Place, entry: &Entry) -> std::io::Result<()> {
    let mut bytes = serde_json::to_vec(entry)?;
    bytes.resize(ENTRY_BYTES - 1, b' ');
    bytes.push(b'\n');
    write_all_at(file, &bytes, place.offset())
}

impl Place {
    fn offset(self) -> u64 {
        match self {
            Self::Press => 0,
            Self::Release => ENTRY_BYTES as u64,
        }
    }
}

impl std::fmt::Display for Pressed {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let ago_s = self.at.elapsed().unwrap_or_default().as_secs();
        let (number, unit) = match ago_s {
            0..=119 => (ago_s, "s"),
            120..=7199 => (ago_s / 60, "min"),
            _ => (ago_s / 3600, "h"),
        };
        write!(formatter, "{}, {number} {unit} ago", self.source)
    }
}

fn short(who: &str) -> String {
    who.chars().filter(|c| !c.is_control()).take(LONGEST_NAME).collect()
}

fn now_ns() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_nanos()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests;
