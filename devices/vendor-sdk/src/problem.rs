//! Errors of loading the library of an SDK, with file, cause and remedy.

use crate::platform::{LIBRARY_ENDING, missing_remedy};
use std::ffi::OsStr;
use std::fmt;
use std::path::{Path, PathBuf};

/// Error of loading the library of an SDK.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LibraryProblem {
    /// No folder contains the library, or the chosen file does not exist.
    NotFound {
        /// Name of the SDK.
        sdk: &'static str,
        /// Searched files, in order.
        searched: Vec<PathBuf>,
    },
    /// The file cannot be read.
    Unreadable {
        /// Path of the file.
        path: PathBuf,
        /// Error of the system.
        reason: String,
    },
    /// The file is no shared library.
    NotALibrary {
        /// Path of the file.
        path: PathBuf,
    },
    /// The library is for another processor.
    Architecture {
        /// Path of the file.
        path: PathBuf,
        /// Word size and processor of the library.
        found: String,
        /// Word size and processor of this program.
        needed: String,
    },
    /// The system's loader rejects the library, usually because of a missing dependency.
    Refused {
        /// Path of the file.
        path: PathBuf,
        /// Error of the loader.
        reason: String,
    },
    /// The file is Flotor's own drop-in library, which simulates a device, and the policy rejects drop-in libraries.
    StandIn {
        /// Path of the file.
        path: PathBuf,
    },
    /// The library lacks a function.
    MissingFunction {
        /// Path of the file.
        path: PathBuf,
        /// Name of the function.
        function: &'static str,
        /// Name of the SDK, with the oldest version that has all functions.
        needed: String,
    },
    /// The SDK is older than the plugin needs.
    TooOld {
        /// Path of the file.
        path: PathBuf,
        /// Version of the SDK.
        found: String,
        /// Oldest supported version.
        needed: String,
    },
}

impl fmt::Display for LibraryProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFound { sdk, searched } => {
                let remedy = "install the SDK, or name its library with the parameter `library`";
                if let [place] = searched.as_slice() {
                    return write!(f, "the file {} of {sdk} does not exist; {remedy}", place.display());
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
                    "no library of {sdk} found (searched for {} in {folders}); {remedy}",
                    named(|place| place.file_name())
                )
            }
            Self::Unreadable { path, reason } => {
                write!(f, "{} cannot be read ({reason}); check its path and its permissions", path.display())
            }
            Self::NotALibrary { path } => write!(
                f,
                "{} is not a shared library; name the file that ends in {LIBRARY_ENDING} with the parameter `library`",
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
                "{} is Flotor's own drop-in library, which has no device; name the vendor's library with `library`, \
                 or accept a simulated device with `stand_in = true`",
                path.display()
            ),
            Self::MissingFunction { path, function, needed } => {
                write!(
                    f,
                    "{} lacks the function `{function}`; install {needed} or later, or name another file with `library`",
                    path.display()
                )
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
