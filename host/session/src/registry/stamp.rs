//! File stamps, which show whether a file has changed since it was read.

use crate::platform;
use std::path::Path;
use std::time::{Duration, SystemTime};

/// Coarsest resolution of file times: a second change within this time may leave the file time unchanged. File systems count in
/// kernel ticks (10 ms at most), some in seconds (FAT in two).
const COARSEST_FILE_TIME: Duration = Duration::from_secs(2);

/// Identity and state of a file, as reported by the file system.
#[derive(Clone, Debug)]
pub(super) struct FileStamp {
    identity: [u64; 2],
    length_bytes: u64,
    /// Time of the last change, s and ns since 1970.
    changed: (i64, i64),
    /// True if the last change was so long before the stamp that any later change has a different time.
    settled: bool,
}

impl FileStamp {
    /// Reads the stamp of a file. Not real-time.
    pub(super) fn of(path: &Path) -> std::io::Result<Self> {
        let file = std::fs::metadata(path)?;
        let changed = platform::changed(&file);
        Ok(Self {
            identity: platform::identity(&file),
            length_bytes: file.len(),
            changed,
            settled: is_settled(changed, SystemTime::now()),
        })
    }

    /// Returns true if the contents have not changed between the two stamps; false: unknown, the contents have to be compared.
    pub(super) fn is_same_as(&self, other: &Self) -> bool {
        let what = |stamp: &Self| (stamp.identity, stamp.length_bytes, stamp.changed);
        self.settled && what(self) == what(other)
    }
}

fn is_settled((seconds, nanoseconds): (i64, i64), now: SystemTime) -> bool {
    let (Ok(seconds), Ok(nanoseconds)) = (u64::try_from(seconds), u32::try_from(nanoseconds)) else {
        return false;
    };
    let changed = SystemTime::UNIX_EPOCH + Duration::new(seconds, nanoseconds);
    now.duration_since(changed).is_ok_and(|age| age > COARSEST_FILE_TIME)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_was_just_written_is_looked_at_again() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("file");
        std::fs::write(&file, b"one").expect("a file");
        let fresh = FileStamp::of(&file).expect("it is there");
        assert!(!fresh.is_same_as(&fresh), "a write within the clock's tick would have the same time");
        let settled = FileStamp { settled: true, ..fresh };
        assert!(settled.is_same_as(&FileStamp::of(&file).expect("it is there")));
        let other = FileStamp { changed: (settled.changed.0, settled.changed.1 + 1), ..settled.clone() };
        assert!(!settled.is_same_as(&other));
        let other = FileStamp { length_bytes: 4, ..settled.clone() };
        assert!(!settled.is_same_as(&other));
    }

    #[test]
    fn settled_is_two_seconds_ago_and_never_the_future() {
        let at = |seconds| SystemTime::UNIX_EPOCH + Duration::from_secs(seconds);
        assert!(is_settled((100, 0), at(103)));
        assert!(!is_settled((100, 0), at(101)));
        assert!(!is_settled((100, 0), at(50)), "a clock was set back");
        assert!(!is_settled((-1, 0), at(50)));
    }
}
