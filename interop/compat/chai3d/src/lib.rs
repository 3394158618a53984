//! Drop-in `libhdPhantom.so`: the fourteen functions through which CHAI3D accesses a Phantom, served by the devices of a scene.
//!
//! Lengths in m, forces in N, torques in N·m; x towards the user, y right, z up. Every function may be called from any thread.
//! A result of 0 is success, -1 a failure: an invalid number, a device that is not open, a rejected command, or an ended run.
//! Functions that set a force wait for the next tick, because nothing else paces CHAI3D's loop. CHAI3D opens and closes each
//! device twice before the program does, so opening causes no motion, and force begins to fade in with the first command.
//!
//! Source: the interface as CHAI3D's own loader uses it (BSD-3), names and numbers only.
#![allow(unsafe_code)] // C entry points; listed in tests/tests/system/architecture.rs
#![allow(non_snake_case)] // the names are another maker's

use flotor_compat::pointer::{In, Out};
use flotor_compat::{Frame, Host, MARKER, Station, env_value, export, host};
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
/// True if the next torque command of the device must wait for a tick, because a torque was set since the last force.
static TORQUE_WAITS: [AtomicBool; MOST] = [const { AtomicBool::new(false) }; MOST];

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

/// Returns the success value of `hdPhantomGetPosition` and `hdPhantomClose`: 0 as in the original library, or 1 if
/// `FLOTOR_PHANTOM_SUCCESS` is `1`, because CHAI3D treats a 0 of these functions as a failure.
fn done_for_chai3d() -> c_int {
    c_int::from(env_value("FLOTOR_PHANTOM_SUCCESS").is_some_and(|value| value == "1"))
}

fn set_held(number: usize, change: impl FnOnce(&mut Wrench)) -> Wrench {
    let Some(held) = HELD.get(number) else { return Wrench::ZERO };
    let mut held = held.lock().unwrap_or_else(PoisonError::into_inner);
    change(&mut held);
    *held
}

