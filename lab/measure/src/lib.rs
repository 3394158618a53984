//! Measurements of plugins, loops and recordings.
//!
//! - [`evaluate`]: a force model at given [`poses`].
//! - [`mod@bench`]: cost and error of an evaluation.
//! - [`stability`]: the largest stable stiffness of the servo.
//! - [`jitter`]: timing of the servo.
//! - [`replay`]: the models of a recording re-evaluated.
//!
//! The judges of models and devices, and what all of these ask a model with, are `flotor-judge`.
//!
//! Nothing here runs a hand; not real-time throughout.

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
