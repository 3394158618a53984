//! Requests of remote peers, and their admission control with replay protection.

use crate::keys::Name;
use crate::wall_clock::since_1970;
use clap::{Subcommand, ValueEnum};
use flotor_live::{Ask, SetValue};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::time::Instant;

/// Limit on the length of a request, bytes; longer requests are rejected unread.
pub const MAX_REQUEST_BYTES: usize = 64 * 1024;
/// Limit on the stored sessions per member and right; beyond it the least recent session is dropped.
const MOST_SESSIONS: usize = 256;
/// Limit on the stored pairs of right and member, far more than a network has; beyond it the least recent pair is dropped.
const MOST_MEMBERS: usize = 1024;
/// Maximum ticket age for start and release, ms.
const FRESH_MS: u64 = 10_000;
/// Member name of all peers without keys.
pub const ANYONE: &str = "anyone";

/// Request of a remote peer to the host, or to the bridge itself; its texts are the help of `flotor bridge ask`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Subcommand)]
#[serde(tag = "request", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Request {
    /// Emergency stop: all forces on the bridge's machine are zero at once, the runs end, and none starts before the release
    EmergencyStop,
    /// Normal stop: the force fades out
    Stop,
    /// Change live parameters, all in the same tick
    Set {
        /// New value of a live parameter, such as spring.gamma_n=20 (repeatable)
        #[arg(required = true, value_name = "PLUGIN.KEY=VALUE", value_parser = set_value)]
        values: Vec<SetValue>,
    },
    /// Change the blend weight of a model
    Weight {
        /// Name of the model in the scene
        model: String,
        /// Blend weight, 0 to 1
        weight: f64,
    },
    /// Start the scene of `flotor bridge serve --scene`
    Start,
    /// Release an emergency stop
    Release,
}

fn set_value(text: &str) -> Result<SetValue, String> {
    let parts = text.split_once('=').and_then(|(key, value)| Some((key.split_once('.')?, value)));
    let ((plugin, parameter), value) = parts.ok_or("write PLUGIN.KEY=VALUE, such as spring.gamma_n=20")?;
    Ok(SetValue { plugin: plugin.to_owned(), parameter: parameter.to_owned(), value: value.to_owned() })
}

/// Right of a member; each right includes the lower rights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Right {
    /// Observe a run and press the emergency stop
    #[default]
    Watch,
    /// Also change parameters and blend weights, stop a run in the normal way, and couple a hand
    Operate,
    /// Also start the scene, and release an emergency stop
    Own,
}

impl Right {
    /// All rights, the least first.
    pub const ALL: [Right; 3] = [Right::Watch, Right::Operate, Right::Own];

    /// Returns the key parts of the requests that this right adds to the lower rights; the member's name follows in the key.
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
    /// Returns the right that the request requires.
    #[must_use]
    pub const fn right(&self) -> Right {
        match self {
            Request::EmergencyStop => Right::Watch,
            Request::Set { .. } | Request::Weight { .. } | Request::Stop => Right::Operate,
            Request::Start | Request::Release => Right::Own,
        }
    }

    /// Returns the key part on which the request must arrive, before the member's name: access control sees keys, not payloads.
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

    /// Converts to a request for the host; `None` for requests to the bridge itself.
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

    /// Converts a request of a local client; `None` for a request that no bridge accepts: for ticks, the swap of a plugin, or the
    /// stop of all runs of a machine.
    #[must_use]
    pub fn of_ask(ask: Ask) -> Option<Self> {
        match ask {
            Ask::Watch { .. } | Ask::Unwatch | Ask::Swap { .. } | Ask::MachineStop => None,
            Ask::Set { values } => Some(Request::Set { values }),
            Ask::Weight { model, weight } => Some(Request::Weight { model, weight }),
            Ask::Stop => Some(Request::Stop),
            Ask::EmergencyStop => Some(Request::EmergencyStop),
        }
    }
}

/// Time stamp by the bridge's clock: issued in the status and repeated in a request, so that the bridge rejects old requests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ticket {
    /// Start of the bridge, ns since 1970; requests for another start are rejected.
    pub began: u64,
    /// Time of issue since the start of the bridge, ms.
    pub at_ms: u64,
}

