//! Two threads between the tick and the chip: one does nothing but read, so that a transfer waits on the bus whenever the
//! chip has something to say; the other keeps one command in flight.
//!
//! The firmware answers each command with one report. A command that was not sent yet is replaced by the next one. The
//! device has no watchdog that is known: if no tick leaves a command for [`COMMAND_LIFE`], the motors are set to rest.

use crate::chip::{Chip, payload};
use crate::protocol::{Command, Frames, Heard, Report};
use crate::trouble::Trouble;
pub use flotor_force_switch::ForceSwitch;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::{JoinHandle, Thread};
use std::time::{Duration, Instant};

/// How long a command counts without another one.
pub const COMMAND_LIFE: Duration = Duration::from_millis(100);
/// Time without a report after which the next command goes out all the same.
const FORGET: Duration = Duration::from_millis(20);
/// How long a device may take to answer the last command.
const LAST_REPORT: Duration = Duration::from_millis(200);
/// How long a read waits before the thread looks whether it is still wanted.
const LOOK: Duration = Duration::from_millis(20);
/// Room for packets of one read.
const READ_BYTES: usize = 512;
/// Bytes that belong to no report, since the last one, that are a fault: four frames.
const MOST_NOISE: usize = 64;

/// What tick and threads leave for each other.
#[derive(Debug, Default)]
struct Slots {
    /// The newest command that was not sent yet.
    command: Option<Command>,
    /// The newest report that was not read yet.
    report: Option<Report>,
    /// Commands without a report, and since when there is one.
    unanswered: u32,
    silent_since: Option<Instant>,
}

#[derive(Default)]
struct Shared {
    /// Each holds it to copy a few numbers, and the tick never waits for it.
    slots: Mutex<Slots>,
    /// What went wrong first.
    trouble: OnceLock<Trouble>,
    /// Nobody wants it any more, and then: the last command is answered.
    is_over: AtomicBool,
    is_done: AtomicBool,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Slots> {
        self.slots.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn fail(&self, trouble: Trouble) {
        // The first one counts.
        let _ = self.trouble.set(trouble);
    }

    fn trouble(&self) -> Option<Trouble> {
        self.trouble.get().copied()
    }

    fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Acquire)
    }
}

/// A device whose reports are read and whose commands are sent.
pub struct Exchange {
    shared: Arc<Shared>,
    writer: Option<JoinHandle<()>>,
    reader: Option<JoinHandle<()>>,
}

impl Exchange {
    /// Starts the threads. A device that is silent for `timeout` is a fault. Not real-time.
    ///
    /// # Errors
    /// If there is no thread.
    pub fn start(chip: &Arc<dyn Chip>, switch: &ForceSwitch, timeout: Duration) -> io::Result<Self> {
        let shared = Arc::new(Shared::default());
        let (theirs, chips, stop) = (Arc::clone(&shared), Arc::clone(chip), switch.clone());
        let thread = |name: &str| std::thread::Builder::new().name(name.to_owned());
        let writer = thread("flotor-falcon-out").spawn(move || write(&*chips, &theirs, &stop, timeout))?;
        let waking = writer.thread().clone();
        switch.wakes(waking.clone());
        let mut exchange = Self { shared, writer: Some(writer), reader: None };
        let (theirs, chips) = (Arc::clone(&exchange.shared), Arc::clone(chip));
        exchange.reader = Some(thread("flotor-falcon-in").spawn(move || read(&*chips, &theirs, &waking))?);
        Ok(exchange)
    }

    /// The newest report since the last call. Real-time: bounded, no allocation, waits for nothing.
    ///
    /// # Errors
    /// A [`Trouble`], from then on in each call.
    pub fn take(&self) -> Result<Option<Report>, Trouble> {
        match self.shared.trouble() {
            Some(trouble) => Err(trouble),
            // Where it is locked a thread is leaving something.
            None => Ok(self.shared.slots.try_lock().ok().and_then(|mut slots| slots.report.take())),
        }
    }

    /// Leaves a command for the thread; whether it could. Real-time: bounded, no allocation, waits for nothing.
    pub fn leave(&self, command: Command) -> bool {
        let Ok(mut slots) = self.shared.slots.try_lock() else { return false };
        slots.command = Some(command);
        drop(slots);
        if let Some(writer) = &self.writer {
            writer.thread().unpark();
        }
        true
    }

