//! DHD device as presented to the program: settings of the program, and last command.

use crate::error::Code;
use crate::gripper;
use crate::regulation::Regulation;
use flotor_compat::{Axes, Frame, Host, Language, Station, env_value, host, language, length};
use flotor_hal::{DVec3, Wrench, math};
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

pub(crate) const FRAME: Frame = Frame::TowardsRightUp;
/// Limit on the number of devices; an id is the number of the device.
pub(crate) const MOST: usize = 16;

/// Default device, with id -1; -1: none.
static DEFAULT: AtomicI32 = AtomicI32::new(-1);
/// Expert mode of the process.
static EXPERT: AtomicBool = AtomicBool::new(false);
static DEVICES: [Mutex<Device>; MOST] = [const { Mutex::new(Device::NEW) }; MOST];

/// Force switch of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Switch {
    /// Not set: the first command enables force.
    Unsaid,
    On,
    Off,
}

/// Settings and last command of the program.
pub(crate) struct Device {
    pub(crate) switch: Switch,
    /// Last command, in the axes of the interface: N and N·m.
    pub(crate) force_n: DVec3,
    pub(crate) torque_nm: DVec3,
    /// Last commanded force of the gripper, N.
    pub(crate) gripper_n: f64,
    /// Limits of the program: N, N·m, gripper N; negative: none.
    pub(crate) most: [f64; 3],
    pub(crate) vibration: [f64; 2],
    pub(crate) mass_kg: f64,
    pub(crate) gravity: bool,
    pub(crate) brakes: bool,
    pub(crate) watchdog: u8,
    /// Count of expired wrenches when force was last enabled.
    pub(crate) lapses: u64,
    pub(crate) has_been_stopped: bool,
    /// Time at which the fade-in ends, ns.
    pub(crate) faded_in_ns: u64,
    pub(crate) velocity_threshold: u32,
    /// Angles of the base about x and about z, and angle of the device, rad.
    pub(crate) angles_rad: [f64; 3],
    pub(crate) parameters: [[f64; 3]; 8],
    pub(crate) gains: [f64; 4],
    pub(crate) priorities: [i32; 2],
    pub(crate) filters: bool,
    pub(crate) regulation: Regulation,
}

impl Device {
    const NEW: Self = Self {
        switch: Switch::Unsaid,
        force_n: DVec3::ZERO,
        torque_nm: DVec3::ZERO,
        gripper_n: 0.0,
        most: [-1.0; 3],
        vibration: [0.0; 2],
        mass_kg: 0.1,
        gravity: true,
        brakes: true,
        watchdog: 0,
        lapses: 0,
        has_been_stopped: false,
        faded_in_ns: 0,
        velocity_threshold: 0,
        angles_rad: [0.0; 3],
        parameters: [[1.0, 0.2, 10.0]; 8],
        gains: [0.0, 0.0, 0.0, 1.0],
        priorities: [0, 0],
        filters: false,
        regulation: Regulation::OFF,
    };
}

/// Device selected by an id, with its station.
pub(crate) struct Open {
    pub(crate) host: &'static Host,
    pub(crate) station: &'static Station,
    pub(crate) number: usize,
}

impl Open {
    /// Locks the settings of the program.
    pub(crate) fn device(&self) -> MutexGuard<'static, Device> {
        device(self.number)
    }
}

fn device(number: usize) -> MutexGuard<'static, Device> {
    // The number was checked before; the first device is an unreachable fallback.
    let device = DEVICES.get(number).unwrap_or(&DEVICES[0]);
    device.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the device of an id, open or not; a negative id selects the default device.
pub(crate) fn any(id: i8) -> Result<Open, Code> {
    let number = if id < 0 { DEFAULT.load(Ordering::Acquire) } else { i32::from(id) };
    let number = usize::try_from(number).ok().filter(|number| *number < MOST).ok_or(Code::NoDevice)?;
    let host = host().ok_or(Code::NoDevice)?;
    let station = host.station(number).ok_or(Code::NoDevice)?;
    Ok(Open { host, station, number })
}

