//! Bilateral teleoperation: forwards the peer state of the two ends of a coupling between a local host and a remote bridge.
//!
//! ```text
//!  host -> peer socket -> couple -> flotor/NAME/couple/COUPLING -> serve -> peer socket -> host
//!       <-             <-        <- flotor/NAME/news/COUPLING   <-       <-             <-
//! ```
//!
//! Both directions are best effort, and only the newest message counts: a full queue drops messages, here and in Zenoh.
//! Messages are not trusted: a message that is not a valid [`Dispatch`] is rejected and counted; a host accepts one partner, and
//! checks the partner's claims as far as possible (`flotor_coupling`).

use crate::keys::Name;
use crate::link::{LinkError, WaitNow};
use flotor_core::peer::{DISPATCH_BYTES, Dispatch};
use flotor_live::{CALL_PERIOD, Directory, DirectoryError, FoundCoupling, PeerSocket};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::{CongestionControl, Priority};
use zenoh::{Session, Wait};

/// Poll interval for messages of the host and of the network: half a tick at 1 kHz.
const LOOK_PERIOD: Duration = Duration::from_micros(500);
/// Capacity of the queue of messages from the network; further messages are dropped.
const MOST_WAITING: usize = 64;
/// Poll interval for new couplings.
const FIND_PERIOD: Duration = Duration::from_millis(200);

/// Role of this program on the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Bridge: publishes to all peers, and accepts messages.
    Serving,
    /// Bridge whose hand no peer may move: publishes, and accepts no messages.
    ServingReadOnly,
    /// Peer that connects to a bridge.
    Visiting,
}

impl Side {
    fn tells(self, name: &Name, coupling: &str) -> String {
        match self {
            Side::Serving | Side::ServingReadOnly => name.key(&format!("news/{coupling}")),
            Side::Visiting => name.key(&format!("couple/{coupling}")),
        }
    }

    fn incoming_key(self, name: &Name, coupling: &str) -> Option<String> {
        match self {
            Side::Serving => Some(name.key(&format!("couple/{coupling}"))),
            Side::ServingReadOnly => None,
            Side::Visiting => Some(name.key(&format!("news/{coupling}"))),
        }
    }
}

/// Message counts of a coupling.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MessageCounts {
    /// Number of messages from the local host that were sent to the network.
    #[serde(rename = "told")]
    pub sent: u64,
    /// Number of messages from the network that were forwarded to the local host.
    #[serde(rename = "heard")]
    pub received: u64,
    /// Number of malformed messages from the network.
    #[serde(rename = "refused")]
    pub rejected: u64,
}

/// Counters shared with the network's threads.
#[derive(Default)]
struct Counts {
    sent: AtomicU64,
    received: AtomicU64,
    rejected: AtomicU64,
    /// Run id of the local end, and partner's run id in the newest message of the other end; 0: none, or unknown.
    here: AtomicU64,
    answered: AtomicU64,
}

impl Counts {
    fn now(&self) -> MessageCounts {
        let [sent, received, rejected] =
            [&self.sent, &self.received, &self.rejected].map(|count| count.load(Ordering::Relaxed));
        MessageCounts { sent, received, rejected }
    }

    /// Returns true if the other end is coupled to another run.
    fn is_held_by_another(&self) -> bool {
        let [here, answered] = [&self.here, &self.answered].map(|run| run.load(Ordering::Relaxed));
        here != 0 && answered != 0 && here != answered
    }
}

