//! Client of the ML API: two connections for a session, and a third one reserved for the stop.
//!
//! - [`connection`]: calls and replies, events and acknowledgements, each with a timeout.
//! - [`session`]: take-off, commands and landing.
//! - [`stop`]: a Land frame, encoded before the coils are energised.
//!
//! A connection with an overdue reply is lost: replies have no sequence number, so the next reply could be the overdue reply. Lost
//! connections are reset when dropped.

pub(crate) mod connection;
pub(crate) mod session;
pub(crate) mod stop;
