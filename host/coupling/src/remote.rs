//! End of a coupling whose other end is on another host.

use super::brake::Brake;
use super::claims::{ClaimExcess, Claims, Reach};
use super::{CouplingConfig, CouplingEnd, End, PortSample, Pull};
use flotor_core::peer::{DISPATCH_WORDS, Dispatch, PeerState, TankState};
use flotor_core::trace::Events;
use flotor_hal::{DeviceState, Tick, Wrench};
use flotor_sync::{Observer, Publisher, latest};

/// Timeout and fade-in time of a remote end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LinkTimeouts {
    /// Time without a message after which the end removes its force, ns.
    pub silence_ns: u64,
    /// Time over which the force fades in after the first message and after a timeout, ns.
    pub fade_ns: u64,
}

/// Connection between an end in the loop and its peer link, in both directions. Neither side waits for the other: only
/// the newest state counts.
pub struct Line {
    /// Newest message of this end. Its fields `run`, `partner` and `since` are 0: the peer link sets them.
    pub outgoing: Observer<Dispatch, DISPATCH_WORDS>,
    /// Cell for the newest message to this end.
    pub incoming: Publisher<Dispatch, DISPATCH_WORDS>,
    /// Time without a message after which the partner is gone, ns.
    pub silence_ns: u64,
}

/// Statistics of the messages from the partner.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinkStatistics {
    /// Number of ticks in which a message was accepted.
    pub ticks: u64,
    /// Number of timeouts of the partner.
    pub silences: u64,
    /// Longest time without a message, shorter than the timeout, ns.
    pub longest_wait_ns: u64,
    /// Number of implausible messages, which were ignored.
    pub implausible: u64,
    /// Run of the last partner; 0 before the first message.
    pub run: u64,
    /// Energy tank of the partner, as last received.
    pub partner: TankState,
    /// Energy accepted from partners, J. The energy delivered to the local hand is at most this energy plus the energy
    /// that the local hand put in.
    pub accepted_j: f64,
    /// Rejected part of the partners' claims.
    pub cut: ClaimExcess,
    /// Number of ticks in which a claim was cut.
    pub cut_ticks: u64,
    /// Runs rejected because of their claims, whose messages are ignored; 0: free place. Without a free place, all
    /// messages are ignored.
    pub rejected_runs: [u64; 3],
}

/// End of a coupling whose partner is on another host, with the line to its peer link.
///
/// Before the first message of the partner, and after the timeout, the force is zero: the position of the partner is
/// unknown. When messages arrive (again), the force fades in.
pub struct RemoteEnd {
    end: End,
    timeouts: LinkTimeouts,
    outgoing: Publisher<Dispatch, DISPATCH_WORDS>,
    incoming: Observer<Dispatch, DISPATCH_WORDS>,
    /// Version of the message taken in last.
    version: u64,
    /// Run of the partner, and the tick since which the partner has this run as its partner.
    partner: Option<(u64, u64)>,
    hold: Hold,
    claims: Claims,
    brake: Brake,
    link: LinkStatistics,
    /// True if the message of this tick was implausible.
    is_implausible: bool,
    /// True if a rejected partner may have thrown the handle: the brake acts until the handle is slow enough.
    is_thrown: bool,
}

/// State of the connection to the partner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Hold {
    /// Without force: the partner's position is unknown.
    Released,
    /// Connected: last message at `heard_ns`, no timeout since `since_ns`.
    On { since_ns: u64, heard_ns: u64 },
}

/// Initial content of the cells, never used as a message.
const NOBODY: Dispatch = Dispatch {
    run: 0,
    partner: 0,
    since: 0,
    tick: 0,
    state: PeerState { pose: flotor_hal::Pose::HOME, twist: flotor_hal::Twist::ZERO, passed_on_j: 0.0 },
    tank: TankState { level_j: 0.0, lowest_j: 0.0, gone_in_j: 0.0, discarded_j: 0.0 },
};

impl RemoteEnd {
    /// Creates an end without a partner, and the line for its peer link; `reach` is the range of the local device,
    /// `period_s` the time between ticks. Not real-time.
    #[must_use]
    pub fn new(
        config: &CouplingConfig,
        end: &CouplingEnd,
        period_s: f64,
        timeouts: LinkTimeouts,
        reach: Reach,
    ) -> (Self, Line) {
        let (outgoing, for_partner) = latest(NOBODY);
        let (from_partner, incoming) = latest(NOBODY);
        let end = End::new(config, &end.mapping, period_s);
        let end = Self {
            claims: Claims::new(config, &end.mapping, reach, period_s),
            brake: Brake::new(reach, period_s),
            end,
            timeouts,
            outgoing,
            incoming,
            version: 0,
            partner: None,
            hold: Hold::Released,
            link: LinkStatistics::default(),
            is_implausible: false,
            is_thrown: false,
        };
        (end, Line { outgoing: for_partner, incoming: from_partner, silence_ns: timeouts.silence_ns })
    }

