//! Errors of loading the library of an SDK, with file, cause and remedy.

use crate::platform::{LIBRARY_ENDING, missing_remedy};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// Error of loading the library of an SDK.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LibraryProblem {
    /// No folder contains the library, or the chosen file does not exist.
    #[error("{}", not_found(sdk, searched))]
    NotFound {
        /// Name of the SDK.
        sdk: &'static str,
        /// Searched files, in order.
        searched: Vec<PathBuf>,
    },
    /// The file cannot be read.
    #[error("{path} cannot be read ({reason}); check its path and its permissions")]
    Unreadable {
        /// Path of the file.
        path: PathBuf,
        /// Error of the system.
        reason: String,
    },
    /// The file is not a shared library.
    #[error(
        "{path} is not a shared library; name the file that ends in {LIBRARY_ENDING} with the parameter `library`"
    )]
    NotALibrary {
        /// Path of the file.
        path: PathBuf,
    },
    /// The library is for another processor.
    #[error("{path} is for {found} and this program for {needed}; install the SDK for {needed}")]
    Architecture {
        /// Path of the file.
        path: PathBuf,
        /// Word size and processor of the library.
        found: String,
        /// Word size and processor of this program.
        needed: String,
    },
    /// The system's loader rejects the library, usually because of a missing dependency.
    #[error("{path} cannot be loaded ({reason}); {}", missing_remedy(path))]
    Refused {
        /// Path of the file.
        path: PathBuf,
        /// Error of the loader.
        reason: String,
    },
    /// The file is Flotor's own drop-in library, which simulates a device, and the policy rejects drop-in libraries.
    #[error(
        "{path} is Flotor's own drop-in library, which has no device; name the vendor's library with `library`, \
         or accept a simulated device with `stand_in = true`"
    )]
    StandIn {
        /// Path of the file.
        path: PathBuf,
    },
    /// The library lacks a function.
    #[error(
        "{path} lacks the function `{function}`; install {needed} or later, or name another file with `library`"
    )]
    MissingFunction {
        /// Path of the file.
        path: PathBuf,
        /// Name of the function.
        function: &'static str,
        /// Name of the SDK, with the oldest version that has all functions.
        needed: String,
    },
    /// The SDK is older than the plugin needs.
    #[error(
        "{path} is version {found}; install version {needed} or later, or name another file with `library`"
    )]
    TooOld {
        /// Path of the file.
        path: PathBuf,
        /// Version of the SDK.
        found: String,
        /// Oldest supported version.
        needed: String,
    },
}

/// Returns the text of [`LibraryProblem::NotFound`].
fn not_found(sdk: &str, searched: &[PathBuf]) -> String {
    let remedy = "install the SDK, or name its library with the parameter `library`";
    if let [place] = searched {
        return format!("the file {} of {sdk} does not exist; {remedy}", place.display());
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
    let files = named(|place| place.file_name());
    // The folders last: a message of a plugin is cut at its limit, and `PATH` may be longer.
    format!("no library of {sdk} found; {remedy} (searched for {files} in {folders})")
}
