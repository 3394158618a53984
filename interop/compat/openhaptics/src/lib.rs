//! Drop-in `libHD.so`: the 36 functions of HDAPI, served by the devices of a Flotor scene.
//!
//! Lengths in mm, forces in N, torques in mN·m; x right, y up, z towards the user. The scheduler is one thread for all devices
//! and calls the program once per tick. A frame takes a snapshot of the device at its start and sends force at its end. The
//! scene's envelope always limits the force; a program gets the error of an excessive force only if it has disabled clamping.
//!
//! Source: public headers of the interface, versions 3.0 to 3.5, and a dozen open programs that use it: names, numbers and
//! behaviour only.
#![allow(unsafe_code)] // C entry points; listed in tests/tests/system/architecture.rs
#![allow(non_snake_case)] // the names are another maker's

mod callbacks;
mod device;
mod error;
mod parameter;
mod scheduler;

use callbacks::{Callback, Entry};
use device::{CURRENT, Devices};
use error::{Code, ErrorInfo, NO_DEVICE, raise};
use flotor_compat::pointer::{In, Out};
use flotor_compat::{MARKER, export};
use parameter::Kind;
use std::ffi::{c_char, c_double, c_float, c_int, c_long, c_uchar, c_uint, c_ulong, c_ushort, c_void};

/// State of calibration, `HD_CALIBRATION_OK`.
const CALIBRATED: c_uint = 0x5000;

/// Returns the value of a result, or raises its error for the current device and returns `otherwise`.
fn value_or<T>(otherwise: T, result: Result<T, Code>) -> T {
    result.unwrap_or_else(|code| {
        raise(code, CURRENT.get());
        otherwise
    })
}

/// Reads a parameter of the current device, converted to the type that the program requests.
fn read<T: Copy>(parameter: c_uint, kind: Kind, place: Out<T>, convert: impl Fn(f64) -> T) {
    let read = Devices::with_current(|device| device.value(parameter));
    // All or nothing: a wrong type leaves the buffer unchanged.
    let values = read.and_then(|values| values.of_kind(kind).ok_or(Code::InvalidInputType));
    let written = values.map(|(numbers, count)| {
        place.put_all(numbers.map(convert).get(..count).unwrap_or_default());
    });
    value_or((), written);
}

/// Sets a parameter of the current device from values of the program.
fn write<T: Copy>(parameter: c_uint, kind: Kind, place: In<T>, convert: impl Fn(T) -> f64) {
    let set = parameter::settable(parameter, kind).and_then(|count| {
        let values = match count {
            1 => place.get().map(|value| [convert(value), 0.0, 0.0]),
            _ => place.get_all().map(|values| values.map(convert)),
        };
        let values = values.ok_or(Code::InvalidValue)?;
        Devices::with_current(|device| device.set(parameter, values))
    });
    value_or((), set);
}

fn switch(capability: c_uint, on: bool) {
    value_or((), Devices::with_current(|device| device.switch(capability, on)));
}

fn raise_unless(is_done: bool, code: Code, device: c_uint) {
    if !is_done {
        raise(code, device);
    }
}

