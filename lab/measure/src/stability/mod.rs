//! Largest stable stiffness of a virtual spring on a device: measured on the simulated flotor, compared with theory.
//!
//! A servo renders a spring by sampling the handle's position `x` once a period `T`; the force `-u` on the handle is constant
//! until the next sample (zero-order hold),
//!
//! ```text
//! u = K x[k] + B (x[k] - x[k-1]) / T
//! ```
//!
//! (the "virtual wall" of the haptics literature, here acting on both sides). Sampling and holding delay the force by
//! half a period and more, so the spring returns slightly more energy than it received; if the damping of the device
//! cannot dissipate that, the handle starts to buzz by itself. The largest `K` without buzz is the limit of the device.
//!
//! - [`simulated_loop`]: loop around a loaded device plugin, and criterion of stability.
//! - [`theory`]: limits without simulation: exact, by passivity, by Gil's rule.
//! - [`grid`]: cases, measured in parallel on all processors.
//!
//! Not real-time throughout.

pub mod grid;
mod search;
pub mod simulated_loop;
pub mod theory;

pub use grid::{Case, Row, default_cases, measure, worst_deviation};
pub use search::is_search_end;
pub use simulated_loop::{Grip, LoopError};
