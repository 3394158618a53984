//! Thread that polls the SDK: reads pose, velocity, grip and buttons, then sends the loop's command, a call that waits for the exchange.

use crate::dhd::{Dhd, Failed, Given, Setup};
use flotor_hal::{Conditions, Fault, Refusal};
use flotor_vendor_sdk::{CommandCursor, Exchange, Sample, without_signals};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Shortest cycle: the fastest device replies at 4 kHz, and calls that return at once must not cause a busy loop.
const SHORTEST: Duration = Duration::from_micros(250);
/// Interval of the check for disabled force, cycles.
const STATUS_EVERY: u64 = 16;

/// Running thread that owns the device.
pub(crate) struct Driver {
    thread: Option<JoinHandle<Dhd>>,
    exchange: Arc<Exchange>,
}

impl Driver {
    /// Energises the device and starts the thread. Not real-time.
    ///
    /// # Errors
    /// The cause, with the device; without the device, which is then closed, if the thread could not be created.
    pub(crate) fn start(
        dhd: Dhd,
        setup: &Setup,
        exchange: &Arc<Exchange>,
    ) -> Result<Self, (Option<Dhd>, Refusal)> {
        if let Err(failed) = dhd.energize(setup) {
            dhd.relax();
            return Err((Some(dhd), failed.refusal()));
        }
        let cursor = exchange.begin();
        let of_thread = Arc::clone(exchange);
        let thread = std::thread::Builder::new().name("force-dimension".to_owned());
        let started = without_signals(|| thread.spawn(move || follow(dhd, &of_thread, cursor)));
        match started {
            Ok(thread) => Ok(Self { thread: Some(thread), exchange: Arc::clone(exchange) }),
            Err(error) => {
                let reason = format!(
                    "cannot start a thread for the device: {error}; end other programs of this user, or raise \
                     the limit of its threads"
                );
                Err((None, Refusal::resource(reason)))
            }
        }
    }

    /// Ends the thread and returns the device with force disabled; `None` if the thread panicked. Not real-time.
    pub(crate) fn end(&mut self) -> Option<Dhd> {
        self.exchange.end();
        self.thread.take()?.join().ok()
    }
}

impl Drop for Driver {
    fn drop(&mut self) {
        drop(self.end());
    }
}

fn follow(dhd: Dhd, exchange: &Exchange, mut cursor: CommandCursor) -> Dhd {
    let mut given = Given::All;
    let mut cycle = 0_u64;
    while !exchange.is_over() {
        let began = Instant::now();
        match step(&dhd, exchange, &mut cursor, given, cycle) {
            Ok(now) => given = now,
            Err(fault) => {
                exchange.fail(fault);
                break;
            }
        }
        cycle += 1;
        if exchange.runs_free() {
            std::thread::sleep(SHORTEST.saturating_sub(began.elapsed()));
        }
    }
    dhd.relax();
    exchange.note_silence();
    dhd
}

/// Runs one cycle; returns whether the motors saturate.
fn step(
    dhd: &Dhd,
    exchange: &Exchange,
    cursor: &mut CommandCursor,
    given: Given,
    cycle: u64,
) -> Result<Given, Fault> {
    let sample = measure(dhd, given).map_err(|failed| failed.fault())?;
    exchange.publish(&sample);
    let command = exchange.next_command(cursor);
    let given = dhd.send(&command).map_err(|failed| failed.fault())?;
    exchange.note_sent(&command);
    if cycle % STATUS_EVERY == STATUS_EVERY - 1 {
        let force_off = dhd.force_off().map_err(|failed| failed.fault())?;
        force_off.map_or(Ok(()), Err)?;
    }
    Ok(given)
}

fn measure(dhd: &Dhd, given: Given) -> Result<Sample, Failed> {
    let conditions = match given {
        Given::All => Conditions::NONE,
        Given::Saturated => Conditions::SATURATED,
    };
    let (delivered, grip) = dhd.delivered()?;
    Ok(Sample { pose: dhd.pose()?, twist: dhd.twist()?, delivered, grip, buttons: dhd.buttons(), conditions })
}
