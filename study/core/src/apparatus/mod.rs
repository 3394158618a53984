//! Perception experiments on a scene: the servo loop presents the stimuli of a protocol.
//!
//! - [`setup`]: scene and varied parameter, checked before the first trial.
//! - [`rig`]: presents to simulated observers in virtual time; [`real_time_rig`]: presents to people in real time.
//! - [`designed_rig`]: presents studies of one's own design to simulated observers, in virtual time.
//! - [`watch`]: observer of a presentation, for measures and recordings.
//! - [`attend`]: sitting of a person, with a front end.
//!
//! Nothing here is real-time: the servo's thread runs the loop.

pub mod attend;
pub mod designed_rig;
pub mod real_time_rig;
pub mod rig;
pub mod setup;
mod stage;
pub mod watch;

pub use setup::{Apparatus, ApparatusError, Kinematics};
pub use stage::UnreadableFile;
