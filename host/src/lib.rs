//! The `flotor` command: its arguments, its output, pictures of runs, and templates of plugins.
//!
//! - [`cli`]: the commands.
//! - [`scaffold`]: `flotor new`.
//! - [`run_picture`], [`timing_picture`]: charts of a run and of its timing.
//!
//! To embed Flotor in a program, use `flotor-session`; this crate is for the command alone.

pub mod cli;
mod diagnosis;
pub mod peak_bounds;
mod platform;
pub mod run_picture;
pub mod scaffold;
pub mod timing_picture;
