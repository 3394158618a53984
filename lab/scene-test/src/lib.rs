//! `flotor test`: scenes with expectations, so that a force model or a device passes or fails in CI without hardware.
//!
//! `file` reads a `NAME.test.toml`, `case` makes its cases, `check` carries each out and judges it, `minimise` finds the
//! shortest run that still fails, `report` writes the results, `bless` changes expected numbers. Every run, evaluation,
//! validation and stress test is a process of its own (`process`): a plugin that crashes fails its case and no other. Not
//! real-time throughout.

mod bless;
mod bound;
mod case;
mod check;
pub mod cli;
mod curve;
mod file;
mod minimise;
mod numbers;
mod platform;
mod process;
mod report;
mod rule;
