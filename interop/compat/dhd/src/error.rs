//! Last error of each thread, and texts of the error numbers.

use flotor_compat::export;
use std::cell::Cell;
use std::ffi::{CStr, c_char, c_int};

/// Error of a call. The numbers are the interface's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub(crate) enum Code {
    Com = 2,
    NoDevice = 5,
    NotAvailable = 6,
    Timeout = 7,
    Geometry = 8,
    ExpertModeDisabled = 9,
    NotImplemented = 10,
    InvalidIndex = 15,
    NullArgument = 17,
    Invalid = 21,
    NoRegulation = 22,
}

thread_local! {
    static LAST: Cell<c_int> = const { Cell::new(0) };
}

/// Return value of success.
pub(crate) const DONE: c_int = 0;
/// Return value of a setter that scaled the command down.
pub(crate) const SATURATED: c_int = 2;

/// Converts a result to a return value, and stores an error for the thread.
pub(crate) fn result(result: Result<c_int, Code>) -> c_int {
    match result {
        Ok(done) => done,
        Err(code) => failed(code),
    }
}

/// Stores an error for the thread, and returns -1.
pub(crate) fn failed(code: Code) -> c_int {
    let _ = LAST.try_with(|last| last.set(code as c_int));
    -1
}

/// Returns the text of an error number.
fn words(code: c_int) -> &'static CStr {
    match code {
        0 => c"no error",
        1 => c"undocumented error",
        2 => c"communication with the device is lost",
        3 => c"the controller is busy",
        4 => c"no driver found",
        5 => c"no device found",
        6 => c"not available on this device",
        7 => c"timeout",
        8 => c"geometry error",
        9 => c"expert mode is disabled",
        10 => c"not implemented",
        11 => c"out of memory",
        12 => c"device not ready",
        13 => c"file not found",
        14 => c"configuration error",
        15 => c"invalid index",
        16 => c"deprecated",
        17 => c"null argument",
        18 => c"redundant check failed",
        19 => c"not enabled",
        20 => c"device in use",
        21 => c"invalid value",
        22 => c"no regulation",
        _ => c"unknown error",
    }
}

export! {
    /// Returns the number of the last error of this thread.
    fn dhdErrorGetLast() -> c_int [0] { LAST.try_with(Cell::get).unwrap_or(0) }
    /// Returns the text of the last error of this thread, never null.
    fn dhdErrorGetLastStr() -> *const c_char [c"".as_ptr()] { words(LAST.try_with(Cell::get).unwrap_or(0)).as_ptr() }
    /// Returns the text of an error number, never null.
    fn dhdErrorGetStr(code: c_int) -> *const c_char [c"".as_ptr()] { words(code).as_ptr() }
}
