//! Scheduler of the SDK, shared by all devices of a process, and its callback, which runs once per tick of the
//! scheduler.
//!
//! The SDK has one current device per process, which a frame sets. Force is therefore enabled and disabled within a
//! frame, on the thread of the scheduler: no other device can intervene.

use crate::ffi::{Client, Scheduled, Stopped};
use crate::hd::{Failed, Force, Hd};
use flotor_hal::{Fault, Wrench};
use flotor_vendor_sdk::{CommandCursor, Exchange, without_signals};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Clients in the scheduler of this process, which runs while there are any.
static CLIENTS: Mutex<Clients> = Mutex::new(Clients { running: 0, retired: Vec::new() });

struct Clients {
    running: usize,
    /// Clients unscheduled while the scheduler ran on for others; freed when it ends.
    retired: Vec<Scheduled<DeviceClient>>,
}

fn clients() -> MutexGuard<'static, Clients> {
    CLIENTS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Callback data of one device.
struct DeviceClient {
    hd: Arc<Hd>,
    exchange: Arc<Exchange>,
    cursor: CommandCursor,
    force: Force,
}

impl Client for DeviceClient {
    /// Runs a frame with a sample and a wrench.
    fn step(&mut self) -> bool {
        match self.frame() {
            Ok(()) if self.exchange.is_over() => self.give_up(),
            Ok(()) => true,
            Err(fault) => {
                self.exchange.fail(fault);
                self.give_up()
            }
        }
    }

    fn break_off(&mut self) -> bool {
        self.exchange.fail(Fault::Broken);
        self.give_up()
    }
}

impl DeviceClient {
    fn frame(&mut self) -> Result<(), Fault> {
        let sample = self.hd.begin()?;
        if self.force == Force::Off {
            self.hd.switch_here(Force::On);
            self.force = Force::On;
        }
        self.exchange.publish(&sample);
        let command = self.exchange.next_command(&mut self.cursor);
        self.hd.finish(&command.wrench)?;
        self.exchange.note_sent(&command);
        Ok(())
    }

    /// Disables the force; returns false to end the calls.
    fn give_up(&mut self) -> bool {
        // Errors of the SDK no longer matter here; an open frame is ended.
        let _ = self.hd.finish(&Wrench::ZERO);
        let _ = self.hd.begin();
        self.hd.switch_here(Force::Off);
        let _ = self.hd.finish(&Wrench::ZERO);
        self.exchange.note_silence();
        false
    }
}

/// Running registration of a device with the scheduler, until dropped.
pub(crate) struct Driver {
    hd: Arc<Hd>,
    exchange: Arc<Exchange>,
    scheduled: Option<Scheduled<DeviceClient>>,
}

impl Driver {
    /// Schedules the device, which is energised at zero in the first frame. Not real-time.
    pub(crate) fn start(hd: &Arc<Hd>, exchange: &Arc<Exchange>) -> Result<Self, Failed> {
        let (hd, exchange) = (Arc::clone(hd), Arc::clone(exchange));
        let cursor = exchange.begin();
        let client =
            DeviceClient { hd: Arc::clone(&hd), exchange: Arc::clone(&exchange), cursor, force: Force::Off };
        let mut clients = clients();
        let scheduled = hd.functions.schedule(Box::new(client));
        if !scheduled.is_in() {
            // A rejected client is never called; it is freed with the others.
            clients.retired.push(scheduled);
            return Err(hd.failure("scheduling"));
        }
        if clients.running == 0 {
            without_signals(|| hd.functions.start_scheduler());
        }
        clients.running += 1;
        drop(clients);
        let driver = Self { hd, exchange, scheduled: Some(scheduled) };
        driver.hd.check("starting the scheduler").map(|()| driver)
    }
}

impl Drop for Driver {
    /// Sends zero force, then unschedules the device; ends the scheduler with its last client. Not real-time.
    fn drop(&mut self) {
        let Some(scheduled) = self.scheduled.take() else { return };
        let functions = &self.hd.functions;
        self.exchange.end();
        self.exchange.stop();
        let mut clients = clients();
        functions.unschedule(&scheduled);
        clients.running = clients.running.saturating_sub(1);
        clients.retired.push(scheduled);
        if clients.running == 0 {
            let stopped: Stopped = functions.stop_scheduler();
            clients.retired.drain(..).for_each(|retired| retired.free(&stopped));
        }
        drop(clients);
        // An error of unscheduling is expected: a client whose last call has returned is no longer scheduled.
        let _ = self.hd.check("the end");
        self.exchange.note_silence();
    }
}
