//! Simulated observers with known sensitivity.

mod ternary;

pub use ternary::TernaryObserver;
