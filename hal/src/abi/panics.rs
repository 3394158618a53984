//! Panics inside a plugin: caught at the boundary, with the message stored and nothing printed.

use super::entry::{HOST_QUIET_PANICS, Host};
use std::any::Any;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};

#[cfg(panic = "abort")]
compile_error!(
    "a Flotor plugin must be built with panic = \"unwind\": its panics are caught at the boundary"
);

thread_local! {
    /// File and line of the last panic on this thread, stored by the quiet hook. Fixed size: no allocation.
    static PLACE: Cell<Place> = const { Cell::new(Place { file: [0; 80], len: 0, line: 0 }) };
}

#[derive(Clone, Copy)]
struct Place {
    file: [u8; 80],
    len: u8,
    line: u32,
}

/// Replaces the panic hook of a separately linked library, which has its own Rust runtime, with a hook that only stores the source
/// location of the panic: the default hook would print from inside the servo and walk the stack for tens of milliseconds. Called by
/// the host after loading. The hook of a plugin linked into the host is unchanged. A plugin built with `-C prefer-dynamic` may
/// share the host's runtime, which is not detectable here: the host's panics are then silenced too.
pub(super) unsafe extern "C" fn init(host: *const Host) {
    // SAFETY: the contract of `init`: null or a valid host struct for the call.
    let flags = unsafe { host.as_ref() }.map_or(0, |host| host.flags);
    if flags & HOST_QUIET_PANICS != 0 {
        std::panic::set_hook(Box::new(|info| {
            let Some(location) = info.location() else { return };
            let mut place = Place { file: [0; 80], len: 0, line: location.line() };
            let file = location.file().as_bytes();
            let tail = file.get(file.len().saturating_sub(place.file.len())..).unwrap_or(file);
            for (to, from) in place.file.iter_mut().zip(tail) {
                *to = *from;
                place.len += 1;
            }
            PLACE.set(place);
        }));
    }
}

/// Writes the text of a caught panic, and its source location if known, to `message`; then drops the payload, and
/// catches a second panic of its `Drop`.
pub(super) fn record(payload: Box<dyn Any + Send>, message: &mut super::Message) {
    let words = payload.downcast_ref::<&str>().copied();
    let words = words.or_else(|| payload.downcast_ref::<String>().map(String::as_str));
    let words = words.unwrap_or("no message");
    let place = PLACE.replace(Place { file: [0; 80], len: 0, line: 0 });
    let file = place.file.get(..usize::from(place.len)).and_then(|bytes| std::str::from_utf8(bytes).ok());
    match file {
        Some(file) if !file.is_empty() => message.set(&format!("panicked at {file}:{}: {words}", place.line)),
        _ => message.set(&format!("panicked: {words}")),
    }
    discard(payload);
}

/// Drops a panic payload without letting a panic of its `Drop` escape.
pub(super) fn discard(payload: Box<dyn Any + Send>) {
    if let Err(second) = catch_unwind(AssertUnwindSafe(|| drop(payload))) {
        std::mem::forget(second);
    }
}
