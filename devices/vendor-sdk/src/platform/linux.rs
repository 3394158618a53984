//! Linux: ELF, `dlopen`, signals.
#![allow(unsafe_code)] // the mask of a thread, and libloading; listed in tests/tests/system/architecture.rs

use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};
use std::mem::MaybeUninit;
use std::path::{Path, PathBuf};

/// Handle of an open library.
pub(crate) type Loaded = Library;

/// Library folders of the system.
const SYSTEM: [&str; 5] = ["/usr/local/lib", "/usr/lib", "/usr/lib64", "/lib", "/opt/lib"];
/// Bytes of an ELF header up to the processor.
pub(crate) const HEAD: usize = 20;

/// User text about the ending of a library's name.
pub(crate) const LIBRARY_ENDING: &str = ".so or in .so and a version";

/// Returns the remedy for a library that cannot be loaded.
pub(crate) fn missing_remedy(path: &Path) -> String {
    format!("`ldd {}` lists the required libraries and the missing ones", path.display())
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
