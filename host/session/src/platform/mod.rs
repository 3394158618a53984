//! What differs between systems around a session. Each system has one module with the same items:
//! - `MachineState`: what of the process any plugin can change;
//! - `identity`, `changed`, `is_same_file`: which file a path leads to, and whether it is still the one that was read;
//! - `NOT_CAUGHT`: what ends the process without a stop of the devices;
//! - `ThreadClock`: what a thread uses of the processors;
//! - `process_group`: a process that ends with its parent, and the processes that it starts;
//! - `user_folder`, `distrust`: where a user keeps plugins, and which folders are not searched.

#[cfg(not(windows))]
mod linux;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use linux::{
    MachineState, NOT_CAUGHT, UNKNOWN_PROGRAM, changed, distrust, identity, process_group, user_folder,
};
#[cfg(not(windows))]
pub use linux::{ThreadClock, end_with_this_thread, is_same_file};
#[cfg(windows)]
pub(crate) use windows::{
    MachineState, NOT_CAUGHT, UNKNOWN_PROGRAM, changed, distrust, identity, process_group, user_folder,
};
#[cfg(windows)]
pub use windows::{ThreadClock, end_with_this_thread, is_same_file};
