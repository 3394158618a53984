//! Drop-in `libHD.so`: the 36 functions of HDAPI, served by the devices of a Flotor scene.
//!
//! Lengths in mm, forces in N, torques in mN·m; x right, y up, z towards the user. The scheduler is one thread for all devices
//! and calls the program once a tick. A frame takes a snapshot of the device at its begin and sends force at its end. The
//! scene's envelope limits force first; a program gets errors of force only if it has disabled the limit itself.
//!
//! Source: public headers of the interface, versions 3.0 to 3.5, and a dozen open programs that use it: names, numbers and
//! behaviour only.
#![allow(unsafe_code)] // C entry points; listed in tests/tests/system/architecture.rs
#![allow(non_snake_case)] // the names are another maker's

mod device;
mod error;
mod parameter;
mod scheduler;

use device::{CURRENT, Devices};
use error::{Code, ErrorInfo, raise};
use flotor_compat::pointer::{get, get_text, put};
use flotor_compat::{MARKER, guarded};
use parameter::{Kind, Reading, Values};
use scheduler::{Callback, Scheduler};
use std::ffi::{c_char, c_double, c_float, c_int, c_long, c_uchar, c_uint, c_ulong, c_ushort, c_void};

/// Handle of no device.
const NO_DEVICE: c_uint = 0xFFFF_FFFF;
/// State of calibration, `HD_CALIBRATION_OK`.
const CALIBRATED: c_uint = 0x5000;

/// Returns the marker of a drop-in library.
#[unsafe(no_mangle)]
pub extern "C" fn flotor_dropin() -> *const c_char {
    MARKER.as_ptr().cast()
}

// ---------------------------------------------------------------- devices

/// Opens a device by name and makes it current; returns its handle.
///
/// # Safety
/// `name` is null or a terminated text.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdInitDevice(name: *const c_char) -> c_uint {
    guarded(NO_DEVICE, || {
        // SAFETY: by the contract of this function.
        let name = unsafe { get_text(name) };
        match device::init(name.as_deref()) {
            Ok(handle) => {
                error::clear();
                handle
            }
            Err(code) => {
                raise(code, NO_DEVICE);
                NO_DEVICE
            }
        }
    })
}

/// Closes a device, whose force ends with the next tick.
#[unsafe(no_mangle)]
pub extern "C" fn hdDisableDevice(handle: c_uint) {
    guarded((), || {
        if !device::disable(handle) {
            raise(Code::BadHandle, handle);
        }
    });
}

/// Makes a device current, for the whole process.
#[unsafe(no_mangle)]
pub extern "C" fn hdMakeCurrentDevice(handle: c_uint) {
    guarded((), || {
        if !CURRENT.set(handle) {
            raise(Code::BadHandle, handle);
        }
    });
}

/// Returns the current device.
#[unsafe(no_mangle)]
pub extern "C" fn hdGetCurrentDevice() -> c_uint {
    guarded(NO_DEVICE, || {
        let current = CURRENT.get();
        if current == NO_DEVICE {
            raise(Code::InvalidOperation, NO_DEVICE);
        }
        current
    })
}

/// Begins a frame with a snapshot of the device.
#[unsafe(no_mangle)]
pub extern "C" fn hdBeginFrame(handle: c_uint) {
    guarded((), || device::begin_frame(handle).unwrap_or_else(|code| raise(code, handle)));
}

/// Ends a frame and sends the values set in it.
#[unsafe(no_mangle)]
pub extern "C" fn hdEndFrame(handle: c_uint) {
    guarded((), || device::end_frame(handle).unwrap_or_else(|code| raise(code, handle)));
}

// ---------------------------------------------------------------- values

/// Reads a parameter of the current device, converted to the type that the program requests.
///
/// # Safety
/// `place` is null or as many values may be written as the parameter has.
unsafe fn read<T>(parameter: c_uint, place: *mut T, convert: impl Fn(&Values, usize) -> Option<T>) {
    guarded((), || {
        let read = Devices::with_current(|device| device.value(parameter));
        let values = match read.and_then(|value| value) {
            Ok(values) => values,
            Err(code) => return raise(code, CURRENT.get()),
        };
        // All or nothing: a wrong type leaves the buffer unchanged.
        if (0..values.len()).any(|index| convert(&values, index).is_none()) {
            return raise(Code::InvalidInputType, CURRENT.get());
        }
        for index in 0..values.len() {
            if let Some(value) = convert(&values, index)
                && !place.is_null()
            {
                // SAFETY: by the contract of this function there is room for all of them.
                unsafe { put(place.add(index), value) };
            }
        }
    });
}

/// Reads the boolean values of a parameter of the current device.
///
/// # Safety
/// The pointer is null or leads to as many values as the parameter has.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdGetBooleanv(parameter: c_uint, place: *mut c_uchar) {
    // SAFETY: by the contract of this function.
    unsafe {
        read(parameter, place, |values, index| values.read(Kind::Boolean, index).map(Reading::as_boolean))
    }
}

