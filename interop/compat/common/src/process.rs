//! Process of the program: forked copies, end, signals, and the file of this library.

use std::collections::BTreeMap;
use std::ffi::{CStr, CString};
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, Once, OnceLock};

/// True in a forked copy of the process that prepared the run: the devices belong to the original.
static IS_COPY: AtomicBool = AtomicBool::new(false);

/// Returns true in a child forked after the scene was prepared: a drop-in does nothing there.
pub(crate) fn is_copy() -> bool {
    IS_COPY.load(Ordering::Relaxed)
}

extern "C" fn note_copy() {
    IS_COPY.store(true, Ordering::Relaxed);
}

/// Registers the detection of forked copies. Not real-time.
pub(crate) fn notice_copies() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // SAFETY: a function that takes nothing and stores one word, which is legal in a child of a process with threads.
        unsafe { libc::pthread_atfork(None, None, Some(note_copy)) };
    });
}

/// Registers a callback for the end of the process by `exit` or by the end of `main`. Not real-time.
pub(crate) fn at_end(end: extern "C" fn()) {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // SAFETY: a function that takes nothing; the library stays loaded (it is linked so that it is never unloaded).
        unsafe { libc::atexit(end) };
    });
}

/// Returns true if this is the first drop-in of the process that prepares a run: a second drop-in has a run of its own, and must
/// not write into the files of the first drop-in. Not real-time.
pub(crate) fn is_first() -> bool {
    static CLAIM: OnceLock<Option<UnixDatagram>> = OnceLock::new();
    let claim = || {
        let space = std::fs::read_link("/proc/self/ns/pid").unwrap_or_default();
        let name = format!("flotor-drop-in {} {}", space.display(), std::process::id());
        UnixDatagram::bind_addr(&SocketAddr::from_abstract_name(name).ok()?).ok()
    };
    // A name that is unique within this process; the system releases it at the process's end.
    CLAIM.get_or_init(claim).is_some()
}

/// Runs `body` with signals blocked in this thread, and so in all threads that `body` starts: signals belong to the program's own
/// threads. Signals raised by an instruction stay unblocked. Not real-time.
pub fn quietly<T>(body: impl FnOnce() -> T) -> T {
    const RAISED: [i32; 7] =
        [libc::SIGSEGV, libc::SIGBUS, libc::SIGFPE, libc::SIGILL, libc::SIGABRT, libc::SIGSYS, libc::SIGTRAP];
    let mut before = std::mem::MaybeUninit::<libc::sigset_t>::zeroed();
    // SAFETY: sets on this stack, initialised by the first call or by the system before they are read.
    let is_blocked = unsafe {
        let mut all = std::mem::MaybeUninit::<libc::sigset_t>::zeroed();
        libc::sigfillset(all.as_mut_ptr());
        for signal in RAISED {
            libc::sigdelset(all.as_mut_ptr(), signal);
        }
        libc::pthread_sigmask(libc::SIG_SETMASK, all.as_ptr(), before.as_mut_ptr()) == 0
    };
    let value = body();
    if is_blocked {
        // SAFETY: the set the system wrote above.
        unsafe { libc::pthread_sigmask(libc::SIG_SETMASK, before.as_ptr(), std::ptr::null_mut()) };
    }
    value
}

/// Runs the body of an entry point; on a panic returns `fallback`.
pub fn guarded<T>(fallback: T, body: impl FnOnce() -> T) -> T {
    catch_unwind(AssertUnwindSafe(body)).unwrap_or(fallback)
}

/// Language of the program, detected by the interpreter in its process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Language {
    /// Python, whose interpreter is in the process.
    Python,
    /// Any other language.
    Other,
}

/// Returns the language of the program of this process. Not real-time.
#[must_use]
pub fn language() -> Language {
    // SAFETY: a terminated name; the address is compared and not called.
    let interpreter = unsafe { libc::dlsym(libc::RTLD_DEFAULT, c"Py_IsInitialized".as_ptr()) };
    if interpreter.is_null() { Language::Other } else { Language::Python }
}

/// Returns the path of this library, with symbolic links resolved; `None` if the system does not list it. Not real-time.
#[must_use]
pub fn library() -> Option<PathBuf> {
    let here = library as fn() -> Option<PathBuf> as usize;
    let maps = std::fs::read_to_string("/proc/self/maps").ok()?;
    let holds = |line: &&str| {
        let range = line.split_ascii_whitespace().next().and_then(|range| range.split_once('-'));
        let number = |text| usize::from_str_radix(text, 16).ok();
        range.and_then(|(from, to)| Some(number(from)? <= here && here < number(to)?)).unwrap_or(false)
    };
    let line = maps.lines().find(holds)?;
    let path = line.find('/').and_then(|start| line.get(start..))?;
    PathBuf::from(path).canonicalize().ok()
}

/// Interns a text for a program: the pointer stays valid for the life of the process, and equal texts share one pointer.
#[must_use]
pub fn interned(text: String) -> &'static CStr {
    static TEXTS: Mutex<BTreeMap<String, &'static CStr>> = Mutex::new(BTreeMap::new());
    let mut texts = flotor_core::lock(&TEXTS);
    let keep =
        |text: &String| &*Box::leak(CString::new(text.as_str()).unwrap_or_default().into_boxed_c_str());
    texts.entry(text).or_insert_with_key(keep)
}
