//! Force model of a helical spring with end plates in three dimensions.
//!
//! One topic per module, from the wire to the wrench:
//! - [`rigidity`]: wire and coil become the rigidities of an equivalent rod; [`preset`]: springs with names.
//! - [`pose`]: pose of the upper plate; [`response`], [`validity`]: response of a law.
//! - [`flotor_lanes`]: SIMD numerics for one pose or several poses side by side, such as angles and saturation; [`batch`]
//!   evaluates a law at many poses.
//! - [`beam_column`]: resistance of a compressed rod to rotations of its ends, without branches or poles of its own.
//! - [`thesis`]: the thesis's printed code with every branch, window and jump, for comparison.
//! - [`closed_form`]: the thesis's printed law, regularised, and its current-length correction. [`precision`] defines
//!   the storage format of its numbers.
//! - [`energy`]: the conservative law in three dimensions, the default. Its bending part is in [`bending`], to
//!   fourth order in the angles by [`shape`] and [`quartic`]; `remainder` adds the higher orders, fitted to the rod.
//! - [`rod`]: the exact rod, past buckling too, with a history.
//! - [`rod_blend`]: blending from the law `energy` to the rod where the tolerance requires it, as one energy;
//!   `rod_share` computes the weight of the rod, in the variables of `directions`.
//! - [`held`]: a law with effects of a real coil: [`contact`] of its coils, and the twist and the off-axis ends of its
//!   [`wire`].
//! - [`seat`]: a lower plate that may roll up on its rim and lift off.
//! - [`centerline`]: the shape, for visualisation.
//!
//! Derivations and sources are in the book, chapter "The spring".

pub mod batch;
pub mod beam_column;
pub mod bending;
pub mod centerline;
pub mod closed_form;
pub mod contact;
pub mod contract;
mod directions;
mod elastic;
pub mod energy;
pub mod held;
mod pace;
mod parameters;
mod plugin;
pub mod pose;
pub mod precision;
mod prepared;
pub mod preset;
pub mod quartic;
mod remainder;
pub mod response;
pub mod rigidity;
pub mod rod;
pub mod rod_blend;
mod rod_share;
pub mod seat;
pub mod shape;
pub mod thesis;
pub mod validity;
pub mod wire;

pub use plugin::{FLOTOR_ENTRY, SpringModel};
