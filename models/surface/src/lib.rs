//! Smooth surface of a mesh file, touched with a ball.
#![allow(clippy::needless_range_loop)]

pub mod closest;
pub mod normals;
pub mod patch;
mod planes;
mod proxy;
pub mod soup;
pub mod surface;
pub mod topology;
pub mod tree;
pub mod weld;
