//! Saved state of a loop on the virtual clock: all numbers that later ticks depend on, to continue from there with the same bits.
//!
//! Devices and models save their own states (`flotor.snapshot/1`). The loop adds schedule, run state, envelopes, weights, couplings
//! and the live parameters of models and devices. Not saved: statistics of timing, and changes that were sent but not applied, which
//! a restore drops.

use crate::forces::SavedForces;
use crate::parameters::SavedChanges;
use crate::station::SavedStation;
use crate::{Port, RunState, Schedule};
use flotor_core::PluginIndex;

/// Saved state of a loop. Fits the loop that saved it, in this process.
pub struct SavedLoop {
    pub(crate) schedule: Schedule,
    pub(crate) servo: SavedServo,
}

/// Saved state of a servo.
pub(crate) struct SavedServo {
    pub(crate) stations: Box<[SavedStation]>,
    pub(crate) ports: Box<[Port]>,
    pub(crate) forces: SavedForces,
    pub(crate) changes: SavedChanges,
    pub(crate) run: RunState,
}

/// Reason why a loop cannot be saved, or not be restored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unsaved {
    /// The loop is on the real clock, where time cannot go back.
    RealClock,
    /// The run has ended other than by its duration.
    Ended,
    /// The device or model does not offer `flotor.snapshot/1`, has failed, or does not run in the loop.
    Plugin(PluginIndex),
    /// A replacement of the model fades in.
    Fading(PluginIndex),
    /// The model was replaced after the state was saved.
    Replaced(PluginIndex),
    /// The remote end of a coupling has a state of its own.
    Remote,
    /// The state was saved by a loop with other devices, models or couplings.
    OtherLoop,
}
