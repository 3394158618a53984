//! Extension `flotor.independent-stop/1`: stop of a device after the host's process has ended in any way.
//!
//! A device that holds its last command offers a handle and a message; the guard process, which runs no plugin code,
//! stores both and writes the message when the host is gone. A device that stops by itself declares its timeout.

use crate::abi::instance::fill;
use crate::abi::interface::table;
use crate::abi::layout::layout;
use crate::abi::{DeviceAdapter, Instance};
use crate::{Device, Refusal};

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

    /// Checks the declaration of a plugin, all but the descriptor. Not real-time.
    ///
    /// # Errors
    /// A [`Refusal`] for an unknown state, a message without a descriptor, or a message that is empty or too long.
    pub fn means(&self) -> Result<StopMeans<'_>, Refusal> {
        let state = match self.state {
            0 => StoppedState::Zero,
            1 => StoppedState::Landed,
            other => {
                return Err(Self::refusal(&format!("leads to state {other}, but must lead to 0 or 1")));
            }
        };
        let length = self.length as usize;
        if self.descriptor == BY_ITSELF {
            return match (length, self.within_ns) {
                (0, NEVER_NS) => Ok(StopMeans::None),
                (0, within_ns) => Ok(StopMeans::Itself { within_ns, state }),
                _ => Err(Self::refusal("has a message but no descriptor")),
            };
        }
        match self.message.get(..length).filter(|message| !message.is_empty()) {
            Some(message) => Ok(StopMeans::Message { descriptor: self.descriptor, message, state }),
            None => Err(Self::refusal(&format!(
                "has a message of {length} bytes, but needs 1 to {STOP_MESSAGE_BYTES}"
            ))),
        }
    }

    /// Builds the refusal of a declaration: "the independent stop of the device", then `problem`.
    pub fn refusal(problem: &str) -> Refusal {
        Refusal::broken(format!("the independent stop of the device {problem}"))
    }
}

/// Checked content of an [`IndependentStop`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopMeans<'a> {
    /// No independent stop.
    None,
    /// Stop by a message.
    Message {
        /// Descriptor that takes the message, not yet checked.
        descriptor: i32,
        /// Message bytes, 1 to 64.
        message: &'a [u8],
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_declaration_outside_the_contract_is_refused() {
        let right = IndependentStop::by_message(7, b"stop", StoppedState::Landed, 0);
        let means = StopMeans::Message { descriptor: 7, message: b"stop", state: StoppedState::Landed };
        assert_eq!(right.means(), Ok(means));
        for (wrong, words) in [
            (IndependentStop { state: 2, ..right }, "state 2"),
            (IndependentStop { length: 65, ..right }, "has a message of 65 bytes"),
            (IndependentStop { length: 0, ..right }, "has a message of 0 bytes"),
            (IndependentStop { descriptor: BY_ITSELF, ..right }, "no descriptor"),
        ] {
            let refused = wrong.means().expect_err("it is wrong").reason;
            assert!(refused.contains(words), "{refused}");
        }
        assert_eq!(IndependentStop::none().means(), Ok(StopMeans::None));
    }
}
