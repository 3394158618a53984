//! What differs between systems when a plugin is loaded: the format of a library, and how a private copy of it is kept and opened.
//!
//! Each system has one module with the same items:
//! - `PrivateCopy`: a copy of a plugin's file that nobody can change, opened once and never unloaded;
//! - `metadata_section`: the bytes of the section `.flotor` of a library, without running any of it;
//! - `link_remedy`: what helps where the system cannot link a library;
//! - `Handle` and `writable_duplicate`: what a plugin's descriptor is kept as.

#[cfg(not(windows))]
mod linux;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use linux::{Handle, PrivateCopy, link_remedy, metadata_section, writable_duplicate};
#[cfg(windows)]
pub(crate) use windows::{Handle, PrivateCopy, link_remedy, metadata_section, writable_duplicate};

/// What an error says, and what caused it.
fn whole_cause(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text = format!("{text}: {cause}");
        source = cause.source();
    }
    text
}
