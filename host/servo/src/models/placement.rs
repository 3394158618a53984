//! Placement of an instance at a device: mapping, and the wall at the bounds of the model.

use super::contribution::{Contribution, Sample};
use crate::engine::Engine;
use flotor_contact::FeltStiffness;
use flotor_core::end_wall::EndWall;
use flotor_core::health::ContactHealth;
use flotor_core::mapping::Mapping;
use flotor_core::trace::Events;
use flotor_hal::{Input, Output, SampledLoop, StepStatus};

/// Mapping of an instance at a device, with the wall at its bounds.
pub(super) struct Placement {
    pub(super) mapping: Mapping,
    /// `None` for a model without bounds.
    end: Option<EndWall>,
}

impl Placement {
    /// Creates the placement; a model with workspace bounds gets a wall at the bounds. Not real-time.
    pub(super) fn new(model: &mut Engine, mapping: Mapping, sampled: &SampledLoop) -> Self {
        Self { mapping, end: EndWall::new(&model.workspace_bounds(), &mapping, sampled) }
    }

    /// Moves the wall to the present bounds of the model. Real-time: bounded, no allocation.
    pub(super) fn move_end(&mut self, model: &mut Engine) {
        if let Some(end) = &mut self.end {
            end.move_to(&model.workspace_bounds(), &self.mapping);
        }
    }

    /// Adds the reductions of contact stiffness, model frame, to the counters of the model. Not real-time.
    pub(super) fn note_stiffness(&self, felt: &FeltStiffness, contacts: &mut ContactHealth) {
        let scale = self.mapping.stiffness_scale();
        contacts.undamped_n_per_m = contacts.undamped_n_per_m.max(felt.undamped_n_per_m * scale);
        let at_hand = felt.reduced_n_per_m.map(|pair| pair.map(|stiffness| stiffness * scale));
        contacts.reduced_n_per_m = contacts.reduced_n_per_m.or(at_hand);
    }

    /// Adds the usable output and effort of a step, model frame, to the contribution at the device, with the force of the wall.
    /// Real-time: bounded, no allocation.
    #[inline(always)] // in the middle of a tick
    pub(super) fn add_to(
        &self,
        share: &mut Contribution,
        (output, effort): (&Output, f64),
        input: &Input,
        sample: &Sample<'_>,
        events: &mut Events,
    ) {
        let Self { mapping, end } = self;
        share.wrench = share.wrench + mapping.wrench_to_device(&output.wrench);
        if let Some(push) = end.as_ref().and_then(|end| end.push(&input.pose, mapping, &sample.state.twist)) {
            events.insert(Events::BOUNDARY);
            share.wrench = share.wrench + push;
        }
        share.energy_j += output.energy_j * mapping.energy_scale();
        if let Some(grip) = sample.grip {
            share.effort += mapping.effort_to_device(grip.kind(), effort);
        }
        if output.status() != Some(StepStatus::Ok) {
            events.insert(Events::MODEL_DEGRADED);
        }
    }
}
