//! Membrane of masses and springs, touched with a ball.
//!
//! The masses are linked by springs that pull and push along the line between their ends. The handle is a ball that
//! pushes the masses out of its volume; the force on the ball is the sum of the reactions of the masses:
//!
//! ```text
//! m a = sum k (1 - l0 / |d|) d  +  m g  -  m c v  +  contact,      F = - sum contact
//! ```
//!
//! The thesis mentions such networks in its introduction as the common way to display a deformable body, and as too simple
//! to be accurate. Here the membrane tests the contract with a large model that has a state.
//!
//! - [`mesh`]: links between masses: a stretched sheet, the edges of a mesh file.
//! - `obj`, `topology`: reader of a mesh file, and its connections by position.
//! - [`network`]: state and time step; [`vectors`]: one array per coordinate.
//! - `links`: springs in runs of equal distance between their ends, so that a run is a loop over slices.
//! - `regions`: blocks of masses at rest, skipped until the ball or a linked block activates them.
//! - [`ball`]: ball that pushes the masses; [`touch`]: ball that moves through a network, and the plane that stands for the network in
//!   a faster loop.
//! - `plugin`: parameters and the contract.

pub mod ball;
mod links;
pub mod mesh;
pub mod network;
mod obj;
mod plugin;
mod regions;
mod topology;
pub mod touch;
pub mod vectors;

pub use plugin::{FLOTOR_ENTRY, Membrane};
