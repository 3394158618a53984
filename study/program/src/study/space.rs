//! Check of the available disk space before a person's sitting.

use crate::platform::free_bytes;
use flotor_command::{CommandError, note};
use std::path::Path;

/// Assumed time per stimulus of a person, with fades, answer and rest, s.
const STIMULUS_S: f64 = 8.0;
/// Number of stimuli whose data must fit on the disk, or the rest of the sitting if shorter.
const LEAST_STIMULI: f64 = 20.0;
/// Estimated size of one answer in the event log and the tables, bytes.
const ANSWER_BYTES: f64 = 4.0e3;

/// Expected output of a sitting.
#[derive(Clone, Copy, Debug)]
pub(super) struct Need {
    /// Estimated number of remaining stimuli.
    pub(super) stimuli: f64,
    /// Data rate of the recorded movement, bytes per second; 0 without recording.
    pub(super) bytes_per_s: f64,
}

/// Result of comparing expected output and available space.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Room {
    Enough,
    /// Enough for a part of the sitting; holds the bytes for the whole rest.
    Short(f64),
    /// Not enough to begin; holds the bytes for the minimum ([`LEAST_STIMULI`]).
    None(f64),
}

impl Need {
    fn bytes(self, stimuli: f64) -> f64 {
        stimuli * (STIMULUS_S * self.bytes_per_s + ANSWER_BYTES)
    }

    fn of(self, free: f64) -> Room {
        let (all, least) = (self.bytes(self.stimuli), self.bytes(self.stimuli.min(LEAST_STIMULI)));
        match free {
            free if free < least => Room::None(least),
            free if free < all => Room::Short(all),
            _ => Room::Enough,
        }
    }
}

/// Returns an error if the disk has no space to begin a sitting, and prints a note if the whole sitting may not fit. Skips the
/// check if the available space is unknown.
pub(super) fn check(folder: &Path, need: Need) -> Result<(), CommandError> {
    let exists =
        folder.ancestors().map(|folder| if folder.as_os_str().is_empty() { Path::new(".") } else { folder });
    let Some(free) = exists.into_iter().find_map(free_bytes) else {
        return Ok(());
    };
    let words = |bytes: f64, what: &str| {
        let advice = if need.bytes_per_s > 0.0 {
            "free disk space, or record less with --kinematics summary"
        } else {
            "free disk space"
        };
        let (folder, [free, bytes]) = (folder.display(), [free, bytes].map(|bytes| bytes / 1.0e6));
        format!("{folder}: {free:.1} MB are free, but {what} needs about {bytes:.1} MB; {advice}")
    };
    match need.of(free) {
        Room::Enough => {}
        Room::Short(bytes) => note(words(bytes, "the rest of the sitting")),
        Room::None(bytes) => return Err(CommandError::Failed(words(bytes, "the beginning of the sitting"))),
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disk_is_judged_by_what_the_sitting_writes() {
        // 400 springs of 8 s at 500 kB a second, and 20 of them.
        let full = Need { stimuli: 400.0, bytes_per_s: 0.5e6 };
        let (all, least) = (400.0 * 4.004e6, 20.0 * 4.004e6);
        assert_eq!(full.of(2.0e9), Room::Enough);
        assert_eq!(full.of(1.0e9), Room::Short(all));
        assert_eq!(full.of(1.0e5), Room::None(least));
        let log_only = Need { bytes_per_s: 0.0, ..full };
        assert_eq!(log_only.of(1.0e7), Room::Enough);
        let over = Need { stimuli: 0.0, ..full };
        assert_eq!(over.of(0.0), Room::Enough, "nothing is to come");
    }

    /// A folder that is not there yet is judged by the disk it will be on.
    #[test]
    fn a_folder_to_be_made_has_the_room_of_its_parent() {
        let folder = std::env::temp_dir().join("flotor-not-there").join("nor-this");
        let endless = Need { stimuli: 1.0e15, bytes_per_s: 1.0e12 };
        let error = check(&folder, endless).expect_err("no disk holds that").to_string();
        assert!(error.contains("MB are free") && error.contains("--kinematics summary"), "{error}");
        for folder in [folder.as_path(), Path::new("data"), Path::new("")] {
            assert!(check(folder, Need { stimuli: 0.0, bytes_per_s: 0.0 }).is_ok());
            assert!(check(folder, endless).is_err());
        }
    }
}
