//! Pairing of the two ends of a coupling: the partner is one run, which answers this run, until the partner times out.
//!
//! Each message contains the number of its sender and of its addressee: the run that the sender answers, or 0. An end
//! selects as its partner the first run whose message is addressed to this end or to no run, and addresses its own
//! messages to the partner. The end uses the messages of the partner from the first message that is addressed to this
//! end. The addressee also informs all other runs that they are rejected. So a third run is never accepted, and at most
//! one run counts the energy.
//!
//! A bridge is a star: the server of a coupling receives all messages to the coupling, and the senders of these
//! messages receive only the messages of the server. (If every end received all messages, three ends that start at once
//! could alternate as partners; the energy would still be counted once.)

use flotor_core::peer::Dispatch;
use serde::Serialize;

/// Counts of messages to a loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LinkCounts {
    /// Messages of the partner that answer this run and are newer than the last message.
    pub arrived: u64,
    /// Skipped ticks of the partner: their messages were lost, or came after newer ones.
    pub lost: u64,
    /// Messages of the partner that arrived after a newer message, or twice.
    pub overtaken: u64,
    /// Malformed messages, and messages of this run itself.
    pub refused: u64,
    /// Messages from runs other than the partner, and messages addressed to another run.
    pub others: u64,
}

/// Filter that finds the partner and passes its newer messages.
#[derive(Debug)]
pub struct Pairing {
    run: u64,
    silence_ns: u64,
    partner: Option<Partner>,
    counts: LinkCounts,
}

#[derive(Clone, Copy, Debug)]
struct Partner {
    run: u64,
    tick: u64,
    heard_ns: u64,
    /// Time when the partner last named this run, or was accepted, ns.
    named_ns: u64,
    /// True once the partner has named this run: then it is not replaced if it names none for a moment.
    has_named_us: bool,
    /// First tick of this run that names the partner.
    since: Option<u64>,
}

impl Pairing {
    /// Creates the pairing of the run that began at this time, ns since 1970; a partner silent for `silence_ns` is dropped.
    #[must_use]
    pub fn new(run: u64, silence_ns: u64) -> Self {
        Self { run, silence_ns, partner: None, counts: LinkCounts::default() }
    }

    /// Returns a message of this end with this run as its sender and the partner as its addressee; the first message to
    /// a partner sets `since`.
    #[must_use]
    pub fn address(&mut self, dispatch: &Dispatch) -> Dispatch {
        let of_partner = |held: &mut Partner| (held.run, *held.since.get_or_insert(dispatch.tick));
        let (partner, since) = self.partner.as_mut().map_or((0, 0), of_partner);
        Dispatch { run: self.run, partner, since, ..*dispatch }
    }

    /// Checks a message, and updates the partner and the counts; returns the message if its sender is the partner, its
    /// addressee is this run, and it is newer than the last message.
    pub fn take(&mut self, dispatch: Dispatch, now_ns: u64) -> Option<Dispatch> {
        let Self { run: us, silence_ns, partner, counts } = self;
        let Dispatch { run, partner: named, tick, .. } = dispatch;
        if run == 0 || run == *us {
            counts.refused += 1;
            return None;
        }
        let names_us = named == *us;
        let is_silent = |since_ns: u64| now_ns.saturating_sub(since_ns) >= *silence_ns;
        let held = partner.filter(|held| !is_silent(held.heard_ns) && !is_silent(held.named_ns));
        let before = match held {
            Some(held) if held.run == run => {
                if tick <= held.tick {
                    counts.overtaken += 1;
                    return None;
                }
                if !names_us && named != 0 {
                    // The partner has gone to another run.
                    *partner = None;
                    counts.others += 1;
                    return None;
                }
                counts.lost = counts.lost.saturating_add(tick - held.tick - 1);
                Some(held)
            }
            Some(held) if held.has_named_us || !names_us => {
                counts.others += 1;
                return None;
            }
            _ if !names_us && named != 0 => {
                counts.others += 1;
                return None;
            }
            _ => None,
        };
        let named_before_ns = before.map_or(now_ns, |before| before.named_ns);
        let named_ns = if names_us { now_ns } else { named_before_ns };
        let has_named_us = names_us || before.is_some_and(|before| before.has_named_us);
        let since = before.and_then(|before| before.since);
        *partner = Some(Partner { run, tick, heard_ns: now_ns, named_ns, has_named_us, since });
        counts.arrived += u64::from(names_us);
        names_us.then_some(dispatch)
    }

    /// Counts a malformed message.
    pub fn refuse(&mut self) {
        self.counts.refused += 1;
    }

