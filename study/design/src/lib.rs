//! Designs of perception experiments: pure state machines, without input or output.
//!
//! - [`design`]: design of a study, with its [`factor`]s, [`order`]s, [`stimulus`], [`task`], [`method`] and questionnaires ([`form`]).
//! - [`course`]: state machine of one subject in one session.
//! - [`procedure`]: adaptive choice of the next difference, and the resulting threshold.
//! - [`estimate`]: estimation of observers from answers; [`observer`]: simulated observers.
//! - [`random`]: streams of random numbers without stored state.
//!
//! Nothing here is real-time.

pub mod answer;
pub mod course;
pub mod design;
pub mod error;
pub mod estimate;
pub mod factor;
pub mod form;
pub mod method;
pub mod observer;
pub mod order;
pub mod procedure;
pub mod random;
pub mod stimulus;
pub mod subject;
pub mod task;
pub mod value;
mod word;
