//! The controller of the Maglev 200 as seen by its clients: the ML API on TCP, gains per axis, procedures, events.
//!
//! ```text
//! connections -> server -> controller: requests, gains, procedures -> wrench -> plant -> sample -> ticks, events
//! ```
//!
//! - [`controller`]: the machine's behaviour. Without side effects: requests and samples in, replies and a wrench out.
//! - [`server`]: connections, clients, callback connections, events.
//! - [`injected_fault`]: injected faults.
//! - [`Machine`]: the servo loop over a [`Plant`](crate::Plant); [`proxy`]: the host's loop over any device.

pub mod controller;
pub mod injected_fault;
pub mod proxy;
mod run;
pub mod server;

pub use controller::{Commanders, Controller, ControllerConfig, ForceCommand, Silence};
pub use injected_fault::{InjectedFault, InjectedFaultKind, When};
pub use run::Machine;
