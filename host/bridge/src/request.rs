//! What peers may ask for, and which letters are not even read.

use flotor_live::{Ask, SetValue};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A longer letter is refused before it is looked at, bytes.
pub const MAX_REQUEST_BYTES: usize = 64 * 1024;
/// Peers whose last number is remembered for each right; a peer beyond them is refused until the bridge starts anew.
const MOST_PEERS: usize = 4096;

/// Something a peer asks for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "request", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Request {
    /// The emergency stop. Anybody's.
    EmergencyStop,
    /// New values for live parameters.
    Set {
        /// The values.
        values: Vec<SetValue>,
    },
    /// How much of a model is felt, 0 to 1.
    Weight {
        /// Its name in the scene.
        model: String,
        /// The new weight.
        weight: f64,
    },
    /// An orderly end of the run.
    Stop,
    /// Runs the bridge's scene.
    Start,
    /// Takes the emergency stop back, so that a scene may be started again.
    Release,
}

/// Who may ask for what. Each includes the ones before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Right {
    /// See everything, and press the emergency stop.
    Watch,
    /// Change parameters, end a run in order.
    Operate,
    /// Start runs, take an emergency stop back.
    Own,
}

impl Right {
    /// All of them, the least first.
    pub const ALL: [Right; 3] = [Right::Watch, Right::Operate, Right::Own];

    /// The last parts of the keys on which this right's own requests arrive.
    #[must_use]
    pub const fn keys(self) -> &'static [&'static str] {
        match self {
            Right::Watch => &["ask/emergency-stop"],
            Right::Operate => &["ask/set", "ask/weight", "ask/stop"],
            Right::Own => &["ask/start", "ask/release"],
        }
    }
}

impl Request {
    /// What it takes to have it followed.
    #[must_use]
    pub const fn right(&self) -> Right {
        match self {
            Request::EmergencyStop => Right::Watch,
            Request::Set { .. } | Request::Weight { .. } | Request::Stop => Right::Operate,
            Request::Start | Request::Release => Right::Own,
        }
    }

    /// The last parts of the key on which it must arrive: access control sees keys, not letters.
    #[must_use]
    pub const fn key(&self) -> &'static str {
        match self {
            Request::EmergencyStop => "ask/emergency-stop",
            Request::Set { .. } => "ask/set",
            Request::Weight { .. } => "ask/weight",
            Request::Stop => "ask/stop",
            Request::Start => "ask/start",
            Request::Release => "ask/release",
        }
    }

    /// What the host is asked for; nothing where the bridge itself is meant.
    #[must_use]
    pub fn ask(&self) -> Option<Ask> {
        match self {
            Request::EmergencyStop => Some(Ask::EmergencyStop),
            Request::Set { values } => Some(Ask::Set { values: values.clone() }),
            Request::Weight { model, weight } => Some(Ask::Weight { model: model.clone(), weight: *weight }),
            Request::Stop => Some(Ask::Stop),
            Request::Start | Request::Release => None,
        }
    }

    /// Of what somebody asked a local host for; nothing where that concerns this machine only.
    #[must_use]
    pub fn of_ask(ask: Ask) -> Option<Self> {
        match ask {
            Ask::Watch { .. } | Ask::LookAway | Ask::Swap { .. } => None,
            Ask::Set { values } => Some(Request::Set { values }),
            Ask::Weight { model, weight } => Some(Request::Weight { model, weight }),
            Ask::Stop => Some(Request::Stop),
            Ask::EmergencyStop => Some(Request::EmergencyStop),
        }
    }
}

/// A request with what makes it valid once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NumberedRequest {
    /// Who asks: anything that no other peer calls itself, new with every start of a program.
    pub peer: String,
    /// Higher than that of the peer's letter before.
    pub number: u64,
    /// Process of the run that is meant, from its greeting; 0 for the bridge itself.
    pub run: u32,
    /// What is wished.
    pub request: Request,
}

impl NumberedRequest {
    /// As it is sent.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        // None of its parts fails to become JSON.
        serde_json::to_vec(self).unwrap_or_default()
    }
}

