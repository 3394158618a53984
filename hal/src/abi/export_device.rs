//! From a [`Device`] to its function table: phases as types inside, trampolines that keep panics inside the plugin.

use super::entry::{CallStatus, Entry, Instance, PluginKind, interface_ids};
use super::export_model::values_from_raw;
use super::{CalibrationTable, DevicePacingTable, DeviceTable, EnergyLedgerTable, Message, Str, panics};
use crate::{
    ActiveDevice, Capabilities, Cycle, Device, DeviceState, EnergyLedger, Fault, LoopConfig, Pacing,
    ParameterValue, RefusalKind, SafeStop, SampleWait, Settings, Tick, VerticalCalibration, Wrench,
};
use std::ffi::c_void;
use std::marker::PhantomData;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Where a device is in its life.
enum Phase<D: Device> {
    Opened(D),
    Active(D::Active),
    /// A call panicked: the device is in an unknown state and is never called again.
    Dead,
}

/// What an [`Instance`] pointer of a device points at.
///
/// `stop` is shared with other threads; `work` belongs to the one thread that owns the instance. The two are
/// borrowed separately and never as a whole while the instance lives.
struct Slot<D: Device> {
    stop: D::Stop,
    work: Work<D>,
}

struct Work<D: Device> {
    phase: Phase<D>,
    message: Message,
}

impl<D: Device> Work<D> {
    /// Runs `body`; a panic kills the device and keeps its words.
    #[inline]
    fn guard<T>(&mut self, broken: T, body: impl FnOnce(&mut Phase<D>) -> T) -> T {
        let phase = &mut self.phase;
        match catch_unwind(AssertUnwindSafe(|| body(phase))) {
            Ok(value) => value,
            Err(panic) => {
                panics::record(panic, &mut self.message);
                let dead = std::mem::replace(&mut self.phase, Phase::Dead);
                if let Err(second) = catch_unwind(AssertUnwindSafe(|| drop(dead))) {
                    panics::discard(second);
                }
                broken
            }
        }
    }
}

/// The working half of an instance.
///
/// # Safety
/// `instance` came from `open::<D>`, is alive, and no other thread uses its working half during `'a`.
#[inline]
unsafe fn work<'a, D: Device>(instance: Instance) -> &'a mut Work<D> {
    // SAFETY: by the contract of this function; only the `work` field is borrowed, `stop` stays shareable.
    unsafe { &mut (*instance.cast::<Slot<D>>()).work }
}

unsafe extern "C" fn open<D: Device>(
    values: *const ParameterValue,
    count: u32,
    message: *mut Message,
    out: *mut Instance,
) -> u32 {
    // SAFETY: the contract of `open`: `values` and `count` describe a slice valid for the call.
    let values = unsafe { values_from_raw(values, count) };
    // SAFETY: the contract of `open`: `message` and `out` are valid for writes for the call.
    let (message, out) = unsafe { (&mut *message, &mut *out) };
    let opened = catch_unwind(|| {
        D::open(&Settings::new(D::PARAMETERS, values)).map(|device| {
            let stop = device.stopper();
            Slot { stop, work: Work { phase: Phase::Opened(device), message: Message::default() } }
        })
    });
    match opened {
        Ok(Ok(slot)) => {
            *out = Box::into_raw(Box::new(slot)).cast();
            0
        }
        Ok(Err(refusal)) => {
            message.set(&refusal.reason);
            refusal.kind as u32
        }
        Err(panic) => {
            panics::record(panic, message);
            RefusalKind::Broken as u32
        }
    }
}

unsafe extern "C" fn close<D: Device>(instance: Instance) {
    // SAFETY: the contract of `close`: `instance` came from `open` of this type and is not used again.
    let slot = unsafe { Box::from_raw(instance.cast::<Slot<D>>()) };
    if let Err(panic) = catch_unwind(AssertUnwindSafe(|| drop(slot))) {
        panics::discard(panic);
    }
}

unsafe extern "C" fn capabilities<D: Device>(instance: Instance, out: *mut Capabilities) -> u32 {
    // SAFETY: the contract of every table call: a live instance, used by one thread, pointers valid for the call.
    let (work, out) = unsafe { (work::<D>(instance), &mut *out) };
    work.guard(CallStatus::Panicked, |phase| match phase {
        Phase::Opened(device) => {
            *out = device.capabilities();
            CallStatus::Ok
        }
        Phase::Active(_) => CallStatus::WrongPhase,
        Phase::Dead => CallStatus::Panicked,
    }) as u32
}

unsafe extern "C" fn activate<D: Device>(
    instance: Instance,
    config: *const LoopConfig,
    message: *mut Message,
) -> u32 {
    // SAFETY: as in `capabilities`.
    let (work, config, message) = unsafe { (work::<D>(instance), &*config, &mut *message) };
    let refused =
        work.guard(Some((RefusalKind::Broken, None)), |phase| match std::mem::replace(phase, Phase::Dead) {
            Phase::Opened(device) => match device.activate(config) {
                Ok(active) => {
                    *phase = Phase::Active(active);
                    None
                }
                Err((device, refusal)) => {
                    *phase = Phase::Opened(device);
                    Some((refusal.kind, Some(refusal.reason)))
                }
            },
            other => {
                *phase = other;
                Some((RefusalKind::Broken, Some("the device is not in the opened phase".to_owned())))
            }
        });
    match refused {
        None => 0,
        Some((kind, reason)) => {
            message.set(reason.as_deref().unwrap_or(work.message.as_str()));
            kind as u32
        }
    }
}

