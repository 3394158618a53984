//! Shared parts of the drop-in libraries: a session inside another program.
//!
//! ```text
//!  program -> libHD / libdhd / libhdPhantom -> Host, Station -> port of the model `program` -> servo, envelope -> device
//! ```
//!
//! A drop-in library serves a program in place of another maker's library. Everything except that maker's interface is here: the
//! scene (`FLOTOR_SCENE`), the recording (`FLOTOR_RECORD`), the run and its end, the devices as [`Station`]s, the wait for a
//! tick, and the duties of a guest in the program: no signal handler by default, no activity in a forked child, no panic, a report
//! at the end. The scene is prepared at the first call; the run begins when the first device is opened.
//!
//! Not real-time: the loop has a thread of its own, and neither side waits for the other.
#![allow(unsafe_code)] // `process.rs` and `pointer.rs`; listed in tests/tests/system/architecture.rs

mod entry;
mod frame;
mod host;
pub mod pointer;
mod process;
mod run;
mod settings;
mod station;

pub use frame::{Frame, length};
pub use host::{Host, host, prepare};
pub use process::{Language, guarded, interned, language, library, quietly};
pub use run::{no_thread, report_no_thread};
pub use settings::{Pace, Settings, SharedControlGroup, env_value};
pub use station::{Axes, State, Station, Turn};

/// Version of Flotor, NUL-terminated; a drop-in exports it as `flotor_dropin`, so that a plugin that loads a maker's library can
/// refuse a drop-in, which would load itself without end.
pub const MARKER: &[u8] = concat!("flotor ", env!("CARGO_PKG_VERSION"), "\0").as_bytes();
