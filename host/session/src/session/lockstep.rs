//! Run on the virtual clock that the caller advances tick by tick, with the outcome of a whole run.

use super::controls::ChangeLog;
use super::observer::Taps;
use super::outcome::{Epilogue, Finished};
use super::prepared_loop::{PreparedLoop, activate};
use super::{Controls, Observer, Outcome, RunError, Session};
use crate::calls::EndReserve;
use flotor_core::demand::DemandRequest;
use flotor_hal::Demand;
use flotor_loader::Stopper;
use flotor_servo::{Loop, RealTimeReport, RunEnd, Schedule, StopSwitch};

/// Run that the caller advances tick by tick. Dropping it stops the devices.
pub struct Lockstep {
    runner: Loop,
    controls: Controls,
    changes: ChangeLog,
    taps: Taps,
    requested: DemandRequest,
    stoppers: Stoppers,
    epilogue: Epilogue,
}

/// Stoppers that stop their devices when dropped.
struct Stoppers(Vec<Stopper>);

impl Drop for Stoppers {
    fn drop(&mut self) {
        self.0.iter().for_each(Stopper::safe_stop);
    }
}

impl Session {
    /// Energises the devices and returns a run with one tick for each call of [`Lockstep::advance`]. The run is on the virtual clock,
    /// even if the session was prepared for the real clock: without waiting, and repeatable. Not real-time.
    ///
    /// # Errors
    /// [`RunError`] if a device refuses to be energised; then no device is energised.
    pub fn into_lockstep(self) -> Result<Lockstep, RunError> {
        let epilogue = self.epilogue(EndReserve::default());
        let Session { prepared, controls, changes, .. } = self;
        let PreparedLoop { standby, plugins, taps, period_ns, duration_ns } = prepared;
        let stoppers = Stoppers(standby.stoppers());
        let requested = standby.observers().request(Demand::FORCE);
        let runner = Loop::new(activate(standby, &plugins)?, Schedule::start_virtual(period_ns), duration_ns);
        Ok(Lockstep { runner, controls, changes, taps, requested, stoppers, epilogue })
    }
}

impl Lockstep {
    /// Runs one tick; passes the changes before the tick, and the tick's records, to the observer. Returns the end of the run once it
    /// has ended, `None` before. Not real-time: calls the observer.
    pub fn advance(&mut self, observer: &mut dyn Observer, stop: &StopSwitch) -> Option<RunEnd> {
        let Self { runner, controls, changes, taps, requested, .. } = self;
        if runner.end().is_some() {
            return runner.end();
        }
        requested.change_to(observer.demand());
        runner.advance(stop, |record| {
            taps.publish(record);
            changes.deliver(record, observer);
        });
        controls.sweep();
        runner.end()
    }

    /// Stops the devices and returns the outcome of the run. Not real-time.
    #[must_use]
    pub fn finish(self) -> Outcome {
        let Self { mut runner, stoppers, epilogue, .. } = self;
        drop(stoppers);
        runner.servo().heartbeat().finish();
        epilogue.conclude(Finished::of(runner, 0, RealTimeReport::not_requested()))
    }
}
