//! A helical spring with end plates in three dimensions, as a force model.
//!
//! One idea a module, from the wire to the wrench:
//! - [`rigidity`]: wire and coil become the rigidities of an equivalent rod; [`preset`]: springs with names.
//! - [`pose`]: where the upper plate is; [`response`], [`validity`]: what a law answers.
//! - [`entire`] and [`beam_column`]: the functions of the compressed rod, without branches or poles of their own.
//! - [`closed_form`]: the thesis's printed law, regularised, and its current-length correction.
//! - [`energy`]: the conservative law in three dimensions, the default. Its bending part is in [`bending`], to
//!   fourth order in the angles by [`shape`] and [`quartic`]; [`angle`] gives angles without `acos`, and [`level`]
//!   keeps the law smooth close to buckling.
//! - [`centerline`]: the shape, for people to look at.
//!
//! Derivations and sources are in the book, chapter "The spring".

pub mod angle;
pub mod beam_column;
pub mod bending;
pub mod centerline;
pub mod closed_form;
pub mod energy;
pub mod entire;
pub mod level;
mod parameters;
mod plugin;
pub mod pose;
pub mod preset;
pub mod quartic;
pub mod response;
pub mod rigidity;
pub mod rod;
pub mod seat;
pub mod shape;
pub mod validity;

pub use plugin::{FLOTOR_ENTRY, SpringModel};
