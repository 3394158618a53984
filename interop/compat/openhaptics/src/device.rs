//! HDAPI device as presented to the program: snapshot and settings of the current frame, and capabilities.

use crate::callbacks;
use crate::error::{Code, NO_DEVICE};
use crate::parameter::{
    ANGULAR_VELOCITY, BUTTONS, CALIBRATION_STYLE, DRIVER_VERSION, ENCODERS, FIRMWARE_VERSION, FORCE,
    FORCE_CLAMPING, FORCE_OUTPUT, GIMBAL_ANGLES, GIMBAL_TORQUE, IMPULSE_LIMIT, INKWELL_SWITCH, INPUT_DOF,
    INSTANTANEOUS_RATE, JOINT_ANGLES, JOINT_TORQUE, Kind, MAX_CONTINUOUS_FORCE, MAX_CONTINUOUS_TORQUE,
    MAX_DAMPING, MAX_FORCE, MAX_STIFFNESS, MAX_TORQUE, MAX_TORQUE_DAMPING, MAX_TORQUE_STIFFNESS, MODEL_TYPE,
    MOTOR_TEMPERATURE, ONE_FRAME_LIMIT, OUTPUT_DOF, PINCH, POSITION, RAMPING_RATE, SAFETY_SWITCH,
    SERIAL_NUMBER, STATUS_LIGHT, TABLETOP_OFFSET, TORQUE, TRANSFORM, UPDATE_RATE, VELOCITY, VELOCITY_LIMIT,
    VENDOR, VERSION, Values, WORKSPACES,
};
use flotor_compat::{Axes, Frame, Host, Station, env_value, host, interned};
use flotor_hal::{DVec3, Wrench, math};
use std::ffi::{CStr, c_uint};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

const FRAME: Frame = Frame::RightUpTowards;
/// Millimetres in a metre, and mN·m in a N·m.
const MILLI: f64 = 1.0e3;
/// Limit on the number of devices; a handle is the number of the device.
const MOST: usize = 16;
/// Names of the first device.
const FIRST: [&str; 4] = ["", "Default Device", "Default PHANToM", "Default PHANTOM"];
/// Capabilities, one bit each from this number on; all but the first are enabled when a device is initialised.
const FIRST_CAPABILITY: c_uint = FORCE_OUTPUT;
const CAPABILITIES: c_uint = 5;
const AT_FIRST: u32 = 0b1_1110;
/// Length of a nominal arm, m, whose joint angles are reported: a Flotor device may have other joints or none.
const ARM_M: f64 = 0.2;

/// Current device of the process.
pub(crate) struct Current(AtomicU32);

pub(crate) static CURRENT: Current = Current(AtomicU32::new(NO_DEVICE));

impl Current {
    pub(crate) fn get(&self) -> c_uint {
        self.0.load(Ordering::Acquire)
    }

    /// Selects an initialised device; returns false for any other.
    pub(crate) fn set(&self, handle: c_uint) -> bool {
        let is_there = Devices::initialised(handle).is_some();
        if is_there {
            self.0.store(handle, Ordering::Release);
        }
        is_there
    }
}

/// Access to all devices.
pub(crate) struct Devices;

static DEVICES: [Mutex<Device>; MOST] = [const { Mutex::new(Device::NONE) }; MOST];

/// Snapshot of a device in a frame.
#[derive(Clone, Copy)]
struct Snapshot {
    position_mm: DVec3,
    velocity_mm_per_s: DVec3,
    angular_velocity_rad_per_s: DVec3,
    rows: [[f64; 3]; 3],
    buttons: u32,
    /// Applied force and torque, N and N·m, axes of the interface.
    applied: [DVec3; 2],
}

const AT_HOME: Snapshot = Snapshot {
    position_mm: DVec3::ZERO,
    velocity_mm_per_s: DVec3::ZERO,
    angular_velocity_rad_per_s: DVec3::ZERO,
    rows: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    buttons: 0,
    applied: [DVec3::ZERO; 2],
};

/// Start of a frame: tick of the scheduler, or of the loop outside of the scheduler.
#[derive(Clone, Copy, PartialEq, Eq)]
enum When {
    Scheduled(u64),
    Outside(u64),
}

/// State of a device for the program: current frame, last command, capabilities and settings.
pub(crate) struct Device {
    is_initialised: bool,
    number: usize,
    capabilities: u32,
    depth: u32,
    begun: Option<When>,
    now: Snapshot,
    last: Snapshot,
    /// Values set in this frame, N and mN·m.
    force_n: Option<DVec3>,
    torque_mnm: Option<DVec3>,
    /// Last sent wrench, Flotor's axes.
    sent: Wrench,
    light: u32,
    velocity_limit_mm_per_s: f64,
    impulse_limit_n_per_ms: f64,
    ramping_n_per_s: f64,
}

