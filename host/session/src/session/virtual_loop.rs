//! The loop on the virtual clock, on a thread of its own: a call of a plugin that does not return is named, and left behind.

use super::prepare::activate;
use super::{Finished, Observer, RunError, Session, TapEnds, hung, publish_to};
use crate::calls::leave_behind;
use crate::long_call::{Exceeded, LongCall, step_limit};
use crate::platform::ThreadClock;
use flotor_core::MOST_DEVICES;
use flotor_hal::abi::loader::Stopper;
use flotor_servo::{Heartbeat, Loop, RealTimeReport, Schedule, StopSwitch, Stuck, drain, queue};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

/// Records of one batch: observers see them between two batches, so that a slow observer slows the run and loses nothing.
const BATCH: usize = 1024;
/// Interval between two looks at a batch that takes long.
const LOOK: Duration = Duration::from_millis(20);
/// The loop and its publishers, which go to its thread for a batch and come back.
struct Batch {
    runner: Loop,
    taps: TapEnds,
}

impl Session {
    /// Ticks without waiting.
    pub(super) fn run_virtual(
        self,
        observer: &mut dyn Observer,
        stop: &StopSwitch,
    ) -> Result<Finished, RunError> {
        let Session { standby, controls, mut changes, taps, period_ns, duration_ns, plugins, .. } = self;
        let (stoppers, heart) = (standby.stoppers(), standby.heart());
        let mut asked = standby.observers().request(observer.demand());
        // The last tick of a batch may leave a record for each device.
        let (mut sender, mut receiver) = queue(BATCH + usize::from(MOST_DEVICES));
        let loop_stop = stop.clone();
        let thread = LoopThread::start(move |Batch { runner, taps }| {
            let mut records = 0;
            while records < BATCH && runner.end().is_none() {
                runner.advance(&loop_stop, |record| {
                    publish_to(taps, record);
                    records += usize::from(sender.push(*record).is_ok());
                });
            }
        })?;
        let servo = activate(standby, &plugins)?;
        let mut batch =
            Batch { runner: Loop::new(servo, Schedule::start_virtual(period_ns), duration_ns), taps };
        while batch.runner.end().is_none() {
            asked.change_to(observer.demand());
            let ticked = thread.tick(batch, &heart, stop);
            if !matches!(&ticked, Ok(batch) if batch.runner.end().is_none()) {
                stoppers.iter().for_each(Stopper::safe_stop);
                heart.finish();
            }
            drain(&mut receiver, |record| {
                changes.up_to(record.tick, |change| observer.change(change));
                observer.observe(&record);
            });
            controls.sweep();
            batch = ticked.map_err(|lost| match lost {
                Lost::Stuck(stuck, limit) => hung(stuck, &plugins, limit),
                Lost::Thread => RunError::Thread("panicked"),
            })?;
        }
        Ok(Finished::of(batch.runner, 0, RealTimeReport::not_asked()))
    }
}

/// Why a batch does not come back.
enum Lost {
    Stuck(Stuck, Exceeded),
    Thread,
}

/// The thread of the loop, which ends when this is dropped.
struct LoopThread {
    batches: SyncSender<Batch>,
    done: Receiver<Batch>,
    clock: ThreadClock,
}

impl LoopThread {
    /// Starts the thread; `tick` runs a batch.
    fn start(mut tick: impl FnMut(&mut Batch) + Send + 'static) -> Result<Self, RunError> {
        let (batches, waiting) = sync_channel::<Batch>(0);
        let (sender, done) = sync_channel(1);
        let (clocks, clock) = sync_channel(1);
        let body = move || {
            let _ = clocks.send(ThreadClock::of_this_thread());
            let mut is_first = true;
            for mut batch in waiting {
                if std::mem::take(&mut is_first) {
                    batch.runner.servo().follow_here();
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
    fn tick(&self, batch: Batch, heart: &Heartbeat, stop: &StopSwitch) -> Result<Batch, Lost> {
        self.batches.send(batch).map_err(|_| Lost::Thread)?;
        let (mut call, limit) = (LongCall::new(heart.now()), step_limit());
        loop {
            match self.done.recv_timeout(LOOK) {
                Ok(batch) => return Ok(batch),
                Err(RecvTimeoutError::Disconnected) => return Err(Lost::Thread),
                Err(RecvTimeoutError::Timeout) => {
                    if let Some(exceeded) = call.look(heart.now(), &self.clock, limit, Some(stop)) {
                        leave_behind();
                        return Err(Lost::Stuck(*call.place(), exceeded));
                    }
                }
            }
        }
    }
}
