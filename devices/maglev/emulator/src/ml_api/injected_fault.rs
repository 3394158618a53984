//! Injected faults: on a connection, on the tick, in the machine; each occurs once, in a given state of the flotor,
//! except for a status in every Nth reply.

use super::controller::Flight;
use flotor_maglev::ml_api::{FaultBits, Status};
use std::str::FromStr;

/// Duration of an injected fault of the machine, s.
const MACHINE_FAULT_S: f64 = 0.5;

/// Treatment of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Deed {
    /// Normal reply to the call.
    Answer,
    /// No reply to this call and to later calls of the client.
    Silence,
    /// First half of the reply, and no reply to later calls of the client.
    HalfFrame,
    /// Orderly close of the client's connections.
    Close,
    /// Reset of the client's connections.
    Reset,
    /// Reply delayed by three seconds.
    Stall,
    /// Reply shortened by four bytes.
    WrongLength,
    /// Reply with this status, without any effect of the call.
    Status(Status),
}

/// Kind of an injected fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InjectedFaultKind {
    /// Treatment of one call in place of the normal reply.
    Call(Deed),
    /// Reply with this status, without any effect, to every Nth call.
    Status(Status, u32),
    /// A tick delayed by 50 ms.
    LateTick,
    /// Fault of the machine, for 0.5 s.
    Machine(FaultBits),
}

/// State in which a fault occurs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum When {
    /// In any state.
    Anytime,
    /// In this state of the flotor.
    In(Flight),
    /// While levitating, with a client registered for ticks.
    Ticking,
}

/// Injected fault with its state and delay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InjectedFault {
    /// Kind of the fault.
    pub kind: InjectedFaultKind,
    /// State in which the fault occurs.
    pub when: When,
    /// Delay after the start of the state, s.
    pub after_s: f64,
}

/// Error: text that describes no fault.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{0}` is not a fault: write KIND[@STATE][+MS]; kinds: silence, half-frame, close, reset, stall, wrong-length, \
     status=CODE/N (CODE decimal, every Nth call), late-tick, out-of-range, over-temperature, over-current, over-speed; states: landed, \
     taking-off, flying, ticking, landing"
)]
pub struct Unknown(String);

impl FromStr for InjectedFault {
    type Err = Unknown;

    fn from_str(text: &str) -> Result<Self, Unknown> {
        let unknown = || Unknown(text.to_owned());
        let (rest, after_s) = match text.split_once('+') {
            Some((rest, ms)) => {
                let delay_ms = ms.parse().ok().filter(|delay_ms: &f64| delay_ms.is_finite());
                (rest, delay_ms.ok_or_else(unknown)? * 1.0e-3)
            }
            None => (text, 0.0),
        };
        let (kind, when) = match rest.split_once('@') {
            Some((kind, state)) => {
                let when = match state {
                    "landed" => When::In(Flight::Landed),
                    "taking-off" => When::In(Flight::TakingOff),
                    "flying" => When::In(Flight::Flying),
                    "landing" => When::In(Flight::Landing),
                    "ticking" => When::Ticking,
                    _ => return Err(unknown()),
                };
                (kind, when)
            }
            None => (rest, When::Anytime),
        };
        let kind = match kind {
            "silence" => InjectedFaultKind::Call(Deed::Silence),
            "half-frame" => InjectedFaultKind::Call(Deed::HalfFrame),
            "close" => InjectedFaultKind::Call(Deed::Close),
            "reset" => InjectedFaultKind::Call(Deed::Reset),
            "stall" => InjectedFaultKind::Call(Deed::Stall),
            "wrong-length" => InjectedFaultKind::Call(Deed::WrongLength),
            "late-tick" => InjectedFaultKind::LateTick,
            "out-of-range" => InjectedFaultKind::Machine(FaultBits::SENSOR_RANGE),
            "over-temperature" => InjectedFaultKind::Machine(FaultBits::OVER_TEMPERATURE),
            "over-current" => InjectedFaultKind::Machine(FaultBits::OVER_CURRENT),
            "over-speed" => InjectedFaultKind::Machine(FaultBits::OVER_SPEED),
            other => {
                let (code, every) = other
                    .strip_prefix("status=")
                    .and_then(|rest| rest.split_once('/'))
                    .ok_or_else(unknown)?;
                let status = Status(code.parse().map_err(|_| unknown())?);
                let every = every.parse().ok().filter(|every| *every > 0).ok_or_else(unknown)?;
                InjectedFaultKind::Status(status, every)
            }
        };
        Ok(Self { kind, when, after_s })
    }
}

/// Injected faults: pending faults with their time in the required state (if in it), the active machine fault with its remaining time, and
/// the client that receives no more replies.
#[derive(Clone, Debug, Default)]
pub(super) struct Plan {
    pending: Vec<(InjectedFault, Option<f64>)>,
    calls: u32,
    silenced: Option<u64>,
    machine: Option<(FaultBits, f64)>,
    is_tick_late: bool,
}

