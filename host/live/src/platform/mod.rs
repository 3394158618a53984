//! What differs between systems: the sockets of a run, who may enter their folder, and which run is over.
//!
//! Each system has one module with the same items.

#[cfg(not(windows))]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(not(windows))]
pub(crate) use unix::{
    Datagrams, Listening, Stream, accept, connect, is_ours, is_ours_alone, make_folder, private_file,
    remove_if_over, run_folder,
};
#[cfg(windows)]
pub(crate) use windows::{
    Datagrams, Listening, Stream, accept, connect, is_ours, is_ours_alone, make_folder, private_file,
    remove_if_over, run_folder,
};
