//! A bridge: puts what a running host publishes on the network, and carries requests back.
//!
//! ```text
//!  host -> live socket -> relay -> tf, tick, change, end                    (only while somebody subscribes)
//!  host <- live socket <- handler  <- ask/...   by letters that pass the gate  (only keys the bridge was told to open)
//! ```
//!
//! The bridge is one of the host's watchers, in a process of its own: whatever happens to it, the host drops what the bridge does
//! not take, counts it, and goes on.

mod emergency;
mod handler;
mod launcher;
mod station;
mod stop_channel;

pub use launcher::Launcher;

use crate::couple::{CoupleError, Couplers, Side};
use crate::keys::Name;
use crate::link::{Link, LinkError};
use crate::request::Right;
use flotor_live::{Ask, Client, Directory, Event, LiveError};
use handler::RequestHandler;
use station::Station;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// How often a bridge without a run looks for one.
const LOOK_PERIOD: Duration = Duration::from_millis(200);
/// How often it is looked whether anybody subscribes, and told how the bridge is doing.
const CHECK_PERIOD: Duration = Duration::from_millis(100);

/// What a bridge is to do.
#[derive(Debug)]
pub struct Service {
    /// What the others call it.
    pub name: Name,
    /// The most that may be asked for; who may is up to the network's access control.
    pub allow: Right,
    /// One tick in so many.
    pub every: u32,
    /// What may be started.
    pub launcher: Option<Launcher>,
}

/// Serves until told to stop. `tell` gets a line for people when something changes.
///
/// # Errors
/// [`CoupleError`]: the network, or this machine, refuses what a bridge needs.
pub fn serve(
    session: &Link,
    directory: &Directory,
    service: Service,
    stop: &AtomicBool,
    tell: &mut dyn FnMut(&str),
) -> Result<(), CoupleError> {
    let Service { name, allow, every, launcher } = service;
    let handler =
        RequestHandler::new(name.clone(), launcher, allow, directory).map_err(CoupleError::Thread)?;
    let handler = Arc::new(handler);
    let station = Station::declare(session, &name)?;
    let _counter = handler::open(session, &handler, allow)?;
    let opened = session.stop_channel().map(|stop| stop_channel::open(stop, &name, directory)).transpose();
    let _stop_channel = opened.unwrap_or_else(|error| {
        tell(&format!(
            "a new member's emergency stop waits for the connections before it: no UDP port of the same number: {error}"
        ));
        None
    });
    // Last of all: who sees it can ask.
    let _alive = session.liveliness().declare_token(name.key("alive")).wait_now()?;
    let side = if allow >= Right::Operate { Side::Serving } else { Side::ServingDeaf };
    let couplers = Couplers::new(session, directory, &name, side);
    let mut relay = Relay { station, handler, couplers, every, stop };
    let mut told = String::new();
    while !stop.load(Ordering::Relaxed) {
        match Client::find(directory) {
            Ok(client) => {
                tell(&format!(
                    "carrying `{}` (process {})",
                    client.greeting().title,
                    client.greeting().process
                ));
                relay.carry(client, tell)?;
                tell("the run is over; waiting for the next");
            }
            Err(LiveError::NoRun { .. }) => {}
            Err(error) => {
                // Once: it is tried again many times a second.
                let words = error.to_string();
                if words != told {
                    tell(&words);
                    told = words;
                }
            }
        }
        relay.report(tell)?;
        std::thread::sleep(LOOK_PERIOD);
    }
    Ok(())
}

/// What it takes to carry runs.
struct Relay<'s> {
    station: Station,
    handler: Arc<RequestHandler>,
    couplers: Couplers,
    every: u32,
    stop: &'s AtomicBool,
}

impl Relay<'_> {
    /// Carries one run.
    fn carry(&mut self, mut client: Client, tell: &mut dyn FnMut(&str)) -> Result<(), CoupleError> {
        self.handler.begin(&client);
        let asker = client.asker();
        let mut is_watching = false;
        let mut checked: Option<Instant> = None;
        while !self.stop.load(Ordering::Relaxed) {
            if checked.is_none_or(|at| at.elapsed() >= CHECK_PERIOD) {
                checked = Some(Instant::now());
                let is_wanted = self.station.is_wanted()?;
                if is_wanted != is_watching {
                    is_watching = is_wanted;
                    // A host that is gone says so below.
                    let every = self.every;
                    let _ = asker.ask(if is_wanted { Ask::Watch { every } } else { Ask::LookAway });
                }
                self.report(tell)?;
            }
            let Self { station, handler, .. } = self;
            match client.next(CHECK_PERIOD) {
                Ok(None) => {}
                Ok(Some(Event::Ticks { records, dropped })) => {
                    for record in &records {
                        station.tick(record, handler.publishing())?;
                    }
                    // A full queue keeps what is in it: what it dropped came after these.
                    handler.dropped(dropped);
                }
                Ok(Some(Event::Change(change))) => {
                    handler.keep(&change);
                    station.change(&change)?;
                }
                Ok(Some(Event::Answer(answer))) => handler.answered(answer),
                Ok(Some(Event::End(end))) => {
                    station.end(&end, handler.due())?;
                    break;
                }
                Err(error) => {
                    station.end(
                        &flotor_live::End { words: error.to_string(), kind: flotor_live::EndKind::Failed },
                        handler.due(),
                    )?;
                    break;
                }
            }
        }
        self.handler.end();
        self.report(tell)
    }

    /// Looks after the couplings, and says how the bridge is doing.
    fn report(&mut self, tell: &mut dyn FnMut(&str)) -> Result<(), CoupleError> {
        self.couplers.follow(tell)?;
        self.handler.carried(self.couplers.carried());
        Ok(self.handler.report(&self.station)?)
    }
}

/// Waiting for what is over at once: all declarations here are local.
trait WaitNow<T> {
    fn wait_now(self) -> Result<T, LinkError>;
}

impl<T, R> WaitNow<T> for R
where
    R: zenoh::Wait + zenoh::Resolvable<To = zenoh::Result<T>>,
{
    fn wait_now(self) -> Result<T, LinkError> {
        self.wait().map_err(LinkError::from)
    }
}
