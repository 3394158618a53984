//! Drop-in `libhdPhantom.so`: the fourteen functions by which CHAI3D reaches a Phantom, served by the devices of a Flotor scene.
//!
//! Lengths in m, forces in N, torques in N·m; x towards the user, y right, z up. Every function may be called from any thread.
//! A result of 0 is success, -1 an invalid number or a device that is not open. Functions that set a force wait for the next
//! tick, because CHAI3D's loop has no other pace. CHAI3D opens and closes each device twice before the program does, so opening
//! causes no motion, and force begins to fade in with the first command.
//!
//! Source: the interface as CHAI3D's own loader uses it (BSD-3), names and numbers only.
#![allow(unsafe_code)] // C entry points; listed in tests/tests/system/architecture.rs
#![allow(non_snake_case)] // the names are another maker's

use flotor_compat::pointer::{get, put, put_all, put_text};
use flotor_compat::{Frame, Host, MARKER, Station, env_value, guarded, host};
use flotor_hal::{DVec3, Wrench};
use std::ffi::{c_char, c_int};
use std::sync::Mutex;
use std::sync::PoisonError;
use std::sync::atomic::{AtomicBool, Ordering};

const FRAME: Frame = Frame::TowardsRightUp;
const DONE: c_int = 0;
const FAILED: c_int = -1;
/// Size of the caller's buffer for a name, bytes.
const NAME_BYTES: usize = 255;
/// Limit on the number of devices.
const MOST: usize = 16;

/// Last command of each device: force and torque may be set separately.
static HELD: [Mutex<Wrench>; MOST] = [const { Mutex::new(Wrench::ZERO) }; MOST];
/// True if a further torque of the device must wait, because one was set since the last force.
static TORQUE_WAITS: [AtomicBool; MOST] = [const { AtomicBool::new(false) }; MOST];

/// Returns the marker of a drop-in library.
#[unsafe(no_mangle)]
pub extern "C" fn flotor_dropin() -> *const c_char {
    MARKER.as_ptr().cast()
}

fn station(id: c_int) -> Option<(&'static Host, &'static Station, usize)> {
    let number = usize::try_from(id).ok().filter(|number| *number < MOST)?;
    let host = host()?;
    Some((host, host.station(number)?, number))
}

/// Returns the station if it is open.
fn open(id: c_int) -> Option<(&'static Host, &'static Station, usize)> {
    station(id).filter(|(_, station, _)| station.is_open())
}

/// Returns the station for a read, which is counted, if it is open.
fn sampled(id: c_int) -> Option<&'static Station> {
    let (host, station, _) = open(id)?;
    host.note_read(|| ());
    Some(station)
}

/// Returns the success value of `hdPhantomGetPosition` and `hdPhantomClose`: CHAI3D takes 0 for failure there, the original returns 0.
fn done_for_chai3d() -> c_int {
    c_int::from(env_value("FLOTOR_PHANTOM_SUCCESS").is_some_and(|value| value == "1"))
}

/// Returns the number of devices.
#[unsafe(no_mangle)]
pub extern "C" fn hdPhantomGetNumDevices() -> c_int {
    let count = || host().map_or(0, |host| host.stations().len().min(MOST));
    guarded(0, || c_int::try_from(count()).unwrap_or(0))
}

/// Opens a device; returns its number, -1 on failure.
#[unsafe(no_mangle)]
pub extern "C" fn hdPhantomOpen(id: c_int) -> c_int {
    guarded(FAILED, || {
        let Some((host, _, number)) = station(id) else { return FAILED };
        if host.open(number) { id } else { FAILED }
    })
}

/// Closes a device; its force ends with the next tick.
#[unsafe(no_mangle)]
pub extern "C" fn hdPhantomClose(id: c_int) -> c_int {
    guarded(FAILED, || {
        let Some((_, station, number)) = station(id) else { return FAILED };
        set_held(number, |held| *held = Wrench::ZERO);
        if station.close() { done_for_chai3d() } else { FAILED }
    })
}