impl Plan {
    pub(super) fn new(injected_faults: Vec<InjectedFault>) -> Self {
        // The controller starts landed, and a first call may come before its first servo interval is over.
        let at_start = |one: &InjectedFault| is_now(one.when, Flight::Landed, false).then_some(0.0);
        let pending = injected_faults.into_iter().map(|one| (one, at_start(&one)));
        Self { pending: pending.collect(), ..Self::default() }
    }

    /// Advances by a servo interval, s, in this state; returns the injected faults of the machine.
    pub(super) fn advance(&mut self, flight: Flight, is_ticking: bool, dt_s: f64) -> FaultBits {
        for (one, in_state_s) in &mut self.pending {
            *in_state_s = is_now(one.when, flight, is_ticking).then(|| in_state_s.unwrap_or(0.0) + dt_s);
        }
        if let Some((_, left_s)) = &mut self.machine {
            *left_s -= dt_s;
        }
        self.machine = self.machine.filter(|(_, left_s)| *left_s > 0.0);
        if let Some(InjectedFaultKind::Machine(bits)) =
            self.take(|kind| matches!(kind, InjectedFaultKind::Machine(_)))
        {
            self.machine = Some((bits, MACHINE_FAULT_S));
        }
        self.is_tick_late |= self.take(|kind| kind == InjectedFaultKind::LateTick).is_some();
        self.machine.map_or(FaultBits::NONE, |(bits, _)| bits)
    }

    /// Takes the first due fault of a kind.
    fn take(&mut self, is_wanted: impl Fn(InjectedFaultKind) -> bool) -> Option<InjectedFaultKind> {
        let is_taken = |(one, in_state_s): &(InjectedFault, Option<f64>)| {
            is_wanted(one.kind) && is_due(one.after_s, *in_state_s)
        };
        let place = self.pending.iter().position(is_taken)?;
        Some(self.pending.remove(place).0.kind)
    }

    /// Returns true once for a delayed tick.
    pub(super) fn delays_tick(&mut self) -> bool {
        std::mem::take(&mut self.is_tick_late)
    }

    /// Returns true if the client gets no more replies.
    pub(super) fn has_silenced(&self, client: u64) -> bool {
        self.silenced == Some(client)
    }

    /// Returns the treatment of a client's next call; a fault of a single call is used up.
    pub(super) fn deed(&mut self, client: u64) -> Deed {
        if self.has_silenced(client) {
            return Deed::Silence;
        }
        let every = self.pending.iter().find_map(|(one, in_state_s)| match one.kind {
            InjectedFaultKind::Status(status, every) if is_due(one.after_s, *in_state_s) => {
                Some((status, every))
            }
            _ => None,
        });
        if let Some((status, every)) = every {
            self.calls += 1;
            return if self.calls.is_multiple_of(every) { Deed::Status(status) } else { Deed::Answer };
        }
        let deed = match self.take(|kind| matches!(kind, InjectedFaultKind::Call(_))) {
            Some(InjectedFaultKind::Call(deed)) => deed,
            _ => Deed::Answer,
        };
        if matches!(deed, Deed::Silence | Deed::HalfFrame) {
            self.silenced = Some(client);
        }
        deed
    }
}

/// Returns true for a fault whose state has lasted for longer than its delay; without a delay, at once in the state.
fn is_due(after_s: f64, in_state_s: Option<f64>) -> bool {
    in_state_s.is_some_and(|in_state_s| after_s == 0.0 || in_state_s > after_s)
}

fn is_now(when: When, flight: Flight, is_ticking: bool) -> bool {
    match when {
        When::Anytime => true,
        When::In(state) => state == flight,
        When::Ticking => flight == Flight::Flying && is_ticking,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_read_as_they_are_written() {
        let read = |text: &str| text.parse::<InjectedFault>();
        let expected = InjectedFault {
            kind: InjectedFaultKind::Status(Status(5), 10),
            when: When::In(Flight::Flying),
            after_s: 0.2,
        };
        assert_eq!(read("status=5/10@flying+200"), Ok(expected));
        assert_eq!(read("reset").map(|one| one.when), Ok(When::Anytime));
        for wrong in
            ["", "rest", "status=5/0", "reset@up", "reset+soon", "reset+nan", "reset+inf", "status=x/1"]
        {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn the_first_call_of_all_suffers_a_fault_without_delay() {
        let deed = |fault: &str| Plan::new(vec![fault.parse().expect("as written")]).deed(1);
        assert_eq!(
            [deed("reset@landed"), deed("reset"), deed("status=5/1@landed")].map(|deed| deed == Deed::Answer),
            [false; 3]
        );
        assert_eq!([deed("reset@flying"), deed("reset@landed+1")], [Deed::Answer; 2]);
    }

    #[test]
    fn one_call_in_the_right_state_suffers_and_the_next_does_not() {
        let mut plan = Plan::new(vec!["reset@flying+5".parse().expect("as written")]);
        for (flight, deed) in [
            (Flight::Landed, Deed::Answer),
            (Flight::Flying, Deed::Answer),
            (Flight::Flying, Deed::Reset),
            (Flight::Flying, Deed::Answer),
        ] {
            for _ in 0..4 {
                assert_eq!(plan.advance(flight, false, 1.0e-3), FaultBits::NONE);
            }
            assert_eq!(plan.deed(1), deed);
        }
    }
}
