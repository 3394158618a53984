//! The state of a run: whether force may reach the hand, and what it takes to get there and back.
//!
//! ```text
//!            ramp over            samples lost
//!  Ramping ------------> Active ---------------> Holding
//!   | ^                    |                      | |
//!   | |                    |     samples back     | |
//!   | +--------------------|----------------------+ |
//!   |                      |                        |
//!   +------- stop asked ---+                        | stop asked   any but Stopped:
//!                          v                        |                device fault, watchdog -> Faulted
//!                      Releasing                    |                emergency stop         -> EmergencyStopped
//!                          | ramp over,             |
//!                          v samples lost           |
//!                       Stopped <-------------------+              from Faulted only an emergency stop leads on,
//!                                                                    from the other two nothing
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
    /// For people.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Key => "key",
            Self::Signal => "signal",
            Self::Latch => "pressed at another run or on the network",
            Self::Watcher => "a program that watches",
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
mod tests {
    use super::*;

    const RAMP_NS: u64 = 100;
    const NOW_NS: u64 = 1_000;
    const FAULT: Cause = Cause::Device(Fault::OverTemperature);

    const YOUNG: RunState = RunState::Ramping { since_ns: NOW_NS - 50 };
    const GROWN: RunState = RunState::Ramping { since_ns: NOW_NS - RAMP_NS };
    const LEAVING: RunState = RunState::Releasing { since_ns: NOW_NS - 50, from: 1.0 };
    const LEFT: RunState = RunState::Releasing { since_ns: NOW_NS - RAMP_NS, from: 1.0 };
    const FAULTED: RunState = RunState::Faulted(FAULT);
    const PRESSED: RunState = RunState::EmergencyStopped(EmergencySource::Key);

    const STATES: [RunState; 9] = [
        YOUNG,
        GROWN,
        RunState::Active,
        RunState::Holding,
        LEAVING,
        LEFT,
        RunState::Stopped,
        FAULTED,
        PRESSED,
    ];
    const EVENTS: [RunEvent; 7] = [
        RunEvent::Time,
        RunEvent::SamplesLost,
        RunEvent::SamplesBack,
        RunEvent::StopAsked,
        RunEvent::Failed(Cause::Watchdog),
        RunEvent::Failed(Cause::Device(Fault::EmergencyStop)),
        RunEvent::Emergency(EmergencySource::Signal),
    ];

    /// Every state, every event, and where it leads: rows as [`STATES`], columns as [`EVENTS`].
    #[test]
    fn every_transition_is_the_one_that_is_drawn() {
        use RunState::{Active, Holding, Stopped};
        let bitten = RunState::Faulted(Cause::Watchdog);
        let device = RunState::EmergencyStopped(EmergencySource::Device);
        let signal = RunState::EmergencyStopped(EmergencySource::Signal);
        let release = |from| RunState::Releasing { since_ns: NOW_NS, from };
        let again = RunState::Ramping { since_ns: NOW_NS };
        let table = [
            [YOUNG, Holding, YOUNG, release(0.5), bitten, device, signal],
            [Active, Holding, GROWN, release(1.0), bitten, device, signal],
            [Active, Holding, Active, release(1.0), bitten, device, signal],
            [Holding, Holding, again, Stopped, bitten, device, signal],
            [LEAVING, Stopped, LEAVING, LEAVING, bitten, device, signal],
            [Stopped, Stopped, LEFT, LEFT, bitten, device, signal],
            [Stopped; 7],
            [FAULTED, FAULTED, FAULTED, FAULTED, FAULTED, FAULTED, signal],
            [PRESSED; 7],
        ];
        for (state, row) in STATES.iter().zip(table) {
            for (event, expected) in EVENTS.iter().zip(row) {
                let found = state.after(*event, NOW_NS, RAMP_NS);
                assert_eq!(found, expected, "{state:?} after {event:?}");
            }
        }
    }

    #[test]
    fn no_state_that_is_over_lets_anything_pass_or_ever_leads_back() {
        for state in STATES.into_iter().filter(|state| state.is_over()) {
            for event in EVENTS {
                let next = state.after(event, NOW_NS, RAMP_NS);
                assert!(next.is_over(), "{state:?} after {event:?}: {next:?}");
                assert_eq!(next.gate(NOW_NS, RAMP_NS), Gate::SHUT);
            }
        }
    }

    #[test]
    fn the_gate_opens_and_shuts_without_a_step() {
        let mut state = RunState::START;
        let mut last = state.gate(0, RAMP_NS);
        assert_eq!(last, Gate { models: 0.0, boundary: 1.0 });
        let mut highest = 0.0_f64;
        // Stopped half-way through the ramp, where a careless fade-out would start from 1.
        for now_ns in 0..=200 {
            let event = if now_ns == 50 { RunEvent::StopAsked } else { RunEvent::Time };
            state = state.after(event, now_ns, RAMP_NS);
            let gate = state.gate(now_ns, RAMP_NS);
            // Steepest slope of 3 p^2 - 2 p^3 is 1.5 per ramp.
            assert!(
                (gate.models - last.models).abs() <= 1.5 / 100.0 + 1.0e-12,
                "{now_ns}: {last:?} {gate:?}"
            );
            highest = highest.max(gate.models);
            last = gate;
        }
        assert_eq!((state, last), (RunState::Stopped, Gate::SHUT));
        assert!((highest - 0.5).abs() < 0.02, "{highest}");
    }

    /// Out of `Holding` nothing may push before there are samples again: the boundary would, on a pose that is old.
    #[test]
    fn a_gate_that_is_shut_opens_with_new_samples_only() {
        for event in EVENTS {
            let next = RunState::Holding.after(event, NOW_NS, RAMP_NS);
            let is_shut = next.gate(NOW_NS, RAMP_NS) == Gate::SHUT;
            assert_eq!(is_shut, event != RunEvent::SamplesBack, "{event:?}");
        }
    }

    #[test]
    fn without_a_ramp_the_gate_is_open_at_once() {
        assert_eq!(RunState::START.gate(0, 0), Gate::OPEN);
        assert_eq!(RunState::START.after(RunEvent::Time, 0, 0), RunState::Active);
    }
}
