//! What peers may ask for, and which letters are not even read.

use crate::keys::Name;
use flotor_live::{Ask, SetValue};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// A longer letter is refused before it is looked at, bytes.
pub const MAX_REQUEST_BYTES: usize = 64 * 1024;
/// Sessions of a member whose last number is remembered for each right; of more, the one that asked longest ago is forgotten.
const MOST_SESSIONS: usize = 256;
/// Members that are distinguished, the access control of our keys knows far fewer; of more, the one that asked longest ago is forgotten.
const MOST_MEMBERS: usize = 1024;
/// How old the bridge's word may be on which a run is started or the emergency stop released, ms.
const FRESH_MS: u64 = 10_000;
/// Who asks where there are no keys: nobody is distinguished there.
pub const ANYONE: &str = "anyone";

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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Right {
    /// See everything, and press the emergency stop.
    #[default]
    Watch,
    /// Change parameters, end a run in order.
    Operate,
    /// Start runs, take an emergency stop back.
    Own,
}

impl Right {
    /// All of them, the least first.
    pub const ALL: [Right; 3] = [Right::Watch, Right::Operate, Right::Own];

    /// Parts of the keys on which this right's own requests arrive; the name of the member comes last.
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

    /// The parts of the key on which it must arrive, before the member's name: access control sees keys, not letters.
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
            Ask::Watch { .. } | Ask::LookAway | Ask::Swap { .. } | Ask::MachineStop => None,
            Ask::Set { values } => Some(Request::Set { values }),
            Ask::Weight { model, weight } => Some(Request::Weight { model, weight }),
            Ask::Stop => Some(Request::Stop),
            Ask::EmergencyStop => Some(Request::EmergencyStop),
        }
    }
}

/// The bridge's word on which a request is made: which start of the bridge, and when, by its own clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ticket {
    /// The bridge's start, ns since 1970: no request is valid for another.
    pub began: u64,
    /// Time since then, ms.
    pub at_ms: u64,
}

/// A request with what makes it valid once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NumberedRequest {
    /// The session of the member: anything that no other of its sessions calls itself. Who the member is says the key.
    pub session: String,
    /// Higher than that of the session's letter before.
    pub number: u64,
    /// Process of the run that is meant, from its greeting; 0: none is on.
    pub run: u32,
    /// From the bridge's status.
    pub ticket: Ticket,
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
    /// It was made on the word of an earlier start of the bridge, or too long ago.
    #[error("asked too long ago, or before the bridge started; ask again")]
    Expired,
    /// More requests than the host answers.
    #[error("too many requests wait for the host's answer; ask again")]
    Busy,
}

/// Lets letters through once. The emergency stop alone is let through however often: a stop too many is safe.
#[derive(Debug)]
pub struct Gate {
    began: u64,
    since: Instant,
    /// By right and member: nobody uses up numbers or room of another.
    members: BTreeMap<(Right, Name), Sessions>,
    /// Letters of unknown members on an older word than this are refused, ms.
    forgotten_ms: u64,
    refused: BTreeMap<Refusal, u64>,
}

/// The sessions of a member.
#[derive(Debug, Default)]
struct Sessions {
    last: BTreeMap<String, Last>,
    /// Letters of unknown sessions on an older word than this are refused, ms: they may be of a forgotten one.
    forgotten_ms: u64,
    /// The newest word on which it asked, ms.
    asked_ms: u64,
}

/// The last letter of a session.
#[derive(Clone, Copy, Debug)]
struct Last {
    number: u64,
    at_ms: u64,
}

impl Default for Gate {
    fn default() -> Self {
        let began = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos());
        #[allow(clippy::cast_possible_truncation)] // in the year 2554
        Self {
            began: began as u64,
            since: Instant::now(),
            members: BTreeMap::new(),
            forgotten_ms: 0,
            refused: BTreeMap::new(),
        }
    }
}

impl Gate {
    /// The bridge's word, for requests that are made on it.
    #[must_use]
    pub fn ticket(&self) -> Ticket {
        let at_ms = u64::try_from(self.since.elapsed().as_millis()).unwrap_or(u64::MAX);
        Ticket { began: self.began, at_ms }
    }

