//! Perception experiments on a scene: what a protocol asks for is presented by the servo loop.
//!
//! - [`setup`]: a scene and what is varied in it, checked before the first trial.
//! - [`rig`]: presents to simulated observers in virtual time; [`live`]: to people, in real time.
//! - [`watch`]: what is taken down of a presentation.
//! - [`attend`]: a person's sitting through a front end.
//! - [`noise`]: white noise on headphones, where there is a player.
//! - [`report`]: the page of the results.
//!
//! Nothing here is real-time: the loop is the servo's.

pub mod attend;
mod figures;
pub mod live;
pub mod noise;
pub mod report;
pub mod rig;
pub mod setup;
pub mod watch;

pub use setup::{Apparatus, ApparatusError, Kinematics};
