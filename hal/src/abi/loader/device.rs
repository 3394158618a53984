//! Loaded device, in two types: [`OpenedDevice`] (answers queries) and [`ActiveDevice`] (energised).

use super::capabilities::{check, check_unchanged};
use super::float_control::preserving_float_control;
use super::model::refusal_from;
use super::setting::{Setting, index_of, live_index, to_raw};
use crate::abi::{CallStatus, CycleCode, DeviceTable, Instance, Message};
use crate::extension::DeviceExtensions;
use crate::{Axes, Capabilities, Cycle, DeviceState, Fault, LoopConfig, Parameter, Refusal, Tick, Wrench};
use std::sync::Arc;

/// Table function that writes one value.
type QueryFn<T> = unsafe extern "C" fn(Instance, *mut T) -> u32;

/// Opened instance; closed when the last reference is dropped.
struct Handle {
    instance: Instance,
    table: &'static DeviceTable,
    extensions: DeviceExtensions,
    parameters: &'static [Parameter],
}

// SAFETY: shared between the owner (`OpenedDevice` or `ActiveDevice`, of which there is exactly one, with `&mut`
// for every call) and `Stopper`s, which only call `safe_stop`; the contract allows that from any thread.
unsafe impl Send for Handle {}
// SAFETY: as above.
unsafe impl Sync for Handle {}

impl Drop for Handle {
    fn drop(&mut self) {
        if let Some(close) = self.table.close {
            // SAFETY: the last handle: nobody uses the instance after this.
            preserving_float_control(&mut 0, || unsafe { close(self.instance) });
        }
    }
}

/// Opened device, not energised.
pub struct OpenedDevice {
    handle: Arc<Handle>,
    /// Capabilities returned by the first call; `None` before.
    declared: Option<Box<Capabilities>>,
}

/// Energised device; deactivated on drop.
pub struct ActiveDevice {
    /// `None` only after `deactivate` has taken the handle.
    handle: Option<Arc<Handle>>,
    declared: Option<Box<Capabilities>>,
    instance: Instance,
    read: unsafe extern "C" fn(Instance, *const Tick, *mut DeviceState) -> CycleCode,
    write: unsafe extern "C" fn(Instance, *const Tick, *const Wrench) -> CycleCode,
    /// First result outside the contract, with the function that returned it.
    unknown: Option<(&'static str, CycleCode)>,
    /// Number of calls that changed the floating-point environment.
    pub(crate) float_changes: u64,
    /// Value of `float_changes` at the last [`Self::has_changed_floats`].
    float_changes_told: u64,
}

// SAFETY: the contract lets an instance be used by any one thread at a time; `&mut self` sees to "one".
unsafe impl Send for ActiveDevice {}

/// Handle that stops a device from any thread, at any time.
#[derive(Clone)]
pub struct Stopper {
    handle: Arc<Handle>,
}

impl Stopper {
    /// Makes the actuators safe at once. Bounded, no allocation, no lock.
    pub fn safe_stop(&self) {
        if let Some(safe_stop) = self.handle.table.safe_stop {
            // SAFETY: a live instance (this handle keeps it open); `safe_stop` may come from any thread.
            preserving_float_control(&mut 0, || unsafe { safe_stop(self.handle.instance) });
        }
    }
}

impl OpenedDevice {
    pub(super) fn open(
        table: &'static DeviceTable,
        extensions: DeviceExtensions,
        parameters: &'static [Parameter],
        settings: &[Setting],
    ) -> Result<Self, Refusal> {
        // SAFETY: `settings` outlives the call, and the plugin keeps no copy past it (contract).
        let values = unsafe { to_raw(settings, parameters) }?;
        let Some(open) = table.open else {
            return Err(Refusal::broken(
                "a required entry of the function table is null; set every required entry",
            ));
        };
        let mut message = Message::default();
        let mut instance = std::ptr::null_mut();
        let count = u32::try_from(values.len()).unwrap_or(u32::MAX);
        // SAFETY: all pointers are valid for the call, as the contract of `open` asks.
        let opened = || unsafe { open(values.as_ptr(), count, &raw mut message, &raw mut instance) };
        // Before activation nothing depends on the floating-point environment: a change is restored but not reported.
        let code = preserving_float_control(&mut 0, opened);
        refusal_from(code, &message)?;
        if instance.is_null() {
            return Err(Refusal::broken("the plugin reported success but opened no device"));
        }
        Ok(Self { handle: Arc::new(Handle { instance, table, extensions, parameters }), declared: None })
    }

