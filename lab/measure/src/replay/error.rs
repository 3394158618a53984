//! Failure of a replay, of a saved state and of a change that does not fit.

use super::snapshot::SnapshotError;
use flotor_record::ReadError;
use flotor_session::RunError;

/// Failure of a replay.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReplayError {
    /// The recording cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A model cannot be created.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The coupling's messages from another host are not in the recording.
    #[error(
        "the coupling `{0}` has its other end on another host, whose messages are not in the recording: \
         only runs whose couplings have both ends on one host can be replayed"
    )]
    RemoteCoupling(String),
    /// The forces of a model came from a program, which is not in the recording.
    #[error(
        "the forces of `{model}` came from an external program, which a replay cannot repeat; replace \
         `{model}` with a force model to evaluate that force model on the recorded motion, for example \
         `--model {model}=spring`"
    )]
    Program {
        /// Name of the model in the scene.
        model: String,
    },
    /// The state of a model cannot be saved.
    #[error(
        "the state of `{model}` cannot be saved: it has a history and does not offer `flotor.snapshot/1`, or it runs \
         asynchronously; replay from the first tick"
    )]
    Unsaved {
        /// Name of the model in the scene.
        model: String,
    },
    /// The run has a history outside its models.
    #[error(
        "{what} at tick {tick}, which no saved state contains; replay from the first tick, or save another tick"
    )]
    Entangled {
        /// The history.
        what: &'static str,
        /// Tick of the state.
        tick: u64,
    },
    /// A saved state is of another instance.
    #[error(transparent)]
    Snapshot(#[from] SnapshotError),
    /// A saved state is of other models.
    #[error("the saved state is of a run with other models; use a state of this recording")]
    OtherInstances,
    /// The recording has no such tick.
    #[error("the recording has no tick {tick}; it ends before")]
    NoSuchTick {
        /// Tick of the state.
        tick: u64,
    },
    /// The requested change does not fit the recording.
    #[error("{0}")]
    Change(String),
}
