//! Your name: a floor at home height that pushes the hand up. Change `step`, build, and feel the difference.
//!
//! A step gets where the handle is (m, z up, home at the origin) and answers with the force on the hand (N).

use flotor_hal::{
    DVec3, ForceModel, Input, ModelInfo, OutOfRange, Output, Parameter, Refusal, Settings, StepStatus, Wrench,
};

/// What one instance knows between two steps.
struct YourName {
    stiffness_n_per_m: f64,
}

/// Deeper than this the floor pushes no harder, m: no pose may give a force without end.
const DEEPEST_M: f64 = 0.1;

impl ForceModel for YourName {
    const INFO: ModelInfo = ModelInfo::new("your-name", "Your name", "A floor that pushes the hand up");

    // Id, unit, smallest, largest, default, words for people. `live`: may change while somebody feels it.
    const PARAMETERS: &'static [Parameter] =
        &[Parameter::real("stiffness_n_per_m", "N/m", 0.0, 5000.0, 500.0, "Stiffness of the floor").live()];

    // Before the loop: the place to allocate, to read files, and to refuse with a reason.
    fn create(settings: &Settings<'_>) -> Result<Self, Refusal> {
        Ok(Self { stiffness_n_per_m: settings.number_or_default("stiffness_n_per_m") })
    }

    // In the loop, a thousand times a second: no allocation, no lock, no printing; every pose gets an answer.
    fn step(&mut self, input: &Input) -> Output {
        if !input.pose.is_finite() {
            return Output::new(Wrench::ZERO, f64::NAN, StepStatus::InvalidInput);
        }
        let depth_m = (-input.pose.position().z).clamp(0.0, DEEPEST_M);
        Wrench::from_force(DVec3::Z * self.stiffness_n_per_m * depth_m).into()
    }

    // Between two steps: one of the live parameters, already checked against its range.
    fn set_parameter(&mut self, _index: usize, value: f64) -> Result<(), OutOfRange> {
        self.stiffness_n_per_m = value;
        Ok(())
    }

    fn parameter(&self, _index: usize) -> f64 {
        self.stiffness_n_per_m
    }
}

flotor_hal::export_model!(YourName);

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::{DQuat, Pose};

    fn force_n_at_height(z_m: f64) -> DVec3 {
        let mut model = YourName { stiffness_n_per_m: 500.0 };
        model.step(&Input::at_rest(Pose::new(DVec3::Z * z_m, DQuat::IDENTITY))).wrench.force()
    }

    #[test]
    fn below_home_it_pushes_up_and_above_it_is_not_there() {
        assert_eq!(force_n_at_height(-0.004), DVec3::Z * 2.0); // 500 N/m times 4 mm
        assert_eq!(force_n_at_height(0.004), DVec3::ZERO);
    }

    #[test]
    fn no_pose_gives_a_force_without_end() {
        assert_eq!(force_n_at_height(-1.0e300), DVec3::Z * 50.0);
        assert_eq!(force_n_at_height(f64::NAN), DVec3::ZERO);
    }
}
