//! Simulated observers with known sensitivity.

mod population;
mod simulated;
mod ternary;

pub use population::Population;
pub use simulated::SimulatedObserver;
pub use ternary::TernaryObserver;
