//! Functions of DHD and DRD used by the plugin, as declared by their public interface (version 3.17): names, numbers and types
//! only. All return `int`, 0 or a greater number for success and -1 for failure, unless the type says otherwise.
//!
//! Calls for a device take its id as the last argument. Pointers point to as many numbers as the call writes, locals of
//! the wrapper functions below, so that no pointer outlives the call.
#![allow(unsafe_code)] // calls into the SDK; listed in tests/tests/system/architecture.rs

use flotor_vendor_sdk::{sdk_functions, static_text};
use std::ffi::{c_char, c_double, c_int, c_uint, c_ushort};

/// C++ `bool` of the SDK, passed as a byte: any value but 0 is true.
type Truth = u8;

sdk_functions! {
    /// Function pointers of the loaded library.
    pub(crate) struct Functions needs "version 3.14 of the Force Dimension SDK" {
        fn dhdGetSDKVersion(*mut c_int, *mut c_int, *mut c_int, *mut c_int);
        fn dhdErrorGetLast() -> c_int;
        fn dhdErrorGetLastStr() -> *const c_char;
        fn dhdOpenID(i8) -> c_int;
        fn dhdClose(i8) -> c_int;
        fn dhdGetSystemName(i8) -> *const c_char;
        fn dhdGetSerialNumber(*mut c_ushort, i8) -> c_int;
        fn dhdHasWrist(i8) -> Truth;
        fn dhdHasActiveWrist(i8) -> Truth;
        fn dhdGetStatus(*mut c_int, i8) -> c_int;
        fn dhdEnableForce(u8, i8) -> c_int;
        fn dhdSetBrakes(c_int, i8) -> c_int;
        fn dhdSetGravityCompensation(c_int, i8) -> c_int;
        fn dhdConfigLinearVelocity(c_int, c_int, i8) -> c_int;
        fn dhdConfigAngularVelocity(c_int, c_int, i8) -> c_int;
        fn dhdEnableExpertMode() -> c_int;
        fn dhdDisableExpertMode() -> c_int;
        fn dhdSetWatchdog(u8, i8) -> c_int;
        fn dhdGetPositionAndOrientationFrame(*mut c_double, *mut c_double, *mut c_double, *mut c_double, i8) -> c_int;
        fn dhdGetLinearVelocity(*mut c_double, *mut c_double, *mut c_double, i8) -> c_int;
        fn dhdGetAngularVelocityRad(*mut c_double, *mut c_double, *mut c_double, i8) -> c_int;
        fn dhdHasGripper(i8) -> Truth;
        fn dhdHasActiveGripper(i8) -> Truth;
        fn dhdGetGripperGap(*mut c_double, i8) -> c_int;
        fn dhdGetGripperLinearVelocity(*mut c_double, i8) -> c_int;
        fn dhdGetForceAndTorqueAndGripperForce(
            *mut c_double, *mut c_double, *mut c_double, *mut c_double, *mut c_double, *mut c_double, *mut c_double, i8
        ) -> c_int;
        fn dhdSetForceAndTorqueAndGripperForce(
            c_double, c_double, c_double, c_double, c_double, c_double, c_double, i8
        ) -> c_int;
        safe fn device_count = dhdGetDeviceCount() -> c_int;
        safe fn system_type = dhdGetSystemType(id: i8) -> c_int;
        safe fn stop = dhdStop(id: i8) -> c_int;
        safe fn set_most_force = dhdSetMaxForce(most_n: c_double, id: i8) -> c_int;
        safe fn set_most_torque = dhdSetMaxTorque(most_nm: c_double, id: i8) -> c_int;
        safe fn buttons = dhdGetButtonMask(id: i8) -> c_uint;
        optional fn drdOpenID(i8) -> c_int;
        optional fn drdClose(i8) -> c_int;
        optional fn drdIsInitialized(i8) -> Truth;
        optional fn drdAutoInit(i8) -> c_int;
        optional fn drdStop(Truth, i8) -> c_int;
    }
}

/// Kind of the SDK's velocity estimator: with a window.
const WINDOWING: c_int = 0;
/// Buffer length for a status: 17 numbers in version 3.17, and a reserve for later versions.
pub(crate) const STATUS: usize = 64;

