//! One end of a coupling whose other end is on another host.

use super::peer_check::PeerCheck;
use super::{CouplingConfig, CouplingEnd, End, Grip, Pull};
use flotor_core::peer::{DISPATCH_WORDS, Dispatch, PeerState, TankState};
use flotor_hal::Tick;
use flotor_sync::{Observer, Publisher, latest};

/// How long an end goes by what it heard last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Patience {
    /// Time without a message after which the end removes its force, ns.
    pub silence_ns: u64,
    /// Time over which its force fades in, again or for the first time, ns.
    pub fade_ns: u64,
}

/// Where the peer state leaves the loop and enters it, for a peer link. Neither side ever waits for the other: only the
/// newest counts.
pub struct Line {
    /// What this end sent last. Its `run` is 0: the peer link knows when the run began.
    pub told: Observer<Dispatch, DISPATCH_WORDS>,
    /// What this end is to hear, newest last.
    pub heard: Publisher<Dispatch, DISPATCH_WORDS>,
}

/// How an end has heard its partner.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hearing {
    /// Ticks in which a message arrived.
    pub ticks: u64,
    /// How often the partner fell silent for longer than is waited.
    pub silences: u64,
    /// The longest wait for a message, ns.
    pub longest_wait_ns: u64,
    /// Messages that cannot be true: they were not used.
    pub implausible: u64,
    /// The partner's energy tank, as received last.
    pub partner: TankState,
}

/// An end, and the line to its partner.
///
/// Until the first message of the partner, and after too long a silence, its force is zero: the position of the partner
/// is unknown. When messages arrive (again) the force fades in.
pub struct RemoteEnd {
    end: End,
    check: PeerCheck,
    patience: Patience,
    told: Publisher<Dispatch, DISPATCH_WORDS>,
    heard: Observer<Dispatch, DISPATCH_WORDS>,
    /// Version of the message taken in last.
    version: u64,
    /// The partner's run.
    run: Option<u64>,
    hold: Hold,
    hearing: Hearing,
    /// Whether the message of this tick was not believed.
    is_implausible: bool,
}

/// Whether the end holds on to its partner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Hold {
    /// Nothing is known of it.
    Released,
    /// It was heard of at `heard_ns`, and without silence since `since_ns`.
    On { since_ns: u64, heard_ns: u64 },
}

/// What the cells hold before the first message. It is never taken in.
const NOBODY: Dispatch = Dispatch {
    run: 0,
    tick: 0,
    state: PeerState { pose: flotor_hal::Pose::HOME, twist: flotor_hal::Twist::ZERO, told_j: 0.0 },
    tank: TankState { level_j: 0.0, lowest_j: 0.0, gone_in_j: 0.0, given_up_j: 0.0 },
};

impl RemoteEnd {
    /// An end at rest, and the line for its peer state. `period_s` is the time between ticks. Not real-time.
    #[must_use]
    pub fn new(
        config: &CouplingConfig,
        end: &CouplingEnd,
        period_s: f64,
        patience: Patience,
    ) -> (Self, Line) {
        let (told, for_partner) = latest(NOBODY);
        let (from_partner, heard) = latest(NOBODY);
        let end = Self {
            check: PeerCheck::new(end.mapping.motion_scale, patience.silence_ns),
            end: End::new(config, &end.mapping, period_s),
            patience,
            told,
            heard,
            version: 0,
            run: None,
            hold: Hold::Released,
            hearing: Hearing::default(),
            is_implausible: false,
        };
        (end, Line { told: for_partner, heard: from_partner })
    }

    /// One tick: what this end asks for. Real-time: bounded, no allocation.
    #[inline]
    pub fn step(&mut self, tick: &Tick, grip: Grip<'_>) -> Pull {
        self.end.observe(grip.state, &grip.held);
        self.listen(tick.time_ns);
        let state = match self.hold {
            Hold::Released => self.end.call(grip.state),
            Hold::On { .. } => self.end.tell(grip.state),
        };
        self.told.publish(&Dispatch { run: 0, tick: tick.index, state, tank: self.end.tank().state() });
        match self.hold {
            Hold::Released => self.end.let_go(),
            Hold::On { since_ns, .. } => {
                let part = self.part_at(tick.time_ns - since_ns);
                self.end.pull_part(grip.state, part)
            }
        }
    }

    /// True if the partner is not heard of. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn is_alone(&self) -> bool {
        self.hold == Hold::Released
    }

    /// True if the partner told in this tick what cannot be. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn is_implausible(&self) -> bool {
        self.is_implausible
    }

    /// This end's energy tank. Real-time: bounded, no allocation.
    #[must_use]
    pub fn tank(&self) -> TankState {
        self.end.tank().state()
    }

    /// How the partner was heard. Real-time: bounded, no allocation.
    #[must_use]
    pub fn hearing(&self) -> Hearing {
        self.hearing
    }

    /// Takes in what is new, or notices that nothing is.
    #[inline]
    fn listen(&mut self, now_ns: u64) {
        // A cell that is being written just now is looked at again in the next tick.
        self.is_implausible = false;
        let newest = self.heard.read().filter(|(version, _)| *version != self.version);
        if let Some((version, dispatch)) = newest {
            self.version = version;
            match self.check.check(&dispatch, now_ns) {
                Ok(()) => self.hear(&dispatch, now_ns),
                Err(_) => {
                    self.is_implausible = true;
                    self.hearing.implausible += 1;
                }
            }
        }
        if let Hold::On { heard_ns, .. } = self.hold {
            let wait_ns = now_ns - heard_ns;
            if wait_ns >= self.patience.silence_ns {
                self.hold = Hold::Released;
                self.hearing.silences += 1;
            } else {
                self.hearing.longest_wait_ns = self.hearing.longest_wait_ns.max(wait_ns);
            }
        }
    }

    #[inline]
    fn hear(&mut self, dispatch: &Dispatch, now_ns: u64) {
        if self.run.replace(dispatch.run) != Some(dispatch.run) {
            // Another run may be anywhere: it is taken hold of as slowly as the first.
            self.end.meet(&dispatch.state);
            self.hold = Hold::Released;
        }
        self.end.hear(&dispatch.state);
        self.hearing.ticks += 1;
        self.hearing.partner = dispatch.tank;
        let since_ns = match self.hold {
            Hold::Released => now_ns,
            Hold::On { since_ns, .. } => since_ns,
        };
        self.hold = Hold::On { since_ns, heard_ns: now_ns };
    }

    /// Which part of the pull is felt so long after the end took hold.
    #[inline]
    fn part_at(&self, held_ns: u64) -> f64 {
        let [held, fade] = [held_ns, self.patience.fade_ns].map(|ns| ns as f64);
        if held_ns >= self.patience.fade_ns { 1.0 } else { held / fade }
    }
}