impl Devices {
    fn lock(handle: c_uint) -> Option<MutexGuard<'static, Device>> {
        let device = DEVICES.get(usize::try_from(handle).ok()?)?;
        Some(device.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Locks an initialised device.
    fn initialised(handle: c_uint) -> Option<MutexGuard<'static, Device>> {
        Self::lock(handle).filter(|device| device.is_initialised)
    }

    /// Runs `body` on the current device.
    pub(crate) fn with_current<T>(body: impl FnOnce(&mut Device) -> Result<T, Code>) -> Result<T, Code> {
        body(&mut *Self::initialised(CURRENT.get()).ok_or(Code::InvalidOperation)?)
    }

    /// Returns the first initialised device, to wait for a tick.
    pub(crate) fn any() -> Option<(&'static Host, &'static Station)> {
        let number = (0..).take(MOST).find(|handle| Self::initialised(*handle).is_some())?;
        let host = host()?;
        Some((host, host.station(usize::try_from(number).ok()?)?))
    }

    /// Enables or disables the force of all devices according to scheduler and capabilities.
    pub(crate) fn follow_scheduler() {
        (0..).take(MOST).filter_map(Self::lock).for_each(|device| device.follow_switches());
    }
}

/// Opens the device with a name (the first device without a name or with a default name) and makes it current; returns its handle.
pub(crate) fn init(name: Option<&str>) -> Result<c_uint, Code> {
    let host = host().ok_or(Code::DeviceFault)?;
    let name = name.unwrap_or_default();
    let named = || host.stations().iter().position(|station| station.name() == name);
    let number = if FIRST.contains(&name) { Some(0) } else { named() };
    let number =
        number.filter(|number| *number < MOST.min(host.stations().len())).ok_or(Code::DeviceFault)?;
    let handle = c_uint::try_from(number).map_err(|_| Code::DeviceFault)?;
    let mut device = Devices::lock(handle).ok_or(Code::DeviceFault)?;
    if device.is_initialised {
        return Err(Code::AlreadyInitiated);
    }
    if !host.open(number) {
        return Err(Code::DeviceFault);
    }
    *device = Device { is_initialised: true, number, capabilities: AT_FIRST, ..Device::NONE };
    device.look();
    device.last = device.now;
    drop(device);
    CURRENT.0.store(handle, Ordering::Release);
    Ok(handle)
}

/// Closes a device, and removes all callbacks with the last device; returns true if the device was open.
pub(crate) fn disable(handle: c_uint) -> bool {
    let Some(mut device) = Devices::initialised(handle) else { return false };
    device.station().into_iter().for_each(|(_, station)| {
        station.close();
    });
    *device = Device::NONE;
    drop(device);
    let _ = CURRENT.0.compare_exchange(handle, NO_DEVICE, Ordering::AcqRel, Ordering::Acquire);
    if Devices::any().is_none() {
        callbacks::clear();
    }
    true
}

/// Begins a frame with a snapshot, and makes the device current. A second frame in a tick is an error in the scheduler; outside
/// of it, waits for the next tick. Neither applies if the program has disabled the one-frame limit.
pub(crate) fn begin_frame(handle: c_uint) -> Result<(), Code> {
    let mut device = Devices::initialised(handle).ok_or(Code::BadHandle)?;
    CURRENT.0.store(handle, Ordering::Release);
    let (host, station) = device.station().ok_or(Code::CommError)?;
    let mut when = device.when(station);
    if device.depth > 0 {
        if device.begun == Some(when) || matches!(when, When::Outside(_)) {
            device.depth += 1;
            return Ok(());
        }
        // The previous frame was never ended.
        device.depth = 0;
        device.send(host, station)?;
    }
    if device.begun == Some(when) && device.capability(ONE_FRAME_LIMIT) == Some(true) {
        if matches!(when, When::Scheduled(_)) {
            return Err(Code::IllegalBegin);
        }
        drop(device);
        host.wait(station);
        device = Devices::initialised(handle).ok_or(Code::BadHandle)?;
        when = device.when(station);
    }
    (device.depth, device.begun) = (1, Some(when));
    (device.force_n, device.torque_mnm) = (None, None);
    device.last = device.now;
    device.look();
    alive(host)
}

