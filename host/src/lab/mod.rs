//! Measurements of plugins, loops and recordings.
//!
//! - [`evaluate`]: a force model at given poses.
//! - [`stress`]: how far a force model can be trusted with a hand.
//! - [`mod@validate`]: a plugin against the rules of the contract.
//! - [`mod@bench`]: what an evaluation costs, and how wrong it is.
//! - [`stability`]: how stiff a spring the servo can render.
//! - [`jitter`]: how well the servo keeps time.
//! - [`replay`]: the models of a recording once more.
//! - [`sampling`]: points that cover a space evenly.
//!
//! Nothing here runs a hand; not real-time throughout.

pub mod bench;
pub mod evaluate;
pub mod jitter;
pub mod replay;
pub mod sampling;
pub mod stability;
pub mod stress;
pub mod validate;