unsafe extern "C" fn deactivate<D: Device>(instance: Instance) -> u32 {
    // SAFETY: as in `capabilities`.
    let work = unsafe { work::<D>(instance) };
    work.guard(CallStatus::Panicked, |phase| match std::mem::replace(phase, Phase::Dead) {
        Phase::Active(active) => {
            *phase = Phase::Opened(active.deactivate());
            CallStatus::Ok
        }
        Phase::Opened(device) => {
            *phase = Phase::Opened(device);
            CallStatus::WrongPhase
        }
        Phase::Dead => CallStatus::Panicked,
    }) as u32
}

unsafe extern "C" fn read<D: Device>(instance: Instance, tick: *const Tick, state: *mut DeviceState) -> u32 {
    // SAFETY: as in `capabilities`.
    let (work, tick, state) = unsafe { (work::<D>(instance), &*tick, &mut *state) };
    let broken = Cycle::Fault(Fault::Broken);
    work.guard(broken, |phase| match phase {
        Phase::Active(device) => device.read(tick, state),
        Phase::Opened(_) | Phase::Dead => broken,
    })
    .code()
}

unsafe extern "C" fn write<D: Device>(instance: Instance, tick: *const Tick, wrench: *const Wrench) -> u32 {
    // SAFETY: as in `capabilities`.
    let (work, tick, wrench) = unsafe { (work::<D>(instance), &*tick, &*wrench) };
    let broken = Cycle::Fault(Fault::Broken);
    work.guard(broken, |phase| match phase {
        Phase::Active(device) => device.write(tick, wrench),
        Phase::Opened(_) | Phase::Dead => broken,
    })
    .code()
}

unsafe extern "C" fn safe_stop<D: Device>(instance: Instance) {
    // SAFETY: the contract of `safe_stop`: a live instance. Only the `stop` field is borrowed, and shared, so a
    // concurrent `read` or `write` (which borrows only `work`) does not alias; `Stop: Sync`.
    let stop = unsafe { &(*instance.cast::<Slot<D>>()).stop };
    if let Err(panic) = catch_unwind(AssertUnwindSafe(|| stop.safe_stop())) {
        panics::discard(panic);
    }
}

unsafe extern "C" fn set_parameter<D: Device>(instance: Instance, index: u32, value: f64) -> u32 {
    let Some(parameter) = D::PARAMETERS.get(index as usize) else { return CallStatus::OutOfRange as u32 };
    if parameter.check(value).is_err() || parameter.mutability() != crate::Mutability::Live {
        return CallStatus::OutOfRange as u32;
    }
    // SAFETY: as in `capabilities`.
    let work = unsafe { work::<D>(instance) };
    work.guard(CallStatus::Panicked, |phase| match phase {
        Phase::Active(device) => match device.set_parameter(index as usize, value) {
            Ok(()) => CallStatus::Ok,
            Err(_) => CallStatus::OutOfRange,
        },
        Phase::Opened(_) => CallStatus::WrongPhase,
        Phase::Dead => CallStatus::Panicked,
    }) as u32
}

unsafe extern "C" fn parameter<D: Device>(instance: Instance, index: u32) -> f64 {
    // SAFETY: as in `capabilities`.
    let work = unsafe { work::<D>(instance) };
    work.guard(f64::NAN, |phase| match phase {
        Phase::Opened(device) => device.parameter(index as usize),
        Phase::Active(_) | Phase::Dead => f64::NAN,
    })
}

unsafe extern "C" fn last_message<D: Device>(instance: Instance, message: *mut Message) {
    // SAFETY: as in `capabilities`.
    let (work, message) = unsafe { (work::<D>(instance), &mut *message) };
    *message = work.message;
}

unsafe extern "C" fn ledger<D: Device>(instance: Instance, out: *mut EnergyLedger) -> u32 {
    // SAFETY: as in `capabilities`.
    let (work, out) = unsafe { (work::<D>(instance), &mut *out) };
    work.guard(CallStatus::Panicked, |phase| match phase {
        Phase::Active(device) => match device.energy_ledger() {
            Some(ledger) => {
                *out = ledger;
                CallStatus::Ok
            }
            None => CallStatus::Unsupported,
        },
        Phase::Opened(_) => CallStatus::WrongPhase,
        Phase::Dead => CallStatus::Panicked,
    }) as u32
}

