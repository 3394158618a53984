//! Smooth surface of a mesh file, touched with a ball.
//!
//! # Law
//!
//! A proxy ball of the tool's radius never enters the surface; its centre `q` is the point nearest to the centre `c` of the tool
//! that the ball reaches by sliding. The force is the gradient of one energy, `k/2 |q - c|^2`.
//!
//! # Surface
//!
//! The triangles of a mesh are samples of a curved surface, which is reconstructed. Each triangle carries a quartic Gregory
//! patch, a displacement from its plane: boundaries are cubics that two neighbours share, and along a boundary both have the
//! plane spanned by its tangent `T(s)` and a vector `K(s)` that is linear from corner to corner. Normals are thus continuous over
//! edges and at corners (G1), and the distance to the surface is continuously differentiable up to the centres of curvature. The
//! position errs by the fourth power of the edge length on a sphere, by the third elsewhere; planes are exact. At a sharp edge
//! each side has its own normals. Curvature is bounded, and jumps at edges of patches. `docs/src/adr/0018-smooth-surface.md` has
//! the alternatives.
//!
//! # Modules
//!
//! - [`files`], [`soup`]: triangles of a file. [`weld`], [`topology`], [`normals`]: an oriented mesh with sharp edges and
//!   normals.
//! - [`patch`], [`closest`]: a curved triangle, and its closest point. `tree`, [`surface`]: all of them, and the search.
//! - `contacts`, `planes`, `proxy`, [`touch`]: the proxy ball, with friction. [`material`]: material parameters by group.
//! - [`object`], [`check`], `store`, `cache`: from a file to a surface that instances share.
//! - `parameters`, `plugin`, `saved`, `drawing`, `built_in`: the contract.
#![allow(clippy::needless_range_loop)] // coordinates and corners have numbers, in several arrays at once

mod built_in;
mod cache;
pub mod check;
pub mod closest;
mod contacts;
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
mod saved;
pub mod soup;
mod store;
pub mod surface;
pub mod topology;
pub mod touch;
mod tree;
pub mod weld;

pub use plugin::{FLOTOR_ENTRY, Touched};
