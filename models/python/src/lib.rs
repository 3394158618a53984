//! Model in Python: contacts near the handle, or a field, that a function of a Python file computes at 50 to 500 Hz.
//!
//! The interpreter is a process of its own. The host calls the model asynchronously (`flotor.contact-set/1`): its thread sends the
//! handle to the interpreter and waits for the answer, while the loop goes on with the last one. A garbage collection, an exception or
//! a killed interpreter never delays a tick: the force of the last answer fades.
//!
//! - [`interpreter`]: the process, its requests and answers. `runner.py` is the other end, embedded in the plugin.
//! - [`message`]: bytes of a question and of an answer.
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

pub mod interpreter;
pub mod message;
mod plugin;

pub use plugin::{FLOTOR_ENTRY, PythonModel};
