//! Viewer of running hosts and recordings.
//!
//! A separate program, so that no graphics driver can delay a servo (docs/src/adr/0008-viewer-process.md). It
//! shows the bodies of the models in 3D, forces and motions as traces, and panels for the parameters.
//!
//! - [`feed`]: data of a running host, for a history (`flotor-history`); [`event_counts`]: counts of events; [`panel`]: parameters.
//! - [`devices`]: devices of a run, one of them chosen.
//! - [`trace`]: points of a plot, updated with each frame; [`export`]: traces as files; [`display_options`]: options of a command
//!   line.
//! - [`shape`]: bodies of the models; [`scene`]: triangles of the bodies, made with `flotor-drawing`.
//! - [`canvas`]: 3D view in the interface, drawn on a GPU or the processor; [`picture`]: a whole picture without a window, drawn
//!   by [`flat`].
//! - [`ui`], [`palette`]: parts of the interface; [`app`]: window with all parts; [`sound`]: acoustic warning.
//! - [`window`]: opening of the window; [`cost`]: processor time and memory; [`frame_rate`]: frames per second.
//! - [`saved_settings`]: settings of the window, saved for the next window.
//! - [`experiment`]: a sitting of a perception experiment, and its screens.
//!
//! Not real-time.

pub mod app;
pub mod canvas;
pub mod cost;
pub mod devices;
pub mod display_options;
pub mod event_counts;
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
pub mod saved_settings;
pub mod scene;
pub mod shape;
pub mod sound;
pub mod trace;
pub mod ui;
pub mod window;
