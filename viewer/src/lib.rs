//! The viewer: what the hand feels, for the eye.
//!
//! A program of its own, so that no graphics driver can delay a servo (docs/src/adr/0008-viewer-process.md). It
//! shows a running host or a recording: the bodies of its models in 3D, what was felt as traces, and panels to change it.
//!
//! - [`feed`] reads the history of a running host (`flotor-history`), [`tally`] counts events, [`panel`] is what can be set.
//! - [`devices`]: the devices of a run, one of which is looked at.
//! - [`trace`]: the points of a plot from picture to picture; [`export`] of traces as files, [`chosen`] on a command line.
//! - [`shape`]: where the bodies of the models are; [`scene`] makes triangles of them with `flotor-drawing`.
//! - [`canvas`]: the 3D view in the interface, drawn on a GPU or the processor; [`picture`] a whole picture without a window, whose
//!   interface [`flat`] draws.
//! - [`ui`], [`palette`]: the parts of the interface; [`app`] puts them together. [`sound`] warns the ear.
//! - [`window`]: opens it, or says why there is none; [`cost`] is what it takes of the machine, [`frame_rate`] its pictures a second.
//! - [`remembered`]: what a person has chosen about the window, from one time to the next.
//! - [`experiment`]: a sitting of a perception experiment, and its screens.
//!
//! Nothing here is real-time.

pub mod app;
pub mod canvas;
pub mod chosen;
pub mod cost;
pub mod devices;
pub mod experiment;
pub mod export;
pub mod feed;
pub mod flat;
pub mod frame_rate;
pub mod guide;
pub mod palette;
pub mod panel;
pub mod picture;
mod platform;
pub mod pointer_order;
pub mod remembered;
pub mod scene;
pub mod shape;
pub mod sound;
pub mod tally;
pub mod trace;
pub mod ui;
pub mod window;
