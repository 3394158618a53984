//! Loop on the virtual clock, in a separate thread: if a plugin call does not return, the call is reported and the thread abandoned.

use super::controls::ChangeLog;
use super::observer::Taps;
use super::outcome::Finished;
use super::plugin_report::PluginNames;
use super::prepared_loop::{PreparedLoop, activate};
use super::{Controls, Observer, RunError};
use crate::calls::abandon;
use crate::long_call::{Exceeded, LongCall, step_limit};
use crate::platform::ThreadClock;
use flotor_core::MAX_DEVICES;
use flotor_core::demand::DemandRequest;
use flotor_core::trace::TickRecord;
use flotor_hal::Demand;
use flotor_loader::Stopper;
use flotor_servo::{
    Consumer, CouplingOutcome, Heartbeat, Loop, RealTimeReport, RunEnd, Schedule, StopSwitch, Stuck, drain,
    queue,
};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

/// Number of records in a batch. Observers are called between two batches, so that a slow observer delays the run and loses no record.
const BATCH: usize = 1024;
/// Poll interval while a batch runs.
const LOOK: Duration = Duration::from_millis(20);

/// Loop with its publishers, passed to the loop's thread for a batch and returned afterwards.
struct Batch {
    runner: Loop,
    taps: Taps,
    /// Ticks still to run; the batch ends earlier if its record buffer is full.
    ticks: u64,
}

/// Runs the loop to its end, as fast as possible.
pub(super) fn run(
    prepared: PreparedLoop,
    changes: ChangeLog,
    controls: &Controls,
    observer: &mut dyn Observer,
    stop: &StopSwitch,
) -> Result<Finished, RunError> {
    let mut ticks = VirtualLoop::start(prepared, changes, stop)?;
    while ticks.end().is_none() {
        ticks.batch(u64::MAX, observer)?;
        controls.sweep();
    }
    ticks.finish()
}

/// Loop of a run on the virtual clock, with energised devices.
pub(super) struct VirtualLoop {
    thread: LoopThread,
    /// `None` once a call has not returned.
    batch: Option<Batch>,
    records: Consumer<TickRecord>,
    changes: ChangeLog,
    requested: DemandRequest,
    stop: StopSwitch,
    stoppers: Vec<Stopper>,
    heartbeat: Heartbeat,
    names: PluginNames,
}

impl VirtualLoop {
    /// Energises the devices; `stop` ends the run. Not real-time.
    ///
    /// # Errors
    /// [`RunError`]; then no device is energised.
    pub(super) fn start(
        prepared: PreparedLoop,
        changes: ChangeLog,
        stop: &StopSwitch,
    ) -> Result<Self, RunError> {
        let PreparedLoop { standby, plugins, taps, period_ns, duration_ns } = prepared;
        let names = PluginNames::of(&plugins);
        let (stoppers, heartbeat) = (standby.stoppers(), standby.heartbeat());
        let requested = standby.observers().request(Demand::FORCE);
        // The last tick of a batch may add a record for each device.
        let (mut sender, records) = queue(BATCH + usize::from(MAX_DEVICES));
        let loop_stop = stop.clone();
        let thread = LoopThread::start(move |Batch { runner, taps, ticks }| {
            let mut records = 0;
            while records < BATCH && *ticks > 0 && runner.end().is_none() {
                runner.advance(&loop_stop, |record| {
                    taps.publish(record);
                    records += usize::from(sender.push(*record).is_ok());
                });
                *ticks -= 1;
            }
        })?;
        let servo = activate(standby, &plugins)?;
        let runner = Loop::new(servo, Schedule::start_virtual(period_ns), duration_ns);
        let batch = Some(Batch { runner, taps, ticks: 0 });
        let stop = stop.clone();
        Ok(Self { thread, batch, records, changes, requested, stop, stoppers, heartbeat, names })
    }

    /// Returns the end of the run; `None` while the run continues.
    pub(super) fn end(&self) -> Option<RunEnd> {
        self.batch.as_ref().and_then(|batch| batch.runner.end())
    }

