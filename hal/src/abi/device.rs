//! `flotor.device/1`: function table of a device, and its implementation for the trait [`Device`], which has one type per
//! phase.

use super::Message;
use super::entry::{CallStatus, Instance};
use super::instance::{self, PluginAdapter, call, fill, from_any_thread, refusable};
use super::interface::table;
use super::layout::layout;
use crate::{
    ActiveDevice, Capabilities, Cycle, Device, DeviceInfo, DeviceState, Fault, LoopConfig, Parameter,
    ParameterValue, Refusal, SafeStop, Settings, Tick, Wrench,
};
use std::marker::PhantomData;

/// Result of `read` and `write` at the plugin boundary, 4 bytes. A separate type, so that no other code of the contract can be
/// mistaken for a result.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct CycleCode {
    /// 0: fresh; 1: stale; 256 plus the code of a [`crate::Fault`]: fault.
    code: u32,
}

/// Bit of a code that marks a fault.
const FAULT_BIT: u32 = 0x100;

impl From<Cycle> for CycleCode {
    fn from(cycle: Cycle) -> Self {
        let code = match cycle {
            Cycle::Fresh => 0,
            Cycle::Stale => 1,
            Cycle::Fault(fault) => FAULT_BIT | fault as u32,
        };
        Self { code }
    }
}

impl CycleCode {
    /// Returns the code as the plugin wrote it.
    #[must_use]
    pub const fn code(self) -> u32 {
        self.code
    }

    /// Converts the code to a result; `None` for a code outside the contract.
    #[inline]
    #[must_use]
    pub const fn cycle(self) -> Option<Cycle> {
        match self.code {
            0 => Some(Cycle::Fresh),
            1 => Some(Cycle::Stale),
            code if code & FAULT_BIT == 0 => None,
            code => match Fault::from_code(code & !FAULT_BIT) {
                Some(fault) => Some(Cycle::Fault(fault)),
                None => None,
            },
        }
    }
}

/// Function table `flotor.device/1`. `open` and `activate` return 0, or a [`crate::RefusalKind`] with the reason in the
/// message; `read` and `write` return a [`CycleCode`]; the other functions with a `uint32_t` result return a
/// [`super::CallStatus`] code.
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct DeviceTable {
    /// Size of this table in the plugin's build, bytes.
    pub size: u32,
    /// Number of parameters.
    pub parameter_count: u32,
    /// Parameter schema, constant.
    pub parameters: *const Parameter,
    /// Id, name and description of the device, constant.
    pub info: DeviceInfo,
    /// Opens a device with explicitly set values and writes the instance to `out`. May block. Not real-time.
    pub open: Option<
        unsafe extern "C" fn(
            values: *const ParameterValue,
            count: u32,
            message: *mut Message,
            out: *mut Instance,
        ) -> u32,
    >,
    /// Closes the device; deactivates an active device first. Not real-time.
    pub close: Option<unsafe extern "C" fn(instance: Instance)>,
    /// Writes the capabilities of an opened device to `out`. Not real-time.
    pub capabilities: Option<unsafe extern "C" fn(instance: Instance, out: *mut Capabilities) -> u32>,
    /// Energises the device at zero wrench. Not real-time.
    pub activate: Option<
        unsafe extern "C" fn(instance: Instance, config: *const LoopConfig, message: *mut Message) -> u32,
    >,
    /// Commands zero wrench and returns to the opened phase. Not real-time.
    pub deactivate: Option<unsafe extern "C" fn(instance: Instance) -> u32>,
    /// Reads the newest sample of an active device into `state`. Real-time.
    pub read: Option<
        unsafe extern "C" fn(instance: Instance, tick: *const Tick, state: *mut DeviceState) -> CycleCode,
    >,
    /// Commands the wrench on the hand until the next write; of an active device only. Real-time.
    pub write: Option<
        unsafe extern "C" fn(instance: Instance, tick: *const Tick, wrench: *const Wrench) -> CycleCode,
    >,
    /// Sets the actuators to zero (or starts a controlled landing) at once, until the next activation. May be called from
    /// any thread at any time, also during `read` and `write`.
    pub safe_stop: Option<unsafe extern "C" fn(instance: Instance)>,
    /// Changes the live parameter at `index` of an active device at a tick boundary (for a choice, `value` is its index).
    /// Real-time. May be null.
    pub set_parameter: Option<unsafe extern "C" fn(instance: Instance, index: u32, value: f64) -> u32>,
    /// Returns the current value of the parameter at `index` of an opened device; NaN if unknown. May be null.
    pub parameter: Option<unsafe extern "C" fn(instance: Instance, index: u32) -> f64>,
    /// Writes the message of the last failure to `message`; empty if there is none. Not real-time. May be null.
    pub last_message: Option<unsafe extern "C" fn(instance: Instance, message: *mut Message)>,
}

layout! {
    CycleCode { code }
    DeviceTable {
        size, parameter_count, parameters, info, open, close, capabilities, activate, deactivate, read, write,
        safe_stop, set_parameter, parameter, last_message,
    }
}
/// Adapter of a [`Device`] for the function tables.
pub(crate) struct DeviceAdapter<D>(PhantomData<D>);

/// Phase of a device instance.
pub(crate) enum Phase<D: Device> {
    Opened(D),
    Active(D::Active),
    /// Placeholder during a transition.
    Between,
}

impl<D: Device> Phase<D> {
    pub(crate) fn opened(&mut self) -> Result<&mut D, CallStatus> {
        match self {
            Self::Opened(device) => Ok(device),
            Self::Active(_) | Self::Between => Err(CallStatus::WrongPhase),
        }
    }