    /// Sets the motors to rest and ends the threads; what went wrong, if anything did. Not real-time.
    pub fn end(&mut self) -> Option<Trouble> {
        self.shared.is_over.store(true, Ordering::Release);
        if let Some(writer) = self.writer.take() {
            writer.thread().unpark();
            let _ = writer.join();
        }
        if let Some(reader) = self.reader.take() {
            let _ = reader.join();
        }
        self.shared.trouble()
    }
}

impl Drop for Exchange {
    fn drop(&mut self) {
        self.end();
    }
}

/// Reads until the exchange is over, or something is wrong.
fn read(chip: &dyn Chip, shared: &Shared, writer: &Thread) {
    let (mut frames, mut packets, mut noise) = (Frames::default(), [0; READ_BYTES], 0);
    while !shared.is_done.load(Ordering::Acquire) && shared.trouble().is_none() {
        let heard = chip.read(&mut packets, LOOK).map_err(Trouble::from).and_then(|length| {
            let read = packets.get(..length).unwrap_or_default();
            let mut trouble = None;
            payload(read, |byte| match frames.push(byte) {
                Heard::Frame(bytes) => {
                    noise = 0;
                    let mut slots = shared.lock();
                    match slots.unanswered.checked_sub(1) {
                        Some(unanswered) => slots.unanswered = unanswered,
                        None => trouble = Some(Trouble::StaleReport),
                    }
                    slots.silent_since = None;
                    slots.report = Some(Report::read(&bytes));
                    drop(slots);
                    writer.unpark();
                }
                Heard::Noise => noise += 1,
                Heard::Part => {}
            })?;
            match trouble {
                Some(trouble) => Err(trouble),
                None if noise > MOST_NOISE => Err(Trouble::Noise),
                None => Ok(()),
            }
        });
        if let Err(trouble) = heard {
            shared.fail(trouble);
            writer.unpark();
        }
    }
}

/// Sends commands until the exchange is over, or something is wrong; then rest, and waits for its report, which would be a
/// stale one for whoever comes next.
fn write(chip: &dyn Chip, shared: &Shared, switch: &ForceSwitch, timeout: Duration) {
    send_commands(chip, shared, switch, timeout);
    shared.lock().unanswered += 1;
    // If it still listens.
    let is_gone = chip.write(&Command::REST.bytes()).is_err();
    let since = Instant::now();
    let is_awaited = || shared.trouble().is_none() && shared.lock().unanswered > 0;
    while !is_gone && is_awaited() && since.elapsed() < LAST_REPORT {
        std::thread::park_timeout(LOOK);
    }
    shared.is_done.store(true, Ordering::Release);
}

fn send_commands(chip: &dyn Chip, shared: &Shared, switch: &ForceSwitch, timeout: Duration) {
    let (mut last, mut left, mut sent) = (Command::REST, Instant::now(), None::<Instant>);
    loop {
        let mut slots = shared.lock();
        if shared.is_over() || shared.trouble().is_some() {
            return;
        }
        if slots.silent_since.is_some_and(|since| since.elapsed() > timeout) {
            drop(slots);
            shared.fail(Trouble::Silent);
            return;
        }
        let since = sent.map_or(FORGET, |sent| sent.elapsed());
        if slots.unanswered > 0 && since < FORGET {
            drop(slots);
            std::thread::park_timeout(FORGET - since);
            continue;
        }
        let has_force = last.motors != [0; 3];
        let is_stopped = switch.is_stopped();
        let next = match slots.command.take() {
            Some(command) => {
                left = Instant::now();
                Some(if is_stopped { Command { motors: [0; 3], ..command } } else { command })
            }
            None if has_force && (is_stopped || left.elapsed() > COMMAND_LIFE) => {
                Some(Command { motors: [0; 3], ..last })
            }
            None => None,
        };
        let Some(command) = next else {
            drop(slots);
            std::thread::park_timeout(LOOK);
            continue;
        };
        let now = Instant::now();
        slots.unanswered += 1;
        slots.silent_since.get_or_insert(now);
        drop(slots);
        (last, sent) = (command, Some(now));
        if chip.write(&command.bytes()).is_err() {
            shared.fail(Trouble::Gone);
        }
    }
}
