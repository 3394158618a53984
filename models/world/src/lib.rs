//! World of rigid bodies, touched with a tool.
//!
//! Bodies fall, stack, slide and hang on joints ([rapier3d](https://rapier.rs) moves them); the tool in the hand is a ball, a capsule
//! or a box. Where the tool enters a body by a depth `d`, a spring pushes both apart, and friction holds them up to Coulomb's limit:
//!
//! ```text
//! N = k d + b v,    |F| <= mu N,    force on the body = - force on the hand
//! ```
//!
//! A step of a world needs milliseconds and allocates, so a world runs asynchronously: it moves its bodies under these forces, and
//! publishes the planes that stand for the surfaces near the tool, with their velocities (`flotor.contact-set/1`). The loop computes
//! the same law at every tick. In the loop itself a world has no force.
//!
//! - [`file`](mod@file): the file of a world, checked. [`form`]: balls, boxes, capsules and planes.
//! - [`bodies`]: the bodies in the solver, with their joints. [`touch`]: tool and bodies, contacts, friction.
//! - [`simulation`]: both in time. [`own`]: built-in worlds.
//! - `drawing`, `plugin`: the contract. `vectors`: the two versions of glam.

pub mod bodies;
mod drawing;
pub mod file;
pub mod form;
pub mod own;
mod plugin;
pub mod simulation;
pub mod touch;
mod vectors;

pub use plugin::{FLOTOR_ENTRY, Touched};
