//! Flotor's host: finds and loads plugins, runs them in a servo loop inside an envelope they cannot bypass,
//! records what happened and reports how time was kept.
//!
//! One tick, in one direction:
//!
//! ```text
//! device.read -> mapping -> models -> mapping -> envelope -> device.write -> record
//! ```
//!
//! - [`scene`]: what is to be run, read from TOML.
//! - [`registry`]: where plugins are.
//! - [`session`]: from a scene to a run.
//! - [`servo`]: the tick, the clock, the envelope; the only real-time module.
//! - [`coupling`]: two devices held together by a virtual spring, over any delay; [`port_energy`]: what crosses a port.
//! - [`calibration`]: how much of a commanded force arrives.
//! - [`scaffold`]: the start of somebody's own plugin.
//! - [`study`]: the results of a perception experiment, as a page.
//! - [`lab`]: measurements: what a model, a device, a loop and a recording are worth.
//! - [`live`]: a running host, for other programs to watch and change.
//! - [`headless`]: a whole run in virtual time for other programs.
//! - [`trace`]: what a tick leaves behind; [`mod@record`] writes it down, [`plot`] draws it.
//! - [`cli`]: the `flotor` command.

#![cfg_attr(rtsan, feature(sanitize))] // the step `blocking` of .ci/full

pub mod cli;
pub mod run_picture;
pub mod scaffold;
pub mod timing_picture;
