//! A membrane of masses and springs, touched with a ball.
//!
//! Masses hang on springs that pull and push along the line between their ends; the handle is a ball that pushes the
//! masses out of itself and feels the sum of what they push back:
//!
//! ```text
//! m a = sum k (1 - l0 / |d|) d  +  m g  -  m c v  +  contact,      F = - sum contact
//! ```
//!
//! The thesis names such networks in its introduction as the common way to show a deformable body, and as too simple to
//! be right about one; here they are the large model with a history the contract has to carry.
//!
//! - [`mesh`]: what is linked to what: a stretched sheet, a hanging chain, the edges of a mesh file.
//! - `obj`, `topology`: the text of a mesh file, and its connections by position.
//! - [`network`]: the state, as one array per coordinate, and its step in time.
//! - `links`: springs in runs of equal distance between their ends, so that a run is a loop over slices.
//! - `regions`: blocks of masses that rest are left out until something moves beside them.
//! - [`touch`]: the ball that walks through a network, and its field: force and stiffness for a faster loop.
//! - `plugin`: parameters and the contract.

mod links;
pub mod mesh;
pub mod network;
mod obj;
mod plugin;
mod regions;
mod topology;
pub mod touch;

pub use plugin::{FLOTOR_ENTRY, Membrane};
