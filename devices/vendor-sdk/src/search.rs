//! Where a library may be, and which processors it is for: told by its first bytes, before anything of it runs.

use crate::platform;
use crate::problem::LibraryProblem;
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

/// An SDK, as far as its library has to be found.
#[derive(Clone, Copy, Debug)]
pub struct Sdk {
    /// What people call it.
    pub name: &'static str,
    /// Names of the library's file, the preferred one first.
    pub files: &'static [&'static str],
    /// The same on Windows.
    pub files_on_windows: &'static [&'static str],
    /// Environment variables that name the folder of the SDK.
    pub variables: &'static [&'static str],
}

impl Sdk {
    /// Returns the files that may be the library, in order, with absolute paths: a relative folder is one of the folder in which the
    /// program was started, as for the loader of the system. Not real-time.
    pub(crate) fn places(&self, said: impl Fn(&str) -> Option<String>) -> Vec<PathBuf> {
        let folders = platform::folders(self, said).into_iter();
        let folders = folders.filter_map(|folder| std::path::absolute(folder).ok()); // an empty one is none
        folders.flat_map(|folder| platform::files(self).iter().map(move |file| folder.join(file))).collect()
    }
}

/// Whether a file is a library for this program; `None` if it is not there. Not real-time.
pub(crate) fn looked_at(path: &Path) -> Option<Result<(), LibraryProblem>> {
    let mut head = Vec::new();
    let read = File::open(path).and_then(|file| file.take(platform::HEAD as u64).read_to_end(&mut head));
    match read {
        Ok(_) => Some(platform::fits(path, &head)),
        Err(error) if error.kind() == ErrorKind::NotFound => None,
        Err(error) => {
            Some(Err(LibraryProblem::Unreadable { path: path.to_path_buf(), reason: error.to_string() }))
        }
    }
}
