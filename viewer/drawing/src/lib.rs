//! The 3D view: triangles of what a model describes, and pictures of them.
//!
//! - [`geometry`] makes the triangles: wires, primitives, surfaces, arrows, ground.
//! - A [`camera`] sees them in a [`light`].
//! - [`contact`]: where a handle touches a body.
//! - [`placing`]: the places of several devices.
//! - [`drag`] moves a point of the scene with a pointer.
//! - [`gpu`] draws them on a GPU or a software adapter, into a texture; [`raster`] on the processor, without an adapter.
//!
//! Knows neither a window nor a run: the viewer says what is drawn, in which colours, and where the picture goes.
//!
//! Nothing here is real-time.

pub mod camera;
pub mod contact;
pub mod drag;
pub mod geometry;
pub mod gpu;
pub mod light;
pub mod placing;
pub mod raster;
