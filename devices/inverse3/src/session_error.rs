//! Faults between the plugin and the service.

use crate::json::Malformed;
use flotor_hal::Fault;

/// Remedy for messages outside the documented interface.
const UPDATE: &str = "update the service to 3.5 or newer";

/// Fault of a session. After a fault, [`Session::end`](crate::session::Session::end) ends the session, and the service removes the
/// force of the session.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SessionError {
    /// The service closed the connection, or is gone.
    #[error("the service closed the connection; restart the service")]
    Gone,
    /// Timeout without a state.
    #[error("the service does not reply; restart the service")]
    Silent,
    /// Timeout with an incomplete state.
    #[error("the service sent an incomplete state; restart the service")]
    Unfinished,
    /// A message above the limit of the plugin; its length, bytes.
    #[error("the service sent a message of {0} bytes, more than this plugin accepts; {UPDATE}")]
    TooLong(u64),
    /// A malformed, fragmented or masked WebSocket frame.
    #[error("the service sent a malformed WebSocket frame; {UPDATE}")]
    NoFrame,
    /// A state is not JSON, or a field has another kind of value.
    #[error("the service sent a malformed device state; {UPDATE}")]
    NoState,
    /// A field of the state is missing.
    #[error("the device state has no valid `{0}`; {UPDATE}")]
    Missing(&'static str),
    /// A field of the state is infinite.
    #[error("`{0}` of the device state is not a finite number; {UPDATE}")]
    Infinite(&'static str),
    /// The device or its grip is no longer connected to the service.
    #[error("the device or its grip is no longer connected to the service; connect both, and switch both on")]
    Unplugged,
    /// The service reports that the device or its grip is not ready: no power, or not calibrated.
    #[error(
        "the device or its grip has no power, or is not calibrated; switch both on, and wait for the calibration, up to 25 s"
    )]
    NotReady,
    /// The device exerts a force that this session did not command: another program also commands it.
    #[error("another program also commands a force on this device; end that program first")]
    ForeignForce,
}

impl SessionError {
    /// Returns the corresponding fault of the device contract.
    #[must_use]
    pub const fn fault(self) -> Fault {
        match self {
            Self::Gone | Self::Unplugged | Self::NotReady => Fault::Disconnected,
            Self::Silent | Self::Unfinished => Fault::Timeout,
            Self::TooLong(_)
            | Self::NoFrame
            | Self::NoState
            | Self::Missing(_)
            | Self::Infinite(_)
            | Self::ForeignForce => Fault::Protocol,
        }
    }
}

impl From<Malformed> for SessionError {
    fn from(_: Malformed) -> Self {
        Self::NoState
    }
}
