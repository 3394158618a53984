//! Procedures that take seconds, in progress.

use flotor_maglev::ml_api::{GainSet, Pid};

/// Id of a procedure, for which a call waits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ProcedureId(pub(super) u64);

/// A procedure in progress.
#[derive(Clone, Debug)]
pub(super) enum Procedure {
    TakeOff { at_home_s: f64 },
    Land { faded_s: f64 },
    FindGravity(Search),
}

/// Reset of a gain set to its defaults, in progress.
#[derive(Clone, Debug)]
pub(super) struct GainReset {
    pub(super) procedure_id: ProcedureId,
    pub(super) set: GainSet,
    pub(super) from: [Pid; 6],
    pub(super) elapsed_s: f64,
}

/// A search for the wrench that holds the flotor.
#[derive(Clone, Debug, Default)]
pub(super) struct Search {
    pub(super) settled_s: f64,
    pub(super) sums: [f64; 6],
    pub(super) samples: u32,
    pub(super) rounds: u32,
}
