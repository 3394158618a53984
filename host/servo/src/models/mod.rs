//! Force models of a run: selects the active ones and adds up their wrenches.
//!
//! A scene's models are *layers*. Their wrenches add up, each times its weight; a layer with a nonzero wrench silences the layers
//! of lower priority; weights move at a constant rate, so that the force does not jump when one model yields to another. A layer
//! without an object that can act at the handle, or with weight 0, is not stepped.
//!
//! A layer is on one device, in that device's stack; or several devices share its one instance, which is then stepped once for
//! all of them, wherever their handles are.

mod body;
mod contribution;
mod instance;
mod layer;
mod model_layer;
mod objects;
mod placement;
mod shared_object;
mod shared_slot;
mod slot;
mod stack;

pub(crate) use body::Body;
pub(crate) use contribution::{Contribution, Sample};
pub(crate) use layer::Kind;
pub use layer::{Layer, Replacement};
pub use model_layer::LayerReport;
pub(crate) use objects::Objects;
pub(crate) use shared_object::SharedObject;
pub(crate) use shared_slot::{SharedSlot, limit_observable};
pub(crate) use slot::{SavedSlot, Slot};
pub(crate) use stack::ModelStack;