/// Checks that the run is in progress. Otherwise [`Code::ForceError`] after an emergency stop, or [`Code::CommError`] for a lost
/// device, which ends a program's loop.
fn alive(host: &Host) -> Result<(), Code> {
    match (host.is_running(), host.is_stopped_for_safety()) {
        (true, _) => Ok(()),
        (false, true) => Err(Code::ForceError),
        (false, false) => Err(Code::CommError),
    }
}

/// Ends a frame; outside of the scheduler, after setting a force, waits for the next tick.
pub(crate) fn end_frame(handle: c_uint) -> Result<(), Code> {
    let mut device = Devices::initialised(handle).ok_or(Code::BadHandle)?;
    if device.depth == 0 {
        return Err(Code::IllegalEnd);
    }
    device.depth -= 1;
    if device.depth > 0 {
        return Ok(());
    }
    let (host, station) = device.station().ok_or(Code::CommError)?;
    let waits = device.has_set() && !callbacks::is_here();
    let sent = device.send(host, station);
    drop(device);
    if waits {
        host.wait(station);
    }
    sent
}

/// Returns a text of the interface or of the current device.
pub(crate) fn text(parameter: c_uint) -> Result<&'static CStr, Code> {
    match parameter {
        VERSION | DRIVER_VERSION => Ok(c"3.4.0"),
        VENDOR => Ok(c"Flotor"),
        MODEL_TYPE | SERIAL_NUMBER => {
            let (number, plugin) = Devices::with_current(|device| {
                let plugin = device.station().map(|(_, station)| station.plugin().to_owned());
                Ok((device.number, plugin.unwrap_or_default()))
            })?;
            let text = match parameter {
                MODEL_TYPE => env_value("FLOTOR_HD_MODEL").unwrap_or_else(|| format!("Flotor {plugin}")),
                _ => format!("flotor-{number}"),
            };
            Ok(interned(text))
        }
        _ => Err(Code::InvalidEnum),
    }
}

impl Device {
    const NONE: Self = Self {
        is_initialised: false,
        number: 0,
        capabilities: 0,
        depth: 0,
        begun: None,
        now: AT_HOME,
        last: AT_HOME,
        force_n: None,
        torque_mnm: None,
        sent: Wrench::ZERO,
        light: 0,
        velocity_limit_mm_per_s: 850.0,
        impulse_limit_n_per_ms: 0.2,
        ramping_n_per_s: 3.0,
    };

    fn station(&self) -> Option<(&'static Host, &'static Station)> {
        let host = host()?;
        Some((host, host.station(self.number)?))
    }

    fn when(&self, station: &Station) -> When {
        if callbacks::is_here() { When::Scheduled(callbacks::tick()) } else { When::Outside(station.ticks()) }
    }

    /// Updates the snapshot.
    fn look(&mut self) {
        let Some((_, station)) = self.station() else { return };
        let state = station.state();
        self.now = Snapshot {
            position_mm: FRAME.of_flotor(state.position_m) * MILLI,
            velocity_mm_per_s: FRAME.of_flotor(state.velocity_m_per_s) * MILLI,
            angular_velocity_rad_per_s: FRAME.of_flotor(state.angular_velocity_rad_per_s),
            rows: FRAME.rotation(state.orientation),
            buttons: state.buttons & 0xF,
            applied: [state.applied.force(), state.applied.torque()].map(|part| FRAME.of_flotor(part)),
        };
    }

    fn has_set(&self) -> bool {
        self.force_n.is_some() || self.torque_mnm.is_some()
    }

    /// Sends the values set in the frame; without any, the previous wrench stays until it expires.
    fn send(&mut self, host: &Host, station: &Station) -> Result<(), Code> {
        if !self.has_set() {
            return Ok(());
        }
        let (force_n, torque_mnm) = (self.force_n.take(), self.torque_mnm.take());
        if let Some(force_n) = force_n {
            self.sent.force_n = FRAME.to_flotor(force_n).to_array();
        }
        if let Some(torque_mnm) = torque_mnm {
            self.sent.torque_nm = (FRAME.to_flotor(torque_mnm) / MILLI).to_array();
        }
        station.command(&self.sent, host.now_ns()).map_err(|_| Code::InvalidValue)?;
        let is_too_much = self.sent.force().length() > station.most()[0];
        if is_too_much && self.capability(FORCE_CLAMPING) == Some(false) {
            return Err(Code::ExceededMaxForce);
        }
        alive(host)
    }