    /// What a letter on a key (`flotor/NAME/ask/REQUEST/MEMBER`) asks for, while `run` is the current run (0: none).
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
        let (member, letter) = letter_on(key, payload).ok_or(Refusal::Malformed)?;
        let now = self.ticket();
        let right = letter.request.right();
        // Whoever presses the emergency stop means whatever runs.
        let is_meant = match right {
            Right::Watch => return Ok(letter.request),
            Right::Operate => run != 0 && letter.run == run,
            Right::Own => letter.run == run,
        };
        let is_fresh = right != Right::Own || now.at_ms.saturating_sub(letter.ticket.at_ms) <= FRESH_MS;
        if letter.ticket.began != now.began || letter.ticket.at_ms > now.at_ms || !is_fresh {
            return Err(Refusal::Expired);
        }
        self.use_up((right, member), &letter)?;
        if is_meant { Ok(letter.request) } else { Err(Refusal::Stale) }
    }

    /// A number is valid once.
    fn use_up(&mut self, member: (Right, Name), letter: &NumberedRequest) -> Result<(), Refusal> {
        if !self.members.contains_key(&member) {
            if letter.ticket.at_ms < self.forgotten_ms {
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
        match last.get(&letter.session) {
            Some(before) if letter.number <= before.number => return Err(Refusal::Replayed),
            None if letter.ticket.at_ms < *forgotten_ms => return Err(Refusal::Expired),
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
        *asked_ms = letter.ticket.at_ms.max(*asked_ms);
        last.insert(letter.session.clone(), Last { number: letter.number, at_ms: letter.ticket.at_ms });
        Ok(())
    }
}

/// Whether a letter on its key presses the emergency stop: that needs nothing that a gate remembers, and waits for none.
#[must_use]
pub fn is_emergency_stop(key: &str, payload: &[u8]) -> bool {
    letter_on(key, payload).is_some_and(|(_, letter)| letter.request == Request::EmergencyStop)
}

/// A letter, and whose it is, if it belongs on its key.
fn letter_on(key: &str, payload: &[u8]) -> Option<(Name, NumberedRequest)> {
    let letter = exactly(payload)?;
    let (key, member) = key.rsplit_once('/')?;
    let member = Name::new(member).ok()?;
    let belongs = key.strip_suffix(letter.request.key())?.ends_with('/');
    (belongs && (1..=64).contains(&letter.session.len())).then_some((member, letter))
}

/// A letter that says what we read, and not a word more: an unknown key anywhere is a misunderstanding.
fn exactly(payload: &[u8]) -> Option<NumberedRequest> {
    let said: serde_json::Value = serde_json::from_slice(payload).ok()?;
    let letter: NumberedRequest = serde_json::from_slice(payload).ok()?;
    (serde_json::to_value(&letter).ok()? == said).then_some(letter)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(request: &Request, member: &str) -> String {
        format!("flotor/a/{}/{member}", request.key())
    }

    fn letter(gate: &Gate, session: &str, number: u64, run: u32, request: &Request) -> NumberedRequest {
        let (session, request, ticket) = (session.to_owned(), request.clone(), gate.ticket());
        NumberedRequest { session, number, run, ticket, request }
    }

    /// A letter of ada's on its key.
    fn ask(
        gate: &mut Gate,
        number: u64,
        run: u32,
        request: Request,
        current: u32,
    ) -> Result<Request, Refusal> {
        let letter = letter(gate, "one", number, run, &request);
        gate.admit(&key(&request, "ada"), &letter.to_bytes(), current)
    }

    #[test]
    fn a_letter_is_valid_once_and_for_its_run() {
        let mut gate = Gate::default();
        assert_eq!(ask(&mut gate, 1, 7, Request::Stop, 7), Ok(Request::Stop));
        assert_eq!(ask(&mut gate, 1, 7, Request::Stop, 7), Err(Refusal::Replayed));
        assert_eq!(ask(&mut gate, 2, 7, Request::Stop, 8), Err(Refusal::Stale));
        assert_eq!(ask(&mut gate, 3, 0, Request::Stop, 0), Err(Refusal::Stale));
        assert_eq!(ask(&mut gate, 4, 7, Request::EmergencyStop, 8), Ok(Request::EmergencyStop));
        // Starting and releasing are for the run that was seen, too.
        assert_eq!(ask(&mut gate, 5, 0, Request::Start, 0), Ok(Request::Start));
        assert_eq!(ask(&mut gate, 6, 7, Request::Release, 8), Err(Refusal::Stale));
        let refused: Vec<_> = gate.refused().iter().map(|(refusal, count)| (*refusal, *count)).collect();
        assert_eq!(refused, [(Refusal::Replayed, 1), (Refusal::Stale, 3)]);
    }

    #[test]
    fn a_letter_is_of_one_start_of_the_bridge_and_starting_and_releasing_of_ten_seconds() {
        let mut gate = Gate::default();
        gate.since -= std::time::Duration::from_secs(60);
        for request in [Request::Stop, Request::Start, Request::Release] {
            let of = |ticket| NumberedRequest { ticket, ..letter(&gate, "one", 9, 7, &request) }.to_bytes();
            let now = gate.ticket();
            let letters = [
                (Ticket { began: now.began - 1, ..now }, Err(Refusal::Expired)),
                (Ticket { at_ms: now.at_ms + 60_000, ..now }, Err(Refusal::Expired)),
                (
                    Ticket { at_ms: now.at_ms - FRESH_MS - 1000, ..now },
                    if request == Request::Stop { Ok(request.clone()) } else { Err(Refusal::Expired) },
                ),
            ];
            for (letter, expected) in letters.map(|(ticket, expected)| (of(ticket), expected)) {
                assert_eq!(gate.admit(&key(&request, "ada"), &letter, 7), expected, "{request:?}");
            }
        }
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
            let payload = letter(&gate, "one", 9, 7, &request).to_bytes();
            let others = Right::ALL.into_iter().flat_map(Right::keys).filter(|key| **key != request.key());
            let wrong = others.map(|key| format!("flotor/a/{key}/ada"));
            let nobody = ["", "*", "**", "Ada", "a/b"].map(|member| key(&request, member));
            for wrong in wrong.chain(nobody).chain([format!("flotor/a/{}", request.key())]) {
                assert_eq!(
                    gate.admit(&wrong, &payload, 7),
                    Err(Refusal::Malformed),
                    "{request:?} on {wrong}"
                );
            }
        }
    }

    #[test]
    fn what_is_no_letter_is_refused_and_counted() {
        let mut gate = Gate::default();
        let stop = Request::Stop;
        let good = letter(&gate, "one", 1, 7, &stop).to_bytes();
        for nonsense in [b"".as_slice(), b"{}", b"\xff\xfe", b"[[[[", &good[1..]] {
            assert_eq!(gate.admit(&key(&stop, "ada"), nonsense, 7), Err(Refusal::Malformed));
        }
        let long = vec![b' '; MAX_REQUEST_BYTES + 1];
        assert_eq!(gate.admit(&key(&stop, "ada"), &long, 7), Err(Refusal::TooLong));
        assert_eq!(gate.refused().values().sum::<u64>(), 6);
        assert_eq!(gate.admit(&key(&stop, "ada"), &good, 7), Ok(Request::Stop));
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
            let mut gate = Gate::default();
            let good = letter(&gate, "one", 1, 7, &request).to_bytes();
            let text = String::from_utf8(good.clone()).unwrap();
            // After every opening brace: in the letter, its ticket, its request, a value of that.
            for (at, _) in text.match_indices('{') {
                let mut more = good.clone();
                more.splice(at + 1..=at, br#""extra":1,"#.iter().copied());
                assert_eq!(
                    gate.admit(&key(&request, "ada"), &more, 7),
                    Err(Refusal::Malformed),
                    "{request:?}"
                );
            }
            assert_eq!(gate.admit(&key(&request, "ada"), &good, 7), Ok(request));
        }
    }

    #[test]
    fn no_flood_of_sessions_or_names_fills_the_memory_or_keeps_another_member_out() {
        let mut gate = Gate::default();
        let release = Request::Release;
        let old = letter(&gate, "old", 1, 7, &release).to_bytes();
        assert_eq!(gate.admit(&key(&release, "bob"), &old, 7), Ok(Request::Release));
        std::thread::sleep(std::time::Duration::from_millis(3));
        for session in 0..4 * MOST_SESSIONS {
            if session % 32 == 0 {
                std::thread::sleep(std::time::Duration::from_millis(1)); // no member has so many in a millisecond
            }
            let payload = letter(&gate, &session.to_string(), 1, 7, &release).to_bytes();
            assert_eq!(gate.admit(&key(&release, "bob"), &payload, 7), Ok(Request::Release));
        }
        assert_eq!(
            gate.admit(&key(&release, "bob"), &old, 7),
            Err(Refusal::Expired),
            "forgotten, not valid again"
        );
        assert!(gate.members.values().all(|sessions| sessions.last.len() <= MOST_SESSIONS));
        let payload = letter(&gate, "one", 1, 7, &release).to_bytes();
        assert_eq!(gate.admit(&key(&release, "ada"), &payload, 7), Ok(Request::Release));
        std::thread::sleep(std::time::Duration::from_millis(3));
        let fresh = letter(&gate, "one", 1, 7, &release).to_bytes();
        for name in 0..2 * MOST_MEMBERS {
            let _ = gate.admit(&key(&release, &format!("n{name}")), &fresh, 7);
        }
        assert!(gate.members.len() <= MOST_MEMBERS);
        assert_eq!(gate.admit(&key(&release, "ada"), &payload, 7), Err(Refusal::Expired), "not valid again");
        std::thread::sleep(std::time::Duration::from_millis(3));
        // Neither who was known nor who is new is kept out.
        let payload = letter(&gate, "one", 2, 7, &release).to_bytes();
        for member in ["ada", "grace"] {
            assert_eq!(gate.admit(&key(&release, member), &payload, 7), Ok(Request::Release));
        }
    }

    #[test]
    fn numbers_up_to_the_last_overflow_nothing() {
        let mut gate = Gate::default();
        let stop = Request::Stop;
        for (number, at_ms) in [(u64::MAX, u64::MAX), (u64::MAX, 0), (0, 0)] {
            let ticket = Ticket { at_ms, ..gate.ticket() };
            let payload =
                NumberedRequest { ticket, ..letter(&gate, "one", number, u32::MAX, &stop) }.to_bytes();
            let _ = gate.admit(&key(&stop, "ada"), &payload, 7);
        }
    }
}
