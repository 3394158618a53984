//! Identification of a real thing: from force over displacement to a law with the errors of its parameters.
//!
//! The laws form a ladder, from a constant stiffness to a curve of many points. Each is fitted by least squares and scored by its error
//! of prediction in parts of the measurement that were left out; the simplest law within one standard error of the best one is chosen,
//! and `none of these` is the answer if its residuals have structure that noise does not have.
//!
//! Data flows one way: [`csv`] or [`recording`] -> [`Measurement`] -> `cells` (means of some samples) -> `law` (predicted force) ->
//! `fit` (least squares) -> `ladder` (scores and choice) -> `uncertainty` and `displacement_noise` (intervals without bias) ->
//! [`Identification`] -> [`picture`], `curve` (a scene that renders the thing).
//!
//! Not real-time throughout.

mod cells;
pub mod cli;
pub mod csv;
mod curve;
mod displacement_noise;
mod fit;
mod identification;
mod ladder;
mod law;
mod linear_system;
mod measurement;
pub mod picture;
pub mod recording;
mod uncertainty;

pub use fit::Device;
pub use identification::{Estimate, Identification, IdentifyError, Rung, identify};
pub use law::Law;
pub use measurement::{LEAST_SAMPLES, Measurement, MeasurementError};
