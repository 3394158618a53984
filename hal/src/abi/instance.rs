//! Plugin instances and the common part of all table functions: catching panics, disabling an instance after a panic, and
//! writing results to the caller's memory.

use super::entry::{CallStatus, Instance};
use super::{Message, panics};
use crate::{Mutability, Parameter, ParameterValue, Refusal, RefusalKind, Settings};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Adapter of a plugin type for the function tables.
pub(crate) trait PluginAdapter: 'static {
    /// State used by one thread at a time.
    type State;
    /// State that any other thread may use concurrently.
    type Shared: Sync;
    /// Parameter schema.
    const PARAMETERS: &'static [Parameter];

    fn make(settings: &Settings<'_>) -> Result<(Self::State, Self::Shared), Refusal>;
}

/// Target of an [`Instance`] pointer. The two halves are borrowed separately and never as a whole while the instance
/// lives: `shared` from any thread, `work` by the thread that uses the instance.
struct Slot<P: PluginAdapter> {
    shared: P::Shared,
    work: Work<P::State>,
}

struct Work<S> {
    /// `None` after a panic, which leaves the state undefined.
    state: Option<S>,
    message: Message,
}

impl<S> Work<S> {
    /// Runs `body`; `None` if the plugin panics now or panicked before. A panic disables the instance; the panic message is stored.
    #[inline]
    fn call<T>(&mut self, body: impl FnOnce(&mut S) -> T) -> Option<T> {
        let state = self.state.as_mut()?;
        match catch_unwind(AssertUnwindSafe(|| body(state))) {
            Ok(value) => Some(value),
            Err(panic) => {
                panics::record(panic, &mut self.message);
                let dead = self.state.take();
                guarded(|| drop(dead));
                None
            }
        }
    }
}

/// Runs `body` and discards a panic.
fn guarded(body: impl FnOnce()) {
    if let Err(panic) = catch_unwind(AssertUnwindSafe(body)) {
        panics::discard(panic);
    }
}

/// Returns the working half of an instance.
///
/// # Safety
/// The contract of every table call: `instance` came from [`create`] of this type, is alive, and no other thread uses
/// its working half during `'a`.
#[inline]
unsafe fn work<'a, P: PluginAdapter>(instance: Instance) -> &'a mut Work<P::State> {
    // SAFETY: by the contract of this function; only `work` is borrowed, `shared` stays shareable.
    unsafe { &mut (*instance.cast::<Slot<P>>()).work }
}

/// Returns the half of an instance that any thread may use.
///
/// # Safety
/// `instance` came from [`create`] of this type and is alive during `'a`.
unsafe fn shared<'a, P: PluginAdapter>(instance: Instance) -> &'a P::Shared {
    // SAFETY: by the contract of this function. A concurrent call borrows `work` only, and `Shared` is `Sync`.
    unsafe { &(*instance.cast::<Slot<P>>()).shared }
}

/// Runs `body` on the shared half, on any thread; discards a panic.
///
/// # Safety
/// As for [`shared`].
pub(super) unsafe fn from_any_thread<P: PluginAdapter>(instance: Instance, body: impl FnOnce(&P::Shared)) {
    // SAFETY: by the contract of this function.
    let shared = unsafe { shared::<P>(instance) };
    guarded(|| body(shared));
}

/// Runs `body` on the state; returns a [`CallStatus`] code.
///
/// # Safety
/// As for [`work`].
#[inline]
pub(crate) unsafe fn call<P: PluginAdapter>(
    instance: Instance,
    body: impl FnOnce(&mut P::State) -> Result<(), CallStatus>,
) -> u32 {
    // SAFETY: by the contract of this function.
    let answer = unsafe { work::<P>(instance) }.call(body);
    match answer {
        Some(Ok(())) => CallStatus::Ok as u32,
        Some(Err(status)) => status as u32,
        None => CallStatus::Panicked as u32,
    }
}

/// Runs `body` and writes its value to `out`; returns a [`CallStatus`] code.
///
/// # Safety
/// As for [`work`]; `out` is valid for a write.
#[inline]
pub(crate) unsafe fn fill<P: PluginAdapter, T>(
    instance: Instance,
    out: *mut T,
    body: impl FnOnce(&mut P::State) -> Result<T, CallStatus>,
) -> u32 {
    // SAFETY: by the contract of this function, all of it.
    unsafe {
        call::<P>(instance, |state| {
            out.write(body(state)?);
            Ok(())
        })
    }
}

