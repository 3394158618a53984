//! Perception experiments on a scene: the servo loop presents the stimuli of a protocol.
//!
//! - [`setup`]: scene and varied parameter, checked before the first trial.
//! - [`rig`]: presents to simulated observers in virtual time; [`real_time_rig`]: presents to people in real time.
//! - [`designed_setup`]: scene of a study of one's own design; [`designed_rig`] presents it in virtual time, [`designed_person_rig`] in
//!   real time.
//! - [`watch`]: observer of a presentation, for measures and recordings.
//! - [`attend`]: sitting of a person, with a front end; [`designed_attend`]: the same for a study of one's own design.
//!
//! Nothing here is real-time: the servo's thread runs the loop.

pub mod attend;
pub mod designed_attend;
mod designed_change;
pub mod designed_person_rig;
pub mod designed_rig;
pub mod designed_setup;
pub mod real_time_rig;
mod real_time_run;
pub mod rig;
pub mod setup;
mod stage;
pub mod watch;

pub use setup::{Apparatus, ApparatusError, Kinematics};
pub use stage::UnreadableFile;
