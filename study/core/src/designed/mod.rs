//! Studies of one's own design: log, data set, simulated cohort and screens of a person for a [`flotor_study_design::design::Design`].
//!
//! The lines of a log are those of the other experiments ([`crate::log`]); its first line has the design, and each further line a step
//! with its answer. The reader repeats the course: every step must follow.

mod attended;
mod cohort;
mod dataset;
mod log;
pub mod screen;
mod table;

pub use attended::{AttendedCourse, Effect, InputError};
pub use cohort::{DesignedCohort, DesignedError, DesignedPresenter, PresenterOf};
pub use dataset::{DesignedData, Progress};
pub use log::{Begin, DesignedLog, Event, FORMAT, StepEvent};
pub use table::{forms_tsv, trials_tsv};

#[cfg(test)]
mod tests;
