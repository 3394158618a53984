//! Embeds Flotor in a program: reads scenes, finds and loads plugins, runs sessions, and records and summarises runs.
//!
//! ```text
//! file -> Scene -> Session (plugins loaded, settings checked, devices paired) -> run
//! ```
//!
//! - [`scene`]: description of a run, read from TOML.
//! - [`registry`]: search for plugins.
//! - [`Session`]: preparation and run of a scene.
//! - [`program`]: the embedding program as a source of force.
//! - [`headless`]: a whole run in virtual time, recorded and reported.
//! - [`summary`]: results of a run; [`run_description`]: all data to repeat the run.
//! - [`telemetry`]: server through which other programs observe and change a running session.
//! - [`PluginProcess`]: process for plugin code, killed when its host ends.
//! - [`calibration_file`]: measured correction of a device's vertical force.

pub mod calibration_file;
mod calls;
pub mod headless;
mod long_call;
mod measurements;
mod platform;
mod plugin_process;
pub mod program;
pub mod registry;
pub mod run_description;
pub mod scene;
mod session;
pub mod summary;
pub mod telemetry;

pub use calls::{
    Call, CallError, LIMIT_VARIABLE, Notice, STEP_LIMIT_VARIABLE, Unresponsive, is_abandoned, on_notice,
    stop_waits_with,
};
pub use flotor_servo::THREAD_ADVICE;
pub use long_call::{Exceeded, LongCall, step_limit};
pub use measurements::{Measurements, RunRecording};
pub use platform::ThreadClock;
pub use plugin_process::PluginProcess;
pub use session::{
    ControlError, Controls, DeviceOutcome, FaultyPlugin, Guardian, LatchGuard, LatchWatch, LiveNumbers,
    Lockstep, NewValue, Observer, Outcome, PluginReport, RunError, RunOptions, SavedRun, Session, Steps,
    StopReach, StopTime, StopWithoutHost, Strength, StrongDevice, Tap, UnfreedPlugins, WatchdogStart,
    check_plugins, prepare_model, start_watchdog_process,
};