/// Request with number and ticket, valid once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NumberedRequest {
    /// Session of the member: a text of 1 to 64 bytes that is unique among the member's sessions. The key names the member.
    pub session: String,
    /// Request number, higher than the numbers of the session's earlier requests.
    pub number: u64,
    /// Process id of the run that the request is for, from the run's greeting; 0: no run.
    pub run: u32,
    /// Ticket from the bridge's status.
    pub ticket: Ticket,
    /// Requested operation; its kind must match the key.
    pub request: Request,
}

impl NumberedRequest {
    /// Encodes the request as JSON.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        // Serialisation of these types cannot fail.
        serde_json::to_vec(self).unwrap_or_default()
    }
}

/// Reason why a request was rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, thiserror::Error)]
#[serde(rename_all = "kebab-case")]
pub enum Refusal {
    /// Not a request, or on the wrong key.
    #[error("the request is malformed, or has the wrong key; use the same build of Flotor as the bridge")]
    Malformed,
    /// Longer than [`MAX_REQUEST_BYTES`].
    #[error("the request is longer than {MAX_REQUEST_BYTES} bytes; send fewer values at once")]
    TooLong,
    /// Number not higher than the number of the session's last request.
    #[error(
        "the number of the request is not above the previous number, and each request is valid once; send a new request"
    )]
    Replayed,
    /// Meant for a run that has ended, or there is no run.
    #[error("no run is active, or the request was for another run; start a run, or try again")]
    Stale,
    /// Based on a ticket of an earlier start of the bridge, or too old.
    #[error("the request is too old, or from before the start of the bridge; send a new request")]
    Expired,
    /// Too many requests are pending.
    #[error("too many requests are pending; try again")]
    Busy,
}

/// Replay protection: accepts each request once, but emergency stops always, because a repeated stop is safe.
#[derive(Debug)]
pub struct AdmissionControl {
    began: u64,
    since: Instant,
    /// Sessions by right and member, so that no member can exhaust numbers or capacity of another.
    members: BTreeMap<(Right, Name), Sessions>,
    /// Oldest accepted ticket of unknown members, ms: an older request may be a replay of a dropped member.
    forgotten_ms: u64,
    refused: BTreeMap<Refusal, u64>,
}

/// Stored sessions of a member.
#[derive(Debug, Default)]
struct Sessions {
    last: BTreeMap<String, Last>,
    /// Oldest accepted ticket of unknown sessions, ms: an older request may be a replay of a dropped session.
    forgotten_ms: u64,
    /// Newest ticket of the member, ms.
    asked_ms: u64,
}

/// Last request of a session.
#[derive(Clone, Copy, Debug)]
struct Last {
    number: u64,
    at_ms: u64,
}

impl Default for AdmissionControl {
    fn default() -> Self {
        #[allow(clippy::cast_possible_truncation)] // nanoseconds fit until the year 2554
        Self {
            began: since_1970().as_nanos() as u64,
            since: Instant::now(),
            members: BTreeMap::new(),
            forgotten_ms: 0,
            refused: BTreeMap::new(),
        }
    }
}

impl AdmissionControl {
    /// Returns the current ticket, for the status.
    #[must_use]
    pub fn ticket(&self) -> Ticket {
        let at_ms = u64::try_from(self.since.elapsed().as_millis()).unwrap_or(u64::MAX);
        Ticket { began: self.began, at_ms }
    }

    /// Decodes and admits a request that arrived on `key` (`flotor/NAME/ask/REQUEST/MEMBER`), and stores its number to reject
    /// replays (not for an emergency stop, which may be repeated); `run` is the process id of the current run (0: no run).
    ///
    /// # Errors
    /// [`Refusal`], which is counted.
    pub fn admit(&mut self, key: &str, payload: &[u8], run: u32) -> Result<Request, Refusal> {
        self.read(key, payload, run).map_err(|refusal| self.refuse(refusal))
    }

    /// Counts a refusal and returns it.
    pub fn refuse(&mut self, refusal: Refusal) -> Refusal {
        *self.refused.entry(refusal).or_default() += 1;
        refusal
    }

    /// Returns the number of refusals since the start of the bridge, by reason.
    #[must_use]
    pub fn refused(&self) -> &BTreeMap<Refusal, u64> {
        &self.refused
    }

