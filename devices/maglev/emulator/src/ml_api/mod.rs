//! The controller of the Maglev 200 as its clients see it: the ML API on TCP, gains per axis, procedures, events.
//!
//! ```text
//! connections -> server -> controller: requests, gains, procedures -> wrench -> plant -> sample -> ticks, events
//! ```
//!
//! - [`controller`]: what the machine does. Pure: requests and samples come in, replies and a wrench come out.
//! - [`server`]: connections, clients, callback connections, events.
//! - [`misbehavior`]: what goes wrong on purpose.
//! - [`Machine`]: the servo loop over a [`Plant`](crate::Plant); [`proxy`]: the host's loop over any device.

pub mod controller;
pub mod misbehavior;
pub mod proxy;
mod run;
pub mod server;

pub use controller::{Commanders, Controller, ControllerConfig, ForceCommand, Silence};
pub use misbehavior::{Misbehavior, MisbehaviorKind, When};
pub use run::Machine;
pub use server::Server;
