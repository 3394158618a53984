//! Loaded device, one type per phase: [`OpenedDevice`] (not energised) and [`ActiveDevice`] (energised).

use super::capabilities::{check, check_unchanged};
use super::guarded::{GuardedInstance, INCOMPLETE};
use super::setting::Setting;
use crate::extension::DeviceExtensions;
use flotor_hal::abi::{CallStatus, CycleCode, DeviceTable, Instance};
use flotor_hal::{
    Axes, Capabilities, Cycle, DeviceState, Fault, LoopConfig, Parameter, Refusal, Tick, Wrench,
};
use std::sync::Arc;

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
            GuardedInstance::new(self.instance).call(|instance| unsafe { close(instance) });
        }
    }
}

/// Opened device of a plugin, not energised. The device is closed when this value and all its [`Stopper`]s are dropped.
pub struct OpenedDevice {
    handle: Arc<Handle>,
    pub(crate) calls: GuardedInstance,
    /// Capabilities returned by the first call; `None` before.
    declared: Option<Box<Capabilities>>,
}

/// Energised device of a plugin; dropping deactivates the device.
pub struct ActiveDevice {
    /// `None` only after `deactivate` has taken the handle.
    handle: Option<Arc<Handle>>,
    declared: Option<Box<Capabilities>>,
    pub(crate) calls: GuardedInstance,
    read: unsafe extern "C" fn(Instance, *const Tick, *mut DeviceState) -> CycleCode,
    write: unsafe extern "C" fn(Instance, *const Tick, *const Wrench) -> CycleCode,
    /// First result outside the contract, with the function that returned it.
    unknown: Option<(&'static str, CycleCode)>,
    /// Number of changes of the floating-point environment at the last [`Self::has_changed_floats`].
    float_changes_told: u64,
}

/// Handle that stops a device from any thread, at any time; the device stays open while the handle exists.
#[derive(Clone)]
pub struct Stopper {
    handle: Arc<Handle>,
}

impl Stopper {
    /// Sets the actuators to zero (or starts a controlled landing) at once, until the next activation. Real-time:
    /// bounded, no allocation, no lock.
    pub fn safe_stop(&self) {
        if let Some(safe_stop) = self.handle.table.safe_stop {
            // SAFETY: a live instance (this handle keeps it open); `safe_stop` may come from any thread.
            GuardedInstance::new(self.handle.instance).call(|instance| unsafe { safe_stop(instance) });
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
        let Some(open) = table.open else {
            return Err(Refusal::broken(INCOMPLETE));
        };
        let nothing = "the plugin reported success but opened no device";
        let calls = GuardedInstance::create(open, parameters, settings, nothing)?;
        let handle = Arc::new(Handle { instance: calls.instance(), table, extensions, parameters });
        Ok(Self { handle, calls, declared: None })
    }

    /// Returns the parameter schema of the device.
    pub fn parameters(&self) -> &'static [Parameter] {
        self.handle.parameters
    }

    /// Returns the current value of the parameter at `index`, including values set by a preset; NaN if unknown.
    #[must_use]
    pub fn parameter(&mut self, index: usize) -> f64 {
        self.calls.parameter(self.handle.table.parameter, self.handle.parameters, index)
    }

