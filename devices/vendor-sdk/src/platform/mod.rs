//! Parts of an SDK's library that differ between systems. Each system has one module with the same items:
//! - `files`, `folders`, `HEAD`, `fits`: file names, folders to search, and check of the processor;
//! - `Loaded`, `open`, `LIBRARY_ENDING`, `missing_remedy`: an open library, and user texts about files;
//! - `without_signals`: signal mask for the threads of a library.

#[cfg(not(windows))]
mod linux;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
use linux as system;
#[cfg(windows)]
use windows as system;

pub use system::without_signals;
pub(crate) use system::{HEAD, LIBRARY_ENDING, Loaded, files, fits, folders, missing_remedy, open};

use crate::problem::LibraryProblem;
use std::path::Path;

/// Checks bits and processor of a library against this program.
fn compared(path: &Path, found: Option<(u32, &str)>, told: String) -> Result<(), LibraryProblem> {
    let needed = (usize::BITS, if cfg!(target_arch = "aarch64") { "ARM" } else { "x86" });
    if found == Some(needed) {
        return Ok(());
    }
    let needed = format!("{}-bit {}", needed.0, needed.1);
    Err(LibraryProblem::Architecture { path: path.to_path_buf(), found: told, needed })
}
