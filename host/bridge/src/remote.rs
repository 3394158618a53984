//! A run on another machine: what it tells, and how it is asked for something.

use crate::keys::Name;
use crate::link::LinkError;
use crate::status::Status;
use crate::wish::{Letter, Wish};
use flotor_live::{Answer, End, Greeting};
use flotor_record::trace::TickRecord;
use flotor_record::{Change, RunDescription, tick_from_messages};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;
use zenoh::pubsub::Subscriber;
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};

/// Ticks that wait here at most: eight seconds at 1 kHz. What finds no room is counted as lost.
const MOST_WAITING: usize = 8192;
/// How long a bridge may take to answer.
const ANSWER_WAIT: Duration = Duration::from_secs(3);
/// Pause between two looks for a bridge or run that is not there.
const LOOK_PERIOD: Duration = Duration::from_millis(300);

/// What a remote run tells.
#[derive(Clone, Debug, PartialEq)]
pub enum Told {
    /// A tick.
    Tick(TickRecord),
    /// A parameter changed.
    Change(Change),
    /// The run is over.
    End(End),
    /// The bridge cannot be seen any more.
    Gone,
}

/// A bridge on the network, from afar.
pub struct Remote {
    session: Session,
    name: Name,
    told: Receiver<Told>,
    lost: Arc<AtomicU64>,
    errand: Errand,
    _all: Subscriber<()>,
    _alive: Subscriber<()>,
}

/// Carries requests to a bridge, from any thread; clone it freely.
#[derive(Clone)]
pub struct Errand {
    session: Session,
    name: Name,
    number: Arc<AtomicU64>,
    /// Process of the run that is meant.
    run: Arc<AtomicU64>,
}

impl Remote {
    /// Listens to a bridge, whether it is there yet or not.
    ///
    /// # Errors
    /// [`LinkError`]: the network refuses.
    pub fn listen(session: &Session, name: &Name) -> Result<Self, LinkError> {
        let (sender, told) = sync_channel(MOST_WAITING);
        let lost = Arc::new(AtomicU64::new(0));
        let mut ear = Ear::new(sender.clone(), Arc::clone(&lost));
        let all =
            session.declare_subscriber(name.key("*")).callback_mut(move |sample| ear.hear(&sample)).wait()?;
        let alive = session
            .liveliness()
            .declare_subscriber(name.key("alive"))
            .callback(move |sample| {
                if sample.kind() == SampleKind::Delete {
                    let _ = sender.try_send(Told::Gone);
                }
            })
            .wait()?;
        let errand = Errand {
            session: session.clone(),
            name: name.clone(),
            number: Arc::default(),
            run: Arc::default(),
        };
        Ok(Self {
            session: session.clone(),
            name: name.clone(),
            told,
            lost,
            errand,
            _all: all,
            _alive: alive,
        })
    }

    /// Waits for a run: who it is, and how it was set up. Nothing if told to stop.
    ///
    /// # Errors
    /// [`LinkError`]: the network refuses.
    pub fn wait_for_run(&self, stop: &AtomicBool) -> Result<Option<(Greeting, RunDescription)>, LinkError> {
        while !stop.load(Ordering::Relaxed) {
            let greeting =
                self.get("greeting")?.and_then(|bytes| serde_json::from_slice::<Greeting>(&bytes).ok());
            let run = self.get("run")?.and_then(|bytes| RunDescription::from_bytes(&bytes).ok());
            if let (Some(greeting), Some(run)) = (greeting, run) {
                self.errand.run.store(u64::from(greeting.process), Ordering::Relaxed);
                return Ok(Some((greeting, run)));
            }
            std::thread::sleep(LOOK_PERIOD);
        }
        Ok(None)
    }

    /// What is told next; nothing if nothing is told in this time.
    #[must_use]
    pub fn next(&self, timeout: Duration) -> Option<Told> {
        match self.told.recv_timeout(timeout) {
            Ok(told) => Some(told),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => Some(Told::Gone),
        }
    }

    /// Requests are for this run from now on (its process, 0 for none). Not needed after [`Remote::wait_for_run`].
    pub fn mean(&self, run: u32) {
        self.errand.run.store(u64::from(run), Ordering::Relaxed);
    }

