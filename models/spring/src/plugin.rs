//! The spring as a force-model plugin.

use crate::centerline::{Centerline, Helix};
use crate::closed_form::{ClosedForm, Form};
use crate::energy::EnergyForm;
use crate::parameters::{Choice, SCHEMA, Variant};
use crate::pose::Pose;
use crate::response::{Demand, Response};
use crate::validity::Validity;
use flotor_hal::{
    CenterlineInfo, CenterlineModel, ForceModel, Input, ModelInfo, Output, Parameter, Refusal, Settings,
    StepStatus, Wrench, export_model,
};

/// The spring: what it is, and the law that answers.
pub struct SpringModel {
    choice: Choice,
    law: Law,
}

#[allow(clippy::large_enum_variant)] // one per model, made once: a box would add a load to every tick
enum Law {
    ClosedForm(ClosedForm),
    Energy(EnergyForm),
}

impl ForceModel for SpringModel {
    const INFO: ModelInfo =
        ModelInfo::new("spring", "Helical spring", "A helical spring with end plates in three dimensions")
            .serving(flotor_hal::Demand::ALL);
    const PARAMETERS: &'static [Parameter] = SCHEMA;

    fn create(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let choice = Choice::resolve(settings)?;
        let law = match choice.variant {
            Variant::ClosedForm => Law::ClosedForm(ClosedForm::new(&choice.spring, Form::Printed)),
            Variant::CurrentLength => Law::ClosedForm(ClosedForm::new(&choice.spring, Form::CurrentLength)),
            Variant::Energy => Law::Energy(EnergyForm::new(&choice.spring)),
        };
        Ok(Self { choice, law })
    }

    #[inline]
    fn step(&mut self, input: &Input) -> Output {
        let pose = pose(input);
        let demand = demand(input.demand);
        let response = match &self.law {
            Law::ClosedForm(law) => law.respond(&pose, demand),
            Law::Energy(law) => law.respond(&pose, demand),
        };
        output(&response)
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
        let Some(line) = Centerline::new(&self.choice.spring, &pose(input)) else { return 0 };
        let last = points.len().saturating_sub(1).max(1);
        #[allow(clippy::cast_precision_loss)] // some tens of points
        for (index, point) in points.iter_mut().enumerate() {
            let section = line.section(index as f64 / last as f64);
            *point = flotor_hal::Pose::new(section.center_m, section.orientation);
        }
        points.len()
    }
}

#[inline]
fn pose(input: &Input) -> Pose {
    Pose { position_m: input.pose.position(), orientation: input.pose.orientation() }
}

#[inline]
fn demand(demand: flotor_hal::Demand) -> Demand {
    if demand.contains(flotor_hal::Demand::ENERGY) {
        Demand::WrenchAndEnergy
    } else if demand.contains(flotor_hal::Demand::TORQUE) {
        Demand::Wrench
    } else {
        Demand::Force
    }
}

#[inline]
fn output(response: &Response) -> Output {
    let status = match response.validity {
        Validity::Ok => StepStatus::Ok,
        Validity::Clamped => StepStatus::Clamped,
        Validity::NotConverged => StepStatus::NotConverged,
        Validity::OutOfDomain => StepStatus::OutOfDomain,
        Validity::InvalidInput => StepStatus::InvalidInput,
    };
    let wrench = Wrench::new(response.force_n, response.torque_nm);
    Output::new(wrench, response.energy_j.unwrap_or(f64::NAN), status)
}

export_model!(SpringModel, centerline);
