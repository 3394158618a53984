//! Bilateral teleoperation: carries what the two ends of a coupling tell each other, between a host here and a bridge elsewhere.
//!
//! ```text
//!  host -> peer socket -> couple -> flotor/NAME/couple/COUPLING -> serve -> peer socket -> host
//!       <-             <-        <- flotor/NAME/news/COUPLING   <-       <-             <-
//! ```
//!
//! Both directions are best effort, and only the newest counts: what finds no room is dropped, here and in Zenoh. Nothing of it
//! is trusted: what is no [`Dispatch`] is refused and counted; a host hears one partner, and believes of its claims what it can check
//! (`flotor_coupling`).

use crate::keys::Name;
use crate::link::LinkError;
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

/// Pause between two looks at both sides: half a period at 1 kHz.
const LOOK_PERIOD: Duration = Duration::from_micros(500);
/// Messages from the network that waits for the host at most: more is old.
const MOST_WAITING: usize = 64;
/// How often it is looked which couplings there are.
const FIND_PERIOD: Duration = Duration::from_millis(200);

/// Which end of the network this program is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The bridge itself, which tells everybody and lets itself be told.
    Serving,
    /// The same, but nobody may move its hand.
    ServingDeaf,
    /// Who came to it.
    Visiting,
}

impl Side {
    fn tells(self, name: &Name, coupling: &str) -> String {
        match self {
            Side::Serving | Side::ServingDeaf => name.key(&format!("news/{coupling}")),
            Side::Visiting => name.key(&format!("couple/{coupling}")),
        }
    }

    fn hears(self, name: &Name, coupling: &str) -> Option<String> {
        match self {
            Side::Serving => Some(name.key(&format!("couple/{coupling}"))),
            Side::ServingDeaf => None,
            Side::Visiting => Some(name.key(&format!("news/{coupling}"))),
        }
    }
}

/// What was carried for a coupling.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Carried {
    /// Messages of the host here, put on the network.
    pub told: u64,
    /// Messages from the network, given to the host here.
    pub heard: u64,
    /// What came from the network and was no message.
    pub refused: u64,
}

/// Counts that the network's threads and ours add to.
#[derive(Default)]
struct Counts {
    told: AtomicU64,
    heard: AtomicU64,
    refused: AtomicU64,
    /// The run here, and the one that the other end answers; 0: none, or not known.
    here: AtomicU64,
    answered: AtomicU64,
}

impl Counts {
    fn now(&self) -> Carried {
        let [told, heard, refused] =
            [&self.told, &self.heard, &self.refused].map(|count| count.load(Ordering::Relaxed));
        Carried { told, heard, refused }
    }

    /// Whether the other end holds another run than the one here.
    fn is_held_by_another(&self) -> bool {
        let [here, answered] = [&self.here, &self.answered].map(|run| run.load(Ordering::Relaxed));
        here != 0 && answered != 0 && here != answered
    }
}