    /// Runs one tick: checks and receives a message or detects a timeout, and publishes the state of this end; returns
    /// the request of this end. Real-time: bounded, no allocation.
    #[inline]
    pub fn step(&mut self, tick: &Tick, sample: PortSample<'_>) -> Pull {
        self.end.observe(sample.state, &sample.held);
        self.claims.pass(self.end.passed_on_j());
        self.listen(tick.time_ns, sample.state);
        let state = match self.hold {
            Hold::Released => self.end.call(sample.state),
            Hold::On { .. } => self.end.send_state(sample.state),
        };
        self.outgoing.publish(&Dispatch { tick: tick.index, state, tank: self.tank(), ..NOBODY });
        match self.hold {
            Hold::Released if self.is_thrown => {
                let pull = self.end.pull_part(sample.state, 0.0, &self.brake);
                self.is_thrown = pull.wrench != Wrench::ZERO;
                pull
            }
            Hold::Released => self.end.release(),
            Hold::On { since_ns, .. } => {
                let part = self.part_at(tick.time_ns - since_ns);
                self.end.pull_part(sample.state, part, &self.brake)
            }
        }
    }

    /// Returns the events of the connection in this tick. Real-time: bounded, no allocation.
    #[inline]
    pub fn events(&self) -> Events {
        let mut events = Events::NONE;
        if self.hold == Hold::Released {
            events.insert(Events::PARTNER_SILENT);
        }
        if self.is_implausible {
            events.insert(Events::IMPLAUSIBLE_SAMPLE);
        }
        if self.claims.is_cut {
            events.insert(Events::PARTNER_LIMITED);
        }
        events
    }

    /// Returns the state of this end's energy tank. Real-time: bounded, no allocation.
    #[must_use]
    pub fn tank(&self) -> TankState {
        self.end.tank.state()
    }

    /// Returns the statistics of the partner's messages. Real-time: bounded, no allocation.
    #[must_use]
    pub fn link(&self) -> LinkStatistics {
        LinkStatistics { accepted_j: self.claims.accepted_j, cut: self.claims.cut, ..self.link }
    }

    /// Processes a new message, or checks the timeout.
    #[inline]
    fn listen(&mut self, now_ns: u64, here: &DeviceState) {
        // A cell that is being written now is read again in the next tick.
        self.is_implausible = false;
        let newest = self.incoming.read().filter(|(version, _)| *version != self.version);
        if let Some((version, dispatch)) = newest {
            self.version = version;
            if self.claims.can_be(&dispatch.state, &self.end.mapping) {
                self.receive(&dispatch, now_ns, here);
            } else {
                self.is_implausible = true;
                self.link.implausible += 1;
                if self.link.run == 0 {
                    self.link.run = dispatch.run;
                }
            }
        }
        if let Hold::On { heard_ns, .. } = self.hold {
            let wait_ns = now_ns - heard_ns;
            if wait_ns >= self.timeouts.silence_ns {
                self.hold = Hold::Released;
                self.link.silences += 1;
            } else {
                self.link.longest_wait_ns = self.link.longest_wait_ns.max(wait_ns);
            }
        }
    }

    #[inline]
    fn receive(&mut self, dispatch: &Dispatch, now_ns: u64, here: &DeviceState) {
        let is_rejected = self.link.rejected_runs.contains(&dispatch.run);
        if is_rejected || !self.link.rejected_runs.contains(&0) {
            return;
        }
        let partner = (dispatch.run, dispatch.since);
        let before = self.partner.replace(partner);
        if before != Some(partner) {
            // Another run may be anywhere: the force fades in as for the first one, also when a run returns after another.
            self.claims.meet(&dispatch.state, before.is_none_or(|(run, _)| run != dispatch.run));
            self.hold = Hold::Released;
        }
        let silent_ns = match self.hold {
            Hold::Released => {
                self.claims.forget_place();
                0
            }
            Hold::On { heard_ns, .. } => now_ns - heard_ns,
        };
        let mapping = &self.end.mapping;
        let accepted = self.claims.accept(&dispatch.state, here, mapping, silent_ns as f64 * 1.0e-9);
        self.end.receive(&accepted);
        self.link.cut_ticks += u64::from(self.claims.is_cut);
        if self.claims.is_too_much() {
            if let Some(place) = self.link.rejected_runs.iter_mut().find(|run| **run == 0) {
                *place = dispatch.run;
            }
            self.hold = Hold::Released;
            self.is_thrown = true;
            return;
        }
        self.link.run = dispatch.run;
        self.link.ticks += 1;
        self.link.partner = dispatch.tank;
        let since_ns = match self.hold {
            Hold::Released => now_ns,
            Hold::On { since_ns, .. } => since_ns,
        };
        self.hold = Hold::On { since_ns, heard_ns: now_ns };
    }

    /// Returns the fraction of the pull, 0 to 1, by the time since the force began to fade in.
    #[inline]
    fn part_at(&self, held_ns: u64) -> f64 {
        let [held, fade] = [held_ns, self.timeouts.fade_ns].map(|ns| ns as f64);
        if held_ns >= self.timeouts.fade_ns { 1.0 } else { held / fade }
    }
}
