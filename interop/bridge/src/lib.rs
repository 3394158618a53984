//! Access to a running host over a network ([Zenoh](https://zenoh.io)), for remote viewers, recorders and operators.
//!
//! ```text
//!  machine A                                              machine B
//!  flotor run -> live socket -> bridge serve  -> network -> bridge attach -> live socket -> flotor view
//!                                                        -> bridge record -> FILE.mcap
//!  flotor run <-> peer socket <-> bridge serve <-> network <-> bridge couple <-> peer socket <-> flotor run
//! ```
//!
//! [`serve`] is one end: a client of the host ([`flotor_live`]) that publishes the host's messages on keys ([`keys`]) in the format
//! of a recording. [`remote`] is the other end; [`attach`] republishes a remote run locally, and [`record`] records it. [`couple`]
//! couples a local hand to a remote hand. Requests take the reverse path ([`request`]); Zenoh's access control decides who may send
//! which, by keys and configurations from [`access`]. An emergency stop takes a second path beside Zenoh: [`stop_channel`].
//!
//! Not real-time: nothing here runs in the process of a servo.

pub mod access;
pub mod attach;
pub mod couple;
pub mod keys;
pub mod link;
pub mod record;
pub mod remote;
pub mod request;
pub mod serve;
pub mod status;
pub mod stop_channel;
mod wall_clock;
