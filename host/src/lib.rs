//! The `flotor` command: arguments, output, plots of runs, and templates of plugins.
//!
//! - [`cli`]: the commands.
//! - [`scaffold`]: creation of plugins, for `flotor new`.
//! - [`run_picture`], [`timing_picture`]: plots of a run and of its timing.
//!
//! To embed Flotor in a program, use `flotor-session`; this crate is for the command alone.

pub mod cli;
mod diagnosis;
pub mod peak_bounds;
mod platform;
pub mod run_picture;
pub mod scaffold;
pub mod timing_picture;
