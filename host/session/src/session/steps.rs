//! Run on the virtual clock that the caller advances by any number of ticks, for experiments.

use super::virtual_loop::VirtualLoop;
use super::{Controls, Observer, RunError, RunOptions, Session};
use crate::registry::Registry;
use crate::scene::Scene;
use flotor_coupling::Line;
use flotor_servo::{Clock, CouplingOutcome, RunEnd, StopSwitch};

/// Run that the caller advances by any number of ticks. Dropping it stops the devices.
pub struct Steps {
    ticks: VirtualLoop,
    controls: Controls,
    lines: Vec<(String, Line)>,
}

impl Steps {
    /// Prepares a session on the virtual clock, and energises its devices; `stop` ends the run. Not real-time.
    ///
    /// # Errors
    /// [`RunError`]; then no device is energised.
    pub fn prepare(
        scene: &Scene,
        registry: &Registry,
        seed: u64,
        stop: &StopSwitch,
    ) -> Result<Self, RunError> {
        let mut session = Session::prepare(scene, registry, &RunOptions { clock: Clock::Virtual, seed })?;
        let lines = session.take_lines();
        let Session { prepared, changes, controls, .. } = session;
        Ok(Self { ticks: VirtualLoop::start(prepared, changes, stop)?, controls, lines })
    }

    /// Returns the handle with which the caller changes parameters, weights and models of the run.
    #[must_use]
    pub fn controls(&self) -> &Controls {
        &self.controls
    }

    /// Removes and returns the lines of couplings with a remote end, as [`Session::take_lines`] does: a caller that advances two runs
    /// can connect their lines.
    #[must_use]
    pub fn take_lines(&mut self) -> Vec<(String, Line)> {
        std::mem::take(&mut self.lines)
    }

    /// Returns the statistics of each coupling so far, in the scene's order. Not real-time.
    #[must_use]
    pub fn couplings(&mut self) -> Vec<CouplingOutcome> {
        self.ticks.couplings()
    }

    /// Runs `ticks` ticks, or until the run ends; returns the end of the run once it has ended, `None` before. Passes the changes
    /// before each tick and the tick's records to the observer. Not real-time: calls the observer.
    ///
    /// # Errors
    /// [`RunError::Hung`] if a plugin call does not return; the devices are stopped, and later calls fail with
    /// [`RunError::Thread`].
    pub fn advance(&mut self, ticks: u64, observer: &mut dyn Observer) -> Result<Option<RunEnd>, RunError> {
        let mut left = ticks;
        while left > 0 && self.ticks.end().is_none() {
            left = self.ticks.batch(left, observer)?;
        }
        Ok(self.ticks.end())
    }
}

impl Drop for Steps {
    fn drop(&mut self) {
        self.ticks.stop_devices();
    }
}
