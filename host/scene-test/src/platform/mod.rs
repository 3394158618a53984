//! What differs between systems for a test of scenes: who may read a result, and which rules of `flotor validate` it cannot check.

#[cfg(not(windows))]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use unix::{UNTOLD_RULES, readable_by_all};
#[cfg(windows)]
pub(crate) use windows::{UNTOLD_RULES, readable_by_all};
