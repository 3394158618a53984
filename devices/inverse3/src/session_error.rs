//! Faults between the plugin and the service.

use crate::json::Malformed;
use flotor_hal::Fault;
use std::fmt;

/// Remedy for messages outside the documented interface.
const UPDATE: &str = "update the service to 3.5 or newer";

/// Fault of a session. After a fault, [`Session::end`](crate::session::Session::end) ends the session, and the service removes the
/// force of the session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SessionError {
    /// The service closed the connection, or is gone.
    Gone,
    /// Timeout without a state.
    Silent,
    /// Timeout with an incomplete state.
    Unfinished,
    /// A message above the limit of the plugin; its length, bytes.
    TooLong(u64),
    /// A malformed, fragmented or masked WebSocket frame.
    NoFrame,
    /// A state is not JSON, or a field has another kind of value.
    NoState,
    /// A field of the state is missing.
    Missing(&'static str),
    /// A field of the state is infinite.
    Infinite(&'static str),
    /// The device or its grip is no longer connected to the service.
    Unplugged,
    /// The service reports that the device or its grip is not ready: no power, or not calibrated.
    NotReady,
    /// The device exerts a force that this session did not command: another program also commands it.
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

impl fmt::Display for SessionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Gone => f.write_str("the service closed the connection; restart the service"),
            Self::Silent => f.write_str("the service does not reply; restart the service"),
            Self::Unfinished => f.write_str("the service sent an incomplete state; restart the service"),
            Self::TooLong(bytes) => write!(f, "the service sent a message of {bytes} bytes, too long for a device state; {UPDATE}"),
            Self::NoFrame => write!(f, "the service sent a malformed WebSocket frame; {UPDATE}"),
            Self::NoState => write!(f, "the service sent a malformed device state; {UPDATE}"),
            Self::Missing(field) => write!(f, "the device state has no `{field}`; {UPDATE}"),
            Self::Infinite(field) => write!(f, "`{field}` of the device state is not a finite number; {UPDATE}"),
            Self::Unplugged => f.write_str("the device or its grip is no longer connected to the service; connect both, and switch both on"),
            Self::NotReady => f.write_str(
                "the device or its grip has no power, or is not calibrated; switch both on, and wait for the calibration, up to 25 s",
            ),
            Self::ForeignForce => f.write_str("another program also commands a force on this device; end that program first"),
        }
    }
}
