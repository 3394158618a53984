//! Instance of a plugin on the host's side: each call restores the floating-point environment of the calling thread.

use super::float_control::preserving_float_control;
use super::setting::{Setting, index_of, live_index, to_raw};
use flotor_hal::abi::{CallStatus, Instance, Message};
use flotor_hal::{Parameter, ParameterValue, Refusal, RefusalKind};

/// Reason of a refusal if the table lacks a required function.
pub(super) const INCOMPLETE: &str =
    "a required entry of the function table is null; set every required entry";

/// Table function that creates an instance: `create` of models, `open` of devices.
pub(super) type CreateFn =
    unsafe extern "C" fn(*const ParameterValue, u32, *mut Message, *mut Instance) -> u32;
/// Table function that writes one value.
type QueryFn<T> = unsafe extern "C" fn(Instance, *mut T) -> u32;
type SetParameterFn = unsafe extern "C" fn(Instance, u32, f64) -> u32;
type ParameterFn = unsafe extern "C" fn(Instance, u32) -> f64;
type LastMessageFn = unsafe extern "C" fn(Instance, *mut Message);

/// Live instance. Every function passed to a method is from the instance's own tables.
pub(crate) struct GuardedInstance {
    instance: Instance,
    /// Number of calls that changed the floating-point environment.
    pub(crate) float_changes: u64,
}

// SAFETY: the contract lets an instance be used by one thread at a time, any; `&mut self` excludes a second.
unsafe impl Send for GuardedInstance {}

impl GuardedInstance {
    pub(super) const fn new(instance: Instance) -> Self {
        Self { instance, float_changes: 0 }
    }

    /// Creates an instance from settings; `nothing` is the message of the refusal if the plugin returns no instance.
    pub(super) fn create(
        create: CreateFn,
        parameters: &'static [Parameter],
        settings: &[Setting],
        nothing: &str,
    ) -> Result<Self, Refusal> {
        // SAFETY: `settings` outlives the call, and the plugin keeps no copy past it (contract).
        let values = unsafe { to_raw(settings, parameters) }?;
        let count = u32::try_from(values.len()).unwrap_or(u32::MAX);
        let mut created = Self::new(std::ptr::null_mut());
        let mut instance = std::ptr::null_mut();
        created.refusable(|_, message| {
            // SAFETY: all pointers are valid for the call, as the contract of `create` and `open` asks.
            unsafe { create(values.as_ptr(), count, message, &raw mut instance) }
        })?;
        if instance.is_null() {
            return Err(Refusal::broken(nothing));
        }
        Ok(Self { instance, ..created })
    }

    /// Returns the pointer to the instance, for a call from any thread.
    pub(super) const fn instance(&self) -> Instance {
        self.instance
    }

    /// Calls a function with the instance. Real-time: the call plus six instructions.
    #[inline(always)]
    pub(crate) fn call<T>(&mut self, function: impl FnOnce(Instance) -> T) -> T {
        let instance = self.instance;
        preserving_float_control(&mut self.float_changes, || function(instance))
    }

    /// Calls a function that may refuse, with the reason in a message.
    pub(crate) fn refusable(
        &mut self,
        function: impl FnOnce(Instance, *mut Message) -> u32,
    ) -> Result<(), Refusal> {
        let mut message = Message::default();
        let code = self.call(|instance| function(instance, &raw mut message));
        if code == 0 {
            return Ok(());
        }
        let reason = match message.for_people() {
            text if text.is_empty() && RefusalKind::from_code(code) == RefusalKind::Broken => {
                format!("no reason given (code {code})")
            }
            text if text.is_empty() => {
                format!("no reason given (code {code}); ask the author of the plugin for the reason")
            }
            text => text,
        };
        Err(Refusal { kind: RefusalKind::from_code(code), reason })
    }

    /// Returns the value that a function writes; `None` if the function is missing or failed.
    pub(crate) fn query<T>(&mut self, function: Option<QueryFn<T>>, mut value: T) -> Option<T> {
        let function = function?;
        // SAFETY: a live instance, used by this thread only (`&mut`), an out pointer valid for the call.
        let code = self.call(|instance| unsafe { function(instance, &raw mut value) });
        (code == CallStatus::Ok as u32).then_some(value)
    }

    /// Changes a live parameter; the value is checked against the schema first. Real-time: bounded, no allocation.
    pub(super) fn set_parameter(
        &mut self,
        function: Option<SetParameterFn>,
        parameters: &[Parameter],
        index: usize,
        value: f64,
    ) -> CallStatus {
        let Some(function) = function else { return CallStatus::Unsupported };
        let Some(index) = live_index(parameters, index, value) else { return CallStatus::OutOfRange };
        // SAFETY: as in `query`.
        CallStatus::from_code(self.call(|instance| unsafe { function(instance, index, value) }))
    }

    /// Returns the current value of a parameter; NaN if unknown. Real-time: bounded, no allocation.
    pub(super) fn parameter(
        &mut self,
        function: Option<ParameterFn>,
        parameters: &[Parameter],
        index: usize,
    ) -> f64 {
        let (Some(function), Some(index)) = (function, index_of(parameters, index)) else { return f64::NAN };
        // SAFETY: as in `query`.
        self.call(|instance| unsafe { function(instance, index) })
    }

    /// Returns the message about the last failure; empty without the function.
    pub(super) fn last_message(&mut self, function: Option<LastMessageFn>) -> Message {
        let mut message = Message::default();
        if let Some(function) = function {
            // SAFETY: as in `query`.
            self.call(|instance| unsafe { function(instance, &raw mut message) });
        }
        message
    }
}