/// Returns the device of an id, if open.
pub(crate) fn open(id: i8) -> Result<Open, Code> {
    any(id).and_then(|open| if open.station.is_open() { Ok(open) } else { Err(Code::NoDevice) })
}

/// Returns the device of an id, if open and not lost.
pub(crate) fn live(id: i8) -> Result<Open, Code> {
    open(id).and_then(|open| if open.host.is_running() { Ok(open) } else { Err(Code::Com) })
}

/// Returns the device of an id, if open and not lost, in expert mode.
pub(crate) fn expert(id: i8) -> Result<Open, Code> {
    if EXPERT.load(Ordering::Acquire) { live(id) } else { Err(Code::ExpertModeDisabled) }
}

pub(crate) fn set_expert(on: bool) {
    EXPERT.store(on, Ordering::Release);
}

/// Returns the number of devices.
pub(crate) fn count() -> usize {
    host().map_or(0, |host| host.stations().len().min(MOST))
}

/// Opens a device and makes it the default device; returns its id.
pub(crate) fn open_number(number: usize) -> Result<i32, Code> {
    let host = host().filter(|_| number < count()).ok_or(Code::NoDevice)?;
    let id = i32::try_from(number).map_err(|_| Code::NoDevice)?;
    let was_open = host.station(number).is_some_and(Station::is_open);
    if !was_open {
        if !host.open(number) {
            return Err(Code::NoDevice);
        }
        *device(number) = Device::NEW;
    }
    DEFAULT.store(id, Ordering::Release);
    Ok(id)
}

/// Opens the first device that is not open and satisfies `fits`.
pub(crate) fn open_first(fits: impl Fn(&Open) -> bool) -> Result<i32, Code> {
    let free = (0..count()).find(|number| {
        let open = i8::try_from(*number).map_err(|_| Code::NoDevice).and_then(any);
        open.is_ok_and(|open| !open.station.is_open() && fits(&open))
    });
    open_number(free.ok_or(Code::NoDevice)?)
}

/// Ends the regulation of a device and closes the device; if it was the default device, another open device becomes the default.
pub(crate) fn close(id: i8) -> Result<i32, Code> {
    let closing = open(id)?;
    closing.device().regulation = Regulation::OFF;
    closing.station.close();
    let own = i32::try_from(closing.number).unwrap_or(-1);
    let is_open = |number: &usize| closing.host.station(*number).is_some_and(Station::is_open);
    let next = (0..count()).find(is_open).and_then(|number| i32::try_from(number).ok()).unwrap_or(-1);
    let _ = DEFAULT.compare_exchange(own, next, Ordering::AcqRel, Ordering::Acquire);
    Ok(0)
}

/// Returns the id of the default device.
pub(crate) fn default() -> Result<i32, Code> {
    let id = DEFAULT.load(Ordering::Acquire);
    if id < 0 { Err(Code::NoDevice) } else { Ok(id) }
}

/// Makes an open device the default device.
pub(crate) fn set_default(id: i8) -> Result<i32, Code> {
    let open = open(id)?;
    DEFAULT.store(i32::try_from(open.number).unwrap_or(-1), Ordering::Release);
    Ok(0)
}

/// Returns the device type reported to the program: `FLOTOR_DHD_TYPE` if set, else by axes and language. Of the types with six
/// driven axes, Python bindings accept 104 only and fail at an unknown type; CHAI3D, in C++, shifts the position of a 104 by a
/// centimetre.
pub(crate) fn kind(station: &Station) -> i32 {
    let set = env_value("FLOTOR_DHD_TYPE").and_then(|text| text.parse().ok());
    set.unwrap_or_else(|| match (station.axes(), language()) {
        (Axes::Three, _) => 33,
        (Axes::ThreeAndWrist, _) => 34,
        (Axes::Six, Language::Python) => 104,
        (Axes::Six, Language::Other) => 108,
    })
}

impl Open {
    pub(crate) fn has_wrist(&self) -> bool {
        self.station.axes() != Axes::Three
    }

    pub(crate) fn has_active_wrist(&self) -> bool {
        self.station.axes() == Axes::Six
    }

