//! Platform layer of the live protocol: sockets of a run, permissions of their folder, and detection of closed sockets.
//!
//! Each operating system has one module with the same items.

#[cfg(not(windows))]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
use unix as system;
#[cfg(windows)]
use windows as system;

pub(crate) use system::{
    Datagrams, Listening, Stream, connect, connect_now, has_left, is_ours, is_ours_alone,
    is_out_of_descriptors, is_same_file, make_folder, private_file, read_at, remove_if_dead, run_folder,
    write_all_at,
};
