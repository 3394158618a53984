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
use flotor_servo::{Loop, RealTimeReport, RunEnd, SavedLoop, Schedule, StopSwitch, Unsaved};
use std::sync::Arc;

/// Saved state of a run: devices, models and loop. Fits the run that has saved it.
pub struct SavedRun {
    of: Arc<()>,
    state: SavedLoop,
}

/// Run that the caller advances tick by tick. Dropping it stops the devices.
pub struct Lockstep {
    /// Identity of the run.
    id: Arc<()>,
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
        let id = Arc::new(());
        Ok(Lockstep { id, runner, controls, changes, taps, requested, stoppers, epilogue })
    }
}

impl Lockstep {
    /// Runs one tick; passes the changes before the tick, and the tick's records, to the observer. Returns the end of the run once it
    /// has ended, `None` before. Not real-time: calls the observer.
    pub fn advance(&mut self, observer: &mut dyn Observer, stop: &StopSwitch) -> Option<RunEnd> {
        self.advance_by(1, observer, stop)
    }

    /// Runs `ticks` ticks as [`Self::advance`] does, or until the run ends.
    pub fn advance_by(
        &mut self,
        ticks: u64,
        observer: &mut dyn Observer,
        stop: &StopSwitch,
    ) -> Option<RunEnd> {
        let Self { runner, controls, changes, taps, requested, .. } = self;
        requested.change_to(observer.demand());
        for _ in 0..ticks {
            if runner.end().is_some() {
                break;
            }
            runner.advance(stop, |record| {
                taps.publish(record);
                changes.deliver(record, observer);
            });
        }
        controls.sweep();
        runner.end()
    }

    /// Returns the end of the run once it has ended, `None` before.
    #[must_use]
    pub fn end(&self) -> Option<RunEnd> {
        self.runner.end()
    }

    /// Saves the state of the run before its next tick. Not real-time.
    ///
    /// # Errors
    /// [`RunError::Unsaved`], for example if a plugin does not offer `flotor.snapshot/1`.
    pub fn save(&mut self) -> Result<SavedRun, RunError> {
        let state = self.runner.save().map_err(|unsaved| self.unsaved(unsaved))?;
        Ok(SavedRun { of: self.id.clone(), state })
    }

    /// Restores a state that this run has saved: the run continues from there with the same bits, if the same changes follow. Changes
    /// that were sent and not applied are dropped. Also restores a run whose duration is over. Not real-time.
    ///
    /// # Errors
    /// [`RunError::Unsaved`]; unless the text says that the run has ended or that the state is of another run, the run should be dropped.
    pub fn restore(&mut self, saved: &SavedRun) -> Result<(), RunError> {
        if !Arc::ptr_eq(&saved.of, &self.id) {
            return Err(self.unsaved(Unsaved::OtherLoop));
        }
        self.runner.restore(&saved.state).map_err(|unsaved| self.unsaved(unsaved))
    }

    fn unsaved(&self, unsaved: Unsaved) -> RunError {
        let name = |plugin| self.epilogue.names.name(plugin);
        RunError::Unsaved(match unsaved {
            Unsaved::RealClock => "it is on the real clock; save a run on the virtual clock".to_owned(),
            Unsaved::Ended => "it has ended; start it again".to_owned(),
            Unsaved::Plugin(plugin) => format!(
                "`{}` has a state and does not offer `flotor.snapshot/1`, has failed, or does not run in the loop",
                name(plugin)
            ),
            Unsaved::Fading(plugin) => {
                format!("a replacement of `{}` is fading in; run on until it has", name(plugin))
            }
            Unsaved::Replaced(plugin) => {
                format!("`{}` was replaced after the state was saved; save it again", name(plugin))
            }
            Unsaved::Remote => "a coupling has its other end on another host".to_owned(),
            Unsaved::OtherLoop => "another run has saved it; restore it there".to_owned(),
        })
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
