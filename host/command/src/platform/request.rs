//! Kinds of requests to end a run.

/// Request to end a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Request {
    /// Orderly end; if repeated, an emergency stop.
    End,
    /// Emergency stop.
    Emergency,
}
