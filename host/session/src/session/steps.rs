//! A run on the virtual clock that somebody else advances: for experiments, which decide between ticks what comes next.

use super::virtual_loop::VirtualLoop;
use super::{Controls, Observer, RunError, RunOptions, Session};
use crate::registry::Registry;
use crate::scene::Scene;
use flotor_coupling::Line;
use flotor_servo::{Clock, CouplingOutcome, RunEnd, StopSwitch};

/// A run that goes on when it is told to. When it is dropped the devices are stopped.
pub struct Steps {
    ticks: VirtualLoop,
    controls: Controls,
    lines: Vec<(String, Line)>,
}

impl Steps {
    /// Loads, checks, opens and activates everything a scene names; `stop` ends the run. Not real-time.
    ///
    /// # Errors
    /// [`RunError`]; nothing is energised before this has succeeded.
    pub fn prepare(
        scene: &Scene,
        registry: &Registry,
        seed: u64,
        stop: &StopSwitch,
    ) -> Result<Self, RunError> {
        let mut session = Session::prepare(scene, registry, &RunOptions { clock: Clock::Virtual, seed })?;
        let (controls, lines) = (session.controls(), session.take_lines());
        Ok(Self { ticks: VirtualLoop::start(session, stop)?, controls, lines })
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
        self.ticks.couplings()
    }

    /// Ticks `ticks` times, or until the run ends; returns how it ended, if it did. The observer is told of each tick and of what changed
    /// before it. Not real-time: the observer is not.
    ///
    /// # Errors
    /// [`RunError::Hung`] if a call of a plugin does not return: there are no ticks any more.
    pub fn advance(&mut self, ticks: u64, observer: &mut dyn Observer) -> Result<Option<RunEnd>, RunError> {
        self.ticks.advance(ticks, observer)?;
        Ok(self.ticks.end())
    }
}

impl Drop for Steps {
    fn drop(&mut self) {
        self.ticks.stop_devices();
    }
}
