//! The state of a run: whether force may reach the hand, and what it takes to get there and back.
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
//! While nobody knows where the hand is there is no force, and none to fade out: not the models', nor the boundary's.
//!
//! In the last three a run ends, and an emergency stop latches: force comes back only with a new run, which opens and
//! activates the device anew. A fault may still become an emergency stop, never the other way round.

use flotor_core::trace::Events;
use flotor_hal::Fault;

/// Who pressed the emergency stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EmergencySource {
    /// A key of the terminal.
    Key,
    /// The signal `SIGUSR1`, or a second one that asks for an end.
    Signal,
    /// The latch of the machine: the emergency stop of another run, or of the network.
    Latch,
    /// A program that watches the run: the viewer.
    Watcher,
    /// A button of the device that the scene names.
    Button,
    /// The device's own emergency stop.
    Device,
}

impl EmergencySource {
    /// All of them.
    pub(crate) const ALL: [EmergencySource; 6] =
        [Self::Key, Self::Signal, Self::Latch, Self::Watcher, Self::Button, Self::Device];

    /// For people.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Key => "key",
            Self::Signal => "signal",
            Self::Latch => "pressed at another run or on the network",
            Self::Watcher => "the viewer's window or another client",
            Self::Button => "button of the device",
            Self::Device => "the device's own",
        }
    }
}

/// Why a run may give no force any more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// The device said so.
    Device(Fault),
    /// The loop had not finished a tick for too long, and the watchdog had stopped the device.
    Watchdog,
    /// The force of a device swung between its limits, and went on when it was damped.
    Oscillation,
}

/// Where a run stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RunState {
    /// The gate opens: the models' force fades in.
    Ramping {
        /// When it began to, ns.
        since_ns: u64,
    },
    /// The models' force reaches the hand.
    Active,
    /// No usable sample for a while: no force until there is one.
    Holding,
    /// Asked to stop: all force fades out.
    Releasing {
        /// When it began to, ns.
        since_ns: u64,
        /// How far the gate was open then, 0 to 1.
        from: f64,
    },
    /// Ended in order.
    Stopped,
    /// Ended by a fault.
    Faulted(Cause),
    /// Ended by somebody who pressed the emergency stop.
    EmergencyStopped(EmergencySource),
}

/// What can change the state of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RunEvent {
    /// Time goes on.
    Time,
    /// There has been no usable sample for longer than a hand may be trusted to stay where it was.
    SamplesLost,
    /// There is one again.
    SamplesBack,
    /// An orderly end is asked for.
    StopAsked,
    /// The run can go no further.
    Failed(Cause),
    /// The emergency stop.
    Emergency(EmergencySource),
}

/// How much of what is asked for may pass, 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gate {
    /// For the models.
    pub models: f64,
    /// For the boundary, which stands at once and while the models fade in.
    pub boundary: f64,
}

impl Gate {
    /// Everything.
    pub const OPEN: Gate = Gate { models: 1.0, boundary: 1.0 };
    /// Nothing.
    pub const SHUT: Gate = Gate { models: 0.0, boundary: 0.0 };
}

impl RunState {
    /// Where a run begins.
    pub const START: RunState = RunState::Ramping { since_ns: 0 };

    /// The state after an event at a time. Real-time: bounded, no allocation.
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
            (Self::Releasing { .. }, RunEvent::SamplesLost) | (Self::Holding, RunEvent::StopAsked) => {
                Self::Stopped
            }
            (Self::Ramping { .. } | Self::Active, RunEvent::StopAsked) => {
                Self::Releasing { since_ns: now_ns, from: self.gate(now_ns, ramp_ns).models }
            }
            _ => self,
        }
    }

    /// How far the gate is open. Real-time: bounded, no allocation.
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

    /// What a tick in this state leaves in its record. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub const fn events(self) -> Events {
        match self {
            Self::Ramping { .. } => Events::RAMPING,
            Self::Holding => Events::HOLDING,
            Self::Releasing { .. } => Events::RELEASING,
            Self::EmergencyStopped(_) => Events::EMERGENCY_STOP,
            Self::Active | Self::Stopped | Self::Faulted(_) => Events::NONE,
        }
    }

    /// True where a run ends.
    #[inline]
    #[must_use]
    pub const fn is_over(self) -> bool {
        matches!(self, Self::Stopped | Self::Faulted(_) | Self::EmergencyStopped(_))
    }
}

fn elapsed(since_ns: u64, now_ns: u64) -> u64 {
    now_ns.saturating_sub(since_ns)
}

/// From 0 to 1 over `length_ns`, with zero slope at both ends.
fn fade(elapsed_ns: u64, length_ns: u64) -> f64 {
    if elapsed_ns >= length_ns {
        return 1.0;
    }
    let part = elapsed_ns as f64 / length_ns as f64;
    part * part * (3.0 - 2.0 * part)
}

#[cfg(test)]
mod tests;
