//! Perception experiments: presentations, answers, and their log. Device-independent.
//!
//! ```text
//!                      +----------------- a person, a simulated observer
//!                      v                        ^
//! Protocol -> Sitting::next -> Trial -> Presenter -> Exploration
//!                ^                                      |
//!                +------- Sitting::answer <-------------+--> log (one line per trial, on disk before the next)
//! ```
//!
//! - [`protocol`]: experiments and their settings.
//! - [`sitting`]: state machine of one subject's experiment, used for people, simulated observers and replay.
//! - [`procedure`]: adaptive choice of the next difference, and the resulting threshold.
//! - [`observer`]: simulated subjects; [`estimate`]: estimation of observers from answers; [`bias`]: accuracy of the estimators.
//! - [`log`]: hash-chained event log; [`dataset`]: data folder and tables.
//! - [`kinematics`]: movement measures of an exploration, from samples of handle and force.
//! - [`screen`]: screens of a person's sitting, for any front end; [`blinding`]: codes that replace conditions.
//! - [`conduct`]: runs a sitting with presenter, simulated subject and log.
//! - [`cohort`]: studies of many simulated subjects in parallel.
//! - [`designed`]: logs, data sets and cohorts of studies of one's own design.
//! - [`exclusion`]: exclusion rules, fixed before data collection.
//!
//! `flotor-analysis` computes thresholds, tests and effects from the logs.
//!
//! Procedures, estimators and streams of random numbers are those of `flotor-study-design`.
//!
//! Nothing here is real-time.

pub use flotor_study_design::{estimate, procedure};

#[cfg(feature = "apparatus")]
pub mod apparatus;
pub mod bias;
pub mod blinding;
pub mod cohort;
pub mod conduct;
pub mod dataset;
pub mod designed;
pub mod exclusion;
pub mod kinematics;
pub mod log;
pub mod observer;
mod platform;
pub mod protocol;
mod schedule;
pub mod screen;
pub mod sitting;
pub mod time_of_day;
pub mod trial;
