//! Parts of an SDK's library that differ between systems. Each system has one module with the same items:
//! - `files`, `folders`, `HEAD`, `processor`: file names and folders to search, and processor of a library by its first bytes;
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
pub(crate) use system::{HEAD, LIBRARY_ENDING, Loaded, files, folders, missing_remedy, open, processor};
