//! Error stack of each thread, the newest error on top.

use std::cell::RefCell;
use std::ffi::{CStr, c_int, c_uint};

/// Handle of no device.
pub(crate) const NO_DEVICE: c_uint = 0xFFFF_FFFF;
/// Limit on the stored errors of a thread; beyond it the oldest error is dropped.
const MOST: usize = 64;

/// Error of a call. The numbers are the interface's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub(crate) enum Code {
    InvalidEnum = 0x0100,
    InvalidValue = 0x0101,
    InvalidOperation = 0x0102,
    InvalidInputType = 0x0103,
    BadHandle = 0x0104,
    ExceededMaxForce = 0x0201,
    ForceError = 0x0204,
    DeviceFault = 0x0300,
    AlreadyInitiated = 0x0301,
    CommError = 0x0302,
    TimerError = 0x0304,
    IllegalBegin = 0x0400,
    IllegalEnd = 0x0401,
    FrameError = 0x0402,
    SchedulerFull = 0x0501,
}

/// `HDErrorInfo`, 12 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ErrorInfo {
    code: c_uint,
    internal: c_int,
    device: c_uint,
}

/// No error.
pub(crate) const NONE: ErrorInfo = ErrorInfo { code: 0, internal: 0, device: NO_DEVICE };

thread_local! {
    static ERRORS: RefCell<Vec<ErrorInfo>> = const { RefCell::new(Vec::new()) };
}

/// Pushes an error on the error stack of the calling thread.
pub(crate) fn raise(code: Code, device: c_uint) {
    let _ = ERRORS.try_with(|errors| {
        let mut errors = errors.borrow_mut();
        if errors.len() == MOST {
            errors.remove(0);
        }
        errors.push(ErrorInfo { code: code as c_uint, internal: 0, device });
    });
}

/// Pops the newest error of the calling thread; [`NONE`] without an error.
pub(crate) fn take() -> ErrorInfo {
    ERRORS.try_with(|errors| errors.borrow_mut().pop()).ok().flatten().unwrap_or(NONE)
}

/// Clears the error stack of the calling thread.
pub(crate) fn clear() {
    let _ = ERRORS.try_with(|errors| errors.borrow_mut().clear());
}

/// Returns the text of an error number.
pub(crate) fn words(code: c_uint) -> &'static CStr {
    match code {
        0x0000 => c"no error",
        0x0100 => c"invalid enumeration value",
        0x0101 => c"invalid value",
        0x0102 => c"invalid operation in the present state",
        0x0103 => c"invalid type of value",
        0x0104 => c"invalid device handle",
        0x0200 => c"the motors are too warm",
        0x0201 => c"force above the limit of the device",
        0x0202 => c"force changes too fast",
        0x0203 => c"the handle moves too fast",
        0x0204 => c"the force was stopped for safety",
        0x0300 => c"the device was not found",
        0x0301 => c"the device is initialised already",
        0x0302 => c"communication with the device is lost",
        0x0303 => c"the connection to the device is not configured",
        0x0304 => c"no timer available",
        0x0400 => c"a frame cannot begin here",
        0x0401 => c"a frame cannot end here",
        0x0402 => c"valid only within a frame",
        0x0500 => c"invalid priority",
        0x0501 => c"the scheduler is full",
        0x0600 => c"no licence",
        _ => c"unknown error",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_comes_first_and_threads_have_their_own() {
        assert_eq!(size_of::<ErrorInfo>(), 12);
        raise(Code::InvalidEnum, 0);
        raise(Code::BadHandle, 7);
        assert_eq!(std::thread::spawn(take).join().map(|info| info.code).ok(), Some(0));
        assert_eq!([take(), take(), take()].map(|info| info.code), [0x0104, 0x0100, 0]);
        (0..1000).for_each(|_| raise(Code::FrameError, 0));
        clear();
        assert_eq!(take(), NONE);
    }
}
