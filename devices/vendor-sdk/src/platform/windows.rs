//! Windows: PE, `LoadLibrary`.
#![allow(unsafe_code)] // libloading; listed in tests/tests/system/architecture.rs

use libloading::os::windows::Library;
use std::path::{Path, PathBuf};

/// Handle of an open library.
pub(crate) type Loaded = Library;

/// Bytes of a file up to the processor in the PE header: the DOS stub before it is short.
pub(crate) const HEAD: usize = 4096;

/// User text about the ending of a library's name.
pub(crate) const LIBRARY_ENDING: &str = ".dll";

/// Returns the remedy for a library that cannot be loaded.
pub(crate) fn missing_remedy(path: &Path) -> String {
    format!("a library that {} needs is missing; install the whole SDK", path.display())
}

/// Returns the library search path from environment variables, in order: the folders of the SDK (`variables`), `PATH`,
/// and the system folder, where drivers install their libraries.
pub(crate) fn folders(variables: &[&str], said: impl Fn(&str) -> Option<String>) -> Vec<PathBuf> {
    let of_sdk = variables.iter().filter_map(|variable| said(variable)).flat_map(|folder| {
        let folder = PathBuf::from(folder);
        [folder.join("bin"), folder.join("lib").join("x64").join("Release"), folder.join("lib"), folder]
    });
    let path = said("PATH").unwrap_or_default();
    let path: Vec<PathBuf> = std::env::split_paths(&path).collect();
    let system = said("SystemRoot").map(|folder| PathBuf::from(folder).join("System32"));
    of_sdk.chain(path).chain(system).collect()
}

/// Returns word size and processor of a library, read from its first bytes; `None` for another kind of file.
pub(crate) fn processor(head: &[u8]) -> Option<String> {
    Some(match machine(head)? {
        0x014c => "32-bit x86".to_owned(),
        0x8664 => "64-bit x86".to_owned(),
        0xaa64 => "64-bit ARM".to_owned(),
        other => format!("a processor of number {other:#x}"),
    })
}

/// Returns the processor number of a PE file.
fn machine(head: &[u8]) -> Option<u16> {
    let place = match head {
        [b'M', b'Z', ..] => u32::from_le_bytes(head.get(0x3c..0x40)?.try_into().ok()?),
        _ => return None,
    };
    match head.get(usize::try_from(place).ok()?..)? {
        [b'P', b'E', 0, 0, low, high, ..] => Some(u16::from_le_bytes([*low, *high])),
        _ => None,
    }
}

/// Opens a library. Not real-time.
///
/// # Errors
/// Errors of the loader.
///
/// # Safety
/// The caller trusts the library: opening it runs its constructors.
pub(crate) unsafe fn open(path: &Path) -> Result<Loaded, libloading::Error> {
    // SAFETY: the caller guarantees it.
    unsafe { Library::new(path) }
}

/// Runs `body` unchanged: there are no signals to block. Not real-time.
pub fn without_signals<T>(body: impl FnOnce() -> T) -> T {
    body()
}