    /// Runs `ticks` ticks, or until the batch is full or the run ends; returns the number of remaining ticks. Passes the changes
    /// before each tick and the tick's records to the observer. Not real-time.
    ///
    /// # Errors
    /// [`RunError::Hung`] if a call does not return; the devices are stopped, and later calls fail.
    pub(super) fn batch(&mut self, ticks: u64, observer: &mut dyn Observer) -> Result<u64, RunError> {
        let batch = self.batch.take().ok_or(RunError::Thread("did not return its state"))?;
        self.requested.change_to(observer.demand());
        let ticked = self.thread.tick(Batch { ticks, ..batch }, &self.heartbeat, &self.stop);
        if !matches!(&ticked, Ok(batch) if batch.runner.end().is_none()) {
            self.stop_devices();
            self.heartbeat.finish();
        }
        let changes = &mut self.changes;
        drain(&mut self.records, |record| changes.deliver(&record, observer));
        let batch = ticked.map_err(|lost| match lost {
            Lost::Stuck(stuck, limit) => RunError::hung(stuck, &self.names, limit),
            Lost::Thread => RunError::Thread("panicked"),
        })?;
        Ok(self.batch.insert(batch).ticks)
    }

    /// Returns the statistics of each coupling so far, in the scene's order. Not real-time.
    pub(super) fn couplings(&mut self) -> Vec<CouplingOutcome> {
        self.batch.as_mut().map_or_else(Vec::new, |batch| batch.runner.servo().forces().coupling_outcomes())
    }

    /// Stops the devices. Not real-time.
    pub(super) fn stop_devices(&self) {
        self.stoppers.iter().for_each(Stopper::safe_stop);
    }

    /// Returns the ended loop. Not real-time.
    fn finish(mut self) -> Result<Finished, RunError> {
        let batch = self.batch.take().ok_or(RunError::Thread("did not return its state"))?;
        Ok(Finished::of(batch.runner, 0, RealTimeReport::not_requested()))
    }
}

/// Reason why a batch was not returned.
enum Lost {
    Stuck(Stuck, Exceeded),
    Thread,
}

/// Thread of the loop; it ends when this handle is dropped.
struct LoopThread {
    batches: SyncSender<Batch>,
    done: Receiver<Batch>,
    clock: ThreadClock,
}

impl LoopThread {
    /// Starts the thread, which calls `tick` for each batch.
    fn start(mut tick: impl FnMut(&mut Batch) + Send + 'static) -> Result<Self, RunError> {
        let (batches, waiting) = sync_channel::<Batch>(0);
        let (sender, done) = sync_channel(1);
        let (clocks, clock) = sync_channel(1);
        let body = move || {
            // The first wait of a thread allocates, which would otherwise happen between two ticks.
            let _ = waiting.recv_timeout(Duration::ZERO);
            let _ = clocks.send(ThreadClock::of_this_thread());
            let mut is_first = true;
            for mut batch in waiting {
                if std::mem::take(&mut is_first) {
                    batch.runner.servo().register_loop_thread();
                }
                tick(&mut batch);
                let _ = sender.send(batch);
            }
        };
        let thread = std::thread::Builder::new().name("flotor-servo".to_owned());
        thread.spawn(body).map_err(|_| RunError::NoThread("the loop"))?;
        let clock = clock.recv().map_err(|_| RunError::NoThread("the loop"))?;
        Ok(Self { batches, done, clock })
    }

    /// Runs a batch on the thread.
    fn tick(&self, batch: Batch, heartbeat: &Heartbeat, stop: &StopSwitch) -> Result<Batch, Lost> {
        self.batches.send(batch).map_err(|_| Lost::Thread)?;
        let (mut call, limit) = (LongCall::new(heartbeat.now()), step_limit());
        loop {
            match self.done.recv_timeout(LOOK) {
                Ok(batch) => return Ok(batch),
                Err(RecvTimeoutError::Disconnected) => return Err(Lost::Thread),
                Err(RecvTimeoutError::Timeout) => {
                    if let Some(exceeded) = call.check(heartbeat.now(), &self.clock, limit, Some(stop)) {
                        abandon();
                        return Err(Lost::Stuck(*call.place(), exceeded));
                    }
                }
            }
        }
    }
}
