//! The viewer: what the hand feels, for the eye.
//!
//! A program of its own, so that no graphics driver can hold up a servo (docs/src/adr/0008-viewer-process.md). It
//! reads a recording, draws the bodies of its models in 3D, and plots what was felt.
//!
//! - [`history`]: what has been seen of a run; [`quantity`] what can be plotted of it, [`decimate`] with how few
//!   points.
//! - [`shape`]: where the bodies of the models are; [`geometry`] makes triangles of them, [`scene`] a picture's worth,
//!   seen by a [`camera`] in a [`light`].
//! - [`raster`]: draws without a GPU; [`picture`] is a whole picture made that way.
//! - [`ui`], [`palette`]: the interface.
//!
//! Nothing here is real-time.

pub mod camera;
pub mod decimate;
pub mod geometry;
pub mod history;
pub mod light;
pub mod palette;
pub mod picture;
pub mod quantity;
pub mod raster;
pub mod scene;
pub mod shape;
pub mod ui;