/// Reads the integer values of a parameter of the current device.
///
/// # Safety
/// The pointer is null or leads to as many values as the parameter has.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdGetIntegerv(parameter: c_uint, place: *mut c_int) {
    // SAFETY: by the contract of this function.
    unsafe {
        read(parameter, place, |values, index| values.read(Kind::Integer, index).map(Reading::as_integer))
    }
}

/// Reads the long integer values of a parameter of the current device.
///
/// # Safety
/// The pointer is null or leads to as many values as the parameter has.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdGetLongv(parameter: c_uint, place: *mut c_long) {
    // SAFETY: by the contract of this function.
    unsafe { read(parameter, place, |values, index| values.read(Kind::Long, index).map(Reading::as_long)) }
}

/// Reads the single-precision values of a parameter of the current device.
///
/// # Safety
/// The pointer is null or leads to as many values as the parameter has.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdGetFloatv(parameter: c_uint, place: *mut c_float) {
    #[allow(clippy::cast_possible_truncation)] // what the program asks for
    let convert = |values: &Values, index: usize| {
        values.read(Kind::Real, index).map(|reading| reading.as_real() as c_float)
    };
    // SAFETY: by the contract of this function.
    unsafe { read(parameter, place, convert) }
}

/// Reads the double-precision values of a parameter of the current device.
///
/// # Safety
/// The pointer is null or leads to as many values as the parameter has.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdGetDoublev(parameter: c_uint, place: *mut c_double) {
    // SAFETY: by the contract of this function.
    unsafe { read(parameter, place, |values, index| values.read(Kind::Real, index).map(Reading::as_real)) }
}

/// Returns a text, never null; texts of the interface are valid before any device is open.
#[unsafe(no_mangle)]
pub extern "C" fn hdGetString(parameter: c_uint) -> *const c_char {
    let nothing = c"".as_ptr();
    guarded(nothing, || match device::text(parameter) {
        Ok(text) => text.as_ptr(),
        Err(code) => {
            raise(code, CURRENT.get());
            nothing
        }
    })
}

/// Sets a parameter of the current device from values of the program.
///
/// # Safety
/// `place` is null or as many values may be read as the parameter has.
unsafe fn write<T: Copy>(parameter: c_uint, kind: Kind, place: *const T, convert: impl Fn(T) -> f64) {
    guarded((), || {
        let set = || {
            let count = parameter::settable(parameter, kind)?;
            let mut values = [0.0; 6];
            for (index, value) in values.iter_mut().enumerate().take(count) {
                // SAFETY: by the contract of this function; nothing is added to null.
                let read = (!place.is_null()).then(|| unsafe { get(place.add(index)) }).flatten();
                *value = convert(read.ok_or(Code::InvalidValue)?);
            }
            Devices::with_current(|device| device.set(parameter, values)).and_then(|set| set)
        };
        set().unwrap_or_else(|code| raise(code, CURRENT.get()));
    });
}

/// Sets the boolean values of a parameter of the current device.
///
/// # Safety
/// The pointer is null or leads to as many values as the parameter has.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdSetBooleanv(parameter: c_uint, place: *const c_uchar) {
    // SAFETY: by the contract of this function.
    unsafe { write(parameter, Kind::Boolean, place, f64::from) }
}

/// Sets the integer values of a parameter of the current device.
///
/// # Safety
/// The pointer is null or leads to as many values as the parameter has.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdSetIntegerv(parameter: c_uint, place: *const c_int) {
    // SAFETY: by the contract of this function.
    unsafe { write(parameter, Kind::Integer, place, f64::from) }
}

/// Sets the long integer values of a parameter of the current device.
///
/// # Safety
/// The pointer is null or leads to as many values as the parameter has.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdSetLongv(parameter: c_uint, place: *const c_long) {
    // SAFETY: by the contract of this function.
    unsafe { write(parameter, Kind::Long, place, |value| value as f64) }
}

/// Sets the single-precision values of a parameter of the current device.
///
/// # Safety
/// The pointer is null or leads to as many values as the parameter has.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdSetFloatv(parameter: c_uint, place: *const c_float) {
    // SAFETY: by the contract of this function.
    unsafe { write(parameter, Kind::Real, place, f64::from) }
}

/// Sets the double-precision values of a parameter of the current device.
///
/// # Safety
/// The pointer is null or leads to as many values as the parameter has.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdSetDoublev(parameter: c_uint, place: *const c_double) {
    // SAFETY: by the contract of this function.
    unsafe { write(parameter, Kind::Real, place, |value| value) }
}

/// Enables a capability of the current device.
#[unsafe(no_mangle)]
pub extern "C" fn hdEnable(capability: c_uint) {
    guarded((), || switch(capability, true));
}

/// Disables a capability of the current device.
#[unsafe(no_mangle)]
pub extern "C" fn hdDisable(capability: c_uint) {
    guarded((), || switch(capability, false));
}

fn switch(capability: c_uint, on: bool) {
    let switched = Devices::with_current(|device| device.switch(capability, on)).and_then(|done| done);
    switched.unwrap_or_else(|code| raise(code, CURRENT.get()));
}

