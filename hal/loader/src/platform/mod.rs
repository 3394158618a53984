//! Platform-specific loading of a plugin: library format, private copy and opening.
//!
//! Each system has one module with the same items:
//! - `PrivateCopy`: a copy of a plugin's file that nobody can change, opened once and never unloaded;
//! - `metadata_section`: the bytes of the section `.flotor` of a library, without running any of it;
//! - `COPY_REMEDY`: the remedy if the system cannot make the copy;
//! - `link_remedy`: the remedy if the system cannot link a library;
//! - `Handle` and `writable_duplicate`: a duplicate of a plugin's descriptor.

#[cfg(not(windows))]
mod linux;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use linux::{COPY_REMEDY, Handle, PrivateCopy, link_remedy, metadata_section, writable_duplicate};
#[cfg(windows)]
pub(crate) use windows::{
    COPY_REMEDY, Handle, PrivateCopy, link_remedy, metadata_section, writable_duplicate,
};

/// Reason why a file has no metadata section that can be read.
pub(crate) enum NoSection {
    /// The file is not a library of this system.
    NotALibrary(object::Error),
    /// The file is shorter than the library's tables require.
    Truncated {
        /// Bytes required.
        need: u64,
    },
    /// The library has no such section.
    NotAPlugin,
}

impl From<object::Error> for NoSection {
    fn from(cause: object::Error) -> Self {
        Self::NotALibrary(cause)
    }
}

/// Returns the text of an error with the chain of its causes.
fn whole_cause(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text = format!("{text}: {cause}");
        source = cause.source();
    }
    text
}
