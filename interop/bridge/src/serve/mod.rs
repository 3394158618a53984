//! Bridge: publishes the messages of a running host on the network, and forwards requests to the host.
//!
//! ```text
//!  host -> live socket -> relay   -> tf, tick, change, end     (only while there are subscribers)
//!  host <- live socket <- handler <- ask/..., admitted requests (only keys within the bridge's rights)
//! ```
//!
//! The bridge is a client of the host, in a process of its own: if the bridge is slow or fails, the host drops and counts the
//! messages that the bridge does not receive, and keeps running.

mod emergency;
mod handler;
mod launcher;
mod station;
mod stop_channel;

pub use launcher::Launcher;

use crate::couple::{CoupleError, Couplers, Side};
use crate::keys::Name;
use crate::link::{Link, WaitNow};
use crate::request::Right;
use flotor_live::{Ask, Client, Directory, End, EndKind, Event, LiveError};
use handler::RequestHandler;
use station::Station;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Poll interval while no run is published.
const LOOK_PERIOD: Duration = Duration::from_millis(200);
/// Timeout for the next event of the host, and interval of the checks for subscribers and for a changed status.
const CHECK_PERIOD: Duration = Duration::from_millis(100);

/// Configuration of a bridge.
#[derive(Debug)]
pub struct Service {
    /// Name of the bridge on the network.
    pub name: Name,
    /// Highest right whose requests are accepted; the access control of the network sets the right of each member.
    pub allow: Right,
    /// Decimation of the ticks: one in `every` is published.
    pub every: u32,
    /// Starter of the bridge's scene; `None` if no scene may be started.
    pub launcher: Option<Launcher>,
}

/// Publishes each run of this machine and handles requests until `stop` is set. `report_line` receives a human-readable line at
/// each change. Not real-time.
///
/// # Errors
/// [`CoupleError`] of the network or of this machine.
pub fn serve(
    session: &Link,
    directory: &Directory,
    service: Service,
    stop: &AtomicBool,
    report_line: &mut dyn FnMut(&str),
) -> Result<(), CoupleError> {
    let Service { name, allow, every, launcher } = service;
    let handler =
        RequestHandler::new(name.clone(), launcher, allow, directory).map_err(CoupleError::Thread)?;
    let handler = Arc::new(handler);
    let station = Station::declare(session, &name)?;
    let _counter = handler::open(session, &handler, allow)?;
    let opened = session.stop_channel().map(|stop| stop_channel::open(stop, &name, directory)).transpose();
    let _stop_channel = opened.unwrap_or_else(|error| {
        report_line(&format!(
            "cannot open the UDP port with the number of the TCP port ({error}), so earlier connections can delay the \
             emergency stop of a new member; end the program that uses the port, and start the bridge again"
        ));
        None
    });
    // Declared last: a peer that sees the token can send requests.
    let _alive = session.liveliness().declare_token(name.key("alive")).wait_now()?;
    let side = if allow >= Right::Operate { Side::Serving } else { Side::ServingReadOnly };
    let couplers = Couplers::new(session, directory, &name, side);
    let mut relay = Relay { station, handler, couplers, every, stop };
    let mut reported = String::new();
    while !stop.load(Ordering::Relaxed) {
        match Client::find(directory) {
            Ok(client) => {
                report_line(&format!(
                    "carrying `{}` (process {})",
                    client.greeting().title,
                    client.greeting().process
                ));
                relay.carry(client, report_line)?;
                report_line("the run is over; waiting for the next run");
            }
            Err(LiveError::NoRun(_)) => {}
            Err(error) => {
                // Report once, as this is retried many times a second.
                let words = error.to_string();
                if words != reported {
                    report_line(&words);
                    reported = words;
                }
            }
        }
        relay.report(report_line)?;
        std::thread::sleep(LOOK_PERIOD);
    }
    Ok(())
}

/// Relay of a run between host and network.
struct Relay<'s> {
    station: Station,
    handler: Arc<RequestHandler>,
    couplers: Couplers,
    every: u32,
    stop: &'s AtomicBool,
}

impl Relay<'_> {
    /// Relays one run until it ends or `stop` is set.
    fn carry(&mut self, mut client: Client, report_line: &mut dyn FnMut(&str)) -> Result<(), CoupleError> {
        self.handler.begin(&client);
        let request_client = client.request_client();
        let mut is_watching = false;
        let mut checked: Option<Instant> = None;
        while !self.stop.load(Ordering::Relaxed) {
            if checked.is_none_or(|at| at.elapsed() >= CHECK_PERIOD) {
                checked = Some(Instant::now());
                let is_wanted = self.station.is_wanted()?;
                if is_wanted != is_watching {
                    is_watching = is_wanted;
                    // A lost host is reported below.
                    let every = self.every;
                    let _ = request_client.ask(if is_wanted { Ask::Watch { every } } else { Ask::Unwatch });
                }
                self.report(report_line)?;
            }
            let Self { station, handler, .. } = self;
            match client.next(CHECK_PERIOD) {
                Ok(None) => {}
                Ok(Some(Event::Ticks { records, dropped })) => {
                    for record in &records {
                        station.tick(record, handler.publishing())?;
                    }
                    // A full queue drops the newest ticks: the dropped ticks came after these records.
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
                    let end = End { words: error.to_string(), kind: EndKind::Failed };
                    station.end(&end, handler.due())?;
                    break;
                }
            }
        }
        self.handler.end();
        self.report(report_line)
    }

    /// Updates the couplings and publishes the status.
    fn report(&mut self, report_line: &mut dyn FnMut(&str)) -> Result<(), CoupleError> {
        self.couplers.follow(report_line)?;
        self.handler.carried(self.couplers.carried());
        Ok(self.handler.report(&self.station)?)
    }
}
