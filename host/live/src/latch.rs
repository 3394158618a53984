//! The latch of a machine: an emergency stop that stays, whoever ran and whoever pressed it.
//!
//! A file in the folder of the run sockets, to which lines are only ever appended: a press, or a release of all presses up to a
//! number. So neither needs a lock, a release never undoes a press that it did not see, and no restart changes anything. What
//! cannot be read counts as a press. Not real-time.

use crate::Directory;
use crate::directory::{DirectoryError, unusable};
use crate::platform::private_file;
use serde::{Deserialize, Serialize};
use std::fs::OpenOptions;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Its file.
const FILE: &str = "latch";
/// Longest name of who presses, characters: a line stays so short that it is written as one.
const LONGEST_NAME: usize = 120;

/// Stops every run of this user on this machine until it is released.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Latch {
    directory: Directory,
    path: PathBuf,
}

/// Who pressed the emergency stop, and when.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pressed {
    /// In words for people.
    pub who: String,
    /// By this machine's clock.
    pub at: SystemTime,
}

/// What the latch says.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LatchState {
    /// How often it was ever pressed. A run that began before a press is stopped by it even if the release came before the look.
    pub presses: u64,
    /// The first press that is not released; nothing may be energised while there is one.
    pub pressed: Option<Pressed>,
}

/// A line of the file.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
enum Entry {
    Press { who: String, at_s: u64 },
    Release { up_to: u64, who: String, at_s: u64 },
}

impl Directory {
    /// The latch of the runs whose sockets are in this folder.
    #[must_use]
    pub fn latch(&self) -> Latch {
        Latch { directory: self.clone(), path: self.path().join(FILE) }
    }
}

impl Latch {
    /// Its file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Length of the file, bytes: a watcher reads it again when this changes. Nothing without a file.
    #[must_use]
    pub fn length(&self) -> Option<u64> {
        std::fs::metadata(&self.path).ok().map(|attributes| attributes.len())
    }

    /// What it says now. In a folder of another user there is none: others could press it, and nothing can be pressed there.
    #[must_use]
    pub fn state(&self) -> LatchState {
        if !self.directory.is_ours() {
            return LatchState::default();
        }
        let bytes = match std::fs::read(&self.path) {
            Ok(bytes) => bytes,
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
                return LatchState::default();
            }
            Err(error) => format!("cannot be read: {error}").into_bytes(),
        };
        let (mut state, mut open) = (LatchState::default(), Vec::new());
        for line in String::from_utf8_lossy(&bytes).lines() {
            match serde_json::from_str(line) {
                Ok(Entry::Release { up_to, .. }) => open.retain(|(number, _)| *number > up_to),
                read => {
                    let (who, at_s) = match read {
                        Ok(Entry::Press { who, at_s }) => (who, at_s),
                        _ => (format!("an unreadable line of {}", self.path.display()), 0),
                    };
                    state.presses += 1;
                    let at = UNIX_EPOCH.checked_add(Duration::from_secs(at_s)).unwrap_or(UNIX_EPOCH);
                    open.push((state.presses, Pressed { who, at }));
                }
            }
        }
        state.pressed = open.into_iter().next().map(|(_, pressed)| pressed);
        state
    }

    /// Presses it. One that is pressed stays as it is.
    ///
    /// # Errors
    /// [`DirectoryError`]: the folder is not usable, or not ours alone; other runs learn nothing.
    pub fn press(&self, who: &str) -> Result<(), DirectoryError> {
        if self.state().pressed.is_some() {
            return Ok(());
        }
        self.append(&Entry::Press { who: short(who), at_s: now_s() })
    }

    /// Releases what is pressed now; who had pressed it, if anybody.
    ///
    /// # Errors
    /// [`DirectoryError`]: nothing can be written; it stays pressed.
    pub fn release(&self, who: &str) -> Result<Option<Pressed>, DirectoryError> {
        let LatchState { presses, pressed } = self.state();
        if pressed.is_some() {
            self.append(&Entry::Release { up_to: presses, who: short(who), at_s: now_s() })?;
        }
        Ok(pressed)
    }

    fn append(&self, entry: &Entry) -> Result<(), DirectoryError> {
        self.directory.make()?;
        // Neither word nor number of it fails to become JSON.
        let line = serde_json::to_string(entry).unwrap_or_default() + "\n";
        let file = private_file(OpenOptions::new().append(true).create(true)).open(&self.path);
        file.and_then(|mut file| file.write_all(line.as_bytes())).map_err(unusable(&self.path))
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
        write!(formatter, "{}, {number} {unit} ago", self.who)
    }
}

fn short(who: &str) -> String {
    who.chars().filter(|c| !c.is_control()).take(LONGEST_NAME).collect()
}

fn now_s() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn latch() -> (tempfile::TempDir, Latch) {
        let scratch = tempfile::tempdir().unwrap();
        let latch = Directory::at(scratch.path().join("runs")).latch();
        (scratch, latch)
    }

    #[test]
    fn a_press_stays_until_it_is_released_and_is_never_forgotten() {
        let (_scratch, latch) = latch();
        assert_eq!(latch.state(), LatchState::default());
        assert_eq!(latch.release("nobody").unwrap(), None);
        latch.press("first").unwrap();
        latch.press("second").unwrap();
        let state = latch.state();
        assert_eq!((state.presses, state.pressed.unwrap().who.as_str()), (1, "first"));
        assert_eq!(latch.release("owner").unwrap().unwrap().who, "first");
        assert_eq!(latch.state(), LatchState { presses: 1, pressed: None });
        latch.press("third").unwrap();
        assert_eq!(latch.state().presses, 2);
        assert!(latch.state().pressed.unwrap().to_string().starts_with("third, 0 s ago"));
    }

    #[test]
    fn a_release_undoes_no_press_that_it_did_not_see() {
        let (_scratch, latch) = latch();
        latch.press("seen").unwrap();
        let seen = latch.state().presses;
        latch.append(&Entry::Press { who: "unseen".to_owned(), at_s: 0 }).unwrap();
        latch.append(&Entry::Release { up_to: seen, who: "owner".to_owned(), at_s: 0 }).unwrap();
        assert_eq!(latch.state().pressed.unwrap().who, "unseen");
    }

    #[test]
    fn what_cannot_be_read_is_a_press_and_can_be_released() {
        let (_scratch, latch) = latch();
        latch.press("first").unwrap();
        latch.release("owner").unwrap();
        for nonsense in ["\n", "{", "{\"press\":{}}\n", "{\"lift\":{}}\n"] {
            let before = latch.state().presses;
            let mut file = OpenOptions::new().append(true).open(latch.path()).unwrap();
            file.write_all(nonsense.as_bytes()).unwrap();
            assert!(latch.state().pressed.is_some() && latch.state().presses > before, "{nonsense:?}");
            latch.release("owner").unwrap();
            if nonsense.ends_with('\n') {
                assert_eq!(latch.state().pressed, None, "{nonsense:?}");
            }
        }
        let long = "x".repeat(10_000) + "\n";
        latch.append(&Entry::Press { who: short(&long), at_s: u64::MAX }).unwrap();
        assert!(latch.length().unwrap() < 1000);
    }
}
