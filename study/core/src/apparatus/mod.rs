//! Perception experiments on a scene: the servo loop presents the stimuli of a protocol.
//!
//! - [`setup`]: a scene and its varied parameter, checked before the first trial.
//! - [`rig`]: presents to simulated observers in virtual time; [`real_time_rig`]: presents to people in real time.
//! - [`watch`]: the record of a presentation.
//! - [`attend`]: a person's sitting through a front end.
//!
//! Nothing here is real-time: the loop runs in the servo.

pub mod attend;
pub mod real_time_rig;
pub mod rig;
pub mod setup;
pub mod watch;

pub use setup::{Apparatus, ApparatusError, Kinematics};