    fn bit(capability: c_uint) -> Option<u32> {
        match capability {
            // Limits that are also capabilities.
            VELOCITY_LIMIT | IMPULSE_LIMIT => Some(1 << (capability - VELOCITY_LIMIT + CAPABILITIES)),
            _ => {
                capability.checked_sub(FIRST_CAPABILITY).filter(|bit| *bit < CAPABILITIES).map(|bit| 1 << bit)
            }
        }
    }

    fn capability(&self, capability: c_uint) -> Option<bool> {
        if capability == STATUS_LIGHT {
            return Some(self.light != 0);
        }
        Self::bit(capability).map(|bit| self.capabilities & bit != 0)
    }

    pub(crate) fn is_on(&self, capability: c_uint) -> Result<bool, Code> {
        self.capability(capability).ok_or(Code::InvalidEnum)
    }

    pub(crate) fn switch(&mut self, capability: c_uint, on: bool) -> Result<(), Code> {
        if capability == STATUS_LIGHT {
            self.light = u32::from(on);
            return Ok(());
        }
        let bit = Self::bit(capability).ok_or(Code::InvalidEnum)?;
        self.capabilities = if on { self.capabilities | bit } else { self.capabilities & !bit };
        self.follow_switches();
        Ok(())
    }

    /// Enables force while the scheduler runs and the capability is enabled, and disables it otherwise.
    fn follow_switches(&self) {
        if !self.is_initialised {
            return;
        }
        let is_on = self.capability(FORCE_OUTPUT) == Some(true) && callbacks::is_running();
        self.station()
            .into_iter()
            .for_each(|(_, station)| if is_on { station.enable() } else { station.disable() });
    }

    /// Sets a parameter; of several values in a frame, the last one is sent.
    pub(crate) fn set(&mut self, parameter: c_uint, [x, y, z]: [f64; 3]) -> Result<(), Code> {
        if !(x.is_finite() && y.is_finite() && z.is_finite()) {
            return Err(Code::InvalidValue);
        }
        match parameter {
            VELOCITY_LIMIT => self.velocity_limit_mm_per_s = x,
            IMPULSE_LIMIT => self.impulse_limit_n_per_ms = x,
            RAMPING_RATE => self.ramping_n_per_s = x,
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturated, then masked
            STATUS_LIGHT => self.light = x as u32 & 0x7,
            _ if self.depth == 0 => return Err(Code::FrameError),
            _ if parameter == FORCE[0] => self.force_n = Some(DVec3::new(x, y, z)),
            _ if parameter == TORQUE[0] => self.torque_mnm = Some(DVec3::new(x, y, z)),
            // Joint torques: the device has no such joints.
            _ => {}
        }
        Ok(())
    }

    /// Returns the values of a parameter in this frame, or in the last one.
    pub(crate) fn value(&self, parameter: c_uint) -> Result<Values, Code> {
        let (_, station) = self.station().ok_or(Code::CommError)?;
        // Index of the parameter in a pair: 0 for the current frame, 1 for the last frame.
        let of = |ids: [c_uint; 2]| ids.iter().position(|id| *id == parameter);
        let seen = |ids: [c_uint; 2]| of(ids).map(|frame| [&self.now, &self.last][frame]);
        // The current force reads 0 until set in this frame, because programs add to it.
        let [force_n, torque_nm] = self.now.applied;
        let forces_n = [self.force_n.unwrap_or_default(), force_n];
        let torques_mnm = [self.torque_mnm.unwrap_or_default(), torque_nm * MILLI];
        let vector = seen(POSITION)
            .map(|seen| seen.position_mm)
            .or_else(|| seen(VELOCITY).map(|seen| seen.velocity_mm_per_s))
            .or_else(|| seen(ANGULAR_VELOCITY).map(|seen| seen.angular_velocity_rad_per_s))
            .or_else(|| seen(JOINT_ANGLES).map(|seen| joint_angles(seen.position_mm / MILLI)))
            .or_else(|| seen(GIMBAL_ANGLES).map(|seen| gimbal_angles(&seen.rows)))
            .or_else(|| of(FORCE).map(|frame| forces_n[frame]))
            .or_else(|| of(TORQUE).map(|frame| torques_mnm[frame]))
            .or_else(|| of(JOINT_TORQUE).or(of(GIMBAL_TORQUE)).map(|_| DVec3::ZERO));
        if let Some(vector) = vector {
            return Ok(Values::real(vector.to_array()));
        }
        if let Some(seen) = seen(TRANSFORM) {
            return Ok(Values::real(transform(seen)));
        }
        if let Some(seen) = seen(BUTTONS) {
            return Ok(Values::integer(seen.buttons));
        }
        // "In the inkwell" would mean without force; the safety switch is closed while the device is held.
        match parameter {
            _ if ENCODERS.contains(&parameter) => Ok(Values::new(Kind::Long, &encoders(&self.now))),
            _ if PINCH.contains(&parameter) => Ok(Values::real([0.0])),
            _ if SAFETY_SWITCH.contains(&parameter) => Ok(Values::boolean(false)),
            _ if INKWELL_SWITCH.contains(&parameter) => Ok(Values::boolean(true)),
            _ => self.constant(parameter, station),
        }
    }

