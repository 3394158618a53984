//! Locale of the C library, which determines how C plugins parse and format numbers.
#![allow(unsafe_code)] // `setlocale`; tests/tests/system/architecture.rs lists it

use std::ffi::{CStr, CString};
use std::ptr::null;

/// Returns the locale of the process, for all categories; `None` if the C library reports none. Not real-time.
pub(super) fn now() -> Option<CString> {
    // SAFETY: asked with no name, `setlocale` changes nothing and returns a text that is valid until the next call. The host makes no
    // other call meanwhile, and the contract forbids plugins to change the process.
    let text = unsafe { libc::setlocale(libc::LC_ALL, null()) };
    // SAFETY: null, or a text that ends in a zero.
    (!text.is_null()).then(|| unsafe { CStr::from_ptr(text) }.to_owned())
}

/// Sets the locale that [`now`] returned. Not real-time.
pub(super) fn set(locale: &CStr) {
    // SAFETY: a text that ends in a zero and is there for the call. The host's own code reads no locale; the contract forbids plugins
    // to call `setlocale`, so that none runs at the same time.
    unsafe { libc::setlocale(libc::LC_ALL, locale.as_ptr()) };
}
