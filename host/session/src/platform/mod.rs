//! Platform layer of a session. Each system has one module with the same items:
//! - `MachineState`: record of the process state that any plugin can change;
//! - `identity`, `changed`, `is_same_file`: identity of a file, and detection of changes;
//! - `NOT_CAUGHT`: warning about ends of the process that stop no device;
//! - `ThreadClock`: processor use of a thread;
//! - `user_folder`, `distrust`: plugin folder of the user, and folders that are not searched.

#[cfg(not(windows))]
mod linux;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
use linux as system;
#[cfg(windows)]
use windows as system;

pub(crate) use system::{
    MachineState, NOT_CAUGHT, UNKNOWN_PROGRAM, changed, distrust, identity, user_folder,
};
pub use system::{ThreadClock, is_same_file};