    /// Returns the value of a parameter outside the snapshot of an HDAPI frame (`hdBeginFrame`): a property or setting of device or
    /// scheduler.
    fn constant(&self, parameter: c_uint, station: &Station) -> Result<Values, Code> {
        let six = station.axes() != Axes::Three;
        let [force_n, torque_nm] = station.most();
        let range_mm = FRAME.of_flotor(station.range_m()).abs() * MILLI;
        let stiffness_n_per_mm = match station.max_stiffness_n_per_m() {
            none if none <= 0.0 => 1.0,
            stiffness_n_per_m => stiffness_n_per_m / MILLI,
        };
        Ok(match parameter {
            _ if WORKSPACES.contains(&parameter) => {
                let [x, y, z] = range_mm.to_array();
                Values::real([-x, -y, -z, x, y, z])
            }
            FIRMWARE_VERSION => Values::real([1.0]),
            TABLETOP_OFFSET => Values::real([range_mm.y]),
            INPUT_DOF => Values::integer(if six { 6 } else { 3 }),
            OUTPUT_DOF => Values::integer(if station.axes() == Axes::Six { 6 } else { 3 }),
            CALIBRATION_STYLE => Values::integer(2),
            UPDATE_RATE | INSTANTANEOUS_RATE => Values::integer(callbacks::rate_hz()),
            MAX_STIFFNESS => Values::real([stiffness_n_per_mm]),
            MAX_DAMPING => Values::real([stiffness_n_per_mm * 1.0e-3]),
            MAX_FORCE | MAX_CONTINUOUS_FORCE => Values::real([force_n]),
            MAX_TORQUE | MAX_CONTINUOUS_TORQUE => Values::real([torque_nm * MILLI]),
            MAX_TORQUE_STIFFNESS | MAX_TORQUE_DAMPING => Values::real([0.0]),
            MOTOR_TEMPERATURE => Values::real(&[0.0; 6][..if six { 6 } else { 3 }]),
            VELOCITY_LIMIT => Values::real([self.velocity_limit_mm_per_s]),
            IMPULSE_LIMIT => Values::real([self.impulse_limit_n_per_ms]),
            RAMPING_RATE => Values::real([self.ramping_n_per_s]),
            STATUS_LIGHT => Values::integer(self.light),
            _ => return Err(Code::InvalidEnum),
        })
    }
}

/// Returns the homogeneous transform, column-major, with the translation in mm.
fn transform(seen: &Snapshot) -> [f64; 16] {
    let at_mm = seen.position_mm.to_array();
    std::array::from_fn(|index| match (index / 4, index % 4) {
        (3, 3) => 1.0,
        (_, 3) => 0.0,
        (3, row) => at_mm[row],
        (column, row) => seen.rows[row][column],
    })
}

/// Returns the angles of turret, thigh and shin of a nominal arm for a position, rad; positive to the left, up and up.
fn joint_angles(DVec3 { x, y, z }: DVec3) -> DVec3 {
    DVec3::new(math::atan2(-x, ARM_M), math::atan2(y, ARM_M), math::atan2(y - z, ARM_M))
}

/// Returns the angles of a nominal gimbal, rad: about y, then x, then z; right is positive, up negative, clockwise positive.
fn gimbal_angles(rows: &[[f64; 3]; 3]) -> DVec3 {
    let pitch = math::asin((-rows[1][2]).clamp(-1.0, 1.0));
    let yaw = math::atan2(rows[0][2], rows[2][2]);
    let roll = math::atan2(rows[1][0], rows[1][1]);
    DVec3::new(-yaw, -pitch, -roll)
}

/// Returns the counts of nominal encoders, 0.01 mm and 0.1 mrad per count.
fn encoders(seen: &Snapshot) -> [f64; 6] {
    let DVec3 { x, y, z } = seen.position_mm * 100.0;
    let DVec3 { x: yaw, y: pitch, z: roll } = gimbal_angles(&seen.rows) * 1.0e4;
    [x, y, z, yaw, pitch, roll].map(f64::round)
}
