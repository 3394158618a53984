//! A running host on a network, over [Zenoh](https://zenoh.io): for a viewer, a recorder or an operator elsewhere.
//!
//! ```text
//!  machine A                                              machine B
//!  flotor run -> live socket -> bridge serve  -> network -> bridge attach -> live socket -> flotor view
//!                                                        -> bridge record -> FILE.mcap
//!  flotor run <-> peer socket <-> bridge serve <-> network <-> bridge couple <-> peer socket <-> flotor run
//! ```
//!
//! [`serve`] is the one end: a watcher of the host like any other ([`flotor_live`]), whose words it puts on keys
//! ([`keys`]) in the messages of a recording. [`remote`] is the other, [`attach`] shows what it hears as if it ran there,
//! and [`keep`] records it. [`couple`] holds a hand here and one there together. Requests go back the same way ([`request`]); who may ask for what is Zenoh's access control, for which
//! [`access`] writes keys and configurations. An emergency stop goes a second way beside Zenoh: [`stop_channel`].
//!
//! Not real-time: nothing here runs in the process of a servo.

pub mod access;
pub mod attach;
pub mod couple;
pub mod keep;
pub mod keys;
pub mod link;
pub mod remote;
pub mod request;
pub mod serve;
pub mod status;
pub mod stop_channel;