export! {
    /// Returns the marker of a drop-in library.
    fn flotor_dropin() -> *const c_char [MARKER.as_ptr().cast()] { MARKER.as_ptr().cast() }

    /// Opens a device by name and makes it current; returns its handle.
    fn hdInitDevice(name: In<c_char>) -> c_uint [NO_DEVICE] {
        match device::init(name.get_text().as_deref()) {
            Ok(handle) => {
                error::clear();
                handle
            }
            Err(code) => {
                raise(code, NO_DEVICE);
                NO_DEVICE
            }
        }
    }
    /// Closes a device, whose force ends with the next tick.
    fn hdDisableDevice(handle: c_uint) -> () [()] { raise_unless(device::disable(handle), Code::BadHandle, handle) }
    /// Makes a device current, for the whole process.
    fn hdMakeCurrentDevice(handle: c_uint) -> () [()] { raise_unless(CURRENT.set(handle), Code::BadHandle, handle) }
    /// Returns the handle of the current device; an error without one.
    fn hdGetCurrentDevice() -> c_uint [NO_DEVICE] {
        let current = CURRENT.get();
        raise_unless(current != NO_DEVICE, Code::InvalidOperation, NO_DEVICE);
        current
    }
    /// Begins a frame with a snapshot of the device.
    fn hdBeginFrame(handle: c_uint) -> () [()] { device::begin_frame(handle).unwrap_or_else(|code| raise(code, handle)) }
    /// Ends a frame and sends the values set in it.
    fn hdEndFrame(handle: c_uint) -> () [()] { device::end_frame(handle).unwrap_or_else(|code| raise(code, handle)) }

    /// Reads the boolean values of a parameter of the current device.
    fn hdGetBooleanv(parameter: c_uint, place: Out<c_uchar>) -> () [()] {
        read(parameter, Kind::Boolean, place, |value| c_uchar::from(value != 0.0));
    }
    /// Reads the integer values of a parameter of the current device.
    fn hdGetIntegerv(parameter: c_uint, place: Out<c_int>) -> () [()] {
        #[allow(clippy::cast_possible_truncation)] // whole and small, or saturated
        read(parameter, Kind::Integer, place, |value| value as c_int);
    }
    /// Reads the long integer values of a parameter of the current device.
    fn hdGetLongv(parameter: c_uint, place: Out<c_long>) -> () [()] {
        #[allow(clippy::cast_possible_truncation)] // whole and small, or saturated
        read(parameter, Kind::Long, place, |value| value as c_long);
    }
    /// Reads the single-precision values of a parameter of the current device.
    fn hdGetFloatv(parameter: c_uint, place: Out<c_float>) -> () [()] {
        #[allow(clippy::cast_possible_truncation)] // what the program asks for
        read(parameter, Kind::Real, place, |value| value as c_float);
    }
    /// Reads the double-precision values of a parameter of the current device.
    fn hdGetDoublev(parameter: c_uint, place: Out<c_double>) -> () [()] { read(parameter, Kind::Real, place, |value| value) }
    /// Returns a text, never null; texts of the interface are valid before any device is open.
    fn hdGetString(parameter: c_uint) -> *const c_char [c"".as_ptr()] { value_or(c"", device::text(parameter)).as_ptr() }
    /// Sets the boolean values of a parameter of the current device.
    fn hdSetBooleanv(parameter: c_uint, place: In<c_uchar>) -> () [()] { write(parameter, Kind::Boolean, place, f64::from) }
    /// Sets the integer values of a parameter of the current device.
    fn hdSetIntegerv(parameter: c_uint, place: In<c_int>) -> () [()] { write(parameter, Kind::Integer, place, f64::from) }
    /// Sets the long integer values of a parameter of the current device.
    fn hdSetLongv(parameter: c_uint, place: In<c_long>) -> () [()] { write(parameter, Kind::Long, place, |value| value as f64) }
    /// Sets the single-precision values of a parameter of the current device.
    fn hdSetFloatv(parameter: c_uint, place: In<c_float>) -> () [()] { write(parameter, Kind::Real, place, f64::from) }
    /// Sets the double-precision values of a parameter of the current device.
    fn hdSetDoublev(parameter: c_uint, place: In<c_double>) -> () [()] { write(parameter, Kind::Real, place, |value| value) }
    /// Enables a capability of the current device.
    fn hdEnable(capability: c_uint) -> () [()] { switch(capability, true) }
    /// Disables a capability of the current device.
    fn hdDisable(capability: c_uint) -> () [()] { switch(capability, false) }
    /// Returns true if a capability of the current device is enabled.
    fn hdIsEnabled(capability: c_uint) -> c_uchar [0] {
        c_uchar::from(value_or(false, Devices::with_current(|device| device.is_on(capability))))
    }

    /// Pops the newest error of the calling thread.
    fn hdGetError() -> ErrorInfo [error::NONE] { error::take() }
    /// Returns the text of an error number, never null.
    fn hdGetErrorString(code: c_uint) -> *const c_char [c"".as_ptr()] { error::words(code).as_ptr() }

    /// Returns "calibrated" always, because programs wait for it.
    fn hdCheckCalibration() -> c_uint [CALIBRATED] { CALIBRATED }
    /// Returns "calibrated" always, as [`hdCheckCalibration`].
    fn hdCheckCalibrationStyle() -> c_uint [CALIBRATED] { CALIBRATED }
    /// Does nothing: there is nothing to calibrate.
    fn hdUpdateCalibration(_style: c_uint) -> () [()] {}
    /// Does nothing: there is nothing to calibrate.
    fn hdUpdateCalibrationMessage(_style: c_uint) -> () [()] {}

    /// Starts the scheduler, and enables the force of devices whose force output is enabled.
    fn hdStartScheduler() -> () [()] { raise_unless(scheduler::start(), Code::TimerError, CURRENT.get()) }
    /// Stops the scheduler and disables force; unless called by a callback, waits for its end: no callback is called afterwards.
    fn hdStopScheduler() -> () [()] { scheduler::stop() }
    /// Sets the rate of the scheduler, 1000 or 500 Hz.
    fn hdSetSchedulerRate(rate_hz: c_ulong) -> () [()] {
        raise_unless(callbacks::set_rate(rate_hz), Code::InvalidValue, CURRENT.get());
    }
    /// Schedules a callback, called in every tick until it returns 0; higher priority first. The callback may be called with `data`
    /// from another thread until it has returned 0 or is unscheduled.
    fn hdScheduleAsynchronous(callback: Option<Callback>, data: *mut c_void, priority: c_ushort) -> c_ulong [c_ulong::MAX] {
        // SAFETY: the caller of this entry point guarantees what its documentation states.
        let entry = callback.map(|callback| unsafe { Entry::new(callback, data, priority) });
        value_or(c_ulong::MAX, entry.ok_or(Code::InvalidValue).and_then(Entry::schedule))
    }
    /// Schedules a callback and returns once it has returned 0; without a running scheduler, or on its thread, calls it directly.
    /// The callback may be called with `data` from another thread until this returns.
    fn hdScheduleSynchronous(callback: Option<Callback>, data: *mut c_void, priority: c_ushort) -> () [()] {
        match callback {
            // SAFETY: the caller of this entry point guarantees what its documentation states.
            Some(callback) => unsafe { scheduler::synchronous(callback, data, priority) },
            None => raise(Code::InvalidValue, CURRENT.get()),
        }
    }
    /// Unschedules a callback.
    fn hdUnschedule(handle: c_ulong) -> () [()] {
        raise_unless(callbacks::unschedule(handle), Code::InvalidOperation, CURRENT.get());
    }
    /// Returns true if a callback is still scheduled; with `how` = 1, waits for its end first.
    fn hdWaitForCompletion(handle: c_ulong, how: c_uint) -> c_uchar [0] {
        c_uchar::from(callbacks::is_scheduled(handle, how != 0))
    }
    /// Returns the time since this tick began, s.
    fn hdGetSchedulerTimeStamp() -> c_double [0.0] { callbacks::since_tick_s() }

    /// Does nothing: angles are not scaled.
    fn hdScaleGimbalAngles(_x: c_double, _y: c_double, _z: c_double, _matrix: Out<c_double>) -> () [()] {}
    /// Returns success: no licence is required.
    fn hdDeploymentLicense(_vendor: In<c_char>, _application: In<c_char>, _password: In<c_char>) -> c_uchar [1] { 1 }
}
