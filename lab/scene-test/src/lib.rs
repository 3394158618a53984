//! Scenes with expectations (`flotor test`): a force model or a device passes or fails in CI without hardware.
//!
//! `file` parses a `NAME.test.toml`, `case` lists its cases, `check` and `run` execute and judge them, `minimise` finds the
//! shortest run that still fails, `near` a replay that starts near the failure, `report` writes the results, `bless` updates
//! expected numbers. Every run, evaluation, validation and stress test has its own process (`process`): a plugin that crashes
//! fails only its case. Not real-time throughout.

mod bless;
mod bound;
mod case;
mod check;
pub mod cli;
mod curve;
mod file;
mod minimise;
mod near;
mod numbers;
mod platform;
mod process;
mod report;
mod rule;
mod run;
