//! Elastic solid, touched with a sphere, a punch or a plate.
//!
//! Linear elasticity, small strains, with the exact rotation of the tool. All systems of equations are solved before the loop
//! and cached; a tick evaluates one energy and its gradient.
//!
//! - [`basis`], [`grid`], [`dissection`], [`dense`]: finite elements of any order on a block, and their sparse Cholesky
//!   factorisation with one order of sums.
//! - [`half_space`]: field of forces on an elastic half-space, the singular part of every contact.
//! - [`remainder`], [`table`]: difference between a block and a half-space, by finite elements.
//! - [`gmsh`], [`cylinder`], [`mesh`], [`cells`], [`facet`]: bodies of any shape, their elements and surface; [`body`]:
//!   difference between such a body and a half-space; [`recovery`]: error estimate of a mesh.
//! - [`refinement`], [`condensation`], [`touch`]: contact of a ball with any part of a body of tetrahedra, at one place.
//! - [`sphere`]: contact solver of a sphere. [`punch`], [`plate`]: rigid patches bonded to a surface.
//! - [`description`], [`prepare`], [`law`], [`cache`]: from a description to a law.
//! - [`atlas`], [`several`], [`rigid`], [`friction`]: laws evaluated in a tick, with the numerics of [`jet`] and [`spline`].
//! - [`drawing`], [`skin`]: pictures of the deformed solid.
//! - [`tetrahedra`]: linear elements, for comparison.
//! - `parameters`: schema; `plugin`: the contract.

// Loop indices name components of vectors and tensors, in several arrays at once.
#![allow(clippy::needless_range_loop)]

pub mod atlas;
pub mod basis;
pub mod body;
pub mod cache;
pub mod cells;
pub mod condensation;
pub mod cylinder;
pub mod dense;
pub mod description;
pub mod dissection;
pub mod drawing;
pub mod facet;
pub mod friction;
pub mod gmsh;
pub mod grid;
pub mod half_space;
pub mod jet;
pub mod law;
pub mod mesh;
mod parameters;
pub mod plate;
mod plugin;
pub mod prepare;
pub mod punch;
pub mod recovery;
pub mod refinement;
pub mod remainder;
pub mod rigid;
pub mod several;
pub mod skin;
pub mod sphere;
pub mod spline;
pub mod table;
pub mod tetrahedra;
pub mod touch;

pub use plugin::{FLOTOR_ENTRY, Solid};
