//! The client of the ML API: two connections and a session, and a third connection for nothing but the stop.
//!
//! - [`connection`]: a call and its reply, events and their acknowledgements, each with a deadline.
//! - [`session`]: from the first call to levitation, and back.
//! - [`stop`]: a Land frame that is ready before anything is energised.
//!
//! A connection on which a reply is overdue is lost: replies have no number, so that the next one could be the one that is
//! missing. Lost connections are reset when they are dropped.

pub(crate) mod connection;
pub(crate) mod session;
pub(crate) mod stop;
