//! Extension `flotor.independent-stop/1`: stop of a device after the host's process has ended in any way.
//!
//! A device that holds its last command offers a handle and a message; the guard process, which runs no plugin code,
//! stores both and writes the message when the host is gone. A device that stops by itself declares its timeout.

use crate::Device;
use crate::abi::instance::fill;
use crate::abi::interface::table;
use crate::abi::layout::layout;
#[cfg(feature = "loader")]
use crate::abi::loader::OpenedDevice;
use crate::abi::{DeviceAdapter, Instance};
#[cfg(feature = "loader")]
use crate::{Refusal, extension::independent_stop::means::Independence};

/// Capacity of a stop message, bytes.
pub const STOP_MESSAGE_BYTES: usize = 64;
/// Value of `descriptor` for a device that stops by itself.
const BY_ITSELF: i32 = -1;
/// Value of `within_ns` for a device without any independent stop, ns.
const NEVER_NS: u64 = u64::MAX;

/// Final state of a stopped device. In C, a `uint32_t` with these values.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoppedState {
    /// No force.
    Zero = 0,
    /// No force, after a controlled landing of the handle.
    Landed = 1,
}

/// Stop of a device that does not depend on the host's process. 88 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
#[must_use]
pub struct IndependentStop {
    /// Time from the end of the host's commands, or from the message, until the device is in its safe state, ns. The
    /// largest number with descriptor -1: no independent stop.
    pub(crate) within_ns: u64,
    /// File descriptor of the host's process, open for writing until the device is closed; the host duplicates the
    /// descriptor. On Windows the lower 32 bits of a handle. -1: the device stops by itself without commands.
    pub(crate) descriptor: i32,
    /// Length of the message, bytes, 1 to 64; 0 with descriptor -1.
    pub(crate) length: u32,
    /// Message written to the descriptor, up to three times: stops the device at any time, also after a partial command.
    pub(crate) message: [u8; STOP_MESSAGE_BYTES],
    /// Code of a [`StoppedState`].
    pub(crate) state: u32,
    /// Reserved, 0.
    pub(crate) reserved: u32,
}

impl IndependentStop {
    /// Declares a stop by a message to a descriptor, which is open for writing until the device is closed; the device is
    /// in `state` at most `within_ns` after the message. The host rejects an empty message and one of more than 64 bytes.
    pub fn by_message(descriptor: i32, message: &[u8], state: StoppedState, within_ns: u64) -> Self {
        let mut bytes = [0; STOP_MESSAGE_BYTES];
        bytes.iter_mut().zip(message).for_each(|(place, byte)| *place = *byte);
        let length = u32::try_from(message.len()).unwrap_or(u32::MAX);
        Self { within_ns, descriptor, length, message: bytes, state: state as u32, reserved: 0 }
    }

    /// Declares a stop by the device's controller after `within_ns` without a command; 0: the device ends with the host's process.
    pub const fn by_itself(state: StoppedState, within_ns: u64) -> Self {
        let message = [0; STOP_MESSAGE_BYTES];
        Self { within_ns, descriptor: BY_ITSELF, length: 0, message, state: state as u32, reserved: 0 }
    }

    /// Declares no independent stop, as a plugin without this extension: for a plugin with several kinds of devices.
    pub const fn none() -> Self {
        Self::by_itself(StoppedState::Zero, NEVER_NS)
    }
}

/// Device with a stop that does not depend on the host's process: a [`Device`], or a [`SimpleDevice`](crate::SimpleDevice).
///
/// ```
/// # use flotor_hal::*;
/// # struct Crank { samples: u64, ledger: EnergyLedger }
/// # impl Device for Crank {
/// #     const INFO: DeviceInfo = DeviceInfo::new("crank", "Crank", "A handle that turns");
/// #     type Active = Crank;
/// #     type Stop = NothingToStop;
/// #     fn open(_: &Settings<'_>) -> Result<Self, Refusal> {
/// #         Ok(Crank { samples: 0, ledger: EnergyLedger::default() })
/// #     }
/// #     fn capabilities(&self) -> Capabilities { Capabilities::UNDRIVEN }
/// #     fn stopper(&self) -> NothingToStop { NothingToStop }
/// #     fn activate(self, _: &LoopConfig) -> Result<Crank, (Self, Refusal)> { Ok(self) }
/// # }
/// # impl ActiveDevice for Crank {
/// #     type Opened = Crank;
/// #     fn read(&mut self, _: &Tick, _: &mut DeviceState) -> Cycle { Cycle::Fresh }
/// #     fn write(&mut self, _: &Tick, _: &Wrench) -> Cycle { Cycle::Fresh }
/// #     fn deactivate(self) -> Crank { self }
/// # }
/// /// The board removes the force 20 ms after the last command: `export_device!(Crank, independent_stop)`.
/// impl IndependentStopDevice for Crank {
///     fn independent_stop(&self) -> IndependentStop {
///         IndependentStop::by_itself(StoppedState::Zero, 20_000_000)
///     }
/// }
/// ```
pub trait IndependentStopDevice {
    /// Returns the independent stop. Called once, after opening; valid until the device is closed. Not real-time.
    fn independent_stop(&self) -> IndependentStop;
}