/// Safe wrappers: each call passes numbers, and pointers to its own locals.
impl Functions {
    /// Returns the version of the SDK: major, minor, release, revision.
    pub(crate) fn version(&self) -> [c_int; 4] {
        let mut version = [0; 4];
        let [major, minor, release, revision] = &mut version;
        // SAFETY: a function without preconditions; four places for a number each.
        unsafe { (self.dhdGetSDKVersion)(major, minor, release, revision) };
        version
    }

    /// Returns number and text of the last error of this thread.
    pub(crate) fn last_error(&self) -> (c_int, String) {
        // SAFETY: functions without preconditions; the words are a static text, or null.
        unsafe { ((self.dhdErrorGetLast)(), static_text((self.dhdErrorGetLastStr)())) }
    }

    pub(crate) fn open(&self, index: i8) -> c_int {
        // SAFETY: any index is legal; one without a device fails.
        unsafe { (self.drdOpenID.unwrap_or(self.dhdOpenID))(index) }
    }

    pub(crate) fn close(&self, id: i8) -> c_int {
        // SAFETY: any id is legal; nobody uses the device any more.
        unsafe { (self.drdClose.unwrap_or(self.dhdClose))(id) }
    }

    pub(crate) fn system_name(&self, id: i8) -> String {
        // SAFETY: any id is legal; the name is a static text, or null.
        unsafe { static_text((self.dhdGetSystemName)(id)) }
    }

    pub(crate) fn serial_number(&self, id: i8) -> (c_int, u16) {
        let mut serial = 0;
        // SAFETY: any id is legal; a place for the number.
        (unsafe { (self.dhdGetSerialNumber)(&raw mut serial, id) }, serial)
    }

    pub(crate) fn has_wrist(&self, id: i8) -> bool {
        // SAFETY: any id is legal.
        unsafe { (self.dhdHasWrist)(id) != 0 }
    }

    pub(crate) fn has_active_wrist(&self, id: i8) -> bool {
        // SAFETY: any id is legal.
        unsafe { (self.dhdHasActiveWrist)(id) != 0 }
    }

    pub(crate) fn has_gripper(&self, id: i8) -> bool {
        // SAFETY: any id is legal.
        unsafe { (self.dhdHasGripper)(id) != 0 }
    }

    pub(crate) fn has_active_gripper(&self, id: i8) -> bool {
        // SAFETY: any id is legal.
        unsafe { (self.dhdHasActiveGripper)(id) != 0 }
    }

    /// Reads the gap of the gripper, m.
    pub(crate) fn gripper_gap(&self, id: i8) -> (c_int, f64) {
        let mut gap = 0.0;
        // SAFETY: any id is legal; a place for the number.
        (unsafe { (self.dhdGetGripperGap)(&raw mut gap, id) }, gap)
    }

    /// Reads the velocity of the gap, m/s.
    pub(crate) fn gripper_velocity(&self, id: i8) -> (c_int, f64) {
        let mut velocity = 0.0;
        // SAFETY: any id is legal; a place for the number.
        (unsafe { (self.dhdGetGripperLinearVelocity)(&raw mut velocity, id) }, velocity)
    }

    pub(crate) fn status(&self, id: i8) -> (c_int, [c_int; STATUS]) {
        let mut status = [0; STATUS];
        // SAFETY: any id is legal; more places than a status has numbers.
        (unsafe { (self.dhdGetStatus)(status.as_mut_ptr(), id) }, status)
    }

    /// Returns whether the device is initialised; `None` if the library has no such function.
    pub(crate) fn is_initialized(&self, id: i8) -> Option<bool> {
        // SAFETY: any id is legal.
        self.drdIsInitialized.map(|is_initialized| unsafe { is_initialized(id) != 0 })
    }

    /// Initialises the device by moving its arm, for seconds; `None` if the library has no such function.
    pub(crate) fn auto_init(&self, id: i8) -> Option<c_int> {
        // SAFETY: any id is legal.
        self.drdAutoInit.map(|auto_init| unsafe { auto_init(id) })
    }

    /// Ends the regulation of the arm; force may stay enabled. Returns 0 if the library has no such function.
    pub(crate) fn stop_regulation(&self, id: i8) -> c_int {
        // SAFETY: any id is legal.
        self.drdStop.map_or(0, |stop| unsafe { stop(1, id) })
    }