/// Why a letter was not followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, thiserror::Error)]
#[serde(rename_all = "kebab-case")]
pub enum Refusal {
    /// No letter at all, or on the wrong key.
    #[error("this is no request that belongs on this key")]
    Malformed,
    /// Longer than any request.
    #[error("longer than {MAX_REQUEST_BYTES} bytes, which no request is")]
    TooLong,
    /// Its number is not higher than that of the peer's last.
    #[error("a request with this number, or a higher one, came before: requests are valid once")]
    Replayed,
    /// It is meant for a run that is over, or none is on.
    #[error("no run is on, or not the one that was meant")]
    Stale,
    /// More peers than anybody needs.
    #[error("too many peers since the bridge started; start it anew")]
    Crowded,
    /// More requests than the host answers.
    #[error("too many requests wait for the host's answer; ask again")]
    Busy,
}

/// Lets letters through once. The emergency stop alone is let through however often: a stop too many is safe, and whoever may use
/// up the numbers of another peer could press it anyway.
#[derive(Debug, Default)]
pub struct Gate {
    /// The last number of each peer, for each right by itself: who may only press the emergency stop, and calls itself like an
    /// owner, does not use up the owner's numbers.
    last: BTreeMap<Right, BTreeMap<String, u64>>,
    refused: BTreeMap<Refusal, u64>,
}

impl Gate {
    /// What a letter on a key asks for, while `run` is the current run (0: none).
    ///
    /// # Errors
    /// [`Refusal`], counted.
    pub fn admit(&mut self, key: &str, payload: &[u8], run: u32) -> Result<Request, Refusal> {
        self.read(key, payload, run).map_err(|refusal| self.refuse(refusal))
    }

    /// Counts a refusal, whoever decided on it.
    pub fn refuse(&mut self, refusal: Refusal) -> Refusal {
        *self.refused.entry(refusal).or_default() += 1;
        refusal
    }

    /// How many were refused, by reason.
    #[must_use]
    pub fn refused(&self) -> &BTreeMap<Refusal, u64> {
        &self.refused
    }

    fn read(&mut self, key: &str, payload: &[u8], run: u32) -> Result<Request, Refusal> {
        if payload.len() > MAX_REQUEST_BYTES {
            return Err(Refusal::TooLong);
        }
        let letter: NumberedRequest = serde_json::from_slice(payload).map_err(|_| Refusal::Malformed)?;
        let belongs = key.strip_suffix(letter.request.key()).is_some_and(|rest| rest.ends_with('/'));
        if !belongs || letter.peer.is_empty() || letter.peer.len() > 64 {
            return Err(Refusal::Malformed);
        }
        // Whoever presses the emergency stop means whatever runs.
        let is_meant = match letter.request.right() {
            Right::Watch => return Ok(letter.request),
            Right::Operate => run != 0 && letter.run == run,
            Right::Own => true,
        };
        self.use_up(letter.request.right(), letter.peer, letter.number)?;
        if is_meant { Ok(letter.request) } else { Err(Refusal::Stale) }
    }

