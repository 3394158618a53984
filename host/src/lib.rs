//! The `flotor` command: its arguments, what it prints, the pictures it draws, and the start of somebody's own plugin.
//!
//! - [`cli`]: the commands.
//! - [`scaffold`]: `flotor new`.
//! - [`run_picture`], [`timing_picture`]: charts of a run and of how time was kept.
//!
//! To embed Flotor in a program, use `flotor-session`; this crate is for the command alone.

pub mod cli;
pub mod peak_bounds;
mod platform;
pub mod run_picture;
pub mod scaffold;
pub mod timing_picture;