    fn read(&mut self, key: &str, payload: &[u8], run: u32) -> Result<Request, Refusal> {
        if payload.len() > MAX_REQUEST_BYTES {
            return Err(Refusal::TooLong);
        }
        let (member, numbered) = numbered_on(key, payload).ok_or(Refusal::Malformed)?;
        let now = self.ticket();
        let right = numbered.request.right();
        // An emergency stop applies to any run.
        let is_meant = match right {
            Right::Watch => return Ok(numbered.request),
            Right::Operate => run != 0 && numbered.run == run,
            Right::Own => numbered.run == run,
        };
        let is_fresh = right != Right::Own || now.at_ms.saturating_sub(numbered.ticket.at_ms) <= FRESH_MS;
        if numbered.ticket.began != now.began || numbered.ticket.at_ms > now.at_ms || !is_fresh {
            return Err(Refusal::Expired);
        }
        self.use_up((right, member), &numbered)?;
        if is_meant { Ok(numbered.request) } else { Err(Refusal::Stale) }
    }

    /// Rejects a replayed number, and stores the new one.
    fn use_up(&mut self, member: (Right, Name), numbered: &NumberedRequest) -> Result<(), Refusal> {
        if !self.members.contains_key(&member) {
            if numbered.ticket.at_ms < self.forgotten_ms {
                return Err(Refusal::Expired);
            }
            if self.members.len() >= MOST_MEMBERS {
                let oldest = self.members.iter().min_by_key(|(_, sessions)| sessions.asked_ms);
                if let Some((member, asked_ms)) = oldest.map(|(member, s)| (member.clone(), s.asked_ms)) {
                    self.members.remove(&member);
                    self.forgotten_ms = asked_ms.saturating_add(1).max(self.forgotten_ms);
                }
            }
        }
        let Sessions { last, forgotten_ms, asked_ms } = self.members.entry(member).or_default();
        match last.get(&numbered.session) {
            Some(before) if numbered.number <= before.number => return Err(Refusal::Replayed),
            None if numbered.ticket.at_ms < *forgotten_ms => return Err(Refusal::Expired),
            Some(_) => {}
            None if last.len() >= MOST_SESSIONS => {
                let oldest = last.iter().min_by_key(|(_, last)| last.at_ms);
                if let Some((session, at_ms)) = oldest.map(|(session, last)| (session.clone(), last.at_ms)) {
                    last.remove(&session);
                    *forgotten_ms = at_ms.saturating_add(1).max(*forgotten_ms);
                }
            }
            None => {}
        }
        *asked_ms = numbered.ticket.at_ms.max(*asked_ms);
        last.insert(numbered.session.clone(), Last { number: numbered.number, at_ms: numbered.ticket.at_ms });
        Ok(())
    }
}

/// Returns true if a payload on its key is an emergency stop; needs neither state nor lock of the [`AdmissionControl`].
#[must_use]
pub fn is_emergency_stop(key: &str, payload: &[u8]) -> bool {
    numbered_on(key, payload).is_some_and(|(_, numbered)| numbered.request == Request::EmergencyStop)
}

/// Parses a request, and the member in its key; `None` for a malformed request, or one on the key of another kind of request.
fn numbered_on(key: &str, payload: &[u8]) -> Option<(Name, NumberedRequest)> {
    let numbered = exactly(payload)?;
    let (key, member) = key.rsplit_once('/')?;
    let member = Name::new(member).ok()?;
    let belongs = key.strip_suffix(numbered.request.key())?.ends_with('/');
    (belongs && (1..=64).contains(&numbered.session.len())).then_some((member, numbered))
}

