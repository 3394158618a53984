//! The interface: parts that window, tests and headless pictures put together.

pub mod legend;
pub mod plots;
pub mod readout;
pub mod style;
