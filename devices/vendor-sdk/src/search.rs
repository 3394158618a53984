//! Search for the library of an SDK, and check of its processor by its first bytes, before any of its code runs.

use crate::platform;
use crate::problem::LibraryProblem;
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

/// Library lookup data of an SDK.
#[derive(Clone, Copy, Debug)]
pub struct Sdk {
    /// Name of the SDK, for errors.
    pub name: &'static str,
    /// File names of the library, the preferred one first.
    pub files: &'static [&'static str],
    /// File names of the library on Windows, the preferred one first.
    pub files_on_windows: &'static [&'static str],
    /// Environment variables that name the folder of the SDK.
    pub variables: &'static [&'static str],
}

impl Sdk {
    /// Returns the candidate files in search order, as absolute paths: a relative folder is relative to the working
    /// directory of the program, as for the loader of the system. Not real-time.
    pub(crate) fn places(&self, said: impl Fn(&str) -> Option<String>) -> Vec<PathBuf> {
        let folders = platform::folders(self.variables, said).into_iter();
        let folders = folders.filter_map(|folder| std::path::absolute(folder).ok()); // `absolute` drops empty ones
        let files = if cfg!(windows) { self.files_on_windows } else { self.files };
        folders.flat_map(|folder| files.iter().map(move |file| folder.join(file))).collect()
    }
}

/// Checks that a file is a library for this program; `None` if the file does not exist. Not real-time.
pub(crate) fn looked_at(path: &Path) -> Option<Result<(), LibraryProblem>> {
    let mut head = Vec::new();
    let read = File::open(path).and_then(|file| file.take(platform::HEAD as u64).read_to_end(&mut head));
    match read {
        Ok(_) => Some(fits(path, &head)),
        Err(error) if error.kind() == ErrorKind::NotFound => None,
        Err(error) => {
            Some(Err(LibraryProblem::Unreadable { path: path.to_path_buf(), reason: error.to_string() }))
        }
    }
}

/// Checks the first bytes of a file for a library of this program's word size and processor.
fn fits(path: &Path, head: &[u8]) -> Result<(), LibraryProblem> {
    let path = path.to_path_buf();
    let maker = if cfg!(target_arch = "aarch64") { "ARM" } else { "x86" };
    let needed = format!("{}-bit {maker}", usize::BITS);
    match platform::processor(head) {
        Some(found) if found == needed => Ok(()),
        Some(found) => Err(LibraryProblem::Architecture { path, found, needed }),
        None => Err(LibraryProblem::NotALibrary { path }),
    }
}

#[cfg(all(test, not(windows)))]
mod tests {
    use super::*;
    use crate::platform::HEAD;

    const SDK: Sdk = Sdk {
        name: "an SDK",
        files: &["libsome.so.3", "libsome.so"],
        files_on_windows: &["some64.dll"],
        variables: &["SOMESDK"],
    };

    #[test]
    fn the_folder_of_the_sdk_comes_before_those_of_the_system() {
        let said = |variable: &str| match variable {
            "SOMESDK" => Some("/opt/some".to_owned()),
            "LD_LIBRARY_PATH" => Some("/first::relative:/second".to_owned()),
            _ => None,
        };
        let places: Vec<String> = SDK.places(said).iter().map(|place| place.display().to_string()).collect();
        let machine = std::env::consts::ARCH;
        assert_eq!(places[0], format!("/opt/some/lib/release/lin-{machine}-gcc/libsome.so.3"));
        let here = std::env::current_dir().unwrap().join("relative").display().to_string();
        let folders = ["/first", &here, "/second"];
        let files =
            folders.map(|folder| ["libsome.so.3", "libsome.so"].map(|file| format!("{folder}/{file}")));
        assert_eq!(places[6..12], files.concat(), "an empty folder is none");
    }

    #[test]
    fn a_file_is_told_by_its_head() {
        const CLASS: u8 = if usize::BITS == 64 { 2 } else { 1 };
        const MACHINE: u16 = if cfg!(target_arch = "aarch64") { 183 } else { 62 };
        let path = Path::new("/a/lib.so");
        let head = |class: u8, machine: u16| {
            let mut head = [0_u8; HEAD];
            head[..5].copy_from_slice(&[0x7f, b'E', b'L', b'F', class]);
            head[18..].copy_from_slice(&machine.to_le_bytes());
            head
        };
        assert_eq!(fits(path, &head(CLASS, MACHINE)), Ok(()));
        let told = |head: &[u8]| fits(path, head).expect_err("it does not fit").to_string();
        assert!(told(&head(1, 3)).contains("is for 32-bit x86 and this program for 64-bit"));
        assert!(told(&head(1, 40)).contains("is for 32-bit ARM"));
        assert!(told(&head(2, 243)).contains("a 64-bit processor of number 243"));
        assert!(told(b"#!/bin/sh\n").contains("not a shared library"));
        assert!(told(&head(2, 62)[..19]).contains("not a shared library"), "a head that is cut off");
    }
}

#[cfg(all(test, windows))]
mod tests_on_windows {
    use super::*;

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
