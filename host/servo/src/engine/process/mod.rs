//! A force model in a process of its own: when it hangs or crashes, the loop goes on without it.
//!
//! The host starts its own program once more, as `flotor worker`, which loads the plugin and makes the model. The
//! two share one page of memory. A step is a request there; the worker sleeps until one comes, the loop sleeps until
//! it is answered, but no longer than the model's time. A late answer costs one tick with the last force and none
//! after that, until the worker has caught up; a worker that is late in five ticks more than in time is disabled, as a
//! model in the loop would be, and one that has ended too.
//!
//! The library is loaded into the host as well, for its schema, but no model of it is made there.

mod child;
mod memory;
pub(crate) mod parent;
mod shared_words;

pub use child::{LoadFile, WorkerArguments, serve};
pub(crate) use memory::SharedPage;
pub use parent::{Worker, WorkerOrder};

use serde::{Deserialize, Serialize};

/// What a worker says in the memory both share, once, in one line of JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
enum Greeting {
    /// The model is made.
    Ready {
        /// Value in force of each parameter, in the order of the schema; `None` for one that has none.
        parameters: Vec<Option<f64>>,
        /// Whether it serves force, torque and energy.
        serves: [bool; 3],
        /// Whether its answer depends on the path.
        remembers: bool,
        /// Whether it has a linear field.
        has_field: bool,
    },
    /// The plugin was refused, or said no.
    Refused {
        /// Code of the [`flotor_hal::RefusalKind`].
        kind: u32,
        /// Why.
        reason: String,
    },
}

/// What came of asking a worker.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reply<T> {
    /// It answered in time.
    Answered(T),
    /// It has not answered yet.
    Late,
    /// Its process has ended.
    Gone,
}