/// Error of the transport of a coupling.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CoupleError {
    /// Error of the network.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// Error of the local directory of couplings.
    #[error(transparent)]
    Directory(#[from] DirectoryError),
    /// A thread could not be created.
    #[error("cannot start a thread: {0}; end other programs of this user")]
    Thread(#[from] std::io::Error),
}

/// Peer links of all couplings of this user's running hosts.
pub struct Couplers {
    session: Session,
    directory: Directory,
    name: Name,
    side: Side,
    here: BTreeMap<String, Coupler>,
    looked: Option<Instant>,
}

impl Couplers {
    /// Creates an empty set; [`Couplers::follow`] finds the couplings.
    #[must_use]
    pub fn new(session: &Session, directory: &Directory, name: &Name, side: Side) -> Self {
        Self {
            session: session.clone(),
            directory: directory.clone(),
            name: name.clone(),
            side,
            here: BTreeMap::new(),
            looked: None,
        }
    }

    /// Starts links for new couplings and drops the links of ended runs, at most every 200 ms; in between returns at once. `report`
    /// receives a human-readable line for each started or ended link.
    ///
    /// # Errors
    /// [`CoupleError`] of a new link.
    pub fn follow(&mut self, report: &mut dyn FnMut(&str)) -> Result<(), CoupleError> {
        if self.looked.is_some_and(|at| at.elapsed() < FIND_PERIOD) {
            return Ok(());
        }
        self.looked = Some(Instant::now());
        self.here.retain(|coupling, coupler| {
            let is_on = !coupler.thread.as_ref().is_none_or(JoinHandle::is_finished);
            if !is_on {
                report(&format!("the coupling `{coupling}` has ended with its run"));
            }
            is_on
        });
        for found in self.directory.couplings() {
            if !self.here.contains_key(&found.name) {
                report(&format!(
                    "forwarding the peer state of the coupling `{}` (process {})",
                    found.name, found.process
                ));
                let coupler = Coupler::start(&self.session, &self.directory, &self.name, self.side, &found)?;
                self.here.insert(found.name, coupler);
            }
        }
        Ok(())
    }

    /// Returns the couplings whose other end is coupled to another run, and therefore rejects the run here.
    #[must_use]
    pub fn held_by_others(&self) -> Vec<String> {
        let held = self.here.iter().filter(|(_, coupler)| coupler.counts.is_held_by_another());
        held.map(|(name, _)| name.clone()).collect()
    }

    /// Returns the message counts by coupling.
    #[must_use]
    pub fn carried(&self) -> BTreeMap<String, MessageCounts> {
        self.here.iter().map(|(name, coupler)| (name.clone(), coupler.counts.now())).collect()
    }
}

/// Links the couplings of local hosts to the couplings of the same name at a bridge, until `stop` is set. `report` receives a
/// human-readable line at each change. Not real-time.
///
/// # Errors
/// [`CoupleError`] of a link.
pub fn couple(
    session: &Session,
    directory: &Directory,
    name: &Name,
    stop: &AtomicBool,
    report: &mut dyn FnMut(&str),
) -> Result<(), CoupleError> {
    let mut couplers = Couplers::new(session, directory, name, Side::Visiting);
    let mut before: BTreeMap<String, (MessageCounts, bool)> = BTreeMap::new();
    let mut reported: Vec<String> = Vec::new();
    while !stop.load(Ordering::Relaxed) {
        couplers.follow(report)?;
        std::thread::sleep(FIND_PERIOD);
        let held = couplers.held_by_others();
        for coupling in held.iter().filter(|coupling| !reported.contains(coupling)) {
            report(&format!(
                "the other end of `{coupling}` is coupled to another run, so the run here has no partner"
            ));
        }
        reported = held;
        for (coupling, now) in couplers.carried() {
            let (last, was_received) = before.get(&coupling).copied().unwrap_or_default();
            let is_received = now.received > last.received;
            if is_received != was_received {
                let words = if is_received { "sends messages" } else { "sends no messages any more" };
                report(&format!("the other end of `{coupling}` {words}"));
            }
            before.insert(coupling, (now, is_received));
        }
    }
    Ok(())
}

/// Peer link of one coupling, in both directions. Its thread ends when the link is dropped, or when the host has ended.
struct Coupler {
    counts: Arc<Counts>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    _subscriber: Option<Subscriber<()>>,
}

impl Coupler {
    fn start(
        session: &Session,
        directory: &Directory,
        name: &Name,
        side: Side,
        found: &FoundCoupling,
    ) -> Result<Self, CoupleError> {
        let counts = Arc::<Counts>::default();
        let (sender, from_network) = sync_channel(MOST_WAITING);
        let of_callback = Arc::clone(&counts);
        let receive = move |sample: zenoh::sample::Sample| {
            // Check the length before copying.
            let payload = sample.payload();
            let dispatch =
                (payload.len() == DISPATCH_BYTES).then(|| Dispatch::from_bytes(&payload.to_bytes()));
            match dispatch {
                Some(Ok(dispatch)) => {
                    of_callback.answered.store(dispatch.partner, Ordering::Relaxed);
                    let _ = sender.try_send(dispatch);
                }
                _ => {
                    of_callback.rejected.fetch_add(1, Ordering::Relaxed);
                }
            }
        };
        let key = side.incoming_key(name, &found.name);
        let subscriber =
            key.map(|key| session.declare_subscriber(key).callback(receive).wait_now()).transpose()?;
        // Highest priority. Not express: on a slow network messages share a batch instead of being dropped.
        let tells = session
            .declare_publisher(side.tells(name, &found.name))
            .congestion_control(CongestionControl::Drop)
            .priority(Priority::RealTime)
            .wait_now()?;
        let socket = PeerSocket::join(directory, found)?;
        let stop = Arc::new(AtomicBool::new(false));
        let (of_thread, until) = (Arc::clone(&counts), Arc::clone(&stop));
        let thread = std::thread::Builder::new().name("flotor-couple".to_owned());
        let thread = thread.spawn(move || carry(socket, &from_network, &tells, &of_thread, &until))?;
        Ok(Self { counts, stop, thread: Some(thread), _subscriber: subscriber })
    }
}

impl Drop for Coupler {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Transports messages in both directions until `stop` is set or the host is gone.
fn carry(
    mut socket: PeerSocket,
    from_network: &Receiver<Dispatch>,
    tells: &Publisher<'_>,
    counts: &Counts,
    stop: &AtomicBool,
) {
    let mut called: Option<Instant> = None;
    while !stop.load(Ordering::Relaxed) {
        if called.is_none_or(|at| at.elapsed() >= CALL_PERIOD) {
            called = Some(Instant::now());
            if !socket.subscribe() {
                return;
            }
        }
        // Forward only the newest pending message. The local host sends no malformed messages, so none is counted as rejected.
        let mut newest = None;
        while let Ok(Some(dispatch)) = socket.receive() {
            newest = Some(dispatch);
        }
        if let Some(dispatch) = newest {
            counts.here.store(dispatch.run, Ordering::Relaxed);
        }
        if let Some(dispatch) = newest
            && tells.put(dispatch.to_bytes()).wait().is_ok()
        {
            counts.sent.fetch_add(1, Ordering::Relaxed);
        }
        for dispatch in from_network.try_iter() {
            socket.send(&dispatch);
            counts.received.fetch_add(1, Ordering::Relaxed);
        }
        std::thread::sleep(LOOK_PERIOD);
    }
}
