//! Result of a step.

use flotor_hal::abi::CallStatus;

/// Result of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stepped {
    /// Answered; the output is not validated yet.
    Answered,
    /// No answer in time; one may come in a later tick.
    Late,
    /// No answer for longer than the last one stays valid.
    Silent,
    /// The model panicked or violated the contract.
    Broken,
    /// The worker process has ended.
    Gone,
}

impl From<CallStatus> for Stepped {
    #[inline]
    fn from(status: CallStatus) -> Self {
        if status == CallStatus::Ok { Self::Answered } else { Self::Broken }
    }
}