    /// Returns the position, m, and the rotation matrix, row-major.
    pub(crate) fn pose(&self) -> (DVec3, [[f64; 3]; 3]) {
        let state = self.station.state();
        (FRAME.of_flotor(state.position_m), FRAME.rotation(state.orientation))
    }

    /// Enables or disables force; disabling also clears the last command and ends the regulation.
    pub(crate) fn set_switch(&self, device: &mut Device, switch: Switch) {
        if switch == Switch::On {
            self.enable(device);
            device.has_been_stopped = false;
        } else {
            device.switch = switch;
            (device.force_n, device.torque_nm, device.gripper_n) = (DVec3::ZERO, DVec3::ZERO, 0.0);
            device.regulation = Regulation::OFF;
            self.station.disable();
        }
    }

    /// Enables force, which fades in unless enabled already.
    fn enable(&self, device: &mut Device) {
        device.switch = Switch::On;
        device.lapses = self.station.counts().lapses;
        if !self.station.is_enabled() {
            device.faded_in_ns = self.host.now_ns() + self.station.ramp_ns();
            self.station.enable();
        }
    }

    /// Limits the program's force, torque and force of the gripper, and sends both in addition to regulation and vibration. Enables force unless the
    /// program has set the force switch. Returns true if force or torque is scaled down, here or later by the envelope;
    /// [`Code::Invalid`] for a non-finite command.
    pub(crate) fn send(
        &self,
        device: &mut Device,
        [force_n, torque_nm]: [DVec3; 2],
        gripper_n: f64,
    ) -> Result<bool, Code> {
        if !(force_n.is_finite() && torque_nm.is_finite() && gripper_n.is_finite()) {
            // The port counts and rejects the command.
            let wrench = Wrench::new(FRAME.to_flotor(force_n), FRAME.to_flotor(torque_nm));
            let _ = self.station.command_with_grip(&wrench, gripper_n, self.host.now_ns());
            return Err(Code::Invalid);
        }
        let own = |vector: DVec3, most: f64| if most < 0.0 { vector } else { shortened(vector, most) };
        let [most_n, most_nm, most_gripper_n] = device.most;
        (device.force_n, device.torque_nm) = (own(force_n, most_n), own(torque_nm, most_nm));
        device.gripper_n = match most_gripper_n {
            most if most < 0.0 => gripper_n,
            most => gripper_n.clamp(-most, most),
        };
        if device.switch == Switch::Unsaid {
            self.enable(device);
        }
        self.send_again(device);
        let [limit_n, limit_nm] = self.station.most();
        let is_long = |vector: DVec3, most: f64| length(vector) > most;
        let is_cut = (device.force_n, device.torque_nm) != (force_n, torque_nm);
        let is_limited = is_long(force_n, limit_n) || self.has_active_wrist() && is_long(torque_nm, limit_nm);
        Ok(is_cut || is_limited)
    }

    /// Sends the last command of the program, with the current wrench of regulation and vibration.
    pub(crate) fn send_again(&self, device: &mut Device) {
        let now_ns = self.host.now_ns();
        let [frequency_hz, amplitude_n] = device.vibration;
        let phase = frequency_hz * (now_ns % 1_000_000_000_000) as f64 * 1.0e-9;
        let shake_n = amplitude_n * math::sin(std::f64::consts::TAU * (phase - phase.floor()));
        let state = self.station.state();
        let (held_n, held_nm) = device.regulation.wrench(&state, now_ns);
        let force_n = FRAME.to_flotor(device.force_n + DVec3::Z * shake_n) + held_n;
        let torque_nm = FRAME.to_flotor(device.torque_nm) + held_nm;
        // Non-finite parts were rejected before; the port rejects an overflowing sum in the same way.
        let effort = gripper::effort(self.station, device.gripper_n);
        let _ = self.station.command_with_grip(&Wrench::new(force_n, torque_nm), effort, now_ns);
    }
}

/// Limits the length of a vector.
fn shortened(vector: DVec3, most: f64) -> DVec3 {
    let length = length(vector);
    if length <= most || length == 0.0 { vector } else { vector / length * most }
}