    /// A number is valid once.
    fn use_up(&mut self, right: Right, peer: String, number: u64) -> Result<(), Refusal> {
        let last = self.last.entry(right).or_default();
        let peers = last.len();
        match last.get_mut(&peer) {
            Some(last) if number <= *last => return Err(Refusal::Replayed),
            Some(last) => *last = number,
            None if peers >= MOST_PEERS => return Err(Refusal::Crowded),
            None => {
                last.insert(peer, number);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn letter(number: u64, run: u32, request: Request) -> Vec<u8> {
        serde_json::to_vec(&NumberedRequest { peer: "somebody".to_owned(), number, run, request }).unwrap()
    }

    #[test]
    fn a_letter_is_valid_once_and_for_its_run() {
        let mut gate = Gate::default();
        assert_eq!(gate.admit("flotor/a/ask/stop", &letter(1, 7, Request::Stop), 7), Ok(Request::Stop));
        assert_eq!(gate.admit("flotor/a/ask/stop", &letter(1, 7, Request::Stop), 7), Err(Refusal::Replayed));
        assert_eq!(gate.admit("flotor/a/ask/stop", &letter(2, 7, Request::Stop), 8), Err(Refusal::Stale));
        assert_eq!(gate.admit("flotor/a/ask/stop", &letter(3, 0, Request::Stop), 0), Err(Refusal::Stale));
        let stop = letter(4, 7, Request::EmergencyStop);
        assert_eq!(gate.admit("flotor/a/ask/emergency-stop", &stop, 8), Ok(Request::EmergencyStop));
        let refused: Vec<_> = gate.refused().iter().map(|(refusal, count)| (*refusal, *count)).collect();
        assert_eq!(refused, [(Refusal::Replayed, 1), (Refusal::Stale, 2)]);
    }

    #[test]
    fn a_request_on_the_key_of_another_is_refused() {
        let mut gate = Gate::default();
        for request in [
            Request::EmergencyStop,
            Request::Set { values: Vec::new() },
            Request::Weight { model: "spring".to_owned(), weight: 0.5 },
            Request::Stop,
            Request::Start,
            Request::Release,
        ] {
            for right in Right::ALL {
                for key in right.keys().iter().filter(|key| **key != request.key()) {
                    let refused = gate.admit(&format!("flotor/a/{key}"), &letter(9, 7, request.clone()), 7);
                    assert_eq!(refused, Err(Refusal::Malformed), "{request:?} on {key}");
                }
            }
        }
    }

    #[test]
    fn what_is_no_letter_is_refused_and_counted() {
        let mut gate = Gate::default();
        let key = "flotor/a/ask/stop";
        for nonsense in [b"".as_slice(), b"{}", b"\xff\xfe", b"[[[[", &letter(1, 7, Request::Stop)[1..]] {
            assert_eq!(gate.admit(key, nonsense, 7), Err(Refusal::Malformed));
        }
        let mut more = letter(1, 7, Request::Stop);
        more.splice(1..1, br#""extra":1,"#.iter().copied());
        assert_eq!(gate.admit(key, &more, 7), Err(Refusal::Malformed), "an unknown word");
        let long = vec![b' '; MAX_REQUEST_BYTES + 1];
        assert_eq!(gate.admit(key, &long, 7), Err(Refusal::TooLong));
        assert_eq!(gate.refused().values().sum::<u64>(), 7);
    }

    #[test]
    fn no_flood_of_peers_fills_the_memory() {
        let mut gate = Gate::default();
        let from = |peer: usize| {
            let letter =
                NumberedRequest { peer: peer.to_string(), number: 1, run: 7, request: Request::Stop };
            serde_json::to_vec(&letter).unwrap()
        };
        let admitted = (0..2 * MOST_PEERS)
            .filter(|peer| gate.admit("flotor/a/ask/stop", &from(*peer), 7).is_ok())
            .count();
        assert_eq!(admitted, MOST_PEERS);
        let stop = letter(1, 0, Request::EmergencyStop);
        assert_eq!(gate.admit("flotor/a/ask/emergency-stop", &stop, 7), Ok(Request::EmergencyStop));
        assert_eq!(gate.admit("flotor/a/ask/start", &letter(1, 0, Request::Start), 7), Ok(Request::Start));
    }

    #[test]
    fn who_calls_itself_like_another_peer_keeps_nothing_from_it_that_it_may_not_do_itself() {
        let mut gate = Gate::default();
        let key = "flotor/a/ask/emergency-stop";
        let last_of_all = letter(u64::MAX, 0, Request::EmergencyStop);
        assert_eq!(gate.admit(key, &last_of_all, 7), Ok(Request::EmergencyStop));
        assert_eq!(gate.admit("flotor/a/ask/stop", &letter(1, 7, Request::Stop), 7), Ok(Request::Stop));
        assert_eq!(
            gate.admit("flotor/a/ask/release", &letter(2, 0, Request::Release), 7),
            Ok(Request::Release)
        );
        assert_eq!(gate.admit(key, &letter(3, 0, Request::EmergencyStop), 7), Ok(Request::EmergencyStop));
        assert_eq!(gate.refused().len(), 0);
    }
}
