//! Plugin of the spring: parameters, step, details, centreline and workspace bounds.

use crate::batch::Batch;
use crate::centerline::{Helix, Section};
use crate::contract;
use crate::pace::Pace;
use crate::parameters::{Choice, SCHEMA, Switch};
use crate::prepared::{Diagnostics, Prepared};
use crate::rod::Branch;
use flotor_hal::glam::{DQuat, DVec3};
use flotor_hal::{
    CenterlineInfo, CenterlineModel, Choices, Demand, Detail, DetailsModel, ForceModel, Input, Memory,
    ModelInfo, Output, Parameter, Refusal, SetParameterError, Settings, VariantInfo, VariantModel,
    WorkspaceBounds, WorkspaceBoundsModel, choices, export_model, restorable,
};

/// Force model of the spring: parameters, prepared law and timing.
pub struct SpringModel {
    choice: Choice,
    law: Prepared,
    pace: Pace,
    batch: Batch,
}

restorable!(SpringModel { law, pace } without { choice, batch });

impl SpringModel {
    fn new(choice: Choice) -> Self {
        Self { law: Prepared::new(&choice), choice, pace: Pace::default(), batch: Batch::default() }
    }
}

impl ForceModel for SpringModel {
    // Covers all variants; `VariantModel` declares the chosen one.
    const INFO: ModelInfo =
        ModelInfo::new("spring", "Helical spring", "A helical spring with end plates in three dimensions")
            .serving(Demand::ALL)
            .with_memory(Memory::PathDependent);
    const PARAMETERS: &'static [Parameter] = SCHEMA;

    fn create(settings: &Settings<'_>) -> Result<Self, Refusal> {
        Choice::resolve(settings).map(Self::new)
    }

    #[inline]
    fn step(&mut self, input: &Input) -> Output {
        self.law.step(input, &mut self.pace)
    }

    fn step_batch(&mut self, inputs: &[Input], outputs: &mut [Output]) {
        if !self.law.respond_side_by_side(&self.batch, &mut self.pace, inputs, outputs) {
            for (input, output) in inputs.iter().zip(outputs) {
                *output = self.step(input);
            }
        }
    }

    fn set_parameter(&mut self, index: usize, value: f64) -> Result<(), SetParameterError> {
        let choice = self.choice.with(index, value)?;
        self.law.retune(&self.choice, &choice);
        self.choice = choice;
        Ok(())
    }

    fn parameter(&self, index: usize) -> f64 {
        self.choice.in_force(index)
    }

    fn reset(&mut self) {
        self.law.reset();
        self.pace = Pace::default();
    }
}

impl VariantModel for SpringModel {
    fn variant_info(&self) -> VariantInfo {
        self.law.info()
    }
}

const BRANCHES: Choices = choices!["unbuckled", "buckled"];

impl DetailsModel for SpringModel {
    const DETAILS: &'static [Detail] = &[
        Detail::word(
            "branch",
            BRANCHES,
            "Branch of the rod: buckled if the height between the plates is below that at which a straight rod buckles (rod)",
        ),
        Detail::flag("stable", "True if the shape is a minimum of the stored energy (rod)"),
        Detail::number(
            "seat_roll_rad",
            "rad",
            "Roll of the lower plate about y; no value for a spring in the air",
        ),
        Detail::number("rod_share", "1", "Weight of the exact rod in the energy (energy with hand_over)"),
    ];

    fn details(&self, values: &mut [f64]) {
        let Diagnostics { branch, is_stable, seat_roll_rad, rod_share } = self.law.diagnostics();
        let branch = branch.map(|branch| match branch {
            Branch::Unbuckled => 0.0,
            Branch::Buckled => 1.0,
        });
        let is_stable = is_stable.map(|is_stable| f64::from(u8::from(is_stable)));
        for (value, known) in values.iter_mut().zip([branch, is_stable, seat_roll_rad, rod_share]) {
            *value = known.unwrap_or(f64::NAN);
        }
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
        let mut sections =
            vec![Section { center_m: DVec3::ZERO, orientation: DQuat::IDENTITY }; points.len()];
        if !self.law.draw(&self.choice.spring, &contract::pose(input), &mut sections) {
            return 0;
        }
        for (point, section) in points.iter_mut().zip(&sections) {
            *point = flotor_hal::Pose::new(section.center_m, section.orientation);
        }
        points.len()
    }
}

impl WorkspaceBoundsModel for SpringModel {
    /// Returns a lower bound of the height at the solid length; no bounds for a law with coil contact.
    fn workspace_bounds(&self) -> WorkspaceBounds {
        if self.choice.coil_contact == Switch::On {
            return WorkspaceBounds::UNBOUNDED;
        }
        let geometry = self.choice.spring.geometry();
        let solid_m = geometry.solid_length_m() - geometry.free_length_m;
        WorkspaceBounds::between([f64::NEG_INFINITY, f64::NEG_INFINITY, solid_m], [f64::INFINITY; 3])
    }
}

export_model!(SpringModel, centerline, variant, details, snapshot, workspace_bounds);

#[cfg(test)]
mod tests;
