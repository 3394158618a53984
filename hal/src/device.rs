//! Devices: the traits that an author implements, and the data that goes in and out each tick.
//!
//! A device is *opened* (responds to queries, exerts no force), then *active* (energised, real-time), then opened again.
//! The two phases are different types, so that a real-time call before activation does not compile.

use crate::abi::Str;
use crate::abi::layout::layout;
use crate::{LoopConfig, Parameter, Pose, Refusal, SetParameterError, Settings, Twist, Wrench};

layout! {
    Tick { index, time_ns, dt_ns }
    DeviceState { pose, twist, delivered, sampled_ns, buttons, conditions }
    Conditions { bits }
    Axes { bits }
    Capabilities {
        sensed, actuated, range_m, range_rad, resolution_m, max_force_n, max_torque_nm, max_force_slew_n_per_s,
        max_torque_slew_nm_per_s, max_stiffness_n_per_m, rate_hz, latency_s,
    }
    DeviceInfo { id, name, doc, embodiment, reserved }
}

/// Number and scheduled time of a tick. 24 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct Tick {
    /// Number of the tick, from 0.
    pub index: u64,
    /// Scheduled time since the loop started, ns: free of jitter, so that runs can be repeated.
    pub time_ns: u64,
    /// Scheduled time since the previous tick, ns; more than a period after missed ticks; 0 on the first.
    pub dt_ns: u64,
}

/// Fault of a device: a closed set, each fault with a remedy.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The handle left the sensor's range: move the handle back, then start again.
    SensorOutOfRange = 1,
    /// A coil is too hot: let it cool.
    OverTemperature = 2,
    /// A coil carried too much current for too long: reduce the load.
    OverCurrent = 3,
    /// The handle moved faster than the device allows: move the handle more slowly.
    OverSpeed = 4,
    /// The device is disconnected: check cable and power.
    Disconnected = 5,
    /// The device did not respond in time.
    Timeout = 6,
    /// The device sent malformed data.
    Protocol = 7,
    /// The emergency stop of the device is pressed.
    EmergencyStop = 8,
    /// The plugin panicked or returned a code outside the contract: report the fault to its author.
    Broken = 9,
}

impl Fault {
    /// Converts a fault code of the ABI: 0 is `None`, an unknown code is [`Self::Broken`].
    #[inline]
    #[must_use]
    pub const fn from_code(code: u32) -> Option<Self> {
        Some(match code {
            0 => return None,
            1 => Self::SensorOutOfRange,
            2 => Self::OverTemperature,
            3 => Self::OverCurrent,
            4 => Self::OverSpeed,
            5 => Self::Disconnected,
            6 => Self::Timeout,
            7 => Self::Protocol,
            8 => Self::EmergencyStop,
            _ => Self::Broken,
        })
    }

    /// Returns cause and remedy as a message for users.
    #[must_use]
    pub const fn advice(self) -> &'static str {
        match self {
            Self::SensorOutOfRange => "the handle left the sensor's range; move it back and start again",
            Self::OverTemperature => "a coil is too hot; let the device cool",
            Self::OverCurrent => "the current of a coil was too high for too long; reduce stiffness or load",
            Self::OverSpeed => {
                "the handle moved faster than the device allows; move it more slowly, then start again"
            }
            Self::Disconnected => "the device is gone; check cable and power",
            Self::Timeout => "the device did not answer in time; check cable, hub and machine load",
            Self::Protocol => "the device sent malformed data; check its firmware version",
            Self::EmergencyStop => {
                "the emergency stop of the device is pressed; release the stop to continue"
            }
            Self::Broken => "the device plugin violated the contract; report the fault to its author",
        }
    }
}

/// Result of one real-time call on a device.
#[must_use]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cycle {
    /// From `read`: a new sample is in the state. From `write`: the device has accepted the command.
    Fresh,
    /// From `read`: no new sample since the last call; the host keeps the previous state. From `write`: the device has
    /// not accepted the command yet.
    Stale,
    /// The device is faulted and exerts no force.
    Fault(Fault),
}

/// Sample that a device reports each tick. 168 bytes, in the device frame.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct DeviceState {
    /// Pose of the handle, m and unit quaternion.
    pub pose: Pose,
    /// Velocity of the handle, m/s and rad/s.
    pub twist: Twist,
    /// Wrench delivered to the hand since the previous tick, as reported by the device, N and N·m.
    pub delivered: Wrench,
    /// Time of the sample, ns, on the clock of [`Tick::time_ns`].
    pub sampled_ns: u64,
    /// Buttons, one bit each: 1 while pressed.
    pub buttons: u32,
    /// Conditions of this sample other than faults.
    pub conditions: Conditions,
}

/// Conditions of a sample other than faults, as a bit set; no condition ends a run.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct Conditions {
    bits: u32,
}

