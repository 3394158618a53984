//! File that announces a port of this machine and a secret.

use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::os::windows::fs::OpenOptionsExt;
use std::path::Path;
use std::time::Duration;

/// Share mode (`FILE_SHARE_READ`): others may read the file, but neither write nor remove it.
const SHARE_READ: u32 = 1;
/// `FILE_FLAG_DELETE_ON_CLOSE`: the system removes the file when the process ends for any reason.
const REMOVE_AT_END: u32 = 0x0400_0000;
/// Length of a secret in hexadecimal digits, bytes.
pub(super) const SECRET_BYTES: usize = 32;
/// Number of attempts to read a file that is still empty: the writer creates and fills the file in two calls.
const LOOKS: u32 = 5;
/// Pause between two attempts.
const PAUSE: Duration = Duration::from_millis(1);

/// Port and secret that the file announces.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Announced {
    pub(super) port: u16,
    pub(super) secret: String,
}

impl Announced {
    /// Creates the content for a port, with a new secret of 128 random bits.
    ///
    /// # Errors
    /// If the system returns no random bits.
    pub(super) fn new(port: u16) -> io::Result<Self> {
        let mut bits = [0; SECRET_BYTES / 2];
        getrandom::fill(&mut bits).map_err(io::Error::other)?;
        Ok(Self { port, secret: format!("{:032x}", u128::from_le_bytes(bits)) })
    }

    /// Creates and writes the file, which is removed when the returned handle is closed.
    pub(super) fn write(&self, path: &Path) -> io::Result<File> {
        let mut file = create(path)?;
        file.write_all(format!("{} {}\n", self.port, self.secret).as_bytes())?;
        Ok(file)
    }

    /// Reads the file; waits a few milliseconds for an incomplete file.
    pub(super) fn read(path: &Path) -> io::Result<Self> {
        for _ in 0..LOOKS {
            let text = std::fs::read_to_string(path)?;
            if let Some(line) = text.strip_suffix('\n') {
                return Self::of_line(line).ok_or_else(no_port);
            }
            std::thread::sleep(PAUSE);
        }
        Err(no_port())
    }

    fn of_line(line: &str) -> Option<Self> {
        let (port, secret) = line.split_once(' ')?;
        let port = port.parse().ok()?;
        (secret.len() == SECRET_BYTES).then(|| Self { port, secret: secret.to_owned() })
    }
}

fn create(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.write(true).create_new(true).share_mode(SHARE_READ).custom_flags(REMOVE_AT_END).open(path)
}

fn no_port() -> io::Error {
    io::Error::new(ErrorKind::InvalidData, "the file of the session contains no port")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread;

    #[test]
    fn a_file_that_is_being_written_is_waited_for_and_an_empty_one_is_refused() {
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("1-0.run");
        let announced = Announced::new(7).unwrap();
        let mut file = create(&path).unwrap();
        file.write_all(b"7 ").unwrap();
        assert_eq!(Announced::read(&path).unwrap_err().kind(), ErrorKind::InvalidData);
        // Whoever reads meanwhile may be too early, and then says so; it never takes a part for the whole.
        let reader = {
            let path = path.clone();
            thread::spawn(move || {
                (0..100).find_map(|_| Announced::read(&path).ok()).map(|read| (read.port, read.secret))
            })
        };
        for byte in announced.secret.bytes().chain([b'\n']) {
            file.write_all(&[byte]).unwrap();
        }
        assert_eq!(reader.join().unwrap(), Some((7, announced.secret)));
    }

    #[test]
    fn each_secret_is_another_and_the_file_goes_with_its_owner() {
        let scratch = tempfile::tempdir().unwrap();
        let path = scratch.path().join("1-0.run");
        let [first, second] = [(); 2].map(|()| Announced::new(7).unwrap());
        assert_ne!(first.secret, second.secret);
        assert_eq!(first.secret.len(), SECRET_BYTES);
        let file = first.write(&path).unwrap();
        assert_eq!(Announced::read(&path).unwrap(), first);
        assert!(std::fs::remove_file(&path).is_err(), "others cannot remove it");
        drop(file);
        assert!(!path.exists());
    }
}
