//! Where a library may be, and which processors it is for: told by its first bytes, before anything of it runs.

use crate::problem::LibraryProblem;
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

/// An SDK, as far as its library has to be found.
#[derive(Clone, Copy, Debug)]
pub struct Sdk {
    /// What people call it.
    pub name: &'static str,
    /// Names of the library's file, the preferred one first.
    pub files: &'static [&'static str],
    /// Environment variables that name the folder of the SDK.
    pub variables: &'static [&'static str],
}

/// Folders of the system.
const SYSTEM: [&str; 5] = ["/usr/local/lib", "/usr/lib", "/usr/lib64", "/lib", "/opt/lib"];
/// Bytes of the head of an ELF file that say what it is for.
const HEAD: usize = 20;
/// Processor of this program, as ELF numbers it.
const MACHINE: u16 = if cfg!(target_arch = "aarch64") { 183 } else { 62 };
/// Two for 64 bits.
const CLASS: u8 = if cfg!(target_pointer_width = "64") { 2 } else { 1 };

impl Sdk {
    /// Where the library may be, in order. Not real-time.
    pub(crate) fn places(&self, said: impl Fn(&str) -> Option<String>) -> Vec<PathBuf> {
        let machine = std::env::consts::ARCH;
        let of_sdk = self.variables.iter().filter_map(|variable| said(variable)).flat_map(|folder| {
            let folder = PathBuf::from(folder);
            [folder.join(format!("lib/release/lin-{machine}-gcc")), folder.join("lib"), folder]
        });
        let loader = said("LD_LIBRARY_PATH").unwrap_or_default();
        let loader: Vec<PathBuf> = std::env::split_paths(&loader).collect();
        let own = said("HOME").map(|home| PathBuf::from(home).join(".local/lib"));
        let system = SYSTEM.map(PathBuf::from);
        let of_machine = PathBuf::from(format!("/usr/lib/{machine}-linux-gnu"));
        let folders = of_sdk.chain(loader).chain(own).chain(system).chain([of_machine]);
        let folders = folders.filter(|folder| folder.is_absolute());
        folders.flat_map(|folder| self.files.iter().map(move |file| folder.join(file))).collect()
    }
}

/// Whether a file is a library for this program; `None` if it is not there. Not real-time.
pub(crate) fn looked_at(path: &Path) -> Option<Result<(), LibraryProblem>> {
    let mut head = Vec::new();
    let read = File::open(path).and_then(|file| file.take(HEAD as u64).read_to_end(&mut head));
    match read {
        Ok(_) => Some(fits(path, &head)),
        Err(error) if error.kind() == ErrorKind::NotFound => None,
        Err(error) => {
            Some(Err(LibraryProblem::Unreadable { path: path.to_path_buf(), reason: error.to_string() }))
        }
    }
}

fn fits(path: &Path, head: &[u8]) -> Result<(), LibraryProblem> {
    let Some([0x7f, b'E', b'L', b'F', class, _, .., low, high]) = head.get(..HEAD) else {
        return Err(LibraryProblem::NotALibrary { path: path.to_path_buf() });
    };
    let found = (*class, u16::from_le_bytes([*low, *high]));
    if found == (CLASS, MACHINE) {
        return Ok(());
    }
    let [found, needed] = [found, (CLASS, MACHINE)].map(|(class, machine)| processor(class, machine));
    Err(LibraryProblem::Architecture { path: path.to_path_buf(), found, needed })
}

/// For people.
fn processor(class: u8, machine: u16) -> String {
    let bits = if class == 1 { 32 } else { 64 };
    match machine {
        3 | 62 => format!("{bits}-bit x86"),
        40 | 183 => format!("{bits}-bit ARM"),
        other => format!("a {bits}-bit processor of number {other}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SDK: Sdk = Sdk { name: "an SDK", files: &["libsome.so.3", "libsome.so"], variables: &["SOMESDK"] };

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
        assert_eq!(
            places[6..10],
            ["/first/libsome.so.3", "/first/libsome.so", "/second/libsome.so.3", "/second/libsome.so"]
        );
        assert!(
            places.iter().all(|place| place.starts_with('/')),
            "a folder of the moment is no place: {places:?}"
        );
    }

    #[test]
    fn a_file_is_told_by_its_head() {
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
        assert!(told(b"#!/bin/sh\n").contains("no shared library"));
        assert!(told(&head(2, 62)[..19]).contains("no shared library"), "a head that is cut off");
    }
}
