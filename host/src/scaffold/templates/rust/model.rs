//! Your name: a floor that pushes the hand up. Change `step`, build, and feel the difference.
//!
//! A step gets the pose of the handle (m; z up, home at the origin) and returns the force on the hand (N).

mod shape;

use flotor_hal::*;

/// Instance of the model.
struct YourName {
    /// Values of the parameters, in the order of `PARAMETERS`.
    values: [f64; 3],
    shape: Shape,
}

impl ForceModel for YourName {
    const INFO: ModelInfo = ModelInfo::new(
        "your-name", // in scenes
        "Your name", // on screens
        "A floor that pushes the hand up",
    );

    // Id, unit, smallest, largest, default, description. `live`: may change during a run.
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::real("stiffness_n_per_m", "N/m", 0.0, 5000.0, 500.0, "Stiffness of the floor").live(),
        Parameter::real("height_mm", "mm", -10.0, 10.0, 0.0, "Height of the floor").live(),
        Parameter::real("thickness_mm", "mm", 1.0, 100.0, 50.0, "Depth at the largest force").live(),
    ];

    // Before the loop: the place to allocate, to read files, and to refuse with a reason.
    fn create(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let ids = ["stiffness_n_per_m", "height_mm", "thickness_mm"];
        Ok(Self { values: ids.map(|id| settings.number_or_default(id)), shape: Shape::default() })
    }

    // In the loop, a thousand times a second: no allocation, no lock, no printing; every pose gets an answer.
    fn step(&mut self, input: &Input) -> Output {
        if !input.pose.is_finite() {
            return Output::new(Wrench::ZERO, f64::NAN, StepStatus::InvalidInput);
        }
        let [stiffness_n_per_m, height_mm, thickness_mm] = self.values;
        let depth_m = (1e-3 * height_mm - input.pose.position().z).clamp(0.0, 1e-3 * thickness_mm);
        Wrench::from_force(DVec3::Z * stiffness_n_per_m * depth_m).into()
    }

    // Between two steps: the new value of a live parameter. A value that the model cannot use is refused, and the old
    // one stays.
    fn set_parameter(&mut self, index: usize, value: f64) -> Result<(), SetParameterError> {
        Self::PARAMETERS[index].check(value)?; // `SetParameterError::OutOfRange`
        self.values[index] = value;
        Ok(())
    }

    fn parameter(&self, index: usize) -> f64 {
        self.values[index]
    }
}

flotor_hal::export_model!(YourName, shape);

#[cfg(test)]
mod tests {
    use super::*;

    fn force_n_at_height(z_m: f64) -> DVec3 {
        let (values, shape) = ([500.0, 0.0, 50.0], Shape::default());
        let mut model = YourName { values, shape };
        let pose = Pose::new(DVec3::Z * z_m, DQuat::IDENTITY);
        model.step(&Input::at_rest(pose)).wrench.force()
    }

    #[test]
    fn below_home_it_pushes_up_and_above_there_is_nothing() {
        assert_eq!(force_n_at_height(-0.004), DVec3::Z * 2.0); // 500 N/m times 4 mm
        assert_eq!(force_n_at_height(0.004), DVec3::ZERO);
    }

    #[test]
    fn a_value_outside_its_range_is_refused() {
        let mut model = YourName { values: [500.0, 0.0, 50.0], shape: Shape::default() };
        let refused = model.set_parameter(0, -1.0);
        assert_eq!(refused, Err(OutOfRange { min: 0.0, max: 5000.0, value: -1.0 }.into()));
        assert_eq!(model.parameter(0), 500.0);
    }

    #[test]
    fn the_force_is_bounded() {
        assert_eq!(force_n_at_height(-1.0e300), DVec3::Z * 25.0);
        assert_eq!(force_n_at_height(f64::NAN), DVec3::ZERO);
    }
}
