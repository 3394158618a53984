//! Plugin of the measured spring: parameters, step, and centreline for drawing.

use crate::curve::Curve;
use crate::table;
use flotor_hal::{
    CenterlineInfo, CenterlineModel, DQuat, DVec3, Demand, ForceModel, Input, ModelInfo, Output, Parameter,
    Pose, Refusal, SetParameterError, Settings, StepStatus, Wrench, choices, read_text,
};
use std::path::Path;

/// Default table: spring 1 of the thesis, 0.68 N/mm, straight over 12 mm.
const SPRING_1: &str = "compression_mm,force_n\n0,0\n6,4.08\n12,8.16\n";

/// Workspace limit along each axis, m; a position beyond it is limited to the edge, with status `Clamped`.
const REACH_M: f64 = 1.0;

/// Assumed shape of the drawn spring, not in a table of forces: turns, and wire over coil, of spring 1.
const DRAWN_TURNS: f64 = 10.0;
const DRAWN_WIRE_PER_COIL: f64 = 0.1;

/// Spring with a measured curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    curve: Curve,
    stiffness_scale: f64,
    free_length_m: f64,
    coil_diameter_m: f64,
}

impl Measured {
    /// Returns force on the hand along z, N, stored energy, J, and status, at a height above home, m. The status is `Clamped`
    /// beyond the workspace limit of 1 m, `OutOfDomain` beyond the last row of the table. Real-time: bounded, no allocation.
    #[must_use]
    pub fn at(&self, height_m: f64) -> (f64, f64, StepStatus) {
        let reached_m = height_m.clamp(-REACH_M, REACH_M);
        let (force_n, energy_j) = self.curve.at(-reached_m);
        let status = if reached_m != height_m {
            StepStatus::Clamped
        } else if -reached_m > self.curve.deepest_m {
            StepStatus::OutOfDomain
        } else {
            StepStatus::Ok
        };
        (self.stiffness_scale * force_n, self.stiffness_scale * energy_j, status)
    }
}

impl ForceModel for Measured {
    const INFO: ModelInfo =
        ModelInfo::new("measured", "Measured spring", "The force-length curve of a real spring, as measured")
            .serving(Demand::ALL);

    const PARAMETERS: &'static [Parameter] = &[
        Parameter::file(
            "curve",
            choices![],
            "CSV file with the columns compression_mm,force_n (default: a straight line of 0.68 N/mm)",
        ),
        Parameter::real(
            "stiffness_scale",
            "1",
            0.0,
            20.0,
            1.0,
            "Factor on the measured force, the same at every length",
        )
        .live(),
        Parameter::real(
            "free_length_mm",
            "mm",
            1.0,
            500.0,
            25.0,
            "Free length: length without load, above the largest compression of the curve; for the drawing",
        ),
        Parameter::real(
            "coil_diameter_mm",
            "mm",
            1.0,
            200.0,
            6.0,
            "Diameter of the coil between wire centres (only for the drawing)",
        ),
    ];

    fn create(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let curve = match settings.text("curve") {
            None => table::parse(SPRING_1).map_err(|wrong| Refusal::broken(wrong.problem))?,
            Some(file) => read_text(Path::new(file), "the curve")
                .and_then(|text| table::parse(&text))
                .map_err(|wrong| Refusal::parameter(wrong.in_file(file)))?,
        };
        let metres = |id| settings.number_or_default(id) * 1.0e-3;
        let (free_length_m, coil_diameter_m) = (metres("free_length_mm"), metres("coil_diameter_mm"));
        if curve.deepest_m >= free_length_m {
            return Err(Refusal::parameter(format!(
                "the curve ends at a compression of {:.3} mm, but the spring is only {:.3} mm long; set `free_length_mm` \
                 to a greater length",
                curve.deepest_m * 1.0e3,
                free_length_m * 1.0e3
            )));
        }
        let stiffness_scale = settings.number_or_default("stiffness_scale");
        Ok(Self { curve, stiffness_scale, free_length_m, coil_diameter_m })
    }

    fn step(&mut self, input: &Input) -> Output {
        if !input.pose.is_finite() {
            return Output::new(Wrench::ZERO, 0.0, StepStatus::InvalidInput);
        }
        let (force_n, energy_j, status) = self.at(input.pose.position().z);
        Output::new(Wrench::from_force(DVec3::Z * force_n), energy_j, status)
    }

    fn set_parameter(&mut self, index: usize, value: f64) -> Result<(), SetParameterError> {
        if index != 1 {
            return Err(SetParameterError::Fixed);
        }
        self.stiffness_scale = value;
        Ok(())
    }

    fn parameter(&self, index: usize) -> f64 {
        match index {
            0 => 0.0,
            1 => self.stiffness_scale,
            2 => self.free_length_m * 1.0e3,
            3 => self.coil_diameter_m * 1.0e3,
            _ => f64::NAN,
        }
    }
}

impl CenterlineModel for Measured {
    fn centerline_info(&self) -> CenterlineInfo {
        let coil_radius_m = 0.5 * self.coil_diameter_m;
        let wire_radius_m = DRAWN_WIRE_PER_COIL * coil_radius_m;
        CenterlineInfo::coil(wire_radius_m, coil_radius_m, DRAWN_TURNS, coil_radius_m + wire_radius_m)
    }

    /// Draws the spring from its fixed end to the handle; under a handle above home, at its free length.
    fn centerline(&mut self, input: &Input, points: &mut [Pose]) -> usize {
        let foot_m = -DVec3::Z * self.free_length_m;
        let handle_m = input.pose.position();
        let top_m = handle_m.min(DVec3::new(f64::INFINITY, f64::INFINITY, 0.0));
        let last = points.len().saturating_sub(1).max(1) as f64;
        for (index, point) in points.iter_mut().enumerate() {
            let share = index as f64 / last;
            // Upright at both ends, as plates hold a spring.
            let lean = share * share * (3.0 - 2.0 * share);
            let across_m = (top_m - foot_m).with_z(0.0) * lean;
            let position_m = foot_m + across_m + DVec3::Z * ((top_m.z - foot_m.z) * share);
            *point = Pose::new(position_m, DQuat::IDENTITY.slerp(input.pose.orientation(), lean));
        }
        points.len()
    }
}

flotor_hal::export_model!(Measured, centerline);
