//! Measurements of plugins, loops and recordings.
//!
//! - [`evaluate`]: evaluation of a force model at given [`poses`].
//! - [`mod@bench`]: cost and error of an evaluation.
//! - [`stability`]: largest stable stiffness of the servo.
//! - [`jitter`]: timing of the servo.
//! - [`replay`]: re-evaluation of the models of a recording.
//!
//! The checks and stress tests of models and devices, and the shared means to call a model, are in `flotor-judge`.
//!
//! Nothing here drives a device with a hand; not real-time throughout.

pub mod bench;
pub mod cli;
pub mod evaluate;
pub mod jitter;
mod platform;
pub mod poses;
pub mod replay;
pub mod stability;

pub use flotor_judge::sampling;
use flotor_judge::{PERIOD_NS, Progress, Size};