/// Parses strictly: rejects unknown keys at any depth.
fn exactly(payload: &[u8]) -> Option<NumberedRequest> {
    let said: serde_json::Value = serde_json::from_slice(payload).ok()?;
    let numbered: NumberedRequest = serde_json::from_slice(payload).ok()?;
    (serde_json::to_value(&numbered).ok()? == said).then_some(numbered)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(request: &Request, member: &str) -> String {
        format!("flotor/a/{}/{member}", request.key())
    }

    fn numbered(
        admission: &AdmissionControl,
        session: &str,
        number: u64,
        run: u32,
        request: &Request,
    ) -> NumberedRequest {
        let (session, request, ticket) = (session.to_owned(), request.clone(), admission.ticket());
        NumberedRequest { session, number, run, ticket, request }
    }

    /// A letter of ada's on its key.
    fn ask(
        admission: &mut AdmissionControl,
        number: u64,
        run: u32,
        request: Request,
        current: u32,
    ) -> Result<Request, Refusal> {
        let numbered = numbered(admission, "one", number, run, &request);
        admission.admit(&key(&request, "ada"), &numbered.to_bytes(), current)
    }

    #[test]
    fn a_letter_is_valid_once_and_for_its_run() {
        let mut admission = AdmissionControl::default();
        assert_eq!(ask(&mut admission, 1, 7, Request::Stop, 7), Ok(Request::Stop));
        assert_eq!(ask(&mut admission, 1, 7, Request::Stop, 7), Err(Refusal::Replayed));
        assert_eq!(ask(&mut admission, 2, 7, Request::Stop, 8), Err(Refusal::Stale));
        assert_eq!(ask(&mut admission, 3, 0, Request::Stop, 0), Err(Refusal::Stale));
        assert_eq!(ask(&mut admission, 4, 7, Request::EmergencyStop, 8), Ok(Request::EmergencyStop));
        // Starting and releasing are for the run that was seen, too.
        assert_eq!(ask(&mut admission, 5, 0, Request::Start, 0), Ok(Request::Start));
        assert_eq!(ask(&mut admission, 6, 7, Request::Release, 8), Err(Refusal::Stale));
        let refused: Vec<_> = admission.refused().iter().map(|(refusal, count)| (*refusal, *count)).collect();
        assert_eq!(refused, [(Refusal::Replayed, 1), (Refusal::Stale, 3)]);
    }

    #[test]
    fn a_letter_is_of_one_start_of_the_bridge_and_starting_and_releasing_of_ten_seconds() {
        let mut admission = AdmissionControl::default();
        admission.since -= std::time::Duration::from_secs(60);
        for request in [Request::Stop, Request::Start, Request::Release] {
            let of =
                |ticket| NumberedRequest { ticket, ..numbered(&admission, "one", 9, 7, &request) }.to_bytes();
            let now = admission.ticket();
            let numbered_requests = [
                (Ticket { began: now.began - 1, ..now }, Err(Refusal::Expired)),
                (Ticket { at_ms: now.at_ms + 60_000, ..now }, Err(Refusal::Expired)),
                (
                    Ticket { at_ms: now.at_ms - FRESH_MS - 1000, ..now },
                    if request == Request::Stop { Ok(request.clone()) } else { Err(Refusal::Expired) },
                ),
            ];
            for (numbered, expected) in numbered_requests.map(|(ticket, expected)| (of(ticket), expected)) {
                assert_eq!(admission.admit(&key(&request, "ada"), &numbered, 7), expected, "{request:?}");
            }
        }
    }

    #[test]
    fn a_request_on_the_key_of_another_is_refused() {
        let mut admission = AdmissionControl::default();
        for request in [
            Request::EmergencyStop,
            Request::Set { values: Vec::new() },
            Request::Weight { model: "spring".to_owned(), weight: 0.5 },
            Request::Stop,
            Request::Start,
            Request::Release,
        ] {
            let payload = numbered(&admission, "one", 9, 7, &request).to_bytes();
            let others = Right::ALL.into_iter().flat_map(Right::keys).filter(|key| **key != request.key());
            let wrong = others.map(|key| format!("flotor/a/{key}/ada"));
            let nobody = ["", "*", "**", "Ada", "a/b"].map(|member| key(&request, member));
            for wrong in wrong.chain(nobody).chain([format!("flotor/a/{}", request.key())]) {
                assert_eq!(
                    admission.admit(&wrong, &payload, 7),
                    Err(Refusal::Malformed),
                    "{request:?} on {wrong}"
                );
            }
        }
    }

    #[test]
    fn what_is_no_letter_is_refused_and_counted() {
        let mut admission = AdmissionControl::default();
        let stop = Request::Stop;
        let good = numbered(&admission, "one", 1, 7, &stop).to_bytes();
        for nonsense in [b"".as_slice(), b"{}", b"\xff\xfe", b"[[[[", &good[1..]] {
            assert_eq!(admission.admit(&key(&stop, "ada"), nonsense, 7), Err(Refusal::Malformed));
        }
        let long = vec![b' '; MAX_REQUEST_BYTES + 1];
        assert_eq!(admission.admit(&key(&stop, "ada"), &long, 7), Err(Refusal::TooLong));
        assert_eq!(admission.refused().values().sum::<u64>(), 6);
        assert_eq!(admission.admit(&key(&stop, "ada"), &good, 7), Ok(Request::Stop));
    }

    #[test]
    fn an_unknown_word_anywhere_is_refused() {
        let values =
            vec![SetValue { plugin: "a".to_owned(), parameter: "b".to_owned(), value: "1".to_owned() }];
        for request in [
            Request::EmergencyStop,
            Request::Set { values },
            Request::Weight { model: "spring".to_owned(), weight: 0.1 },
            Request::Stop,
            Request::Start,
            Request::Release,
        ] {
            let mut admission = AdmissionControl::default();
            let good = numbered(&admission, "one", 1, 7, &request).to_bytes();
            let text = String::from_utf8(good.clone()).unwrap();
            // After every opening brace: in the letter, its ticket, its request, a value of that.
            for (at, _) in text.match_indices('{') {
                let mut more = good.clone();
                more.splice(at + 1..=at, br#""extra":1,"#.iter().copied());
                assert_eq!(
                    admission.admit(&key(&request, "ada"), &more, 7),
                    Err(Refusal::Malformed),
                    "{request:?}"
                );
            }
            assert_eq!(admission.admit(&key(&request, "ada"), &good, 7), Ok(request));
        }
    }

    #[test]
    fn no_flood_of_sessions_or_names_fills_the_memory_or_keeps_another_member_out() {
        let mut admission = AdmissionControl::default();
        let release = Request::Release;
        let old = numbered(&admission, "old", 1, 7, &release).to_bytes();
        assert_eq!(admission.admit(&key(&release, "bob"), &old, 7), Ok(Request::Release));
        std::thread::sleep(std::time::Duration::from_millis(3));
        for session in 0..4 * MOST_SESSIONS {
            if session % 32 == 0 {
                std::thread::sleep(std::time::Duration::from_millis(1)); // no member has so many in a millisecond
            }
            let payload = numbered(&admission, &session.to_string(), 1, 7, &release).to_bytes();
            assert_eq!(admission.admit(&key(&release, "bob"), &payload, 7), Ok(Request::Release));
        }
        assert_eq!(
            admission.admit(&key(&release, "bob"), &old, 7),
            Err(Refusal::Expired),
            "forgotten, not valid again"
        );
        assert!(admission.members.values().all(|sessions| sessions.last.len() <= MOST_SESSIONS));
        let payload = numbered(&admission, "one", 1, 7, &release).to_bytes();
        assert_eq!(admission.admit(&key(&release, "ada"), &payload, 7), Ok(Request::Release));
        std::thread::sleep(std::time::Duration::from_millis(3));
        let fresh = numbered(&admission, "one", 1, 7, &release).to_bytes();
        for name in 0..2 * MOST_MEMBERS {
            let _ = admission.admit(&key(&release, &format!("n{name}")), &fresh, 7);
        }
        assert!(admission.members.len() <= MOST_MEMBERS);
        assert_eq!(
            admission.admit(&key(&release, "ada"), &payload, 7),
            Err(Refusal::Expired),
            "not valid again"
        );
        std::thread::sleep(std::time::Duration::from_millis(3));
        // Neither who was known nor who is new is kept out.
        let payload = numbered(&admission, "one", 2, 7, &release).to_bytes();
        for member in ["ada", "grace"] {
            assert_eq!(admission.admit(&key(&release, member), &payload, 7), Ok(Request::Release));
        }
    }

    #[test]
    fn numbers_up_to_the_last_overflow_nothing() {
        let mut admission = AdmissionControl::default();
        let stop = Request::Stop;
        for (number, at_ms) in [(u64::MAX, u64::MAX), (u64::MAX, 0), (0, 0)] {
            let ticket = Ticket { at_ms, ..admission.ticket() };
            let payload =
                NumberedRequest { ticket, ..numbered(&admission, "one", number, u32::MAX, &stop) }.to_bytes();
            let _ = admission.admit(&key(&stop, "ada"), &payload, 7);
        }
    }
}
