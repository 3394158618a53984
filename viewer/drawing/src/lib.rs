//! 3D view: tessellation of the scene, and rendering of its triangles.
//!
//! - [`geometry`]: triangles of wires, primitives, surfaces, arrows, ground.
//! - [`camera`] and [`light`]: projection and shading.
//! - [`contact`]: contact of a handle with a body, and its mark.
//! - [`placing`]: places of several devices.
//! - [`drag`]: dragging a point of the scene with a pointer.
//! - [`gpu`]: rendering by a GPU or a software adapter, into a texture; [`raster`]: rendering by the processor, without an adapter.
//!
//! Independent of windows and runs: the viewer passes bodies, colours and the target of the picture.
//!
//! Not real-time.

pub mod camera;
pub mod contact;
pub mod drag;
pub mod geometry;
pub mod gpu;
pub mod light;
pub mod placing;
pub mod raster;
