//! Path and content hash of the files that parameters of a run name, so that a replay can check whether it has the same
//! files.
//!
//! A setting is stored as written (`curve = "spring.csv"`), without the folder that it refers to. Path and hash are
//! stored among the [parameters](crate::PluginDescription::parameters), under keys that no parameter has (`curve.path`,
//! `curve.xxh3`): readers that do not know these keys ignore them.

use std::fs::{self, File};
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};
use xxhash_rust::xxh3::Xxh3;

/// Block size for reading, bytes.
const BLOCK_BYTES: usize = 64 * 1024;

/// Prefix of a hash, equal to that of a run's digest.
const HASH_PREFIX: &str = "xxh3:";

/// Path and content hash of a file at the time of reading.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedFile {
    /// Absolute path.
    pub path: PathBuf,
    /// xxh3-64 hash of the content. The hash distinguishes files, but is not cryptographic: it is not a protection against
    /// forgery.
    pub hash: u64,
}

impl NamedFile {
    /// Reads a file and computes its hash. Not real-time.
    ///
    /// # Errors
    /// Errors of the system; `InvalidInput` for a file that is not regular: reading a pipe would block, and empty it.
    pub fn read(path: &Path) -> io::Result<Self> {
        if !fs::metadata(path)?.is_file() {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file"));
        }
        let mut hash = Xxh3::new();
        io::copy(&mut BufReader::with_capacity(BLOCK_BYTES, File::open(path)?), &mut hash)?;
        Ok(Self { path: std::path::absolute(path)?, hash: hash.digest() })
    }

    /// Returns the hash as text: `xxh3:` and sixteen hexadecimal digits.
    #[must_use]
    pub fn hash_text(&self) -> String {
        format!("{HASH_PREFIX}{:016x}", self.hash)
    }

    /// Returns the entries of this file in a recording, as key and value: `PARAMETER.path` and `PARAMETER.xxh3`, where `parameter`
    /// is the id of the parameter that names the file.
    #[must_use]
    pub fn to_parameters(&self, parameter: &str) -> [(String, String); 2] {
        let path = self.path.to_string_lossy().into_owned();
        [(path_key(parameter), path), (hash_key(parameter), self.hash_text())]
    }

    /// Finds path and hash of the file of a parameter among the stored entries; `None` if there are none (recordings of
    /// earlier versions), or the hash is malformed.
    #[must_use]
    pub fn among(parameters: &[(String, String)], parameter: &str) -> Option<Self> {
        let value = |key: String| parameters.iter().find(|(known, _)| *known == key).map(|(_, value)| value);
        let path = value(path_key(parameter))?;
        let hash = value(hash_key(parameter))?.strip_prefix(HASH_PREFIX)?;
        Some(Self { path: PathBuf::from(path), hash: u64::from_str_radix(hash, 16).ok()? })
    }
}

fn path_key(parameter: &str) -> String {
    format!("{parameter}.path")
}

fn hash_key(parameter: &str) -> String {
    format!("{parameter}.xxh3")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_is_that_of_all_bytes() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("file");
        let bytes: Vec<u8> = (0..300_000_u32).map(|k| k.to_le_bytes()[0]).collect();
        std::fs::write(&file, &bytes).expect("a file");
        assert_eq!(NamedFile::read(&file).expect("it is there").hash, xxhash_rust::xxh3::xxh3_64(&bytes));
    }
}