/// Writes a vector of an open device to three outputs; returns true if the device is open.
fn vector(id: c_int, places: [Out<f64>; 3], of: impl FnOnce(&Station) -> DVec3) -> bool {
    let station = sampled(id);
    let values = station.map(|station| FRAME.of_flotor(of(station)).to_array());
    places.into_iter().zip(values.into_iter().flatten()).for_each(|(place, value)| place.put(value));
    station.is_some()
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

fn in_flotor(components: [In<f64>; 3]) -> Option<[f64; 3]> {
    let [x, y, z] = components.map(In::get);
    Some(FRAME.to_flotor(DVec3::new(x?, y?, z?)).to_array())
}

export! {
    /// Returns the marker of a drop-in library.
    fn flotor_dropin() -> *const c_char [MARKER.as_ptr().cast()] { MARKER.as_ptr().cast() }
    /// Returns the number of devices.
    fn hdPhantomGetNumDevices() -> c_int [0] {
        c_int::try_from(host().map_or(0, |host| host.stations().len().min(MOST))).unwrap_or(0)
    }
    /// Opens a device; returns its number, -1 on failure.
    fn hdPhantomOpen(id: c_int) -> c_int [FAILED] {
        let Some((host, _, number)) = station(id) else { return FAILED };
        if host.open(number) { id } else { FAILED }
    }
    /// Closes a device; its force ends with the next tick.
    fn hdPhantomClose(id: c_int) -> c_int [FAILED] {
        let Some((_, station, number)) = station(id) else { return FAILED };
        set_held(number, |held| *held = Wrench::ZERO);
        if station.close() { done_for_chai3d() } else { FAILED }
    }
    /// Reads the position, m.
    fn hdPhantomGetPosition(id: c_int, x: Out<f64>, y: Out<f64>, z: Out<f64>) -> c_int [FAILED] {
        if vector(id, [x, y, z], |station| station.state().position_m) { done_for_chai3d() } else { FAILED }
    }
    /// Reads the velocity, m/s.
    fn hdPhantomGetLinearVelocity(id: c_int, x: Out<f64>, y: Out<f64>, z: Out<f64>) -> c_int [FAILED] {
        if vector(id, [x, y, z], |station| station.state().velocity_m_per_s) { DONE } else { FAILED }
    }
    /// Reads the rotation matrix, row-major.
    fn hdPhantomGetRotation(
        id: c_int,
        r00: Out<f64>,
        r01: Out<f64>,
        r02: Out<f64>,
        r10: Out<f64>,
        r11: Out<f64>,
        r12: Out<f64>,
        r20: Out<f64>,
        r21: Out<f64>,
        r22: Out<f64>,
    ) -> c_int [FAILED] {
        let Some(station) = sampled(id) else { return FAILED };
        let rows = FRAME.rotation(station.state().orientation);
        let places = [r00, r01, r02, r10, r11, r12, r20, r21, r22];
        places.into_iter().zip(rows.into_iter().flatten()).for_each(|(place, value)| place.put(value));
        DONE
    }
    /// Returns the buttons, one bit each; 0 if the device is not open.
    fn hdPhantomGetButtons(id: c_int) -> c_int [0] {
        sampled(id).map_or(0, |station| station.state().buttons.cast_signed())
    }
    /// Sets the force on the hand, N; waits for the next tick.
    fn hdPhantomSetForce(id: c_int, x: In<f64>, y: In<f64>, z: In<f64>) -> c_int [FAILED] {
        let Some(force_n) = in_flotor([x, y, z]) else { return FAILED };
        TORQUE_WAITS
            .get(usize::try_from(id).unwrap_or(MOST))
            .inspect(|waits| waits.store(false, Ordering::Relaxed));
        send(id, true, |held| held.force_n = force_n)
    }
    /// Sets the torque on the hand, N·m. Does not wait directly after a force: both belong to one tick.
    fn hdPhantomSetTorque(id: c_int, x: In<f64>, y: In<f64>, z: In<f64>) -> c_int [FAILED] {
        let Some(torque_nm) = in_flotor([x, y, z]) else { return FAILED };
        let waits = TORQUE_WAITS.get(usize::try_from(id).unwrap_or(MOST));
        let waits = waits.is_some_and(|waits| waits.swap(true, Ordering::Relaxed));
        send(id, waits, |held| held.torque_nm = torque_nm)
    }
    /// Sets force, N, and torque, N·m, on the hand; waits for the next tick.
    fn hdPhantomSetForceAndTorque(
        id: c_int,
        fx: In<f64>,
        fy: In<f64>,
        fz: In<f64>,
        tx: In<f64>,
        ty: In<f64>,
        tz: In<f64>,
    ) -> c_int [FAILED] {
        let (Some(force_n), Some(torque_nm)) = (in_flotor([fx, fy, fz]), in_flotor([tx, ty, tz])) else {
            return FAILED;
        };
        send(id, true, |held| *held = Wrench { force_n, torque_nm })
    }
    /// Reads the radius of the workspace, m; valid before the device is open.
    fn hdPhantomGetWorkspaceRadius(id: c_int, radius: Out<f64>) -> c_int [FAILED] {
        let Some((_, station, _)) = station(id) else { return FAILED };
        radius.put(station.range_m().max_element());
        DONE
    }
    /// Reads the name of the device, at most 255 bytes; valid before the device is open. `FLOTOR_PHANTOM_TYPE` replaces the name:
    /// CHAI3D sends torque only to a `PHANTOM Premium 3.0 6DOF`.
    fn hdPhantomGetType(id: c_int, name: Out<c_char>) -> c_int [FAILED] {
        // The caller's buffer is not initialised.
        name.put(0);
        let Some((_, station, _)) = station(id) else { return FAILED };
        let configured =
            env_value("FLOTOR_PHANTOM_TYPE").unwrap_or_else(|| format!("Flotor {}", station.plugin()));
        name.put_text(&configured, NAME_BYTES);
        DONE
    }
    /// Does nothing: the loop begins with the first open device.
    fn hdPhantomStartServo() -> () [()] {}
    /// Disables the devices that are not open, whose force is zero already.
    fn hdPhantomStopServo() -> () [()] {
        let stations = host().map_or(&[][..], Host::stations);
        stations.iter().filter(|station| !station.is_open()).for_each(Station::disable);
    }
}