    /// Returns the capabilities of the device: numbers that a host can enforce, the same at every call.
    ///
    /// # Errors
    /// A [`Refusal`] if the plugin fails, or if the capabilities cannot be enforced or differ from those of an earlier call.
    pub fn capabilities(&mut self) -> Result<Capabilities, Refusal> {
        let table = self.handle.table;
        let Some(capabilities) = self.calls.query(table.capabilities, UNKNOWN) else {
            let reason = match self.calls.last_message(table.last_message).for_people() {
                text if text.is_empty() => "`capabilities` failed without a message".to_owned(),
                text => text,
            };
            return Err(Refusal::broken(reason));
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

    /// Energises the device at zero wrench. Not real-time.
    ///
    /// # Errors
    /// The opened device and the [`Refusal`], if the device refuses.
    pub fn activate(self, config: &LoopConfig) -> Result<ActiveDevice, (Self, Refusal)> {
        let table = self.handle.table;
        let (Some(activate), Some(read), Some(write)) = (table.activate, table.read, table.write) else {
            return Err((self, Refusal::broken(INCOMPLETE)));
        };
        // Before activation nothing depends on the floating-point environment: a change is restored but not reported.
        let mut calls = GuardedInstance::new(self.handle.instance);
        // SAFETY: a live instance, used by this thread only (`self` is owned), pointers valid for the call.
        match calls.refusable(|instance, message| unsafe { activate(instance, config, message) }) {
            Ok(()) => Ok(ActiveDevice {
                handle: Some(self.handle),
                declared: self.declared,
                calls,
                read,
                write,
                unknown: None,
                float_changes_told: 0,
            }),
            Err(refusal) => Err((self, refusal)),
        }
    }

    pub(crate) fn extensions(&self) -> &DeviceExtensions {
        &self.handle.extensions
    }
}

impl ActiveDevice {
    /// Reads the newest sample into `state`; a result outside the contract counts as [`Fault::Broken`]. Real-time:
    /// bounded by the device, no allocation.
    #[inline]
    pub fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle {
        let read = self.read;
        // SAFETY: a live, active instance used by this thread only (`&mut`), pointers valid for the call.
        let code = self.calls.call(|instance| unsafe { read(instance, tick, state) });
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

    /// Returns the number of calls since activation that changed the rounding mode, flush-to-zero or traps of the thread; the host
    /// restored them each time. Real-time: bounded, no allocation.
    #[must_use]
    pub fn float_changes(&self) -> u64 {
        self.calls.float_changes
    }

    /// Returns true if the plugin changed the floating-point environment since the last call of this function. Real-time:
    /// bounded, no allocation.
    #[inline]
    pub fn has_changed_floats(&mut self) -> bool {
        let is_new = self.calls.float_changes != self.float_changes_told;
        self.float_changes_told = self.calls.float_changes;
        is_new
    }

    /// Commands the wrench on the hand until the next write; a result outside the contract counts as [`Fault::Broken`].
    /// Real-time: bounded by the device, no allocation.
    #[inline]
    pub fn write(&mut self, tick: &Tick, wrench: &Wrench) -> Cycle {
        let write = self.write;
        // SAFETY: as in `read`.
        let code = self.calls.call(|instance| unsafe { write(instance, tick, wrench) });
        self.known("write", code)
    }

    /// Changes a live parameter, by its index in the schema, at a tick boundary (for a choice, `value` is its index).
    /// The value is checked against the schema here and again by the plugin. Real-time: bounded, no allocation.
    pub fn set_parameter(&mut self, index: usize, value: f64) -> CallStatus {
        let Some(handle) = &self.handle else { return CallStatus::Unsupported };
        self.calls.set_parameter(handle.table.set_parameter, handle.parameters, index, value)
    }

    /// Returns the current values of all parameters, by their index in the schema. Not real-time.
    #[must_use]
    pub fn parameters(&mut self) -> Vec<f64> {
        let Self { handle, calls, .. } = self;
        let Some(handle) = handle else { return Vec::new() };
        let value = |index| calls.parameter(handle.table.parameter, handle.parameters, index);
        (0..handle.parameters.len()).map(value).collect()
    }

    pub(crate) fn extensions(&self) -> Option<&DeviceExtensions> {
        Some(&self.handle.as_ref()?.extensions)
    }

    /// Returns the device's message about its last failure; after a result outside the contract, a description of that
    /// result. Not real-time.
    #[must_use]
    pub fn last_message(&mut self) -> String {
        if let Some((function, code)) = self.unknown {
            let code = code.code();
            return format!(
                "`{function}` returned {code}, which is not a cycle; return a fault as FLOTOR_CYCLE_FAULT({code})"
            );
        }
        let last_message = self.handle.as_ref().and_then(|handle| handle.table.last_message);
        self.calls.last_message(last_message).for_people()
    }

    /// Commands zero wrench and returns to the opened phase; `None` if the plugin failed. Not real-time.
    #[must_use]
    pub fn deactivate(mut self) -> Option<OpenedDevice> {
        let handle = self.handle.take()?;
        match deactivate(&handle) {
            CallStatus::Ok => {
                let calls = GuardedInstance::new(handle.instance);
                Some(OpenedDevice { handle, calls, declared: self.declared.take() })
            }
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

fn deactivate(handle: &Handle) -> CallStatus {
    let Some(deactivate) = handle.table.deactivate else { return CallStatus::Unsupported };
    // SAFETY: called from the owner of the one working handle, which is giving it up.
    CallStatus::from_code(
        GuardedInstance::new(handle.instance).call(|instance| unsafe { deactivate(instance) }),
    )
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
