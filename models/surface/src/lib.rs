//! Smooth surface of a mesh file, touched with a ball.
#![allow(clippy::needless_range_loop)] // coordinates and corners have numbers, in several arrays at once

mod built_in;
mod cache;
pub mod check;
pub mod closest;
mod drawing;
pub mod files;
pub mod material;
pub mod normals;
pub mod object;
mod parallel;
mod parameters;
pub mod patch;
mod planes;
mod plugin;
mod proxy;
pub mod soup;
mod store;
pub mod surface;
pub mod topology;
pub mod touch;
pub mod tree;
pub mod weld;

pub use plugin::{FLOTOR_ENTRY, Touched};
