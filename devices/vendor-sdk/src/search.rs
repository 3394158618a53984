//! Search for the library of an SDK, and check of its processor by its first bytes, before any of its code runs.

use crate::platform;
use crate::problem::LibraryProblem;
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

/// Library lookup data of an SDK.
#[derive(Clone, Copy, Debug)]
pub struct Sdk {
    /// Name of the SDK, for errors.
    pub name: &'static str,
    /// File names of the library, the preferred one first.
    pub files: &'static [&'static str],
    /// File names of the library on Windows, the preferred one first.
    pub files_on_windows: &'static [&'static str],
    /// Environment variables that name the folder of the SDK.
    pub variables: &'static [&'static str],
}

impl Sdk {
    /// Returns the candidate files in search order, as absolute paths: a relative folder is relative to the working
    /// directory of the program, as for the loader of the system. Not real-time.
    pub(crate) fn places(&self, said: impl Fn(&str) -> Option<String>) -> Vec<PathBuf> {
        let folders = platform::folders(self.variables, said).into_iter();
        let folders = folders.filter_map(|folder| std::path::absolute(folder).ok()); // `absolute` drops empty ones
        let files = platform::files(self.files, self.files_on_windows);
        folders.flat_map(|folder| files.iter().map(move |file| folder.join(file))).collect()
    }
}

/// Checks that a file is a library for this program; `None` if the file does not exist. Not real-time.
pub(crate) fn looked_at(path: &Path) -> Option<Result<(), LibraryProblem>> {
    let mut head = Vec::new();
    let read = File::open(path).and_then(|file| file.take(platform::HEAD as u64).read_to_end(&mut head));
    match read {
        Ok(_) => Some(fits(path, &head)),
        Err(error) if error.kind() == ErrorKind::NotFound => None,
        Err(error) => {
            Some(Err(LibraryProblem::Unreadable { path: path.to_path_buf(), reason: error.to_string() }))
        }
    }
}

/// Checks the first bytes of a file for a library of this program's word size and processor.
pub(crate) fn fits(path: &Path, head: &[u8]) -> Result<(), LibraryProblem> {
    let path = path.to_path_buf();
    let maker = if cfg!(target_arch = "aarch64") { "ARM" } else { "x86" };
    let needed = format!("{}-bit {maker}", usize::BITS);
    match platform::processor(head) {
        Some(found) if found == needed => Ok(()),
        Some(found) => Err(LibraryProblem::Architecture { path, found, needed }),
        None => Err(LibraryProblem::NotALibrary { path }),
    }
}
