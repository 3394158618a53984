//! Linux: ELF, `dlopen`, signals.
#![allow(unsafe_code)] // the mask of a thread, and libloading; listed in tests/tests/system/architecture.rs

use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};
use std::mem::MaybeUninit;
use std::path::{Path, PathBuf};

/// Handle of an open library.
pub(crate) type Loaded = Library;

/// Library folders of the system.
const SYSTEM: [&str; 5] = ["/usr/local/lib", "/usr/lib", "/usr/lib64", "/lib", "/opt/lib"];
/// Length of an ELF header up to the machine type (field `e_machine`) inclusive, bytes.
pub(crate) const HEAD: usize = 20;

/// User text about the ending of a library's name.
pub(crate) const LIBRARY_ENDING: &str = ".so or in .so and a version";

/// Returns the remedy for a library that cannot be loaded.
pub(crate) fn missing_remedy(path: &Path) -> String {
    format!("`ldd {}` lists the required libraries and the missing ones", path.display())
}

/// Returns `files`, the file names of a library on Linux.
pub(crate) fn files(
    files: &'static [&'static str],
    _on_windows: &'static [&'static str],
) -> &'static [&'static str] {
    files
}

/// Returns the library search path from environment variables, in order: the folders of the SDK (`variables`),
/// `LD_LIBRARY_PATH`, the user's `~/.local/lib`, and the library folders of the system.
pub(crate) fn folders(variables: &[&str], said: impl Fn(&str) -> Option<String>) -> Vec<PathBuf> {
    let machine = std::env::consts::ARCH;
    let of_sdk = variables.iter().filter_map(|variable| said(variable)).flat_map(|folder| {
        let folder = PathBuf::from(folder);
        [folder.join(format!("lib/release/lin-{machine}-gcc")), folder.join("lib"), folder]
    });
    let loader = said("LD_LIBRARY_PATH").unwrap_or_default();
    let loader: Vec<PathBuf> = std::env::split_paths(&loader).collect();
    let own = said("HOME").map(|home| PathBuf::from(home).join(".local/lib"));
    let system = SYSTEM.map(PathBuf::from);
    let of_machine = PathBuf::from(format!("/usr/lib/{machine}-linux-gnu"));
    of_sdk.chain(loader).chain(own).chain(system).chain([of_machine]).collect()
}

/// Returns word size and processor of a library, read from its first bytes; `None` for another kind of file.
pub(crate) fn processor(head: &[u8]) -> Option<String> {
    let [0x7f, b'E', b'L', b'F', class, _, .., low, high] = head.get(..HEAD)? else { return None };
    let bits = if *class == 1 { 32 } else { 64 };
    Some(match (bits, u16::from_le_bytes([*low, *high])) {
        (32, 3) | (_, 62) => format!("{bits}-bit x86"),
        (32, 40) | (_, 183) => format!("{bits}-bit ARM"),
        (_, other) => format!("a {bits}-bit processor of number {other}"),
    })
}

/// Opens a library with immediate binding and local symbols. Not real-time.
///
/// # Errors
/// Errors of the loader.
///
/// # Safety
/// The caller trusts the library: opening it runs its constructors.
pub(crate) unsafe fn open(path: &Path) -> Result<Loaded, libloading::Error> {
    // SAFETY: the caller guarantees it.
    unsafe { Library::open(Some(path), RTLD_NOW | RTLD_LOCAL) }
}

/// Runs `body` with all signals of this thread blocked, so that threads started by `body` inherit the signal mask and
/// never handle a signal of the host; then restores the mask. Not real-time.
pub fn without_signals<T>(body: impl FnOnce() -> T) -> T {
    let mut before = MaybeUninit::<libc::sigset_t>::zeroed();
    // SAFETY: two sets on this stack; the first is filled before it is read, the second is written by the system.
    let is_blocked = unsafe {
        let mut all = MaybeUninit::<libc::sigset_t>::zeroed();
        libc::sigfillset(all.as_mut_ptr());
        libc::pthread_sigmask(libc::SIG_SETMASK, all.as_ptr(), before.as_mut_ptr()) == 0
    };
    let value = body();
    if is_blocked {
        // SAFETY: the set that the system wrote above.
        unsafe { libc::pthread_sigmask(libc::SIG_SETMASK, before.as_ptr(), std::ptr::null_mut()) };
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::search::{Sdk, fits};

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
