//! Two threads between the tick and the chip: the reader always has a read pending, so that the chip never waits with a packet;
//! the writer has one command in flight.
//!
//! The firmware replies to each command with one report. A pending command is replaced by the next one. The device has
//! no known watchdog: if no tick posts a command for [`COMMAND_LIFE`], the writer sets the motors to zero torque.

use crate::chip::{Chip, payload};
use crate::device_error::DeviceError;
use crate::protocol::{Command, Frames, Parsed, Report};
pub use flotor_force_switch::ForceSwitch;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::{JoinHandle, Thread};
use std::time::{Duration, Instant};

/// Watchdog timeout: after this time without a new command the motors are set to zero torque.
pub const COMMAND_LIFE: Duration = Duration::from_millis(100);
/// Report timeout, after which the next command is sent without waiting further.
const REPLY_TIMEOUT: Duration = Duration::from_millis(20);
/// Timeout of a report to the last command.
const LAST_REPORT: Duration = Duration::from_millis(200);
/// Timeout of a read, and poll interval for the end of the exchange.
const LOOK: Duration = Duration::from_millis(20);
/// Buffer size of one read, bytes.
const READ_BYTES: usize = 512;
/// Limit on malformed bytes since the last report, above which the line is at fault: four frames.
const MOST_NOISE: usize = 64;

/// Data exchanged between tick and threads.
#[derive(Debug, Default)]
struct Slots {
    /// Newest command, not sent yet.
    command: Option<Command>,
    /// Newest report, not read yet.
    report: Option<Report>,
    /// Commands without a report, and the start of the wait for it.
    unanswered: u32,
    silent_since: Option<Instant>,
}

#[derive(Default)]
struct Shared {
    /// Locked only to copy a few numbers; the tick never waits for the lock.
    slots: Mutex<Slots>,
    /// First fault.
    error: OnceLock<DeviceError>,
    /// `is_over` requests the end of the threads; `is_done`: the writer has sent its last command, and its report has
    /// arrived or timed out.
    is_over: AtomicBool,
    is_done: AtomicBool,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Slots> {
        self.slots.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn fail(&self, error: DeviceError) {
        // Only the first fault is stored.
        let _ = self.error.set(error);
    }

    fn error(&self) -> Option<DeviceError> {
        self.error.get().copied()
    }

    fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Acquire)
    }
}

/// Running report reader and command writer of a device.
pub struct Exchange {
    shared: Arc<Shared>,
    writer: Option<JoinHandle<()>>,
    reader: Option<JoinHandle<()>>,
}

impl Exchange {
    /// Starts the threads. No report to pending commands for `timeout` is a fault ([`DeviceError::Silent`]). Not
    /// real-time.
    ///
    /// # Errors
    /// If a thread cannot be created.
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

    /// Returns the newest report since the last call; `None` if no report has arrived, or a thread holds the lock.
    /// Real-time: bounded, no allocation, no wait.
    ///
    /// # Errors
    /// The first [`DeviceError`], and the same error in every later call.
    pub fn take(&self) -> Result<Option<Report>, DeviceError> {
        match self.shared.error() {
            Some(error) => Err(error),
            // Contention: a thread is storing data.
            None => Ok(self.shared.slots.try_lock().ok().and_then(|mut slots| slots.report.take())),
        }
    }

    /// Posts a command for the writer, replacing a pending one; returns false if the lock is contended. Real-time:
    /// bounded, no allocation, no wait.
    pub fn post(&self, command: Command) -> bool {
        let Ok(mut slots) = self.shared.slots.try_lock() else { return false };
        slots.command = Some(command);
        drop(slots);
        if let Some(writer) = &self.writer {
            writer.thread().unpark();
        }
        true
    }

    /// Sets the motors to zero torque and ends the threads; returns the first fault. Not real-time.
    pub fn end(&mut self) -> Option<DeviceError> {
        self.shared.is_over.store(true, Ordering::Release);
        if let Some(writer) = self.writer.take() {
            writer.thread().unpark();
            let _ = writer.join();
        }
        if let Some(reader) = self.reader.take() {
            let _ = reader.join();
        }
        self.shared.error()
    }
}

impl Drop for Exchange {
    fn drop(&mut self) {
        self.end();
    }
}

/// Reads reports until the exchange ends or a fault occurs.
fn read(chip: &dyn Chip, shared: &Shared, writer: &Thread) {
    let (mut frames, mut packets, mut noise) = (Frames::default(), [0; READ_BYTES], 0);
    while !shared.is_done.load(Ordering::Acquire) && shared.error().is_none() {
        let received = chip.read(&mut packets, LOOK).map_err(DeviceError::from).and_then(|length| {
            let read = packets.get(..length).unwrap_or_default();
            let mut error = None;
            payload(read, |byte| match frames.push(byte) {
                Parsed::Frame(bytes) => {
                    noise = 0;
                    let mut slots = shared.lock();
                    match slots.unanswered.checked_sub(1) {
                        Some(unanswered) => slots.unanswered = unanswered,
                        None => error = Some(DeviceError::StaleReport),
                    }
                    slots.silent_since = None;
                    slots.report = Some(Report::read(&bytes));
                    drop(slots);
                    writer.unpark();
                }
                Parsed::Noise => noise += 1,
                Parsed::Part => {}
            })?;
            match error {
                Some(error) => Err(error),
                None if noise > MOST_NOISE => Err(DeviceError::Noise),
                None => Ok(()),
            }
        });
        if let Err(error) = received {
            shared.fail(error);
            writer.unpark();
        }
    }
}

/// Sends commands until the exchange ends or a fault occurs; then sends zero torque and waits for the outstanding
/// report, which the next session would otherwise receive as a stale report.
fn write(chip: &dyn Chip, shared: &Shared, switch: &ForceSwitch, timeout: Duration) {
    send_commands(chip, shared, switch, timeout);
    shared.lock().unanswered += 1;
    // Fails if the device is gone.
    let is_gone = chip.write(&Command::REST.bytes()).is_err();
    let since = Instant::now();
    let is_awaited = || shared.error().is_none() && shared.lock().unanswered > 0;
    while !is_gone && is_awaited() && since.elapsed() < LAST_REPORT {
        std::thread::park_timeout(LOOK);
    }
    shared.is_done.store(true, Ordering::Release);
}

fn send_commands(chip: &dyn Chip, shared: &Shared, switch: &ForceSwitch, timeout: Duration) {
    let (mut last, mut left, mut sent) = (Command::REST, Instant::now(), None::<Instant>);
    loop {
        let mut slots = shared.lock();
        if shared.is_over() || shared.error().is_some() {
            return;
        }
        if slots.silent_since.is_some_and(|since| since.elapsed() > timeout) {
            drop(slots);
            shared.fail(DeviceError::Silent);
            return;
        }
        let since = sent.map_or(REPLY_TIMEOUT, |sent| sent.elapsed());
        if slots.unanswered > 0 && since < REPLY_TIMEOUT {
            drop(slots);
            std::thread::park_timeout(REPLY_TIMEOUT - since);
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
            shared.fail(DeviceError::Gone);
        }
    }
}
