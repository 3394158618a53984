//! Scene of a study of one's own design, from the options.

use crate::study::{Common, ObserverOption};
use flotor_command::CommandError;
use flotor_study::apparatus::ApparatusError;
use flotor_study::apparatus::designed_setup::{DesignedApparatus, DesignedApparatusError};
use flotor_study::protocol::Stimulus as ModelParameter;
use flotor_study_design::design::Design;
use flotor_study_design::stimulus::Stimulus;
use flotor_study_design::value::Setting;

/// Checks the design on the scene of the options: the named one, or the built-in one with the model of the stimulus. A simulated observer
/// needs a device with a simulated hand.
pub(super) fn check(common: &Common, design: &Design) -> Result<DesignedApparatus, CommandError> {
    let settings = design.stimulus().map(Stimulus::setting);
    let settings = settings.into_iter().chain(design.factors().iter().filter_map(|one| one.setting.as_ref()));
    let found = settings.into_iter().find_map(|setting| match setting {
        Setting::Scene { part, key } if part != "device" => {
            Some(ModelParameter { model: part.clone(), parameter: key.clone() })
        }
        _ => None,
    });
    let scene = common.scene(&found.unwrap_or_default(), None)?;
    let strength = common.options.strength();
    let apparatus = DesignedApparatus::check(scene, design, strength).map_err(|error| match error {
        DesignedApparatusError::Scene(ApparatusError::Run(error)) => error.into(),
        other => CommandError::Usage(other.to_string()),
    })?;
    if let ObserverOption::Simulated = common.observer {
        apparatus.check_hand().map_err(|error| CommandError::Usage(error.to_string()))?;
    }
    apparatus.notices().iter().for_each(flotor_command::note);
    Ok(apparatus)
}
