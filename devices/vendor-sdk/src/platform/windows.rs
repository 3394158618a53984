//! Windows: PE, `LoadLibrary`.
#![allow(unsafe_code)] // libloading; listed in tests/tests/system/architecture.rs

use libloading::os::windows::Library;
use std::path::{Path, PathBuf};

/// Handle of an open library.
pub(crate) type Loaded = Library;

/// Number of bytes read from the start of a file, enough for the PE header after a usual DOS stub.
pub(crate) const HEAD: usize = 4096;

/// User text about the ending of a library's name.
pub(crate) const LIBRARY_ENDING: &str = ".dll";

/// Returns the remedy for a library that cannot be loaded.
pub(crate) fn missing_remedy(path: &Path) -> String {
    format!("install the whole SDK, as a library that {} needs may be missing", path.display())
}

/// Returns `on_windows`, the file names of a library on Windows.
pub(crate) fn files(
    _files: &'static [&'static str],
    on_windows: &'static [&'static str],
) -> &'static [&'static str] {
    on_windows
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

/// Returns the machine type of a PE file (field `Machine` of the COFF header); `None` for any other file.
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

#[cfg(test)]
mod tests {
    use super::*;

    use crate::search::{Sdk, fits};

    const SDK: Sdk = Sdk {
        name: "an SDK",
        files: &["libsome.so"],
        files_on_windows: &["some64.dll", "some.dll"],
        variables: &["SOMESDK"],
    };

    #[test]
    fn the_folder_of_the_sdk_comes_before_those_of_the_system() {
        let said = |variable: &str| match variable {
            "SOMESDK" => Some(r"C:\some".to_owned()),
            "PATH" => Some(r"C:\first;relative;D:\second".to_owned()),
            "SystemRoot" => Some(r"C:\windows".to_owned()),
            _ => None,
        };
        let places: Vec<String> = SDK.places(said).iter().map(|place| place.display().to_string()).collect();
        let here = std::env::current_dir().unwrap().join("relative").display().to_string();
        let folders = [r"C:\first", &here, r"D:\second"];
        let files = folders.map(|folder| ["some64.dll", "some.dll"].map(|file| format!(r"{folder}\{file}")));
        assert_eq!(places[0], r"C:\some\bin\some64.dll");
        assert_eq!(places[8..14], files.concat());
        assert_eq!(places[14..], [r"C:\windows\System32\some64.dll", r"C:\windows\System32\some.dll"]);
    }

    #[test]
    fn a_file_is_told_by_its_head() {
        let path = Path::new(r"C:\some.dll");
        let head = |machine: u16| {
            let mut head = vec![0_u8; 0x90];
            head[..2].copy_from_slice(b"MZ");
            head[0x3c] = 0x80;
            head[0x80..0x84].copy_from_slice(b"PE\0\0");
            head[0x84..0x86].copy_from_slice(&machine.to_le_bytes());
            head
        };
        assert_eq!(fits(path, &head(0x8664)), Ok(()));
        let told = |head: &[u8]| fits(path, head).expect_err("it does not fit").to_string();
        assert!(told(&head(0x014c)).contains("is for 32-bit x86 and this program for 64-bit"));
        assert!(told(&head(0xaa64)).contains("is for 64-bit ARM"));
        assert!(told(&head(0x0200)).contains("a processor of number 0x200"));
        assert!(told(b"#!/bin/sh\n").contains("not a shared library"));
        assert!(told(&head(0x8664)[..0x85]).contains("not a shared library"), "a head that is cut off");
    }
}
