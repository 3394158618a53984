//! Entry points for keyboard input from the terminal, and for starting a thread of the program.

use crate::error::{Code, DONE, failed};
use flotor_compat::export;
use std::ffi::{c_char, c_int, c_void};
use std::mem::MaybeUninit;
use std::sync::{Mutex, Once, PoisonError};

/// Descriptor of standard input.
const INPUT: c_int = 0;
/// Settings of the terminal before single-key input.
static BEFORE: Mutex<Option<libc::termios>> = Mutex::new(None);

/// Switches the terminal to single-key input, until the program ends.
fn take_keys() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let mut terminal = MaybeUninit::<libc::termios>::zeroed();
        // SAFETY: written by the system if standard input is a terminal, else left as it is.
        if unsafe { libc::tcgetattr(INPUT, terminal.as_mut_ptr()) } != 0 {
            return;
        }
        // SAFETY: plain data that the system has written.
        let mut terminal = unsafe { terminal.assume_init() };
        *BEFORE.lock().unwrap_or_else(PoisonError::into_inner) = Some(terminal);
        terminal.c_lflag &= !(libc::ICANON | libc::ECHO);
        // SAFETY: settings that the system gave, two flags changed; a function that takes nothing.
        unsafe {
            libc::tcsetattr(INPUT, libc::TCSANOW, &raw const terminal);
            libc::atexit(give_keys_back);
        }
    });
}

extern "C" fn give_keys_back() {
    if let Ok(Some(terminal)) = BEFORE.try_lock().map(|mut before| before.take()) {
        // SAFETY: settings that the system gave.
        unsafe { libc::tcsetattr(INPUT, libc::TCSANOW, &raw const terminal) };
    }
}

/// Returns the number of unread bytes of standard input.
fn waiting() -> c_int {
    let mut bytes: c_int = 0;
    // SAFETY: the system writes one number that is there for the call.
    if unsafe { libc::ioctl(INPUT, libc::FIONREAD, &raw mut bytes) } == 0 { bytes } else { 0 }
}

/// Entry point of a thread of the program.
type Body = extern "C" fn(*mut c_void) -> *mut c_void;

export! {
    /// Returns true if a pressed key is unread. The first call switches the terminal to single-key input.
    fn dhdKbHit() -> bool [false] {
        take_keys();
        waiting() > 0
    }
    /// Returns the next key; 0 without a pressed key. The first call switches the terminal to single-key input.
    fn dhdKbGet() -> c_char [0] {
        take_keys();
        let mut key: u8 = 0;
        if waiting() == 0 {
            return 0;
        }
        // SAFETY: one byte that is there for the call.
        let read = unsafe { libc::read(INPUT, (&raw mut key).cast(), 1) };
        if read == 1 { c_char::from_ne_bytes([key]) } else { 0 }
    }
    /// Starts a thread of the program, with the default priority.
    fn dhdStartThread(body: Option<Body>, data: *mut c_void, _priority: c_int) -> c_int [-1] {
        let Some(body) = body else { return failed(Code::NullArgument) };
        let mut thread = MaybeUninit::<libc::pthread_t>::uninit();
        // SAFETY: a place for the number of the thread, no attributes, and what the program wants to be called with its own data.
        let code = unsafe { libc::pthread_create(thread.as_mut_ptr(), std::ptr::null(), body, data) };
        if code != 0 {
            return failed(Code::NotAvailable);
        }
        // SAFETY: written by the call that succeeded; nobody waits for the thread.
        unsafe { libc::pthread_detach(thread.assume_init()) };
        DONE
    }
}
