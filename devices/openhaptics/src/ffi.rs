//! Functions of HDAPI used by the plugin, as declared by its public interface (version 3): names, numbers and types only.
//! `hdGetError` pops the last error from a stack. Parameters are those of the current device of the process.
//!
//! Pointers point to as many numbers as the parameter has, locals of the wrapper functions below, so that no pointer
//! outlives the call.
#![allow(unsafe_code)] // calls into the SDK; listed in tests/tests/system/architecture.rs

use flotor_vendor_sdk::{sdk_functions, static_text};
use std::ffi::{CStr, CString, c_char, c_double, c_int, c_uint, c_ulong, c_ushort, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// `HDErrorInfo`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub(crate) struct ErrorInfo {
    code: c_uint,
    internal: c_int,
    device: c_uint,
}

/// Client of the SDK's scheduler: the scheduler calls [`Self::step`] once per tick.
pub(crate) trait Client: Send + 'static {
    /// Runs a tick; returns true to be called again.
    fn step(&mut self) -> bool;

    /// Handles a panic of [`Self::step`]; returns true to be called again.
    fn break_off(&mut self) -> bool;
}

/// Callback of the scheduler: returns 1 to be called again, 0 to end.
type Callback = unsafe extern "C" fn(*mut c_void) -> c_uint;

/// Priority of a callback in the middle of the range.
const PRIORITY: c_ushort = 0x7FFF;

sdk_functions! {
    /// Function pointers of the loaded library.
    pub(crate) struct Functions needs "OpenHaptics 3.0" {
        fn hdGetString(c_uint) -> *const c_char;
        fn hdInitDevice(*const c_char) -> c_uint;
        fn hdGetDoublev(c_uint, *mut c_double);
        fn hdGetIntegerv(c_uint, *mut c_int);
        fn hdSetDoublev(c_uint, *const c_double);
        fn hdGetError() -> ErrorInfo;
        fn hdGetErrorString(c_uint) -> *const c_char;
        fn hdStopScheduler();
        fn hdScheduleAsynchronous(Callback, *mut c_void, c_ushort) -> c_ulong;
        fn hdUnschedule(c_ulong);
        safe fn close = hdDisableDevice(handle: c_uint);
        safe fn make_current = hdMakeCurrentDevice(handle: c_uint);
        safe fn begin_frame = hdBeginFrame(handle: c_uint);
        safe fn end_frame = hdEndFrame(handle: c_uint);
        safe fn enable = hdEnable(capability: c_uint);
        safe fn disable = hdDisable(capability: c_uint);
        safe fn check_calibration = hdCheckCalibration() -> c_uint;
        safe fn update_calibration = hdUpdateCalibration(style: c_uint);
        safe fn start_scheduler = hdStartScheduler();
    }
}

/// Safe wrappers: each call passes numbers, and pointers to its own locals.
impl Functions {
    /// Returns the value of a string parameter of the SDK or of the current device (`hdGetString`); empty if the SDK returns null.
    pub(crate) fn text(&self, parameter: c_uint) -> String {
        // SAFETY: any number is legal; the text is static, or null.
        unsafe { static_text((self.hdGetString)(parameter)) }
    }

    /// Opens the device with a name, or the default device, and makes it the current one.
    pub(crate) fn init(&self, name: Option<&CStr>) -> c_uint {
        // SAFETY: null, or a text that lives for the call.
        unsafe { (self.hdInitDevice)(name.map_or(std::ptr::null(), CStr::as_ptr)) }
    }

    /// Reads the `N` values of a parameter of the current device.
    pub(crate) fn numbers<const N: usize>(&self, parameter: Numbers<N>) -> [f64; N] {
        let mut numbers = [0.0; N];
        // SAFETY: as many places as the parameter has numbers, by its type.
        unsafe { (self.hdGetDoublev)(parameter.0, numbers.as_mut_ptr()) };
        numbers
    }

    /// Reads the first value of an integer parameter.
    pub(crate) fn whole(&self, parameter: c_uint) -> c_int {
        let mut places = [0; 6];
        // SAFETY: no parameter of whole numbers has more than six.
        unsafe { (self.hdGetIntegerv)(parameter, places.as_mut_ptr()) };
        places[0]
    }

