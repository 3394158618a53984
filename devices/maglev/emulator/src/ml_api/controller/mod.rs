//! The machine: gains, locks, constraints, boundary, limits, faults, and the procedures that lift the flotor and let it down.
//!
//! What is not known of the real one (`[?]` in the book's chapter) is decided here for a program's sake: a command that
//! makes no sense is refused with the status nearest to it, nothing but a fault switches off.

mod answer;
mod coils;
mod gains;
mod law;
mod machine;
mod procedure;
#[cfg(test)]
mod tests;

pub use answer::Answer;
pub use machine::{Commanders, Controller, ControllerConfig, Flight, ForceCommand, Injected, Silence};
pub use procedure::Ticket;