impl Conditions {
    /// No condition.
    pub const NONE: Conditions = Conditions { bits: 0 };
    /// Actuators at their limit: since the previous tick they delivered less than commanded.
    pub const SATURATED: Conditions = Conditions { bits: 1 << 0 };
    /// Requested force above the recommended force of the device: warn the person who holds the handle.
    pub const EXCESS_FORCE: Conditions = Conditions { bits: 1 << 1 };
    /// Pose measured with noise of at least one step of its resolution: a bit-identical pose over a long time means that
    /// the sensor is stuck. Not set by a device that counts steps (an encoder at rest).
    pub const NOISY: Conditions = Conditions { bits: 1 << 2 };

    /// Returns the union of both sets. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub const fn with(self, other: Conditions) -> Conditions {
        Conditions { bits: self.bits | other.bits }
    }

    /// Returns true if the set contains all of `other`. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub const fn contains(self, other: Conditions) -> bool {
        self.bits & other.bits == other.bits
    }

    /// Returns the bits of the set. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub const fn bits(self) -> u32 {
        self.bits
    }
}

impl DeviceState {
    /// State at home and at rest, without force, at time 0.
    pub const HOME: DeviceState = DeviceState {
        pose: Pose::HOME,
        twist: Twist::ZERO,
        delivered: Wrench::ZERO,
        sampled_ns: 0,
        buttons: 0,
        conditions: Conditions::NONE,
    };

    /// Returns true if pose and twist are finite; does not check `delivered`. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.pose.is_finite() & self.twist.is_finite() // without a branch
    }
}

/// Set of axes that a device senses or actuates: x, y, z, then rotation about x, y, z.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct Axes {
    pub(crate) bits: u32,
}

impl Axes {
    /// No axis.
    pub const NONE: Axes = Axes { bits: 0 };
    /// Translation along x.
    pub const X: Axes = Axes { bits: 0b00_0001 };
    /// Translation along y.
    pub const Y: Axes = Axes { bits: 0b00_0010 };
    /// Translation along z.
    pub const Z: Axes = Axes { bits: 0b00_0100 };
    /// Rotation about x.
    pub const RX: Axes = Axes { bits: 0b00_1000 };
    /// Rotation about y.
    pub const RY: Axes = Axes { bits: 0b01_0000 };
    /// Rotation about z.
    pub const RZ: Axes = Axes { bits: 0b10_0000 };
    /// Translations along x and y: a planar device.
    pub const PLANE: Axes = Axes { bits: 0b00_0011 };
    /// The three translations.
    pub const TRANSLATION: Axes = Axes { bits: 0b00_0111 };
    /// The three rotations.
    pub const ROTATION: Axes = Axes { bits: 0b11_1000 };
    /// All six axes.
    pub const ALL: Axes = Axes { bits: 0b11_1111 };

    /// Returns the bits of the set, x first; a foreign plugin may have set bits above the sixth.
    #[must_use]
    pub const fn bits(self) -> u32 {
        self.bits
    }

    /// Returns the union of both sets: `Axes::X.union(Axes::Z)` in constants, `Axes::X | Axes::Z` elsewhere.
    #[must_use]
    pub const fn union(self, other: Axes) -> Axes {
        Axes { bits: self.bits | other.bits }
    }

    /// Returns true if the set contains all of `other`.
    #[must_use]
    pub const fn contains(self, other: Axes) -> bool {
        self.bits & other.bits == other.bits
    }

    /// Returns `translation` for the translations of the set, `rotation` for its rotations, and 0 for all other axes.
    const fn spread(self, translation: f64, rotation: f64) -> ([f64; 3], [f64; 3]) {
        let (mut translations, mut rotations) = ([0.0; 3], [0.0; 3]);
        let mut axis = 0;
        while axis < 3 {
            if self.bits & (1 << axis) != 0 {
                translations[axis] = translation;
            }
            if self.bits & (1 << (axis + 3)) != 0 {
                rotations[axis] = rotation;
            }
            axis += 1;
        }
        (translations, rotations)
    }
}

impl std::ops::BitOr for Axes {
    type Output = Axes;

    fn bitor(self, other: Axes) -> Axes {
        self.union(other)
    }
}

