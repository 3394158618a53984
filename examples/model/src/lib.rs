use flotor_hal::{ForceModel, Input, ModelInfo, Output, Parameter, Refusal, Settings, StepStatus, Wrench};

/// Jelly that yields in every direction and pulls the handle back home.
struct Jelly {
    stiffness_n_per_m: f64,
}

impl ForceModel for Jelly {
    const INFO: ModelInfo =
        ModelInfo::new("jelly", "Jelly", "A soft block that gives way in every direction");
    const PARAMETERS: &'static [Parameter] =
        &[Parameter::real("stiffness_n_per_m", "N/m", 0.0, 2000.0, 300.0, "How hard it pulls home")];

    fn create(settings: &Settings<'_>) -> Result<Self, Refusal> {
        Ok(Jelly { stiffness_n_per_m: settings.number_or_default("stiffness_n_per_m") })
    }

    fn step(&mut self, input: &Input) -> Output {
        if !input.pose.is_finite() {
            return Output::new(Wrench::ZERO, 0.0, StepStatus::InvalidInput);
        }
        Wrench::from_force(-self.stiffness_n_per_m * input.pose.position()).into()
    }
}
flotor_hal::export_model!(Jelly);