/// Function table `flotor.independent-stop/1`: see [`IndependentStopDevice`]. Valid in the opened phase only.
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct IndependentStopTable {
    /// Size of this table in the plugin's build, bytes.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// Writes the independent stop of the device; returns a [`crate::abi::CallStatus`] code. Not real-time.
    pub independent_stop: Option<unsafe extern "C" fn(instance: Instance, stop: *mut IndependentStop) -> u32>,
}

layout! {
    IndependentStop { within_ns, descriptor, length, message, state, reserved }
    IndependentStopTable { size, reserved, independent_stop }
}
unsafe extern "C" fn independent_stop<D: Device + IndependentStopDevice>(
    instance: Instance,
    stop: *mut IndependentStop,
) -> u32 {
    // SAFETY: the contract of every table call.
    unsafe { fill::<DeviceAdapter<D>, _>(instance, stop, |phase| Ok(phase.opened()?.independent_stop())) }
}

table!(IndependentStopTable: "flotor.independent-stop/1", D: [Device + IndependentStopDevice] {
    reserved: 0,
    independent_stop: Some(independent_stop::<D>),
});

/// Host side of the independent stop.
#[cfg(feature = "loader")]
pub mod means {
    use super::{BY_ITSELF, IndependentStop, NEVER_NS, STOP_MESSAGE_BYTES, StoppedState};
    use crate::Refusal;
    use crate::abi::loader::platform::{Handle, writable_duplicate};

    /// Checked independent stop of a device.
    #[derive(Debug)]
    pub enum Independence {
        /// Stop by a message on a duplicated handle.
        Message {
            /// Handle that receives the message.
            handle: Handle,
            /// Message bytes.
            message: Vec<u8>,
            /// State of the stopped device.
            state: StoppedState,
        },
        /// Stop by the device's own controller.
        Itself {
            /// Timeout without a command, ns.
            within_ns: u64,
            /// State of the stopped device.
            state: StoppedState,
        },
    }

    impl Independence {
        /// Checks a plugin's declaration and duplicates its descriptor; `None` without an independent stop.
        pub(crate) fn of(declared: &IndependentStop) -> Result<Option<Self>, Refusal> {
            let wrong = |what: String| Refusal::broken(format!("the independent stop of the device {what}"));
            let state = match declared.state {
                0 => StoppedState::Zero,
                1 => StoppedState::Landed,
                other => return Err(wrong(format!("leads to state {other}, but must lead to 0 or 1"))),
            };
            let length = declared.length as usize;
            if declared.descriptor == BY_ITSELF {
                return match (length, declared.within_ns) {
                    (0, NEVER_NS) => Ok(None),
                    (0, within_ns) => Ok(Some(Self::Itself { within_ns, state })),
                    _ => Err(wrong("has a message but no descriptor".to_owned())),
                };
            }
            let message = declared.message.get(..length).filter(|message| !message.is_empty());
            let Some(message) = message.map(<[u8]>::to_vec) else {
                return Err(wrong(format!(
                    "has a message of {length} bytes, but needs 1 to {STOP_MESSAGE_BYTES}"
                )));
            };
            // SAFETY: the plugin keeps the descriptor open until the device is closed (contract), and the device is
            // open.
            let handle = unsafe { writable_duplicate(declared.descriptor) }.map_err(wrong)?;
            Ok(Some(Self::Message { handle, message, state }))
        }
    }
}

#[cfg(feature = "loader")]
impl OpenedDevice {
    /// Returns the independent stop of the device; `None` if there is none. Not real-time.
    ///
    /// # Errors
    /// A [`Refusal`] if the plugin's declaration is invalid or missing.
    pub fn independent_stop(&mut self) -> Result<Option<Independence>, Refusal> {
        let ask = self.extensions().independent_stop.and_then(|table| table.independent_stop);
        if ask.is_none() {
            return Ok(None);
        }
        // Invalid initial value: rejected below unless the plugin writes it.
        let unfilled = IndependentStop::by_message(BY_ITSELF, &[0], StoppedState::Zero, 0);
        let Some(declared) = self.calls.query(ask, unfilled) else {
            return Err(Refusal::broken(
                "`independent_stop` of the device plugin failed; \
            declare a stop or remove the extension `flotor.independent-stop/1`",
            ));
        };
        Independence::of(&declared)
    }
}
