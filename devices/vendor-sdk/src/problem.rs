//! Why the library of an SDK cannot be used: what, where, and what to do.

use crate::platform::{LIBRARY_ENDING, missing_remedy};
use std::ffi::OsStr;
use std::fmt;
use std::path::{Path, PathBuf};

/// Why the library of an SDK cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LibraryProblem {
    /// None of the places has it.
    NotFound {
        /// What people call the SDK.
        sdk: &'static str,
        /// Where it was looked for, in order.
        searched: Vec<PathBuf>,
    },
    /// It cannot be read.
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system says.
        reason: String,
    },
    /// It is no shared library.
    NotALibrary {
        /// The file.
        path: PathBuf,
    },
    /// It is for other processors.
    Architecture {
        /// The file.
        path: PathBuf,
        /// What it is for.
        found: String,
        /// What this program needs.
        needed: String,
    },
    /// The system's loader refuses it, usually because something it needs is missing.
    Refused {
        /// The file.
        path: PathBuf,
        /// What the loader says.
        reason: String,
    },
    /// It is a drop-in library of Flotor, which would load Flotor once more.
    StandIn {
        /// The file.
        path: PathBuf,
    },
    /// It lacks a function.
    MissingFunction {
        /// The file.
        path: PathBuf,
        /// Name of the function.
        function: &'static str,
        /// What people call the SDK, with the oldest version that has all functions.
        needed: String,
    },
    /// It is older than the plugin needs.
    TooOld {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: String,
        /// The oldest that will do.
        needed: String,
    },
}

impl fmt::Display for LibraryProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFound { sdk, searched } => {
                let remedy = "install it, or name its file with the parameter `library`";
                if let [place] = searched.as_slice() {
                    return write!(f, "there is no {}; for {sdk}, {remedy}", place.display());
                }
                let named = |part: fn(&PathBuf) -> Option<&OsStr>| {
                    let mut names: Vec<String> = Vec::new();
                    for name in searched.iter().filter_map(part).map(|name| name.display().to_string()) {
                        if !names.contains(&name) {
                            names.push(name);
                        }
                    }
                    names.join(", ")
                };
                let folders = named(|place| place.parent().map(Path::as_os_str));
                write!(
                    f,
                    "no library of {sdk}: {remedy}; looked for {} in {folders}",
                    named(|place| place.file_name())
                )
            }
            Self::Unreadable { path, reason } => {
                write!(f, "{} cannot be read ({reason}); check its path and its permissions", path.display())
            }
            Self::NotALibrary { path } => write!(
                f,
                "{} is no shared library; name the file that ends in {LIBRARY_ENDING}",
                path.display()
            ),
            Self::Architecture { path, found, needed } => write!(
                f,
                "{} is for {found} and this program for {needed}; install the SDK for {needed}",
                path.display()
            ),
            Self::Refused { path, reason } => {
                write!(f, "{} cannot be loaded ({reason}); {}", path.display(), missing_remedy(path))
            }
            Self::StandIn { path } => write!(
                f,
                "{} is Flotor's own drop-in library and no device is behind it; name the vendor's with `library`, or \
                 accept a simulated device with `stand_in = true`",
                path.display()
            ),
            Self::MissingFunction { path, function, needed } => {
                write!(f, "{} lacks the function `{function}`; install {needed} or later", path.display())
            }
            Self::TooOld { path, found, needed } => write!(
                f,
                "{} is version {found}; install version {needed} or later, or name another file with `library`",
                path.display()
            ),
        }
    }
}

impl std::error::Error for LibraryProblem {}
