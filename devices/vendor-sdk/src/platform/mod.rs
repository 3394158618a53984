//! What differs between systems for a library of an SDK. Each system has one module with the same items:
//! - `files`, `folders`, `HEAD`, `fits`: what the library is called, where it may be, and whether it is for this program;
//! - `Loaded`, `open`, `LIBRARY_ENDING`, `missing_remedy`: an open library, and what people are told of one;
//! - `without_signals`: what its threads must not take.

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

/// Whether a library is for this program, by bits and processor.
fn compared(path: &Path, found: Option<(u32, &str)>, told: String) -> Result<(), LibraryProblem> {
    let needed = (usize::BITS, if cfg!(target_arch = "aarch64") { "ARM" } else { "x86" });
    if found == Some(needed) {
        return Ok(());
    }
    let needed = format!("{}-bit {}", needed.0, needed.1);
    Err(LibraryProblem::Architecture { path: path.to_path_buf(), found: told, needed })
}
