//! A run on the virtual clock that somebody else advances: for experiments, which decide between ticks what comes next.

use super::prepare::activate;
use super::{ChangeLog, Controls, Observer, RunError, RunOptions, Session};
use crate::registry::Registry;
use crate::scene::Scene;
use flotor_core::demand::DemandRequest;
use flotor_coupling::Line;
use flotor_hal::Demand;
use flotor_hal::abi::loader::Stopper;
use flotor_servo::{Clock, CouplingOutcome, Loop, RunEnd, Schedule, StopSwitch};

/// A run that goes on when it is told to. When it is dropped the devices are stopped.
pub struct Steps {
    runner: Loop,
    controls: Controls,
    changes: ChangeLog,
    asked: DemandRequest,
    stop: StopSwitch,
    stoppers: Vec<Stopper>,
    lines: Vec<(String, Line)>,
}

impl Steps {
    /// Loads, checks, opens and activates everything a scene names. Not real-time.
    ///
    /// # Errors
    /// [`RunError`]; nothing is energised before this has succeeded.
    pub fn prepare(scene: &Scene, registry: &Registry, seed: u64) -> Result<Self, RunError> {
        let session = Session::prepare(scene, registry, &RunOptions { clock: Clock::Virtual, seed })?;
        let Session { standby, controls, changes, period_ns, duration_ns, lines, plugins, .. } = session;
        let stoppers = standby.stoppers();
        let asked = standby.observers().request(Demand::FORCE);
        let runner = Loop::new(activate(standby, &plugins)?, Schedule::start_virtual(period_ns), duration_ns);
        Ok(Self { runner, controls, changes, asked, stop: StopSwitch::default(), stoppers, lines })
    }

    /// The handle by which parameters, weights and models of the run are changed.
    #[must_use]
    pub fn controls(&self) -> &Controls {
        &self.controls
    }

    /// As [`Session::take_lines`]: whoever advances two runs can be the way between them.
    #[must_use]
    pub fn take_lines(&mut self) -> Vec<(String, Line)> {
        std::mem::take(&mut self.lines)
    }

    /// What has become of each coupling so far, in the scene's order. Not real-time.
    #[must_use]
    pub fn couplings(&mut self) -> Vec<CouplingOutcome> {
        self.runner.servo().forces().coupling_outcomes()
    }

    /// One tick; the observer is told of it and of what changed before it. Not real-time: the observer is not.
    ///
    /// # Errors
    /// How the run ended, if it did; then there was no tick.
    pub fn advance(&mut self, observer: &mut dyn Observer) -> Result<(), RunEnd> {
        let Self { runner, changes, asked, stop, .. } = self;
        asked.change_to(observer.demand());
        runner.advance(stop, |record| {
            changes.up_to(record.tick, |change| observer.change(change));
            observer.observe(record);
        });
        self.runner.end().map_or(Ok(()), Err)
    }
}

impl Drop for Steps {
    fn drop(&mut self) {
        self.stoppers.iter().for_each(Stopper::safe_stop);
    }
}
