//! Result of a model's step.

use flotor_contact::Shortcoming;
use flotor_hal::abi::CallStatus;

/// Result of a model's step, independent of its kind of execution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stepped {
    /// The model has returned an output, which is not validated yet.
    Answered,
    /// The contacts of an asynchronous model have an output with a shortcoming.
    Short(Shortcoming),
    /// The newest contacts of an asynchronous model contradict themselves; the output is that of the contacts before.
    Refused,
    /// No output in time; it may arrive in a later tick.
    Late,
    /// The newest answer of an asynchronous model is too old.
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