/// Why messages are not carried.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CoupleError {
    /// The network.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// This machine.
    #[error(transparent)]
    Directory(#[from] DirectoryError),
    /// No thread.
    #[error("no thread: {0}")]
    Thread(#[from] std::io::Error),
}

/// Carries for every coupling of the hosts that run here, as they come and go.
pub struct Couplers {
    session: Session,
    directory: Directory,
    name: Name,
    side: Side,
    here: BTreeMap<String, Coupler>,
    looked: Option<Instant>,
}

impl Couplers {
    /// None yet: [`Couplers::follow`] looks for them.
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

    /// Takes up what has come and closes what has gone, if it is time to look. `tell` gets a line for people about each.
    ///
    /// # Errors
    /// [`CoupleError`].
    pub fn follow(&mut self, tell: &mut dyn FnMut(&str)) -> Result<(), CoupleError> {
        if self.looked.is_some_and(|at| at.elapsed() < FIND_PERIOD) {
            return Ok(());
        }
        self.looked = Some(Instant::now());
        self.here.retain(|coupling, coupler| {
            let is_on = !coupler.thread.as_ref().is_none_or(JoinHandle::is_finished);
            if !is_on {
                tell(&format!("the coupling `{coupling}` is gone: its run is over"));
            }
            is_on
        });
        for found in self.directory.couplings() {
            if !self.here.contains_key(&found.name) {
                tell(&format!(
                    "carrying the peer state of the coupling `{}` (process {})",
                    found.name, found.process
                ));
                let coupler = Coupler::start(&self.session, &self.directory, &self.name, self.side, &found)?;
                self.here.insert(found.name, coupler);
            }
        }
        Ok(())
    }

    /// The couplings whose other end holds another run than the one here: this one is let in by nobody.
    #[must_use]
    pub fn held_by_others(&self) -> Vec<String> {
        let held = self.here.iter().filter(|(_, coupler)| coupler.counts.is_held_by_another());
        held.map(|(name, _)| name.clone()).collect()
    }

    /// What was carried for each.
    #[must_use]
    pub fn carried(&self) -> BTreeMap<String, Carried> {
        self.here.iter().map(|(name, coupler)| (name.clone(), coupler.counts.now())).collect()
    }
}

/// Joins the couplings of hosts here with those of the same name behind a bridge, until told to stop. `tell` gets a line for
/// people when something changes.
///
/// # Errors
/// [`CoupleError`].
pub fn couple(
    session: &Session,
    directory: &Directory,
    name: &Name,
    stop: &AtomicBool,
    tell: &mut dyn FnMut(&str),
) -> Result<(), CoupleError> {
    let mut couplers = Couplers::new(session, directory, name, Side::Visiting);
    let mut before: BTreeMap<String, (Carried, bool)> = BTreeMap::new();
    let mut told_of: Vec<String> = Vec::new();
    while !stop.load(Ordering::Relaxed) {
        couplers.follow(tell)?;
        std::thread::sleep(FIND_PERIOD);
        let held = couplers.held_by_others();
        for coupling in held.iter().filter(|coupling| !told_of.contains(coupling)) {
            tell(&format!(
                "the other end of `{coupling}` is the partner of another run: the one here has none"
            ));
        }
        told_of = held;
        for (coupling, now) in couplers.carried() {
            let (last, was_heard) = before.get(&coupling).copied().unwrap_or_default();
            let is_heard = now.heard > last.heard;
            if is_heard != was_heard {
                let words = if is_heard { "is heard" } else { "cannot be heard any more" };
                tell(&format!("the other end of `{coupling}` {words}"));
            }
            before.insert(coupling, (now, is_heard));
        }
    }
    Ok(())
}

/// A thread that carries for one coupling, both ways; it ends when dropped, or when the host has.
struct Coupler {
    counts: Arc<Counts>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    _hears: Option<Subscriber<()>>,
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
        let hear = move |sample: zenoh::sample::Sample| {
            // A long one is not even copied.
            let payload = sample.payload();
            let dispatch =
                (payload.len() == DISPATCH_BYTES).then(|| Dispatch::from_bytes(&payload.to_bytes()));
            match dispatch {
                Some(Ok(dispatch)) => {
                    of_callback.answered.store(dispatch.partner, Ordering::Relaxed);
                    let _ = sender.try_send(dispatch);
                }
                _ => {
                    of_callback.refused.fetch_add(1, Ordering::Relaxed);
                }
            }
        };
        let hears = side.hears(name, &found.name);
        let hears = hears.map(|key| session.declare_subscriber(key).callback(hear).wait()).transpose();
        let hears = hears.map_err(LinkError::from)?;
        // Before everything else. Not each by itself: what the network is too slow for shares a batch, and is not dropped.
        let tells = session
            .declare_publisher(side.tells(name, &found.name))
            .congestion_control(CongestionControl::Drop)
            .priority(Priority::RealTime)
            .wait()
            .map_err(LinkError::from)?;
        let socket = PeerSocket::join(directory, found)?;
        let stop = Arc::new(AtomicBool::new(false));
        let (of_thread, until) = (Arc::clone(&counts), Arc::clone(&stop));
        let thread = std::thread::Builder::new().name("flotor-couple".to_owned());
        let thread = thread.spawn(move || carry(socket, &from_network, &tells, &of_thread, &until))?;
        Ok(Self { counts, stop, thread: Some(thread), _hears: hears })
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

/// Both ways, until told to stop or until the host is gone.
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
            if !socket.call() {
                return;
            }
        }
        // Of what comes together only the last is new. What the host says is its own: nothing is refused there.
        let mut newest = None;
        while let Ok(Some(dispatch)) = socket.hear() {
            newest = Some(dispatch);
        }
        if let Some(dispatch) = newest {
            counts.here.store(dispatch.run, Ordering::Relaxed);
        }
        if let Some(dispatch) = newest
            && tells.put(dispatch.to_bytes()).wait().is_ok()
        {
            counts.told.fetch_add(1, Ordering::Relaxed);
        }
        for dispatch in from_network.try_iter() {
            socket.tell(&dispatch);
            counts.heard.fetch_add(1, Ordering::Relaxed);
        }
        std::thread::sleep(LOOK_PERIOD);
    }
}
