//! Files that parameters of a run named: which they were and what was in them, so that a replay can tell
//! whether it has the same ones.
//!
//! A setting is kept as it was written (`curve = "spring.csv"`), which says nothing about the folder it was
//! meant from. Path and hash stand beside it among the [parameters](crate::PluginDescription::parameters),
//! under keys that no parameter has (`curve.path`, `curve.xxh3`): readers that do not know them pass them
//! over.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use xxhash_rust::xxh3::Xxh3;

/// Bytes read at once.
const BLOCK_BYTES: usize = 64 * 1024;

/// What the hash begins with, as that of a run does.
const HASH_PREFIX: &str = "xxh3:";

/// A file as it was when it was looked at.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedFile {
    /// Where it is, from the root.
    pub path: PathBuf,
    /// xxh3-64 of what is in it. It distinguishes files; it is no protection against malice.
    pub hash: u64,
}

impl NamedFile {
    /// Reads a file. Not real-time.
    ///
    /// # Errors
    /// What the system says; also of what is no regular file: a pipe would be waited for, and emptied.
    pub fn read(path: &Path) -> io::Result<Self> {
        if !fs::metadata(path)?.is_file() {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file"));
        }
        let mut file = File::open(path)?;
        let mut hash = Xxh3::new();
        let mut block = vec![0; BLOCK_BYTES];
        loop {
            match file.read(&mut block) {
                Ok(0) => return Ok(Self { path: std::path::absolute(path)?, hash: hash.digest() }),
                Ok(length) => hash.update(block.get(..length).unwrap_or_default()),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// The hash as text: `xxh3:` and sixteen hexadecimal digits.
    #[must_use]
    pub fn hash_text(&self) -> String {
        format!("{HASH_PREFIX}{:016x}", self.hash)
    }

    /// What stands beside the parameter that named it.
    #[must_use]
    pub fn to_parameters(&self, parameter: &str) -> [(String, String); 2] {
        let path = self.path.to_string_lossy().into_owned();
        [(path_key(parameter), path), (hash_key(parameter), self.hash_text())]
    }

    /// The file a parameter named, if it stands beside it: recordings of earlier versions do not have it.
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
