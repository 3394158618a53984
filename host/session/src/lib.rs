//! Embeds Flotor in a program: reads scenes, finds and loads plugins, runs sessions, records and reports them.
//!
//! ```text
//! file -> Scene -> Session (plugins loaded, settings checked, devices paired) -> run
//! ```
//!
//! - [`scene`]: what is to be run, read from TOML.
//! - [`registry`]: where plugins are.
//! - [`Session`]: from a scene to a run.
//! - [`headless`]: a whole run in virtual time, recorded and reported.
//! - [`summary`]: what a run came to; [`run_description`]: all it takes to repeat it.
//! - [`telemetry`]: a running session, for other programs to watch and change.
//! - [`calibration_file`]: the correction of a device's vertical force, as measured and kept.

pub mod calibration_file;
pub mod headless;
pub mod registry;
pub mod run_description;
mod run_recording;
pub mod scene;
mod session;
pub mod summary;
pub mod telemetry;

pub use run_recording::RunRecording;
pub use session::{
    ControlError, Controls, DeviceOutcome, LatchGuard, LatchWatch, Misbehaved, NewValue, Observer, Outcome,
    PluginReport, RunError, RunOptions, Session, Steps, Strength, StrongDevice, prepare_model,
};
