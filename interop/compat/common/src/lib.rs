//! What the drop-in libraries share: a session inside another program.
//!
//! ```text
//!  program -> libHD / libdhd / libhdPhantom -> Host, Station -> port of the model `program` -> servo, envelope -> device
//! ```
//!
//! A drop-in answers where a program calls another maker's library. All of it that is not that maker's interface is here: the
//! scene (`FLOTOR_SCENE`), the recording (`FLOTOR_RECORD`), the run and its end, the devices as [`Station`]s, waiting for the
//! tick, and what a guest owes the program: no signal handler unless asked for, nothing in a forked child, no panic, a report
//! at its end. The scene is prepared when something is asked first; the run begins when a device is opened first.
//!
//! Nothing here is real-time: the loop has a thread of its own, and neither side waits for the other.
#![allow(unsafe_code)] // `process.rs` and `pointer.rs`; listed in tests/tests/system/architecture.rs

mod frame;
mod host;
pub mod pointer;
mod process;
mod run;
mod settings;
mod station;

pub use frame::Frame;
pub use host::{Host, host, prepare};
pub use process::{Language, guarded, language, library, quietly};
pub use settings::{Pace, Settings, SharedControlGroup, said};
pub use station::{Axes, State, Station, Turn};

/// What a drop-in exports as `flotor_dropin`, so that a plugin that loads a maker's library can refuse one of these: it would
/// load itself, without end. The version of Flotor, terminated.
pub const MARKER: &[u8] = concat!("flotor ", env!("CARGO_PKG_VERSION"), "\0").as_bytes();