    pub(crate) fn set(&self, parameter: Numbers<3>, numbers: [f64; 3]) {
        // SAFETY: as many numbers as the parameter has, by its type.
        unsafe { (self.hdSetDoublev)(parameter.0, numbers.as_ptr()) }
    }

    /// Pops the last error of this thread; 0 if there is none.
    pub(crate) fn take_error(&self) -> c_uint {
        // SAFETY: a function without preconditions.
        unsafe { (self.hdGetError)() }.code
    }

    pub(crate) fn words(&self, code: c_uint) -> String {
        // SAFETY: any number is legal; the words are a static text, or null.
        unsafe { static_text((self.hdGetErrorString)(code)) }
    }

    pub(crate) fn stop_scheduler(&self) -> Stopped {
        // SAFETY: a function without preconditions.
        unsafe { (self.hdStopScheduler)() }
        Stopped(())
    }

    /// Schedules a client, which is then called once per tick until it is unscheduled.
    pub(crate) fn schedule<C: Client>(&self, client: Box<C>) -> Scheduled<C> {
        let data = Box::into_raw(client);
        // SAFETY: `data` stays valid until `free`, before which the scheduler has ended.
        let handle = unsafe { (self.hdScheduleAsynchronous)(called::<C>, data.cast(), PRIORITY) };
        Scheduled { handle, data }
    }

    /// Unschedules a client. A call of the client may still be in progress.
    pub(crate) fn unschedule<C>(&self, scheduled: &Scheduled<C>) {
        // SAFETY: any handle is legal; one that is not in is an error of the SDK.
        unsafe { (self.hdUnschedule)(scheduled.handle) };
    }
}

/// Id of a parameter with `N` values.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Numbers<const N: usize>(c_uint);

/// Parameters by their numbers in the interface.
pub(crate) const TRANSFORM: Numbers<16> = Numbers(0x2052);
pub(crate) const VELOCITY: Numbers<3> = Numbers(0x2051);
pub(crate) const ANGULAR_VELOCITY: Numbers<3> = Numbers(0x2053);
pub(crate) const LAST_FORCE: Numbers<3> = Numbers(0x2800);
pub(crate) const LAST_TORQUE: Numbers<3> = Numbers(0x2801);
pub(crate) const FORCE: Numbers<3> = Numbers(0x2700);
pub(crate) const TORQUE: Numbers<3> = Numbers(0x2701);
pub(crate) const USABLE_WORKSPACE: Numbers<6> = Numbers(0x2551);
pub(crate) const MAX_STIFFNESS: Numbers<1> = Numbers(0x2602);
pub(crate) const MAX_FORCE: Numbers<1> = Numbers(0x2603);
pub(crate) const MAX_TORQUE: Numbers<1> = Numbers(0x2622);

/// Proof that the scheduler has ended and calls no client any more.
pub(crate) struct Stopped(());

/// Client in the SDK's scheduler: handle and callback data.
pub(crate) struct Scheduled<C> {
    handle: c_ulong,
    data: *mut C,
}

impl<C> Scheduled<C> {
    /// Returns whether the SDK accepted the client.
    pub(crate) fn is_in(&self) -> bool {
        // The interface's invalid handle, in 32 or 64 bits.
        self.handle != 0xFFFF_FFFF && self.handle != c_ulong::MAX
    }

    /// Frees a client; the caller has unscheduled it before the scheduler ended.
    pub(crate) fn free(self, _stopped: &Stopped) {
        // SAFETY: the box of `schedule`, taken back once: nobody calls it any more.
        drop(unsafe { Box::from_raw(self.data) });
    }
}

// SAFETY: the pointer is only handed to `free`; the client behind the pointer may be used from any thread.
unsafe impl<C: Send> Send for Scheduled<C> {}

/// Runs a tick of a client; the callback of every client.
unsafe extern "C" fn called<C: Client>(data: *mut c_void) -> c_uint {
    // SAFETY: the data of `schedule`: a client that lives until it is taken out, and that only the scheduler uses.
    let client = unsafe { &mut *data.cast::<C>() };
    // No panic may unwind into the SDK.
    let goes_on = catch_unwind(AssertUnwindSafe(|| client.step()));
    c_uint::from(goes_on.unwrap_or_else(|_| client.break_off()))
}

/// Converts a device name to a C string; `None` if it contains a null character.
pub(crate) fn name_of(text: &str) -> Option<CString> {
    CString::new(text).ok()
}
