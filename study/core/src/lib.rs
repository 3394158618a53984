//! Perception experiments: presentations, answers, and the log of both. Knows trials, and no device.
//!
//! ```text
//!                      +----------------- a person, a simulated observer
//!                      v                        ^
//! Protocol -> Sitting::next -> Trial -> Presenter -> Exploration
//!                ^                                      |
//!                +------- Sitting::answer <-------------+--> log (one line per trial, on disk before the next)
//! ```
//!
//! - [`protocol`]: the experiments and every choice in them.
//! - [`sitting`]: one subject's way through an experiment, the same for people, simulated observers and replay.
//! - [`procedure`]: which difference comes next, and the threshold in the end.
//! - [`observer`]: simulated subjects; [`estimate`]: what they must be like, given their answers; [`bias`]: how well
//!   that is found.
//! - [`log`]: what happened, line by line, chained; [`dataset`]: where it lies and the tables made from it.
//! - [`kinematics`]: how a stimulus was explored, from samples of handle and force.
//! - [`screen`]: a person's way through a sitting, for any front end; [`blinding`]: codes in place of conditions.
//! - [`conduct`]: a sitting with presenter, simulated subject and log put together.
//! - [`cohort`]: many simulated subjects at once.
//! - [`exclusion`]: rules of exclusion, decided beforehand.
//!
//! `flotor-analysis` computes thresholds, tests and effects from the logs.
//!
//! Nothing here is real-time.

#[cfg(feature = "apparatus")]
pub mod apparatus;
pub mod bias;
pub mod blinding;
pub mod cohort;
pub mod conduct;
pub mod dataset;
pub mod estimate;
pub mod exclusion;
pub mod kinematics;
pub mod log;
pub mod observer;
mod platform;
pub mod procedure;
pub mod protocol;
mod random;
mod schedule;
pub mod screen;
pub mod sitting;
pub mod time_of_day;
pub mod trial;