/// Returns whether a capability of the current device is enabled.
#[unsafe(no_mangle)]
pub extern "C" fn hdIsEnabled(capability: c_uint) -> c_uchar {
    guarded(0, || {
        let is_on = Devices::with_current(|device| device.is_on(capability)).and_then(|is_on| is_on);
        is_on.map_or_else(
            |code| {
                raise(code, CURRENT.get());
                0
            },
            c_uchar::from,
        )
    })
}

// ---------------------------------------------------------------- errors

/// Pops the newest error of the calling thread.
#[unsafe(no_mangle)]
pub extern "C" fn hdGetError() -> ErrorInfo {
    error::take()
}

/// Returns the text of an error number, never null.
#[unsafe(no_mangle)]
pub extern "C" fn hdGetErrorString(code: c_uint) -> *const c_char {
    error::words(code).as_ptr()
}

// ---------------------------------------------------------------- calibration

/// Returns "calibrated" always, because programs wait for it.
#[unsafe(no_mangle)]
pub extern "C" fn hdCheckCalibration() -> c_uint {
    CALIBRATED
}

/// Returns "calibrated" always, as [`hdCheckCalibration`].
#[unsafe(no_mangle)]
pub extern "C" fn hdCheckCalibrationStyle() -> c_uint {
    CALIBRATED
}

/// Does nothing: there is nothing to calibrate.
#[unsafe(no_mangle)]
pub extern "C" fn hdUpdateCalibration(_style: c_uint) {}

/// Does nothing: there is nothing to calibrate.
#[unsafe(no_mangle)]
pub extern "C" fn hdUpdateCalibrationMessage(_style: c_uint) {}

// ---------------------------------------------------------------- scheduler

/// Starts the scheduler, and with it the enabled force.
#[unsafe(no_mangle)]
pub extern "C" fn hdStartScheduler() {
    guarded((), || {
        if !Scheduler::start() {
            raise(Code::TimerError, CURRENT.get());
        }
    });
}

/// Stops the scheduler and waits for its end: no callback is called afterwards.
#[unsafe(no_mangle)]
pub extern "C" fn hdStopScheduler() {
    guarded((), Scheduler::stop);
}

/// Sets the rate of the scheduler, 1000 or 500 Hz.
#[unsafe(no_mangle)]
pub extern "C" fn hdSetSchedulerRate(rate_hz: c_ulong) {
    guarded((), || {
        if !Scheduler::set_rate(rate_hz) {
            raise(Code::InvalidValue, CURRENT.get());
        }
    });
}

/// Schedules a callback, called in every tick until it returns 0; higher priority first.
///
/// # Safety
/// `callback` may be called with `data` from another thread until it returned 0 or was taken out.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdScheduleAsynchronous(
    callback: Option<Callback>,
    data: *mut c_void,
    priority: c_ushort,
) -> c_ulong {
    guarded(c_ulong::MAX, || match callback {
        Some(callback) => {
            // SAFETY: by the contract of this function.
            let handle = unsafe { Scheduler::asynchronous(callback, data, priority) };
            handle.unwrap_or_else(|| {
                raise(Code::SchedulerFull, CURRENT.get());
                c_ulong::MAX
            })
        }
        None => {
            raise(Code::InvalidValue, CURRENT.get());
            c_ulong::MAX
        }
    })
}

/// Schedules a callback and returns once it has returned 0; without a running scheduler, or on its thread, calls it
/// directly.
///
/// # Safety
/// `callback` may be called with `data` from another thread until this returns.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdScheduleSynchronous(
    callback: Option<Callback>,
    data: *mut c_void,
    priority: c_ushort,
) {
    guarded((), || match callback {
        // SAFETY: by the contract of this function.
        Some(callback) => unsafe { Scheduler::synchronous(callback, data, priority) },
        None => raise(Code::InvalidValue, CURRENT.get()),
    });
}

/// Unschedules a callback.
#[unsafe(no_mangle)]
pub extern "C" fn hdUnschedule(handle: c_ulong) {
    guarded((), || {
        if !Scheduler::unschedule(handle) {
            raise(Code::InvalidOperation, CURRENT.get());
        }
    });
}

/// Returns whether a callback is still scheduled; with `how` = 1, waits for its end first.
#[unsafe(no_mangle)]
pub extern "C" fn hdWaitForCompletion(handle: c_ulong, how: c_uint) -> c_uchar {
    guarded(0, || c_uchar::from(Scheduler::is_scheduled(handle, how != 0)))
}

/// Returns the time since this tick began, s.
#[unsafe(no_mangle)]
pub extern "C" fn hdGetSchedulerTimeStamp() -> c_double {
    guarded(0.0, Scheduler::since_tick_s)
}

// ---------------------------------------------------------------- the rest

/// Does nothing: angles are not scaled.
#[unsafe(no_mangle)]
pub extern "C" fn hdScaleGimbalAngles(_x: c_double, _y: c_double, _z: c_double, _matrix: *mut c_double) {}

/// Returns success: no licence is required.
#[unsafe(no_mangle)]
pub extern "C" fn hdDeploymentLicense(
    _vendor: *const c_char,
    _application: *const c_char,
    _password: *const c_char,
) -> c_uchar {
    1
}