unsafe extern "C" fn wait_for_sample<D: Device>(
    instance: Instance,
    timeout_ns: u64,
    samples: *mut u64,
) -> u32 {
    // SAFETY: as in `capabilities`.
    let (work, samples) = unsafe { (work::<D>(instance), &mut *samples) };
    work.guard(CallStatus::Panicked, |phase| match phase {
        Phase::Active(device) => {
            let waited = device.wait_for_sample(timeout_ns);
            *samples = waited.samples();
            if waited == SampleWait::NotPaced { CallStatus::Unsupported } else { CallStatus::Ok }
        }
        Phase::Opened(_) => CallStatus::WrongPhase,
        Phase::Dead => CallStatus::Panicked,
    }) as u32
}

unsafe extern "C" fn serial<D: Device>(instance: Instance, serial: *mut Message) -> u32 {
    // SAFETY: as in `capabilities`.
    let (work, serial) = unsafe { (work::<D>(instance), &mut *serial) };
    work.guard(CallStatus::Panicked, |phase| match phase {
        Phase::Opened(device) => {
            serial.set(&device.serial());
            CallStatus::Ok
        }
        Phase::Active(_) => CallStatus::WrongPhase,
        Phase::Dead => CallStatus::Panicked,
    }) as u32
}

unsafe extern "C" fn calibrate_vertical<D: Device>(
    instance: Instance,
    calibration: *const VerticalCalibration,
    message: *mut Message,
) -> u32 {
    // SAFETY: as in `capabilities`.
    let (work, calibration, message) = unsafe { (work::<D>(instance), &*calibration, &mut *message) };
    if let Err(invalid) = calibration.check() {
        message.set(&invalid.to_string());
        return RefusalKind::Parameter as u32;
    }
    let refused = work.guard(Some((RefusalKind::Broken, None)), |phase| match phase {
        Phase::Opened(device) => match device.calibrate_vertical(calibration) {
            Ok(()) => None,
            Err(refusal) => Some((refusal.kind, Some(refusal.reason))),
        },
        Phase::Active(_) | Phase::Dead => {
            Some((RefusalKind::Broken, Some("the device is not in the opened phase".to_owned())))
        }
    });
    match refused {
        None => 0,
        Some((kind, reason)) => {
            message.set(reason.as_deref().unwrap_or(work.message.as_str()));
            kind as u32
        }
    }
}

/// The tables of one device type, as constants that are promoted to statics.
struct Tables<D>(PhantomData<D>);

#[allow(clippy::cast_possible_truncation)] // table sizes and parameter counts are small
impl<D: Device> Tables<D> {
    const DEVICE: DeviceTable = DeviceTable {
        size: size_of::<DeviceTable>() as u32,
        parameter_count: D::PARAMETERS.len() as u32,
        parameters: D::PARAMETERS.as_ptr(),
        info: D::INFO,
        open: Some(open::<D>),
        close: Some(close::<D>),
        capabilities: Some(capabilities::<D>),
        activate: Some(activate::<D>),
        deactivate: Some(deactivate::<D>),
        read: Some(read::<D>),
        write: Some(write::<D>),
        safe_stop: Some(safe_stop::<D>),
        set_parameter: Some(set_parameter::<D>),
        parameter: Some(parameter::<D>),
        last_message: Some(last_message::<D>),
    };
    const LEDGER: EnergyLedgerTable = EnergyLedgerTable {
        size: size_of::<EnergyLedgerTable>() as u32,
        reserved: 0,
        ledger: Some(ledger::<D>),
    };
    const CALIBRATION: CalibrationTable = CalibrationTable {
        size: size_of::<CalibrationTable>() as u32,
        reserved: 0,
        serial: Some(serial::<D>),
        calibrate_vertical: Some(calibrate_vertical::<D>),
    };
    const PACING: DevicePacingTable = DevicePacingTable {
        size: size_of::<DevicePacingTable>() as u32,
        reserved: 0,
        wait_for_sample: Some(wait_for_sample::<D>),
    };
}

unsafe extern "C" fn interface<D: Device>(id: Str) -> *const c_void {
    match id.as_str() {
        interface_ids::DEVICE => std::ptr::from_ref(&Tables::<D>::DEVICE).cast(),
        interface_ids::ENERGY_LEDGER => std::ptr::from_ref(&Tables::<D>::LEDGER).cast(),
        interface_ids::CALIBRATION => std::ptr::from_ref(&Tables::<D>::CALIBRATION).cast(),
        interface_ids::DEVICE_PACING if D::PACING == Pacing::Device => {
            std::ptr::from_ref(&Tables::<D>::PACING).cast()
        }
        _ => std::ptr::null(),
    }
}

/// The entry of a device plugin; [`crate::export_device!`] makes a static of it.
#[must_use]
pub const fn device_entry<D: Device>() -> Entry {
    Entry::of(PluginKind::Device, interface::<D>)
}

/// Makes a [`crate::Device`] a plugin: `export_device!(SimulatedFlotor);`. One per crate.
#[macro_export]
macro_rules! export_device {
    ($device:ty) => {
        $crate::export_entry!(
            $crate::abi::device_entry::<$device>(),
            $crate::abi::PluginKind::Device,
            <$device as $crate::Device>::INFO.id(),
            <$device as $crate::Device>::INFO.name(),
            <$device as $crate::Device>::INFO.doc()
        );
    };
}
