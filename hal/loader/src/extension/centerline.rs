//! Host side of `flotor.centerline/1`: centreline of a slender body, for drawing.

use crate::Model;
use flotor_hal::abi::CallStatus;
use flotor_hal::extension::centerline::CenterlineTable;
use flotor_hal::{CenterlineInfo, Input, Pose};

/// Access to the centreline of a model. Not real-time.
pub struct Centerline<'a> {
    model: &'a mut Model,
    table: &'static CenterlineTable,
}

impl Model {
    /// Returns access to the model's centreline, if any. Not real-time: for observers with their own instance.
    #[must_use]
    pub fn centerline(&mut self) -> Option<Centerline<'_>> {
        let table = self.extensions.centerline?;
        Some(Centerline { model: self, table })
    }
}

impl Centerline<'_> {
    /// Returns the drawing style of the body; `None` if the model failed.
    #[must_use]
    pub fn info(&mut self) -> Option<CenterlineInfo> {
        self.model.calls.query(self.table.info, CenterlineInfo::default())
    }

    /// Returns the centreline at an input, from the fixed end to the handle, in at most `capacity` points; `None` if
    /// `capacity` is 0 or the model failed.
    #[must_use]
    pub fn points(&mut self, input: &Input, capacity: usize) -> Option<Vec<Pose>> {
        let (ask, room) = (self.table.centerline?, u32::try_from(capacity).ok()?);
        let (mut points, mut count) = (vec![Pose::HOME; capacity], 0);
        // SAFETY: a live instance used by this thread only, room for `capacity` poses, pointers valid for the call.
        let code = self
            .model
            .calls
            .call(|instance| unsafe { ask(instance, input, points.as_mut_ptr(), room, &raw mut count) });
        points.truncate(count as usize);
        (code == CallStatus::Ok as u32).then_some(points)
    }
}
