//! Embeds Flotor in a program: reads scenes, finds and loads plugins, runs sessions, records and reports them.
//!
//! ```text
//! file -> Scene -> Session (plugins loaded, settings checked, devices paired) -> run
//! ```
//!
//! - [`scene`]: what is to be run, read from TOML.
//! - [`registry`]: where plugins are.
//! - [`Session`]: from a scene to a run.
//! - [`program`]: the program itself as a source of force.
//! - [`headless`]: a whole run in virtual time, recorded and reported.
//! - [`summary`]: what a run came to; [`run_description`]: all it takes to repeat it.
//! - [`telemetry`]: a running session, for other programs to watch and change.
//! - [`PluginProcess`]: a process for the code of plugins, which ends with its host.
//! - [`calibration_file`]: the correction of a device's vertical force, as measured and kept.

pub mod calibration_file;
mod calls;
mod estimates;
mod feel;
pub mod headless;
mod long_call;
mod platform;
mod plugin_process;
pub mod program;
pub mod registry;
pub mod run_description;
mod run_recording;
pub mod scene;
mod session;
pub mod summary;
pub mod telemetry;

pub use calls::{
    Call, CallError, LIMIT_VARIABLE, Notice, STEP_LIMIT_VARIABLE, Unresponsive, is_left_behind,
    stop_waits_with, tell_notices,
};
pub use estimates::estimates;
pub use flotor_servo::THREAD_ADVICE;
pub use long_call::{Exceeded, LongCall, step_limit};
pub use platform::{ThreadClock, end_with_this_thread};
pub use plugin_process::PluginProcess;
pub use run_recording::RunRecording;
pub use session::{
    ControlError, Controls, DeviceOutcome, Guardian, LatchGuard, LatchWatch, Lockstep, Misbehaved, NewValue,
    Observer, Outcome, PluginReport, Remains, RunError, RunOptions, Session, Steps, StopReach, StopTime,
    StopWithoutHost, Strength, StrongDevice, Tap, WatchdogStart, check_plugins, prepare_model,
    start_watchdog_process,
};