    /// Returns the parameter schema of the device.
    #[must_use]
    pub fn parameters(&self) -> &'static [Parameter] {
        self.handle.parameters
    }

    /// Returns the current value of the parameter at `index`, presets resolved; NaN if unknown.
    #[must_use]
    pub fn parameter(&mut self, index: usize) -> f64 {
        let Some(parameter) = self.handle.table.parameter else { return f64::NAN };
        let Some(index) = index_of(self.handle.parameters, index) else { return f64::NAN };
        // SAFETY: a live instance, used by this thread only (`&mut`).
        unsafe { parameter(self.handle.instance, index) }
    }

    /// Returns the capabilities of the device: numbers that a host can enforce, the same at every call.
    ///
    /// # Errors
    /// A [`Refusal`] if the plugin fails, or if the capabilities cannot be enforced or differ from those of an earlier call.
    pub fn capabilities(&mut self) -> Result<Capabilities, Refusal> {
        let ask = self.handle.table.capabilities;
        let Some(capabilities) = self.asked(ask, UNKNOWN) else {
            return Err(Refusal::broken(self.last_message()));
        };
        check(&capabilities)?;
        check_unchanged(self.declared.get_or_insert_with(|| Box::new(capabilities)), &capabilities)?;
        Ok(capabilities)
    }

    /// Returns a handle that stops the device from another thread.
    #[must_use]
    pub fn stopper(&self) -> Stopper {
        Stopper { handle: Arc::clone(&self.handle) }
    }

    /// Energises the device.
    ///
    /// # Errors
    /// The opened device and the [`Refusal`], if the device refuses.
    pub fn activate(self, config: &LoopConfig) -> Result<ActiveDevice, (Self, Refusal)> {
        let table = self.handle.table;
        let (Some(activate), Some(read), Some(write)) = (table.activate, table.read, table.write) else {
            return Err((
                self,
                Refusal::broken("a required entry of the function table is null; set every required entry"),
            ));
        };
        let mut message = Message::default();
        // SAFETY: a live instance, used by this thread only (`self` is owned), pointers valid for the call.
        let activated = || unsafe { activate(self.handle.instance, config, &raw mut message) };
        let mut float_changes = 0;
        let code = preserving_float_control(&mut float_changes, activated);
        match refusal_from(code, &message) {
            Ok(()) => {
                let instance = self.handle.instance;
                Ok(ActiveDevice {
                    handle: Some(self.handle),
                    declared: self.declared,
                    instance,
                    read,
                    write,
                    unknown: None,
                    float_changes,
                    float_changes_told: 0,
                })
            }
            Err(refusal) => Err((self, refusal)),
        }
    }

    pub(crate) fn extensions(&self) -> &DeviceExtensions {
        &self.handle.extensions
    }

    pub(crate) fn instance(&self) -> Instance {
        self.handle.instance
    }

    /// Calls a function of this device's tables and returns the value written; `None` if the function is missing or failed.
    pub(crate) fn asked<T>(&mut self, ask: Option<QueryFn<T>>, answer: T) -> Option<T> {
        asked(self.handle.instance, ask, answer)
    }

    fn last_message(&mut self) -> String {
        let mut message = Message::default();
        if let Some(last_message) = self.handle.table.last_message {
            // SAFETY: a live instance, used by this thread only (`&mut`), an out pointer valid for the call.
            unsafe { last_message(self.handle.instance, &raw mut message) };
        }
        message.for_people()
    }
}

impl ActiveDevice {
    /// Takes the newest sample. Real-time: bounded by the device, no allocation.
    #[inline]
    pub fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle {
        // SAFETY: a live, active instance used by this thread only (`&mut`), pointers valid for the call.
        let read = || unsafe { (self.read)(self.instance, tick, state) };
        let code = preserving_float_control(&mut self.float_changes, read);
        self.known("read", code)
    }

    /// Converts a code to a result; a code outside the contract is a fault and is stored for the message.
    #[inline]
    fn known(&mut self, function: &'static str, code: CycleCode) -> Cycle {
        code.cycle().unwrap_or_else(|| {
            self.unknown.get_or_insert((function, code));
            Cycle::Fault(Fault::Broken)
        })
    }

    /// Returns the number of calls so far that changed the rounding mode, flush-to-zero or traps of the thread; the
    /// host restored them each time. Real-time: bounded, no allocation.
    #[must_use]
    pub fn float_changes(&self) -> u64 {
        self.float_changes
    }

