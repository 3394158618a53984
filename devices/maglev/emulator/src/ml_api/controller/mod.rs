//! Emulated controller of the Maglev 200: gains, locks, constraints, boundary, limits, faults, take-off and landing.
//!
//! Unknown behaviour of the real controller (`[?]` in the book's chapter) is decided here in favour of client programs:
//! invalid commands are rejected with the closest status, and only a fault switches the coils off.

mod answer;
mod coils;
mod gains;
mod law;
mod machine;
mod procedure;
mod progress;
#[cfg(test)]
mod tests;

pub use answer::Answer;
pub(super) use answer::is_command;
pub use machine::{Commanders, Controller, ControllerConfig, Flight, ForceCommand, Silence};
pub use procedure::ProcedureId;
