//! Force model in a worker process: if the model hangs or crashes, the loop continues without the model.
//!
//! The host starts a second process of its own program, `flotor worker`, which loads the plugin and creates the model. Both
//! processes share one page of memory, through which the loop requests each step. The worker sleeps until a request arrives; the
//! loop sleeps until the reply, but no longer than the model's timeout. In the first tick without a reply the last force is
//! applied, then no force until the worker replies again. A worker with five more late ticks than ticks in time is disabled, like a
//! model with such overruns in the loop. A worker whose process has ended is also disabled.
//!
//! The host loads the library as well, for its parameter schema, but creates no model.

mod child;
mod memory;
pub(crate) mod parent;
mod shared_words;

pub use child::{LoadFile, WorkerArguments, serve};
pub(crate) use memory::SharedPage;
pub use parent::{Worker, WorkerConfig};

use serde::{Deserialize, Serialize};

/// First message of a worker, JSON text sent through the shared memory.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
enum Greeting {
    /// The model is created and prepared.
    Ready {
        /// Initial value of each parameter, in the order of the schema; `None` for a parameter without one.
        parameters: Vec<Option<f64>>,
        /// Outputs that the model can compute: force, torque, energy.
        serves: [bool; 3],
        /// True if the output depends on the path of the handle.
        remembers: bool,
        /// True if the model can run asynchronously.
        has_local_model: bool,
    },
    /// The plugin could not be loaded, or refused to create the model.
    Refused {
        /// Code of the [`flotor_hal::RefusalKind`].
        kind: u32,
        /// Reason for the user.
        reason: String,
    },
}
