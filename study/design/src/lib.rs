//! Designs of perception experiments: pure state machines, without input or output.
//!
//! - [`procedure`]: adaptive choice of the next difference, and the resulting threshold.
//! - [`estimate`]: estimation of observers from answers; [`observer`]: simulated observers.
//! - [`random`]: streams of random numbers without stored state.
//!
//! Nothing here is real-time.

pub mod answer;
pub mod estimate;
pub mod observer;
pub mod procedure;
pub mod random;
pub mod subject;
mod word;
