//! Function tables of devices: `flotor.device/1` and `flotor.energy-ledger/1`.

use super::{Instance, Message};
use crate::{
    Capabilities, DeviceInfo, DeviceState, EnergyLedger, LoopConfig, Parameter, ParameterValue, Tick, Wrench,
};

/// `flotor.device/1`. `open` and `activate` return 0 or a [`crate::RefusalKind`] and say why in the message;
/// `read` and `write` return the code of a [`crate::Cycle`]; the others a [`super::CallStatus`] code.
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct DeviceTable {
    /// Bytes of this table as the plugin knows it.
    pub size: u32,
    /// Number of parameters.
    pub parameter_count: u32,
    /// The schema, constant.
    pub parameters: *const Parameter,
    /// What the device says about itself.
    pub info: DeviceInfo,
    /// Opens a device. May block. Not real-time.
    pub open: Option<
        unsafe extern "C" fn(
            values: *const ParameterValue,
            count: u32,
            message: *mut Message,
            out: *mut Instance,
        ) -> u32,
    >,
    /// Closes it; deactivates first if needed. Not real-time.
    pub close: Option<unsafe extern "C" fn(instance: Instance)>,
    /// What it can do. Not real-time.
    pub capabilities: Option<unsafe extern "C" fn(instance: Instance, out: *mut Capabilities) -> u32>,
    /// Energises it at zero wrench. Not real-time.
    pub activate: Option<
        unsafe extern "C" fn(instance: Instance, config: *const LoopConfig, message: *mut Message) -> u32,
    >,
    /// Zero wrench, then opened again. Not real-time.
    pub deactivate: Option<unsafe extern "C" fn(instance: Instance) -> u32>,
    /// Newest sample. Real-time.
    pub read:
        Option<unsafe extern "C" fn(instance: Instance, tick: *const Tick, state: *mut DeviceState) -> u32>,
    /// Wrench on the hand until the next write. Real-time.
    pub write:
        Option<unsafe extern "C" fn(instance: Instance, tick: *const Tick, wrench: *const Wrench) -> u32>,
    /// Actuators safe, now. Any thread, any time, also during `read` and `write`.
    pub safe_stop: Option<unsafe extern "C" fn(instance: Instance)>,
    /// Changes a live parameter at a tick boundary. Real-time. May be null.
    pub set_parameter: Option<unsafe extern "C" fn(instance: Instance, index: u32, value: f64) -> u32>,
    /// The value in force. May be null.
    pub parameter: Option<unsafe extern "C" fn(instance: Instance, index: u32) -> f64>,
    /// Why the last call failed. Not real-time. May be null.
    pub last_message: Option<unsafe extern "C" fn(instance: Instance, message: *mut Message)>,
}

// SAFETY: an immutable static table; its pointers lead to immutable statics and code.
unsafe impl Sync for DeviceTable {}
// SAFETY: as for `Sync`.
unsafe impl Send for DeviceTable {}

/// `flotor.energy-ledger/1`: see [`EnergyLedger`].
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct EnergyLedgerTable {
    /// Bytes of this table as the plugin knows it.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// The account since activation. Real-time.
    pub ledger: Option<unsafe extern "C" fn(instance: Instance, out: *mut EnergyLedger) -> u32>,
}
