//! The spring as a force-model plugin.

use crate::batch::Batch;
use crate::centerline::{Centerline, Helix};
use crate::closed_form::{ClosedForm, Form};
use crate::contract;
use crate::energy::EnergyForm;
use crate::parameters::{Choice, SCHEMA, Variant};
use crate::thesis::Thesis;
use flotor_hal::{
    CenterlineInfo, CenterlineModel, ForceModel, Input, ModelInfo, OutOfRange, Output, Parameter, Refusal,
    Settings, export_model,
};

/// The spring: what it is, and the law that answers.
pub struct SpringModel {
    choice: Choice,
    law: Prepared,
    batch: Batch,
}

impl SpringModel {
    fn new(choice: Choice) -> Self {
        Self { law: Prepared::new(&choice), choice, batch: Batch::new() }
    }
}

/// A law, its constants prepared for the spring chosen.
#[allow(clippy::large_enum_variant)] // one per model, made once: a box would add a load to every tick
enum Prepared {
    Thesis(Thesis),
    ClosedForm(ClosedForm),
    Energy(EnergyForm),
}

impl Prepared {
    fn new(choice: &Choice) -> Self {
        let Choice { spring, stiffness, precision, variant, .. } = choice;
        match variant {
            Variant::Thesis => Self::Thesis(Thesis::new(spring, *stiffness, *precision)),
            Variant::ClosedForm => {
                Self::ClosedForm(ClosedForm::new(spring, Form::Printed).with_precision(*precision))
            }
            Variant::CurrentLength => Self::ClosedForm(ClosedForm::new(spring, Form::CurrentLength)),
            Variant::Energy => Self::Energy(EnergyForm::new(spring)),
        }
    }

    /// The law after a change of parameters. Real-time: bounded, no allocation.
    fn retuned(&self, from: &Choice, to: &Choice) -> Self {
        match self {
            Self::Energy(law) => Self::Energy(law.retuned(&from.spring, &to.spring)),
            Self::Thesis(_) | Self::ClosedForm(_) => Self::new(to),
        }
    }
}

impl ForceModel for SpringModel {
    const INFO: ModelInfo =
        ModelInfo::new("spring", "Helical spring", "A helical spring with end plates in three dimensions")
            .serving(flotor_hal::Demand::ALL);
    const PARAMETERS: &'static [Parameter] = SCHEMA;

    fn create(settings: &Settings<'_>) -> Result<Self, Refusal> {
        Choice::resolve(settings).map(Self::new)
    }

    #[inline]
    fn step(&mut self, input: &Input) -> Output {
        let (pose, demand) = (contract::pose(input), contract::demand(input));
        contract::output(&match &self.law {
            Prepared::Thesis(law) => law.respond(&pose, demand),
            Prepared::ClosedForm(law) => law.respond(&pose, demand),
            Prepared::Energy(law) => law.respond(&pose, demand),
        })
    }

    fn step_batch(&mut self, inputs: &[Input], outputs: &mut [Output]) {
        match &self.law {
            Prepared::ClosedForm(law) => self.batch.respond(law, inputs, outputs),
            Prepared::Energy(law) => self.batch.respond(law, inputs, outputs),
            Prepared::Thesis(_) => {
                for (input, output) in inputs.iter().zip(outputs) {
                    *output = self.step(input);
                }
            }
        }
    }

    fn set_parameter(&mut self, index: usize, value: f64) -> Result<(), OutOfRange> {
        let choice = self.choice.with(index, value)?;
        self.law = self.law.retuned(&self.choice, &choice);
        self.choice = choice;
        Ok(())
    }

    fn parameter(&self, index: usize) -> f64 {
        self.choice.in_force(index)
    }
}

impl CenterlineModel for SpringModel {
    fn centerline_info(&self) -> CenterlineInfo {
        let helix = Helix::new(self.choice.spring.geometry());
        // Plates reach the outer edge of the coil.
        let plate_radius_m = helix.coil_radius_m + helix.wire_radius_m;
        CenterlineInfo::coil(helix.wire_radius_m, helix.coil_radius_m, helix.turns, plate_radius_m)
    }

    fn centerline(&mut self, input: &Input, points: &mut [flotor_hal::Pose]) -> usize {
        let Some(line) = Centerline::new(&self.choice.spring, &contract::pose(input)) else { return 0 };
        let last = points.len().saturating_sub(1).max(1);
        #[allow(clippy::cast_precision_loss)] // some tens of points
        for (index, point) in points.iter_mut().enumerate() {
            let section = line.section(index as f64 / last as f64);
            *point = flotor_hal::Pose::new(section.center_m, section.orientation);
        }
        points.len()
    }
}

export_model!(SpringModel, centerline);

#[cfg(test)]
mod tests;