fn set_held(number: usize, change: impl FnOnce(&mut Wrench)) -> Wrench {
    let Some(held) = HELD.get(number) else { return Wrench::ZERO };
    let mut held = held.lock().unwrap_or_else(PoisonError::into_inner);
    change(&mut held);
    *held
}

/// Writes a vector of an open device to three places.
///
/// # Safety
/// Each place is null or may be written.
unsafe fn vector(id: c_int, places: [*mut f64; 3], of: impl FnOnce(&Station) -> DVec3) -> Option<()> {
    let station = sampled(id)?;
    let values = FRAME.of_flotor(of(station)).to_array();
    for (place, value) in places.into_iter().zip(values) {
        // SAFETY: by the contract of this function.
        unsafe { put(place, value) };
    }
    Some(())
}

/// Reads the position, m.
///
/// # Safety
/// Each pointer is null or may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdPhantomGetPosition(id: c_int, x: *mut f64, y: *mut f64, z: *mut f64) -> c_int {
    guarded(FAILED, || {
        // SAFETY: by the contract of this function.
        let written = unsafe { vector(id, [x, y, z], |station| station.state().position_m) };
        written.map_or(FAILED, |()| done_for_chai3d())
    })
}

/// Reads the velocity, m/s.
///
/// # Safety
/// Each pointer is null or may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdPhantomGetLinearVelocity(
    id: c_int,
    x: *mut f64,
    y: *mut f64,
    z: *mut f64,
) -> c_int {
    guarded(FAILED, || {
        // SAFETY: by the contract of this function.
        let written = unsafe { vector(id, [x, y, z], |station| station.state().velocity_m_per_s) };
        written.map_or(FAILED, |()| DONE)
    })
}

/// Reads the rotation matrix, by rows.
///
/// # Safety
/// Each pointer is null or may be written.
#[unsafe(no_mangle)]
#[allow(clippy::too_many_arguments)] // as the interface has it
pub unsafe extern "C" fn hdPhantomGetRotation(
    id: c_int,
    r00: *mut f64,
    r01: *mut f64,
    r02: *mut f64,
    r10: *mut f64,
    r11: *mut f64,
    r12: *mut f64,
    r20: *mut f64,
    r21: *mut f64,
    r22: *mut f64,
) -> c_int {
    guarded(FAILED, || {
        let Some(station) = sampled(id) else { return FAILED };
        let rows = FRAME.rotation(station.state().orientation);
        let places = [r00, r01, r02, r10, r11, r12, r20, r21, r22];
        for (place, value) in places.into_iter().zip(rows.into_iter().flatten()) {
            // SAFETY: by the contract of this function.
            unsafe { put(place, value) };
        }
        DONE
    })
}

/// Returns the buttons, one bit each; 0 if the device is not open.
#[unsafe(no_mangle)]
pub extern "C" fn hdPhantomGetButtons(id: c_int) -> c_int {
    guarded(0, || sampled(id).map_or(0, |station| station.state().buttons.cast_signed()))
}

/// Changes the stored command and sends it; with `waits`, waits for a tick.
fn send(id: c_int, waits: bool, change: impl FnOnce(&mut Wrench)) -> c_int {
    let Some((host, station, number)) = open(id) else { return FAILED };
    let before = set_held(number, |_| ());
    let held = set_held(number, change);
    let is_taken = station.command(&held, host.now_ns()).is_ok();
    if is_taken {
        station.enable();
    } else {
        set_held(number, |held| *held = before);
    }
    // A rejected command waits too: a program that retries must not loop faster for it.
    if waits {
        host.wait(station);
    }
    if is_taken && host.is_running() { DONE } else { FAILED }
}

fn in_flotor(components: [Option<f64>; 3]) -> Option<[f64; 3]> {
    let [x, y, z] = components;
    Some(FRAME.to_flotor(DVec3::new(x?, y?, z?)).to_array())
}