    /// Returns the counts so far.
    #[must_use]
    pub fn counts(&self) -> LinkCounts {
        self.counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_core::peer::{PeerState, TankState};
    use flotor_hal::{Pose, Twist};

    fn dispatch(run: u64, partner: u64, tick: u64) -> Dispatch {
        let state = PeerState { pose: Pose::HOME, twist: Twist::ZERO, passed_on_j: 0.0 };
        Dispatch { run, partner, since: 1, tick, state, tank: TankState::default() }
    }

    const US: u64 = 5;
    const SILENCE_NS: u64 = 100;

    #[test]
    fn only_newer_messages_of_the_partner_pass_and_the_rest_is_counted() {
        let mut pairing = Pairing::new(US, SILENCE_NS);
        let mut passes = |run, partner, tick| pairing.take(dispatch(run, partner, tick), 10).is_some();
        assert!(!passes(7, 0, 4), "it does not name us yet");
        let came = [(7, 5), (7, 6), (7, 9), (7, 8), (7, 9), (8, 0), (7, 10), (8, 1)];
        let passed: Vec<bool> = came.iter().map(|(run, tick)| passes(*run, US, *tick)).collect();
        assert_eq!(passed, [true, true, true, false, false, false, true, false]);
        assert!(!passes(US, US, 11) && !passes(0, US, 11), "no run of another");
        let expected = LinkCounts { arrived: 4, lost: 2, overtaken: 2, refused: 2, others: 2 };
        assert_eq!(pairing.counts(), expected);
        let addressed = pairing.address(&dispatch(0, 0, 3));
        assert_eq!(addressed, Dispatch { since: 3, ..dispatch(US, 7, 3) });
        assert_eq!(pairing.address(&dispatch(0, 0, 4)), Dispatch { since: 3, ..dispatch(US, 7, 4) });
    }

    /// M2: one forged message deafened an end for the rest of its run.
    #[test]
    fn no_forged_message_deafens_an_end_for_longer_than_the_silence() {
        for (run, tick) in [(u64::MAX, 1), (7, u64::MAX)] {
            let mut pairing = Pairing::new(US, SILENCE_NS);
            assert!(pairing.take(dispatch(7, US, 1), 0).is_some());
            pairing.take(dispatch(run, US, tick), 1);
            let heard: Vec<u64> =
                (2..300).filter(|now| pairing.take(dispatch(7, US, *now), *now).is_some()).collect();
            assert!(heard.first().is_some_and(|first| *first <= 1 + SILENCE_NS), "run {run}, tick {tick}");
            assert!(heard.len() > 190, "run {run}, tick {tick}: {}", heard.len());
        }
    }

    #[test]
    fn a_candidate_that_never_answers_keeps_nobody_out() {
        let mut pairing = Pairing::new(US, SILENCE_NS);
        for now in 0..1000 {
            pairing.take(dispatch(9, 0, now), now);
            if now == 500 {
                assert!(pairing.take(dispatch(7, US, now), now).is_some(), "who answers comes first");
            }
        }
        // By itself it is taken again and again, and no longer than the silence at a time.
        assert!(pairing.counts().arrived == 1 && pairing.counts().others > 0);
    }

    /// Two programs heard one, and each counted its energy. As behind a bridge: who serves hears all that come to it, they hear it.
    #[test]
    fn of_three_ends_two_are_a_pair_and_the_third_is_let_in_by_nobody() {
        for (order, delay) in (0..6_usize).flat_map(|order| [0, 1, 20, 45].map(|delay| (order, delay))) {
            let mut ends = [11, 12, 13].map(|run| Pairing::new(run, SILENCE_NS));
            let mut let_in = [[0_u64; 3]; 3];
            let mut told = Vec::new();
            for now in 1..2000_u64 {
                told.push(ends.each_mut().map(|end| end.address(&dispatch(0, 0, now))));
                // At once, and as long under way as a pair bears.
                let Some(told) = told.len().checked_sub(1 + delay).map(|sent| &told[sent]) else { continue };
                for turn in 0..9 {
                    let (to, from) = (((turn + order) / 3) % 3, (turn * (1 + order % 2)) % 3);
                    let is_way = to != from && (to == 0 || from == 0);
                    if is_way && ends[to].take(told[from], now).is_some() && now > 500 {
                        let_in[to][from] += 1;
                    }
                }
            }
            let pairs = let_in.iter().flatten().filter(|count| **count > 0).count();
            assert_eq!(pairs, 2, "order {order}, delay {delay}: one each way: {let_in:?}");
            let alone = (0..3).filter(|end| let_in[*end].iter().all(|count| *count == 0)).count();
            assert_eq!(alone, 1, "order {order}, delay {delay}: {let_in:?}");
        }
    }
}