/// Capabilities of a device, as numbers that a host compares with a model and enforces. 200 bytes, device frame.
///
/// Every number is finite and not negative, and constant from `open` on; a host rejects other capabilities before
/// activation. An actuated axis needs a limit above 0 and, if sensed, a range above 0; actuated axes need a slew rate
/// above 0. Only without actuated translations (rotations) may the slew rate of force (torque) be infinite.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
#[must_use]
pub struct Capabilities {
    /// Axes whose position is measured.
    pub sensed: Axes,
    /// Axes that can be driven.
    pub actuated: Axes,
    /// Largest displacement from the origin along each axis, m; together the semi-axes of an ellipsoid.
    pub range_m: [f64; 3],
    /// Largest rotation about each axis, rad; together the semi-axes of an ellipsoid of rotation vectors.
    pub range_rad: [f64; 3],
    /// Position resolution, m: smallest step that the sensors resolve.
    pub resolution_m: f64,
    /// Largest force along each axis, N.
    pub max_force_n: [f64; 3],
    /// Largest torque about each axis, N·m.
    pub max_torque_nm: [f64; 3],
    /// Maximum slew rate of the force that the device accepts, N/s.
    pub max_force_slew_n_per_s: f64,
    /// Maximum slew rate of the torque that the device accepts, N·m/s.
    pub max_torque_slew_nm_per_s: f64,
    /// Largest stiffness that the device renders stably at its nominal rate with its recommended damping, N/m; 0:
    /// unknown. [`SampledLoop::largest_stiffness`](crate::SampledLoop::largest_stiffness) computes this limit from
    /// damping and timing.
    pub max_stiffness_n_per_m: f64,
    /// Lowest and highest loop rate of the device, Hz.
    pub rate_hz: [f64; 2],
    /// Time from a sample to the resulting force, s, in addition to the hold of the force over one period.
    pub latency_s: f64,
}

impl Capabilities {
    /// Capabilities of a device without actuators; a sensor sets its sensed axes and ranges and inherits the other fields.
    pub const UNDRIVEN: Capabilities = Capabilities {
        sensed: Axes::NONE,
        actuated: Axes::NONE,
        range_m: [0.0; 3],
        range_rad: [0.0; 3],
        resolution_m: 0.0,
        max_force_n: [0.0; 3],
        max_torque_nm: [0.0; 3],
        max_force_slew_n_per_s: f64::INFINITY, // without actuators no limit
        max_torque_slew_nm_per_s: f64::INFINITY,
        max_stiffness_n_per_m: 0.0,
        rate_hz: [100.0, 10_000.0],
        latency_s: 0.0,
    };

    /// Time to the full force and torque from which [`Self::with_limits`] computes the slew, s.
    const DEFAULT_RISE_S: f64 = 0.5e-3;

    /// Returns the capabilities of a device that senses and drives `axes`, with ranges and limits still 0.
    pub const fn driving(axes: Axes) -> Self {
        Self { sensed: axes, actuated: axes, ..Self::UNDRIVEN }
    }

    /// Sets the axes whose position is measured; the driven axes are unchanged.
    pub const fn sensing(self, axes: Axes) -> Self {
        Self { sensed: axes, ..self }
    }

    /// Sets the range of every axis in `sensed`: largest displacement, m, and rotation, rad, to both sides of the origin.
    pub const fn with_range(self, range_m: f64, range_rad: f64) -> Self {
        let (range_m, range_rad) = self.sensed.spread(range_m, range_rad);
        Self { range_m, range_rad, ..self }
    }

    /// Sets the largest force, N, and torque, N·m, of every driven axis, and slew rates that reach these limits in 0.5
    /// ms.
    pub const fn with_limits(self, max_force_n: f64, max_torque_nm: f64) -> Self {
        let (force_n, torque_nm) = self.actuated.spread(max_force_n, max_torque_nm);
        Self { max_force_n: force_n, max_torque_nm: torque_nm, ..self }
            .with_slew(max_force_n / Self::DEFAULT_RISE_S, max_torque_nm / Self::DEFAULT_RISE_S)
    }

    /// Sets the maximum slew rates of force, N/s, and torque, N·m/s.
    pub const fn with_slew(self, max_force_slew_n_per_s: f64, max_torque_slew_nm_per_s: f64) -> Self {
        Self { max_force_slew_n_per_s, max_torque_slew_nm_per_s, ..self }
    }

    /// Sets the largest stiffness that the device renders stably, N/m.
    pub const fn with_stiffness(self, max_stiffness_n_per_m: f64) -> Self {
        Self { max_stiffness_n_per_m, ..self }
    }

    /// Sets the latency from a sample to the resulting force, s, in addition to the hold of the force over one period.
    pub const fn with_latency(self, latency_s: f64) -> Self {
        Self { latency_s, ..self }
    }
}

/// Embodiment of a device: a physical handle, or a simulation only; a closed set.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Embodiment {
    /// Handle that a hand can hold; the default.
    Physical = 0,
    /// Simulation: no command ever reaches an actuator that could push a hand.
    Simulated = 1,
}

impl Embodiment {
    /// Converts an embodiment code of the ABI; an unknown code counts as [`Self::Physical`], because the device may push a hand.
    #[must_use]
    pub const fn from_code(code: u32) -> Self {
        match code {
            1 => Self::Simulated,
            _ => Self::Physical,
        }
    }
}

