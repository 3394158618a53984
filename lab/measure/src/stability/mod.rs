//! The stiffest virtual spring that stays stable on a device: measured on the simulated flotor, compared with theory.
//!
//! A servo renders a spring by sampling the handle's position `x` once a period `T` and a zero-order hold
//! of the force until the next sample,
//!
//! ```text
//! u = K x[k] + B (x[k] - x[k-1]) / T
//! ```
//!
//! (the "virtual wall" of the haptics literature, here felt on both sides). Sampling and holding delay the
//! force by half a period and more, so the spring returns a little more energy than was put into it; if drag
//! cannot take that out, the handle starts to buzz by itself. The largest `K` without that is what a device
//! can render.
//!
//! - [`simulated_loop`]: the loop itself around a loaded device plugin; what counts as stable.
//! - [`theory`]: the same limit without simulating: exact, by passivity, by Gil's rule.
//! - [`grid`]: the cases, measured side by side on all processors.
//!
//! Not real-time throughout.

pub mod grid;
mod search;
pub mod simulated_loop;
pub mod theory;

pub use grid::{Case, Row, default_cases, measure, worst_deviation};
pub use search::is_search_end;
pub use simulated_loop::{Grip, LoopError};
