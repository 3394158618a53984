//! Real-time core: ticks at a fixed rate, inside limits that no plugin can bypass.
//!
//! - [`Servo`]: the tick; [`Clock`]: its time base; [`Envelope`]: limits of the wrench that reaches a hand.
//! - [`last_stop`], [`watchdog_process`]: stop of the devices when the process dies.
//! - [`engine`]: execution of a model: in the loop, asynchronously at its own rate, or in a worker process.
//!
//! Independent of scenes and files: the caller provides opened devices and prepared models.
#![cfg_attr(rtsan, feature(sanitize))] // the step `blocking` of .ci/full

mod budget;
mod clock;
pub mod engine;
mod envelope;
mod forces;
pub mod guest;
mod heartbeat;
mod hot_swap;
pub mod last_stop;
mod models;
mod parameters;
pub mod platform;
mod port;
mod queue;
#[cfg(test)]
#[path = "../../../tests/src/random.rs"]
mod random;
mod realtime;
mod run;
mod run_end;
mod saved;
mod servo;
mod stage_timer;
mod standby;
mod station;
mod stop;
mod timing;
mod watchdog;
pub mod watchdog_process;

pub use budget::TimeBudget;
pub use clock::{Clock, Due, PaceLost, Schedule, SpinWindow, monotonic_ns, sleep_until};
pub use engine::{Engine, Stepped};
pub use envelope::{Envelope, EnvelopeEffects, StageEffect};
pub use flotor_core::run_state::{Cause, EmergencySource, Gate, RunEvent, RunState};
pub use forces::{Coupled, CouplingOutcome, Forces};
pub use heartbeat::{Heartbeat, Place, Stuck};
pub use hot_swap::{HostSwaps, LoopSwaps, swap_queues};
pub use last_stop::{LastStop, Unwound};
pub use models::{Layer, LayerReport, Replacement};
pub use parameters::{
    ChangeReport, ChangeSender, PLUGIN, Pace, ParameterChange, ParameterQueue, ReportReceiver,
    ScheduledChange, WEIGHT,
};
pub use platform::{PRIORITY_NAME, THREAD_ADVICE};
pub use port::Port;
pub use queue::{Consumer, Producer, drain, queue};
pub use realtime::{Core, Privilege, RealTimeReport};
pub use realtime::{enter_guard_priority, enter_real_time, enter_worker_priority, probe_real_time};
pub use run::Loop;
pub use run_end::RunEnd;
pub use saved::{SavedLoop, Unsaved};
pub use servo::{Dismantled, RunConfig, Servo};
pub use standby::{Guarded, Standby};
pub use station::{Reported, Station};
pub use stop::StopSwitch;
pub use timing::{Durations, Percentiles, Stage, Timing};
pub use watchdog::start as start_watchdog;