    /// Ticks that were published and did not get here, as far as is known.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.lost.load(Ordering::Relaxed)
    }

    /// How the bridge is doing.
    ///
    /// # Errors
    /// [`LinkError`]: the network refuses.
    pub fn status(&self) -> Result<Option<Status>, LinkError> {
        Ok(self.get("status")?.and_then(|bytes| serde_json::from_slice(&bytes).ok()))
    }

    /// The way to ask for something.
    #[must_use]
    pub fn errand(&self) -> Errand {
        self.errand.clone()
    }

    fn get(&self, what: &str) -> Result<Option<Vec<u8>>, LinkError> {
        get(&self.session, &self.name.key(what), None)
    }
}

impl Errand {
    /// Asks for something and waits for the answer: the reason if it is refused.
    ///
    /// # Errors
    /// In words, for people.
    pub fn run(&self, wish: Wish) -> Result<(), String> {
        let key = self.name.key(wish.key());
        let letter = Letter {
            peer: self.session.zid().to_string(),
            number: self.number.fetch_add(1, Ordering::Relaxed) + 1,
            run: u32::try_from(self.run.load(Ordering::Relaxed)).unwrap_or(0),
            wish,
        };
        let letter = serde_json::to_vec(&letter).map_err(|error| error.to_string())?;
        let answer = get(&self.session, &key, Some(letter)).map_err(|error| error.to_string())?;
        let answer = answer.ok_or(
            "nobody answers: the bridge is gone, or does not take this request, or not from this peer; \
             `flotor bridge serve --allow` and the network's access control say who may",
        )?;
        let answer: Answer = serde_json::from_slice(&answer).map_err(|error| error.to_string())?;
        answer.refused.map_or(Ok(()), Err)
    }
}

/// What is answered on a key, if anything is.
pub(crate) fn get(
    session: &Session,
    key: &str,
    payload: Option<Vec<u8>>,
) -> Result<Option<Vec<u8>>, LinkError> {
    let question = session.get(key).timeout(ANSWER_WAIT);
    let answers = match payload {
        Some(payload) => question.payload(payload).wait()?,
        None => question.wait()?,
    };
    while let Ok(answer) = answers.recv() {
        if let Ok(sample) = answer.into_result() {
            return Ok(Some(sample.payload().to_bytes().into_owned()));
        }
    }
    Ok(None)
}

/// Puts messages together to what they tell, in the network's thread.
struct Ear {
    sender: SyncSender<Told>,
    lost: Arc<AtomicU64>,
    pose: Option<Vec<u8>>,
    number: Option<u64>,
}

impl Ear {
    fn new(sender: SyncSender<Told>, lost: Arc<AtomicU64>) -> Self {
        Self { sender, lost, pose: None, number: None }
    }

    fn hear(&mut self, sample: &Sample) {
        let payload = sample.payload().to_bytes();
        let number = sample.attachment().and_then(|bytes| bytes.to_bytes().as_ref().try_into().ok());
        let number = number.map(u64::from_le_bytes);
        let told = match sample.key_expr().as_str().rsplit('/').next() {
            Some("tf") => {
                self.pose = Some(payload.into_owned());
                return;
            }
            Some("tick") => self.tick(&payload, number),
            Some("change") => Change::from_bytes(&payload, number.unwrap_or(0)).ok().map(Told::Change),
            Some("end") => serde_json::from_slice(&payload).ok().map(Told::End),
            _ => return,
        };
        let Some(told) = told else { return };
        let is_tick = matches!(told, Told::Tick(_));
        if self.sender.try_send(told).is_err() && is_tick {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// A tick, if its pose came before it; gaps in the numbers are losses.
    fn tick(&mut self, payload: &[u8], number: Option<u64>) -> Option<Told> {
        if let Some(number) = number {
            let missing = self.number.map_or(0, |last| number.saturating_sub(last + 1));
            self.lost.fetch_add(missing, Ordering::Relaxed);
            self.number = Some(number);
        }
        let pose = self.pose.take();
        let record = pose.and_then(|pose| tick_from_messages(&pose, payload).ok());
        if record.is_none() {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
        record.map(Told::Tick)
    }
}

/// Bridges that can be seen.
///
/// # Errors
/// [`LinkError`]: the network refuses.
pub fn bridges(session: &Session) -> Result<Vec<Name>, LinkError> {
    let answers = session.liveliness().get("flotor/*/alive").timeout(ANSWER_WAIT).wait()?;
    let mut names: Vec<Name> = answers
        .iter()
        .filter_map(|answer| Name::of_key(answer.into_result().ok()?.key_expr().as_str()))
        .collect();
    names.sort();
    names.dedup();
    Ok(names)
}