/// Sets the force on the hand, N; waits for the next tick.
///
/// # Safety
/// Each pointer is null or may be read.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdPhantomSetForce(id: c_int, x: *const f64, y: *const f64, z: *const f64) -> c_int {
    guarded(FAILED, || {
        // SAFETY: by the contract of this function.
        let Some(force_n) = in_flotor([x, y, z].map(|place| unsafe { get(place) })) else { return FAILED };
        TORQUE_WAITS
            .get(usize::try_from(id).unwrap_or(MOST))
            .inspect(|waits| waits.store(false, Ordering::Relaxed));
        send(id, true, |held| held.force_n = force_n)
    })
}

/// Sets the torque on the hand, N·m. Does not wait directly after a force: both belong to one tick.
///
/// # Safety
/// Each pointer is null or may be read.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdPhantomSetTorque(id: c_int, x: *const f64, y: *const f64, z: *const f64) -> c_int {
    guarded(FAILED, || {
        // SAFETY: by the contract of this function.
        let Some(torque_nm) = in_flotor([x, y, z].map(|place| unsafe { get(place) })) else { return FAILED };
        let waits = TORQUE_WAITS.get(usize::try_from(id).unwrap_or(MOST));
        let waits = waits.is_some_and(|waits| waits.swap(true, Ordering::Relaxed));
        send(id, waits, |held| held.torque_nm = torque_nm)
    })
}

/// Sets force, N, and torque, N·m, on the hand; waits for the next tick.
///
/// # Safety
/// Each pointer is null or may be read.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdPhantomSetForceAndTorque(
    id: c_int,
    fx: *const f64,
    fy: *const f64,
    fz: *const f64,
    tx: *const f64,
    ty: *const f64,
    tz: *const f64,
) -> c_int {
    guarded(FAILED, || {
        // SAFETY: by the contract of this function.
        let [force_n, torque_nm] =
            [[fx, fy, fz], [tx, ty, tz]].map(|places| in_flotor(places.map(|place| unsafe { get(place) })));
        let (Some(force_n), Some(torque_nm)) = (force_n, torque_nm) else { return FAILED };
        send(id, true, |held| *held = Wrench { force_n, torque_nm })
    })
}

/// Reads the radius of the workspace, m; valid before the device is open.
///
/// # Safety
/// The pointer is null or may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdPhantomGetWorkspaceRadius(id: c_int, radius: *mut f64) -> c_int {
    guarded(FAILED, || {
        let Some((_, station, _)) = station(id) else { return FAILED };
        // SAFETY: by the contract of this function.
        unsafe { put(radius, station.range_m().max_element()) };
        DONE
    })
}

/// Reads the name of the device; valid before the device is open. `FLOTOR_PHANTOM_TYPE` replaces it: CHAI3D gives torque only
/// to `PHANTOM Premium 3.0 6DOF`.
///
/// # Safety
/// The pointer is null or 255 bytes may be written from there on.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdPhantomGetType(id: c_int, name: *mut c_char) -> c_int {
    // The caller's buffer is not initialised.
    // SAFETY: by the contract of this function.
    unsafe { put_all(name, &[0]) };
    guarded(FAILED, || {
        let Some((_, station, _)) = station(id) else { return FAILED };
        let configured =
            env_value("FLOTOR_PHANTOM_TYPE").unwrap_or_else(|| format!("Flotor {}", station.plugin()));
        // SAFETY: by the contract of this function.
        unsafe { put_text(name, &configured, NAME_BYTES) };
        DONE
    })
}

/// Does nothing: the loop begins with the first open device.
#[unsafe(no_mangle)]
pub extern "C" fn hdPhantomStartServo() {}

/// Disables the devices that are not open, whose force is zero already.
#[unsafe(no_mangle)]
pub extern "C" fn hdPhantomStopServo() {
    guarded((), || {
        let stations = host().map_or(&[][..], Host::stations);
        stations.iter().filter(|station| !station.is_open()).for_each(Station::disable);
    });
}
