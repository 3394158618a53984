//! Host side of `flotor.shape/1`: visible shape of a model, copied and checked.

use crate::Model;
use flotor_hal::abi::CallStatus;
use flotor_hal::extension::shape::ShapeView;
use flotor_hal::{Input, InvalidShape, Shape};

impl Model {
    /// Returns true if the model has a shape.
    #[must_use]
    pub fn has_shape(&self) -> bool {
        self.extensions.shape.is_some_and(|table| table.shape.is_some())
    }

    /// Returns the model's shape at an input, copied and checked. Not real-time: for observers with their own instance.
    ///
    /// # Errors
    /// [`InvalidShape`]; for a model without a shape, [`InvalidShape::Failed`].
    pub fn shape(&mut self, input: &Input) -> Result<Shape, InvalidShape> {
        let ask = self.extensions.shape.and_then(|table| table.shape).ok_or(InvalidShape::Failed)?;
        let mut view = ShapeView::empty();
        // SAFETY: a live instance used by this thread only (`&mut`), pointers valid for the call.
        let code = self.calls.call(|instance| unsafe { ask(instance, input, &raw mut view) });
        if code != CallStatus::Ok as u32 {
            return Err(InvalidShape::Failed);
        }
        // SAFETY: the plugin's lists are of the checked layout and valid until its next call, which `&mut` keeps away.
        let shape = unsafe { view.copied() }?;
        shape.check()?;
        Ok(shape)
    }
}