    #[inline]
    pub(crate) fn active(&mut self) -> Result<&mut D::Active, CallStatus> {
        match self {
            Self::Active(device) => Ok(device),
            Self::Opened(_) | Self::Between => Err(CallStatus::WrongPhase),
        }
    }

    fn activate(&mut self, config: &LoopConfig) -> Result<(), Refusal> {
        let (next, answer) = match std::mem::replace(self, Self::Between) {
            Self::Opened(device) => match device.activate(config) {
                Ok(active) => (Self::Active(active), Ok(())),
                Err((device, refusal)) => (Self::Opened(device), Err(refusal)),
            },
            other => (other, Err(not_opened())),
        };
        *self = next;
        answer
    }

    fn deactivate(&mut self) -> Result<(), CallStatus> {
        let (next, answer) = match std::mem::replace(self, Self::Between) {
            Self::Active(active) => (Self::Opened(active.deactivate()), Ok(())),
            other => (other, Err(CallStatus::WrongPhase)),
        };
        *self = next;
        answer
    }
}

/// Builds the refusal for a call outside the opened phase.
pub(crate) fn not_opened() -> Refusal {
    Refusal::broken(
        "the device is active, or an earlier call panicked; deactivate the device, or close and open it again",
    )
}

impl<D: Device> PluginAdapter for DeviceAdapter<D> {
    type State = Phase<D>;
    type Shared = D::Stop;
    const PARAMETERS: &'static [Parameter] = D::PARAMETERS;

    fn make(settings: &Settings<'_>) -> Result<(Phase<D>, D::Stop), Refusal> {
        let device = D::open(settings)?;
        let stop = device.stopper();
        Ok((Phase::Opened(device), stop))
    }
}

unsafe extern "C" fn capabilities<D: Device>(instance: Instance, out: *mut Capabilities) -> u32 {
    // SAFETY: the contract of every table call: a live instance, used by one thread, and pointers to initialised
    // values that are the callee's for the call.
    unsafe { fill::<DeviceAdapter<D>, _>(instance, out, |phase| Ok(phase.opened()?.capabilities())) }
}

unsafe extern "C" fn activate<D: Device>(
    instance: Instance,
    config: *const LoopConfig,
    message: *mut Message,
) -> u32 {
    // SAFETY: as in `capabilities`.
    unsafe { refusable::<DeviceAdapter<D>>(instance, message, |phase| phase.activate(&*config)) }
}

unsafe extern "C" fn deactivate<D: Device>(instance: Instance) -> u32 {
    // SAFETY: as in `capabilities`.
    unsafe { call::<DeviceAdapter<D>>(instance, Phase::deactivate) }
}

/// Runs `body` on an active device; returns [`Fault::Broken`] in another phase and after a panic.
///
/// # Safety
/// As for every table call.
#[inline]
unsafe fn cycle<D: Device>(instance: Instance, body: impl FnOnce(&mut D::Active) -> Cycle) -> CycleCode {
    let mut cycle = Cycle::Fault(Fault::Broken);
    // SAFETY: by the contract of this function.
    let _ = unsafe {
        call::<DeviceAdapter<D>>(instance, |phase| {
            cycle = body(phase.active()?);
            Ok(())
        })
    };
    cycle.into()
}

unsafe extern "C" fn read<D: Device>(
    instance: Instance,
    tick: *const Tick,
    state: *mut DeviceState,
) -> CycleCode {
    // SAFETY: as in `capabilities`.
    unsafe { cycle::<D>(instance, |device| device.read(&*tick, &mut *state)) }
}

unsafe extern "C" fn write<D: Device>(
    instance: Instance,
    tick: *const Tick,
    wrench: *const Wrench,
) -> CycleCode {
    // SAFETY: as in `capabilities`.
    unsafe { cycle::<D>(instance, |device| device.write(&*tick, &*wrench)) }
}

unsafe extern "C" fn safe_stop<D: Device>(instance: Instance) {
    // SAFETY: the contract of `safe_stop`: a live instance, on any thread.
    unsafe { from_any_thread::<DeviceAdapter<D>>(instance, SafeStop::safe_stop) };
}

unsafe extern "C" fn set_parameter<D: Device>(instance: Instance, index: u32, value: f64) -> u32 {
    let set = |phase: &mut Phase<D>| {
        phase.active()?.set_parameter(index as usize, value).map_err(|_| CallStatus::OutOfRange)
    };
    // SAFETY: as in `capabilities`.
    unsafe { instance::set_parameter::<DeviceAdapter<D>>(instance, index, value, set) }
}

unsafe extern "C" fn parameter<D: Device>(instance: Instance, index: u32) -> f64 {
    let ask =
        |phase: &mut Phase<D>| phase.opened().map_or(f64::NAN, |device| device.parameter(index as usize));
    // SAFETY: as in `capabilities`.
    unsafe { instance::parameter::<DeviceAdapter<D>>(instance, ask) }
}

table!(DeviceTable: "flotor.device/1", D: [Device] {
    parameter_count: D::PARAMETERS.len() as u32,
    parameters: D::PARAMETERS.as_ptr(),
    info: D::INFO,
    open: Some(instance::create::<DeviceAdapter<D>>),
    close: Some(instance::destroy::<DeviceAdapter<D>>),
    capabilities: Some(capabilities::<D>),
    activate: Some(activate::<D>),
    deactivate: Some(deactivate::<D>),
    read: Some(read::<D>),
    write: Some(write::<D>),
    safe_stop: Some(safe_stop::<D>),
    set_parameter: Some(set_parameter::<D>),
    parameter: Some(parameter::<D>),
    last_message: Some(instance::last_message::<DeviceAdapter<D>>),
});