/// Declaration of a device; constant, readable without opening the device.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
#[must_use]
pub struct DeviceInfo {
    pub(crate) id: Str,
    pub(crate) name: Str,
    pub(crate) doc: Str,
    /// Code of an [`Embodiment`].
    pub(crate) embodiment: u32,
    /// Reserved, 0.
    pub(crate) reserved: u32,
}

impl DeviceInfo {
    /// Builds the declaration of a physical device: `id` for scenes and commands ("simulated"), `name` and `doc` for
    /// display.
    pub const fn new(id: &'static str, name: &'static str, doc: &'static str) -> Self {
        Self {
            id: Str::new(id),
            name: Str::new(name),
            doc: Str::new(doc),
            embodiment: Embodiment::Physical as u32,
            reserved: 0,
        }
    }

    /// Marks the device as a simulation. A host limits the force of a physical device to a ceiling unless the user allows
    /// more; a simulated device has no ceiling.
    pub const fn simulated(self) -> Self {
        Self { embodiment: Embodiment::Simulated as u32, ..self }
    }

    /// Returns the embodiment: physical or simulated.
    #[must_use]
    pub const fn embodiment(&self) -> Embodiment {
        Embodiment::from_code(self.embodiment)
    }

    /// Returns the id used in scenes and commands.
    #[must_use]
    pub const fn id(&self) -> &str {
        self.id.as_str()
    }

    /// Returns the display name.
    #[must_use]
    pub const fn name(&self) -> &str {
        self.name.as_str()
    }

    /// Returns the description, one sentence.
    #[must_use]
    pub const fn doc(&self) -> &str {
        self.doc.as_str()
    }
}

/// Handle that stops a device from any thread at any time, independently of the thread that uses the device.
pub trait SafeStop: Send + Sync + 'static {
    /// Sets the actuators to zero (or to a controlled landing) until the next activation.
    /// Bounded, no allocation, no lock; may be called twice and while another thread is inside `read` or `write`.
    fn safe_stop(&self);

    /// Clears the stop, so that the device may exert force again. [`Simple`](crate::Simple) calls this function before
    /// each activation; a [`Device`] does so in [`Device::activate`]. Not real-time.
    fn arm(&self) {}
}

/// Stop handle of a device without actuators: there is no force to remove.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NothingToStop;

impl SafeStop for NothingToStop {
    fn safe_stop(&self) {}
}

/// Device in the opened phase, not energised: implemented by the author of a device, with [`ActiveDevice`]. Not
/// real-time.
pub trait Device: Sized + Send + 'static {
    /// Declaration of the device.
    const INFO: DeviceInfo;
    /// Parameter schema of the device.
    const PARAMETERS: &'static [Parameter] = &[];
    /// Type of the energised device.
    type Active: ActiveDevice<Opened = Self>;
    /// Handle that stops the device from another thread.
    type Stop: SafeStop;

    /// Opens the device. The settings are already checked against the schema. May block.
    ///
    /// # Errors
    /// A [`Refusal`] if the device is missing, busy, forbidden or configured wrongly.
    fn open(settings: &Settings<'_>) -> Result<Self, Refusal>;

    /// Returns the capabilities of the opened device, the same at every call.
    fn capabilities(&self) -> Capabilities;

    /// Returns the handle that stops the device from another thread; called once, right after opening.
    fn stopper(&self) -> Self::Stop;

    /// Energises the device at zero wrench.
    ///
    /// # Errors
    /// The opened device and a [`Refusal`]: nothing is lost, the caller may retry.
    fn activate(self, config: &LoopConfig) -> Result<Self::Active, (Self, Refusal)>;

    /// Returns the current value of the parameter at `index` of [`Self::PARAMETERS`], including values set by a preset;
    /// NaN if unknown.
    fn parameter(&self, index: usize) -> f64 {
        Self::PARAMETERS.get(index).map_or(f64::NAN, Parameter::default)
    }
}

/// Energised device. Every method but `deactivate` is real-time: bounded, no allocation, no lock, no unwinding. An
/// implementation must set the actuators to zero when dropped.
pub trait ActiveDevice: Send + 'static {
    /// Type of the device after deactivation.
    type Opened;

    /// Reads the newest sample into `state`. Real-time.
    fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle;

    /// Commands the wrench on the hand until the next write. Real-time.
    fn write(&mut self, tick: &Tick, wrench: &Wrench) -> Cycle;

    /// Changes the live parameter at `index` at a tick boundary; the range is already checked. Real-time.
    ///
    /// # Errors
    /// [`SetParameterError`]; the old value stays.
    fn set_parameter(&mut self, index: usize, value: f64) -> Result<(), SetParameterError> {
        let _ = (index, value);
        Err(SetParameterError::Fixed)
    }

    /// Commands zero wrench and returns to the opened phase. Not real-time; cannot fail.
    fn deactivate(self) -> Self::Opened;
}
