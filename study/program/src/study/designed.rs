//! `flotor study run` for a study of one's own design.

mod ending;
mod person;
mod scene;
mod simulated;

use super::design_file::DesignFile;
use super::options_table::plan;
use super::{ObserverOption, PresentationOption};
use flotor_command::CommandError;
use flotor_study::exclusion::ExclusionRules;
use std::ffi::OsString;
use std::path::Path;

/// Runs the study of a design: begins or resumes it, and skips complete sessions.
pub(super) fn run(
    file: &Path,
    text: String,
    study: DesignFile,
    further: Vec<OsString>,
) -> Result<(), CommandError> {
    let common = study.arguments(file, further)?.common;
    let plan = plan(file, text, ExclusionRules::default());
    match (common.observer, common.apparatus) {
        (ObserverOption::Human, _) => person::sit(file, &common, &study, plan),
        (ObserverOption::Simulated, PresentationOption::None) => simulated::run(&common, study, plan, None),
        (ObserverOption::Simulated, PresentationOption::Scene) => {
            let apparatus = scene::check(&common, &study.design)?;
            simulated::run(&common, study, plan, Some(&apparatus))
        }
    }
}