    pub(crate) fn enable_force(&self, on: bool, id: i8) -> c_int {
        // SAFETY: any id is legal.
        unsafe { (self.dhdEnableForce)(u8::from(on), id) }
    }

    pub(crate) fn set_brakes(&self, on: bool, id: i8) -> c_int {
        // SAFETY: any id is legal.
        unsafe { (self.dhdSetBrakes)(c_int::from(on), id) }
    }

    pub(crate) fn set_gravity_compensation(&self, on: bool, id: i8) -> c_int {
        // SAFETY: any id is legal.
        unsafe { (self.dhdSetGravityCompensation)(c_int::from(on), id) }
    }

    /// Sets the window of the estimate of the linear velocity, ms.
    pub(crate) fn config_velocity(&self, window_ms: c_int, id: i8) -> c_int {
        // SAFETY: any id is legal.
        unsafe { (self.dhdConfigLinearVelocity)(window_ms, WINDOWING, id) }
    }

    /// Sets the window of the estimate of the angular velocity, ms.
    pub(crate) fn config_angular_velocity(&self, window_ms: c_int, id: i8) -> c_int {
        // SAFETY: any id is legal.
        unsafe { (self.dhdConfigAngularVelocity)(window_ms, WINDOWING, id) }
    }

    /// Sets the watchdog, which removes the force after this time without a command, in units of 125 µs.
    pub(crate) fn set_watchdog(&self, units: u8, id: i8) -> c_int {
        // SAFETY: any id is legal. Expert mode belongs to the process, and lasts for this call only.
        unsafe {
            (self.dhdEnableExpertMode)();
            let code = (self.dhdSetWatchdog)(units, id);
            (self.dhdDisableExpertMode)();
            code
        }
    }

    /// Reads the position, m, and the rotation matrix, by rows.
    pub(crate) fn pose(&self, id: i8) -> (c_int, [f64; 3], [[f64; 3]; 3]) {
        let (mut position, mut rows) = ([0.0; 3], [[0.0; 3]; 3]);
        let [x, y, z] = &mut position;
        // SAFETY: any id is legal; three places, and nine of a matrix that lie one after the other.
        let code = unsafe { (self.dhdGetPositionAndOrientationFrame)(x, y, z, rows.as_mut_ptr().cast(), id) };
        (code, position, rows)
    }

    pub(crate) fn linear_velocity(&self, id: i8) -> (c_int, [f64; 3]) {
        let mut velocity = [0.0; 3];
        let [x, y, z] = &mut velocity;
        // SAFETY: any id is legal; three places.
        (unsafe { (self.dhdGetLinearVelocity)(x, y, z, id) }, velocity)
    }

    pub(crate) fn angular_velocity(&self, id: i8) -> (c_int, [f64; 3]) {
        let mut velocity = [0.0; 3];
        let [x, y, z] = &mut velocity;
        // SAFETY: any id is legal; three places.
        (unsafe { (self.dhdGetAngularVelocityRad)(x, y, z, id) }, velocity)
    }

    /// Reads force, N, torque, N·m, and force of the gripper, N.
    pub(crate) fn forces(&self, id: i8) -> (c_int, [f64; 3], [f64; 3], f64) {
        let (mut force, mut torque, mut gripper) = ([0.0; 3], [0.0; 3], 0.0);
        let ([x, y, z], [a, b, g]) = (&mut force, &mut torque);
        // SAFETY: any id is legal; seven places.
        let code =
            unsafe { (self.dhdGetForceAndTorqueAndGripperForce)(x, y, z, a, b, g, &raw mut gripper, id) };
        (code, force, torque, gripper)
    }

    /// Sets force, N, torque, N·m, and force of the gripper, N; waits for the exchange with the device.
    pub(crate) fn set_forces(&self, force: [f64; 3], torque: [f64; 3], gripper: f64, id: i8) -> c_int {
        let ([x, y, z], [a, b, g]) = (force, torque);
        // SAFETY: any id is legal.
        unsafe { (self.dhdSetForceAndTorqueAndGripperForce)(x, y, z, a, b, g, gripper, id) }
    }
}
