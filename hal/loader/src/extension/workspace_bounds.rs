//! Host side of `flotor.workspace-bounds/1`: limits of the range of motion that a model needs.

use crate::Model;
use flotor_hal::WorkspaceBounds;

impl Model {
    /// Returns the limits of the instance with the current parameters; unbounded without the extension. Real-time:
    /// bounded, no allocation.
    pub fn workspace_bounds(&mut self) -> WorkspaceBounds {
        let ask = self.extensions.workspace_bounds.and_then(|table| table.bounds);
        self.calls.query(ask, WorkspaceBounds::UNBOUNDED).unwrap_or(WorkspaceBounds::UNBOUNDED)
    }
}
