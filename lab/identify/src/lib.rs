//! Identification of the force law of a real object from measured force and displacement, with the uncertainty of its parameters.
//!
//! The laws form a ladder, from a constant stiffness to a curve of many points. Each is fitted by least squares and scored by
//! cross-validation, its prediction error in parts of the measurement left out of the fit; the simplest law within one standard
//! error of the best one is chosen, and the result is `none of these` if its residuals are not noise alone.
//!
//! Data flows one way: [`csv`] or [`recording`] -> [`Measurement`] -> `cells` (means of successive samples) -> `law` (predicted
//! force) -> `fit` (least squares) -> `ladder` (scores and choice) -> `uncertainty` and `displacement_noise` (intervals without
//! bias) -> [`Identification`] -> [`picture`], `curve` (a scene that renders the object).
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