    /// Returns true if a call changed the floating-point environment since the last query. Real-time: bounded, no allocation.
    #[inline]
    pub fn has_changed_floats(&mut self) -> bool {
        let is_new = self.float_changes != self.float_changes_told;
        self.float_changes_told = self.float_changes;
        is_new
    }

    /// Commands the wrench on the hand until the next write. Real-time: bounded by the device, no allocation.
    #[inline]
    pub fn write(&mut self, tick: &Tick, wrench: &Wrench) -> Cycle {
        // SAFETY: as in `read`.
        let written = || unsafe { (self.write)(self.instance, tick, wrench) };
        let code = preserving_float_control(&mut self.float_changes, written);
        self.known("write", code)
    }

    /// Changes a live parameter, by its index in the schema, at a tick boundary (for a choice, `value` is its index).
    /// The value is checked against the schema here and again by the plugin. Real-time: bounded, no allocation.
    pub fn set_parameter(&mut self, index: usize, value: f64) -> CallStatus {
        let Some(handle) = &self.handle else { return CallStatus::Unsupported };
        let Some(set_parameter) = handle.table.set_parameter else { return CallStatus::Unsupported };
        let Some(index) = live_index(handle.parameters, index, value) else { return CallStatus::OutOfRange };
        // SAFETY: as in `read`.
        let set = || unsafe { set_parameter(self.instance, index, value) };
        CallStatus::from_code(preserving_float_control(&mut self.float_changes, set))
    }

    pub(crate) fn extensions(&self) -> Option<&DeviceExtensions> {
        Some(&self.handle.as_ref()?.extensions)
    }

    pub(crate) fn instance(&self) -> Instance {
        self.instance
    }

    /// Calls a function of this device's tables and returns the value written; `None` if the function is missing or failed.
    pub(crate) fn asked<T>(&mut self, ask: Option<QueryFn<T>>, answer: T) -> Option<T> {
        asked(self.instance, ask, answer)
    }

    /// Returns the device's message about the call that failed, or the result that is outside the contract. Not real-time.
    #[must_use]
    pub fn last_message(&mut self) -> String {
        if let Some((function, CycleCode { code })) = self.unknown {
            return format!(
                "`{function}` returned {code}, which is not a cycle; return a fault as FLOTOR_CYCLE_FAULT({code})"
            );
        }
        let mut message = Message::default();
        if let Some(last_message) = self.handle.as_ref().and_then(|handle| handle.table.last_message) {
            // SAFETY: as in `read`; the out pointer is valid for the call.
            unsafe { last_message(self.instance, &raw mut message) };
        }
        message.for_people()
    }

    /// Commands zero wrench and returns to the opened phase; `None` if the plugin failed. Not real-time.
    #[must_use]
    pub fn deactivate(mut self) -> Option<OpenedDevice> {
        let handle = self.handle.take()?;
        match deactivate(&handle) {
            CallStatus::Ok => Some(OpenedDevice { handle, declared: self.declared.take() }),
            _ => None,
        }
    }
}

impl Drop for ActiveDevice {
    fn drop(&mut self) {
        if let Some(handle) = self.handle.take() {
            let _ = deactivate(&handle);
        }
    }
}

/// Calls a function of an instance's table; both `asked` methods above hold the instance by `&mut`.
fn asked<T>(instance: Instance, ask: Option<QueryFn<T>>, mut answer: T) -> Option<T> {
    let ask = ask?;
    // SAFETY: a live instance, used by this thread only, an out pointer valid for the call.
    let code = preserving_float_control(&mut 0, || unsafe { ask(instance, &raw mut answer) });
    (code == CallStatus::Ok as u32).then_some(answer)
}

fn deactivate(handle: &Handle) -> CallStatus {
    let Some(deactivate) = handle.table.deactivate else { return CallStatus::Unsupported };
    // SAFETY: called from the owner of the one working handle, which is giving it up.
    CallStatus::from_code(preserving_float_control(&mut 0, || unsafe { deactivate(handle.instance) }))
}

/// Initial value of the out parameter; fails every check unless the plugin writes it.
const UNKNOWN: Capabilities = Capabilities {
    sensed: Axes::NONE,
    actuated: Axes::NONE,
    range_m: [f64::NAN; 3],
    range_rad: [f64::NAN; 3],
    resolution_m: f64::NAN,
    max_force_n: [f64::NAN; 3],
    max_torque_nm: [f64::NAN; 3],
    max_force_slew_n_per_s: f64::NAN,
    max_torque_slew_nm_per_s: f64::NAN,
    max_stiffness_n_per_m: f64::NAN,
    rate_hz: [f64::NAN; 2],
    latency_s: f64::NAN,
};