/// Runs `body`; returns 0, or a [`RefusalKind`] with the reason in `message`.
///
/// # Safety
/// As for [`work`]; `message` is valid for a write.
pub(crate) unsafe fn refusable<P: PluginAdapter>(
    instance: Instance,
    message: *mut Message,
    body: impl FnOnce(&mut P::State) -> Result<(), Refusal>,
) -> u32 {
    // SAFETY: by the contract of this function.
    let work = unsafe { work::<P>(instance) };
    match work.call(body) {
        Some(Ok(())) => 0,
        // SAFETY: by the contract of this function.
        Some(Err(refusal)) => unsafe { refuse(&refusal, message) },
        None => {
            // SAFETY: by the contract of this function.
            unsafe { message.write(work.message) };
            RefusalKind::Broken as u32
        }
    }
}

/// # Safety
/// `message` is valid for a write.
unsafe fn refuse(refusal: &Refusal, message: *mut Message) -> u32 {
    let mut reason = Message::default();
    reason.set(&refusal.reason);
    // SAFETY: by the contract of this function.
    unsafe { message.write(reason) };
    refusal.kind as u32
}

/// Creates an instance: `create` of models, `open` of devices.
pub(super) unsafe extern "C" fn create<P: PluginAdapter>(
    values: *const ParameterValue,
    count: u32,
    message: *mut Message,
    out: *mut Instance,
) -> u32 {
    let values = if values.is_null() || count == 0 {
        &[]
    } else {
        // SAFETY: the contract of `create`: `count` values that are valid for the call.
        unsafe { std::slice::from_raw_parts(values, count as usize) }
    };
    match catch_unwind(|| P::make(&Settings::new(P::PARAMETERS, values))) {
        Ok(Ok((state, shared))) => {
            let work = Work { state: Some(state), message: Message::default() };
            // SAFETY: the contract of `create`: `out` is valid for a write.
            unsafe { out.write(Box::into_raw(Box::new(Slot::<P> { shared, work })).cast()) };
            0
        }
        // SAFETY: the contract of `create`: `message` is valid for a write.
        Ok(Err(refusal)) => unsafe { refuse(&refusal, message) },
        Err(panic) => {
            let mut words = Message::default();
            panics::record(panic, &mut words);
            // SAFETY: as just above.
            unsafe { message.write(words) };
            RefusalKind::Broken as u32
        }
    }
}

/// Destroys an instance: `destroy` of models, `close` of devices.
pub(super) unsafe extern "C" fn destroy<P: PluginAdapter>(instance: Instance) {
    // SAFETY: the contract of `destroy`: `instance` came from `create` of this type and is not used again.
    let slot = unsafe { Box::from_raw(instance.cast::<Slot<P>>()) };
    guarded(|| drop(slot));
}

/// Checks a live value against the schema, then runs `body`; returns a [`CallStatus`] code, `OutOfRange` for an unknown
/// index, a fixed parameter or an illegal value.
///
/// # Safety
/// As for [`work`].
pub(super) unsafe fn set_parameter<P: PluginAdapter>(
    instance: Instance,
    index: u32,
    value: f64,
    body: impl FnOnce(&mut P::State) -> Result<(), CallStatus>,
) -> u32 {
    match P::PARAMETERS.get(index as usize) {
        Some(parameter) if parameter.check(value).is_ok() && parameter.mutability() == Mutability::Live => {
            // SAFETY: by the contract of this function.
            unsafe { call::<P>(instance, body) }
        }
        _ => CallStatus::OutOfRange as u32,
    }
}

/// Returns the current value of a parameter; NaN from a plugin that panicked.
///
/// # Safety
/// As for [`work`].
pub(super) unsafe fn parameter<P: PluginAdapter>(
    instance: Instance,
    body: impl FnOnce(&mut P::State) -> f64,
) -> f64 {
    // SAFETY: by the contract of this function.
    unsafe { work::<P>(instance) }.call(body).unwrap_or(f64::NAN)
}

/// Writes the message of the last panic to `message`; empty without a panic.
pub(super) unsafe extern "C" fn last_message<P: PluginAdapter>(instance: Instance, message: *mut Message) {
    // SAFETY: the contract of every table call; `message` is valid for a write.
    unsafe { message.write(work::<P>(instance).message) };
}
