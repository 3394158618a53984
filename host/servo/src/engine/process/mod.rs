//! Force model in a worker process: the loop continues without the model when it hangs or crashes.
//!
//! The host starts its own program once more, as `flotor worker`, which loads the plugin and creates the model. Both processes
//! share one page of memory. A step is a request there; the worker sleeps until a request comes, the loop until the reply, but no
//! longer than the model's timeout. In the first tick without a reply the last force is applied, then none until the worker has
//! caught up. A worker that is late in five ticks more than in time is disabled, like a model in the loop, and so is an ended one.
//!
//! The host loads the library as well, for its schema, but creates no model.

mod child;
mod memory;
pub(crate) mod parent;
mod shared_words;

pub use child::{LoadFile, WorkerArguments, serve};
pub(crate) use memory::SharedPage;
pub use parent::{Worker, WorkerConfig};

use serde::{Deserialize, Serialize};

/// First message of a worker: one line of JSON in the shared memory.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
enum Greeting {
    /// The model is created and prepared.
    Ready {
        /// Initial value of each parameter, in the order of the schema; `None` for a parameter without one.
        parameters: Vec<Option<f64>>,
        /// Outputs that the model can compute: force, torque, energy.
        serves: [bool; 3],
        /// True if the answer depends on the path.
        remembers: bool,
        /// True if the model has a linear field.
        has_field: bool,
    },
    /// The plugin could not be loaded, or refused to create the model.
    Refused {
        /// Code of the [`flotor_hal::RefusalKind`].
        kind: u32,
        /// Reason for the user.
        reason: String,
    },
}
