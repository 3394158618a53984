//! State machine of a run, which determines the fraction of the force that may reach the hand.
//!
//! ```text
//!            ramp over            samples lost
//!  Ramping ------------> Active ---------------> Holding
//!   | ^                    |                      | |
//!   | |                    |     samples back     | |
//!   | +--------------------|----------------------+ |
//!   |                      |                        |
//!   +------ stop request --+                        | stop request
//!                          v                        |
//!                      Releasing                    |
//!                          | ramp over,             |
//!                          v samples lost           |
//!                       Stopped <-------------------+
//!
//!  From every state but Stopped:  device fault, watchdog -> Faulted
//!                                 emergency stop         -> EmergencyStopped
//!  Only an emergency stop leaves Faulted. Stopped and EmergencyStopped are final.
//! ```
//!
//! While the position of the hand is unknown, neither models nor boundary exert a force, and no force has to fade out.
//!
//! A run ends in the last three states, and an emergency stop latches: force returns only with a new run, which opens and activates
//! the device anew. A fault may still become an emergency stop, never the other way round.

use crate::fade;
use crate::trace::Events;
use flotor_hal::Fault;

/// Source of an emergency stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EmergencySource {
    /// A key of the terminal.
    Key,
    /// Signal `SIGUSR1`, or a second termination signal (on Windows, a console event).
    Signal,
    /// The latch of the machine: the emergency stop of another run, or of the network.
    Latch,
    /// Client that observes the run, such as the viewer.
    Watcher,
    /// Button of the device, named in the scene.
    Button,
    /// The device's own emergency stop.
    Device,
}

impl EmergencySource {
    /// All sources, in the order of their codes.
    pub const ALL: [EmergencySource; 6] =
        [Self::Key, Self::Signal, Self::Latch, Self::Watcher, Self::Button, Self::Device];

    /// Returns the source as text for users.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Key => "key",
            Self::Signal => "signal",
            Self::Latch => "pressed at another run or on the network",
            Self::Watcher => "the viewer's window or another client",
            Self::Button => "button of the device",
            Self::Device => "raised by the device",
        }
    }
}

/// Cause of a fault that ends a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Fault of the device.
    Device(Fault),
    /// The loop did not finish a tick in time and the watchdog stopped the device, or the gap between two ticks was too long.
    Watchdog,
    /// The force of a device oscillated between its limits, even after damping.
    Oscillation,
}

/// State of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RunState {
    /// Start of the run, or return of lost samples: the models' force fades in.
    Ramping {
        /// Start of the fade, ns.
        since_ns: u64,
    },
    /// The models' force reaches the hand.
    Active,
    /// No usable sample for a while: no force until a usable sample arrives.
    Holding,
    /// Stop requested: all force fades out.
    Releasing {
        /// Start of the fade, ns.
        since_ns: u64,
        /// Opening of the gate at the start of the fade, 0 to 1.
        from: f64,
    },
    /// Ended in order.
    Stopped,
    /// Ended by a fault.
    Faulted(Cause),
    /// Ended by an emergency stop.
    EmergencyStopped(EmergencySource),
}

/// Event that may change the state of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RunEvent {
    /// Passage of time: a fade may have ended.
    Time,
    /// No usable sample for longer than a hand may be trusted to stay in place.
    SamplesLost,
    /// A usable sample has arrived.
    SamplesBack,
    /// An orderly end is requested.
    StopRequested,
    /// The run cannot continue.
    Failed(Cause),
    /// Emergency stop from this source.
    Emergency(EmergencySource),
}

/// Fractions of the requested force that may pass, 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gate {
    /// Fraction of the models' force.
    pub models: f64,
    /// Fraction of the boundary's force, which acts in full while the models fade in.
    pub boundary: f64,
}

impl Gate {
    /// Open gate: all force passes.
    pub const OPEN: Gate = Gate { models: 1.0, boundary: 1.0 };
    /// Closed gate: no force passes.
    pub const SHUT: Gate = Gate { models: 0.0, boundary: 0.0 };
}

impl RunState {
    /// First state of a run.
    pub const START: RunState = RunState::Ramping { since_ns: 0 };

    /// Returns the state after an event at the run time `now_ns`, with fades of `ramp_ns`. Real-time: bounded, no allocation.
    #[must_use]
    pub fn after(self, event: RunEvent, now_ns: u64, ramp_ns: u64) -> Self {
        match (self, event) {
            (Self::Stopped | Self::EmergencyStopped(_), _) => self,
            (_, RunEvent::Emergency(source)) => Self::EmergencyStopped(source),
            (Self::Faulted(_), _) => self,
            (_, RunEvent::Failed(Cause::Device(Fault::EmergencyStop))) => {
                Self::EmergencyStopped(EmergencySource::Device)
            }
            (_, RunEvent::Failed(cause)) => Self::Faulted(cause),

            (Self::Ramping { since_ns }, RunEvent::Time) if elapsed(since_ns, now_ns) >= ramp_ns => {
                Self::Active
            }
            (Self::Releasing { since_ns, .. }, RunEvent::Time) if elapsed(since_ns, now_ns) >= ramp_ns => {
                Self::Stopped
            }
            (Self::Ramping { .. } | Self::Active, RunEvent::SamplesLost) => Self::Holding,
            (Self::Holding, RunEvent::SamplesBack) => Self::Ramping { since_ns: now_ns },
            (Self::Releasing { .. }, RunEvent::SamplesLost) | (Self::Holding, RunEvent::StopRequested) => {
                Self::Stopped
            }
            (Self::Ramping { .. } | Self::Active, RunEvent::StopRequested) => {
                Self::Releasing { since_ns: now_ns, from: self.gate(now_ns, ramp_ns).models }
            }
            _ => self,
        }
    }

    /// Returns the fractions of force that may pass at the run time `now_ns`, with fades of `ramp_ns`. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn gate(self, now_ns: u64, ramp_ns: u64) -> Gate {
        match self {
            Self::Active => Gate::OPEN,
            Self::Ramping { since_ns } => {
                Gate { models: fade(elapsed(since_ns, now_ns), ramp_ns), boundary: 1.0 }
            }
            Self::Releasing { since_ns, from } => {
                let left = 1.0 - fade(elapsed(since_ns, now_ns), ramp_ns);
                Gate { models: from * left, boundary: left }
            }
            Self::Holding | Self::Stopped | Self::Faulted(_) | Self::EmergencyStopped(_) => Gate::SHUT,
        }
    }

    /// Returns the events of this state for the record of a tick. Real-time: bounded, no allocation.
    #[inline]
    pub const fn events(self) -> Events {
        match self {
            Self::Ramping { .. } => Events::RAMPING,
            Self::Holding => Events::HOLDING,
            Self::Releasing { .. } => Events::RELEASING,
            Self::EmergencyStopped(_) => Events::EMERGENCY_STOP,
            Self::Active | Self::Stopped | Self::Faulted(_) => Events::NONE,
        }
    }

    /// Returns true if the run has ended.
    #[inline]
    #[must_use]
    pub const fn is_over(self) -> bool {
        matches!(self, Self::Stopped | Self::Faulted(_) | Self::EmergencyStopped(_))
    }
}

fn elapsed(since_ns: u64, now_ns: u64) -> u64 {
    now_ns.saturating_sub(since_ns)
}

#[cfg(test)]
mod tests;
